"""Every command of the README, and of the pages that go on from it, is run and says what the page shows.

```console   `$ command` and what it prints (`...`: lines left out; `exit code N` where it is not 0)
```sh        commands without shown output; `make` targets are looked up, installing is left to them
```toml      a config that loads
```python    runs
"""

import os
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import pytest

from dsd_cli.files.config import parse_config
from tests import warm

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")
#: Pages whose blocks are run; each in a folder of its own, as by a reader who begins there.
PAGES = [
    "README.md",
    *(f"docs/{name}.md" for name in ("missing", "detect", "pipeline", "json", "check", "fleet", "learn", "logs")),
]
#: Pages that begin with the same commands, run once for all of them; the others by themselves.
TOGETHER = [PAGES[:2], *([page] for page in PAGES[2:])]
#: Lines of a page that one printed line may take.
MOST_FOLDS = 6
INSTALL = ("make ", "pip install")


class Example(NamedTuple):
    """A command and the lines shown below it."""

    command: str
    shown: list[str]


def blocks(kind: str, page: str) -> list[str]:
    text = (ROOT / page).read_text(encoding="utf-8")
    return re.findall(rf"^```{kind}\n(.*?)^```$", text, flags=re.MULTILINE | re.DOTALL)


def of_pages(kind: str) -> list[str]:
    return [text for page in PAGES for text in blocks(kind, page)]


def console_examples(page: str) -> list[Example]:
    examples: list[Example] = []
    for line in "".join(blocks("console", page)).splitlines():
        if line.startswith("$ "):
            examples.append(Example(line[2:], []))
        elif line.strip():
            examples[-1].shown.append(line)
    return examples


def shell_lines(page: str) -> list[str]:
    lines = [line.split("  #")[0].strip() for line in "".join(blocks("sh", page)).splitlines()]
    return [line for line in lines if line]


@pytest.fixture
def reader(tmp_path_factory: pytest.TempPathFactory) -> Callable[[], Path]:
    """Makes folders with what a reader has: the sample logs, and `dsd` on the path."""

    def folder() -> Path:
        here = tmp_path_factory.mktemp("readme")
        shutil.copytree(ROOT / "sample_logs", here / "sample_logs")
        (here / "bin").mkdir()
        (here / "bin/dsd").write_text(f'#!/bin/sh\nexec {shlex.quote(sys.executable)} -m dsd_cli "$@"\n')
        (here / "bin/dsd").chmod(0o755)
        return here

    return folder


@pytest.fixture
def folder(reader: Callable[[], Path]) -> Path:
    return reader()


def run(command: str, folder: Path) -> subprocess.CompletedProcess[str]:
    """By a shell, where the line is more than one command and its arguments."""
    name, *words = shlex.split(command)
    if name == "dsd" and not set(command) & set("|<>&;$*"):
        return warm.run(*words, cwd=folder)
    path = os.pathsep.join([str(folder / "bin"), os.environ.get("PATH", "")])
    environment = {**os.environ, "PATH": path, "PYTHONIOENCODING": "utf-8"}
    return subprocess.run(
        ["sh", "-c", command], cwd=folder, env=environment, capture_output=True, encoding="utf-8", check=False
    )


def bare(text: str) -> str:
    return " ".join(text.split())


def as_shown(printed: list[str], shown: list[str]) -> bool:
    """Whether the lines printed are those shown, where `...` stands for any number of lines; the page may fold one."""
    if not shown:
        return not printed
    if shown[0] == "...":
        return any(as_shown(printed[k:], shown[1:]) for k in range(len(printed) + 1))
    folds = (k for k in range(1, min(len(shown), MOST_FOLDS) + 1) if printed)
    return any(bare(printed[0]) == bare(" ".join(shown[:k])) and as_shown(printed[1:], shown[k:]) for k in folds)


def files(folder: Path) -> dict[str, bytes]:
    """What commands have written there."""
    return {path.name: path.read_bytes() for path in sorted(folder.iterdir()) if path.is_file()}


Done = dict[tuple[str, str], tuple[subprocess.CompletedProcess[str], dict[str, bytes]]]


def run_once(command: str, folder: Path, known: Done) -> subprocess.CompletedProcess[str]:
    """The command, or where it was run beside the same files, what it printed and wrote there."""
    key = command, repr(files(folder))
    if key not in known:
        known[key] = run(command, folder), files(folder)
    for name, content in known[key][1].items():
        (folder / name).write_bytes(content)
    return known[key][0]


@pytest.mark.parametrize("pages", TOGETHER, ids=lambda pages: pages[-1])
def test_console_examples_print_what_is_shown(reader: Callable[[], Path], pages: list[str]) -> None:
    known: Done = {}
    for page in pages:
        as_on_the_page(page, reader(), known)


def as_on_the_page(page: str, folder: Path, known: Done) -> None:
    for example in console_examples(page):  # in order: a later one may need what an earlier one wrote
        codes = [line for line in example.shown if line.startswith("exit code ")]
        done = run_once(example.command, folder, known)
        assert done.returncode == int(codes[0].split()[-1] if codes else 0), f"{example.command}\n{done.stderr}"
        shown = [line for line in example.shown if line not in codes]
        printed = done.stderr if codes else done.stdout
        lines = [line for line in printed.splitlines() if line.strip()]
        if shown:
            assert as_shown(lines, shown), f"$ {example.command}\n{printed}"


@pytest.mark.parametrize("page", PAGES)
def test_shell_commands_run(folder: Path, page: str) -> None:
    for line in (line for line in shell_lines(page) if not line.startswith(INSTALL)):
        done = run(line, folder)
        assert done.returncode == 0, f"{line}\n{done.stderr}"


def test_make_targets_exist() -> None:
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    named = {line.split()[1] for page in PAGES for line in shell_lines(page) if line.startswith("make ")}
    named |= set(re.findall(r"`make (\w+)`", README))
    assert {"demo", "test"} <= named
    assert [name for name in named if not re.search(rf"^{name}:", makefile, flags=re.MULTILINE)] == []


def test_demo_and_test_are_on_the_first_screen() -> None:
    first = README.splitlines()[:25]
    assert any(line.startswith("make demo") for line in first)
    assert any(line.startswith("make test") for line in first)


@pytest.mark.parametrize("text", of_pages("toml"))
def test_configs_load(text: str) -> None:
    parse_config(text, "README.md")


@pytest.mark.parametrize("text", of_pages("python"))
def test_python_runs(text: str, folder: Path) -> None:
    done = subprocess.run([sys.executable, "-c", text], cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    for shown in re.findall(r"print\(.*\)  # (.*)$", text, flags=re.MULTILINE):
        assert shown in lines


LINK = re.compile(r"\]\(([^)#]+)\)")


def test_readme_is_short() -> None:
    assert len(README.splitlines()) <= 180


@pytest.mark.parametrize("page", [*PAGES, "sample_logs/README.md", "docs/measured/paper.md"])
def test_links_lead_somewhere(page: str) -> None:
    targets = LINK.findall((ROOT / page).read_text(encoding="utf-8"))
    local = [target for target in targets if not target.startswith("http")]
    assert [target for target in local if not ((ROOT / page).parent / target).exists()] == []
