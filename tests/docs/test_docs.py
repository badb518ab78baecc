"""What the documentation says is what the program has."""

import importlib.util
import re
from pathlib import Path

import pytest

from dsd_cli.cli.effects import markdown
from dsd_cli.cli.lazy import COMMANDS, load_command
from dsd_cli.effects import named_effects

ROOT = Path(__file__).parents[2]


def _config_rows() -> list[tuple[str, str]]:
    spec = importlib.util.spec_from_file_location("config_page", Path(__file__).with_name("config_page.py"))
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return list(module.rows())


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_and_option_has_help(name: str) -> None:
    command = load_command(name)
    assert command.help, f"dsd {name} has no help"
    assert [p.name for p in command.params if not getattr(p, "help", None)] == []


@pytest.mark.parametrize("name", COMMANDS)
def test_readme_names_every_command(name: str) -> None:
    assert f"dsd {name}" in (ROOT / "README.md").read_text(encoding="utf-8")


def test_readme_has_the_figures_of_the_real_machines() -> None:
    page = (ROOT / "docs/measured/machines.md").read_text(encoding="utf-8")
    wanted = r"(\d+) of (\d+) that must be named; (\d+) named that must not be; (\d+ of \d+) published values"
    named, known, wrong, values = re.search(wanted, page).groups()
    row = f"{known} known effects | {named} named, false names: {wrong}; {values} published values"
    assert row in (ROOT / "README.md").read_text(encoding="utf-8")


def test_config_page_has_every_key_with_meaning_unit_and_default() -> None:
    page = (ROOT / "docs/config.md").read_text(encoding="utf-8").splitlines()
    missing = [line for _, line in _config_rows() if line not in page]
    assert not missing, "docs/config.md lacks these lines:\n" + "\n".join(missing)


def test_config_page_has_no_key_that_is_gone() -> None:
    page = (ROOT / "docs/config.md").read_text(encoding="utf-8").splitlines()
    current = {line for _, line in _config_rows()}
    assert [line for line in page if line.startswith("| `") and line not in current] == []


def test_effects_page_is_current() -> None:
    page = (ROOT / "docs/effects.md").read_text(encoding="utf-8")
    assert page == markdown(list(named_effects().values())), "run: dsd effects --format markdown > docs/effects.md"
