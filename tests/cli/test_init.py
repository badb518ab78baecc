"""`dsd init`, the real command."""

from pathlib import Path

import pytest

from dsd_cli.files.config import load_config
from dsd_cli.files.template import template_names, template_text
from tests.warm import run as dsd


def test_writes_the_commented_lab_config(tmp_path: Path) -> None:
    done = dsd("init", cwd=tmp_path)
    assert (done.returncode, done.stdout) == (0, "")
    assert "next: dsd check LOG" in done.stderr
    assert [p.name for p in tmp_path.iterdir()] == ["dsd.toml"]
    assert (tmp_path / "dsd.toml").read_text(encoding="utf-8") == template_text("lab")


@pytest.mark.parametrize("name", template_names())
def test_every_template_is_a_valid_config_and_named_in_the_help(name: str, tmp_path: Path) -> None:
    assert dsd("init", "--template", name, "-o", "rig.toml", cwd=tmp_path).returncode == 0
    load_config(tmp_path / "rig.toml")
    assert name in " ".join(dsd("init", "--help", cwd=tmp_path).stdout.split()).replace("- ", "-")


def test_never_overwrites_unless_forced(tmp_path: Path) -> None:
    target = tmp_path / "dsd.toml"
    target.write_text("mine")
    refused = dsd("init", cwd=tmp_path)
    assert (refused.returncode, target.read_text()) == (2, "mine")
    assert refused.stderr.splitlines() == [
        "dsd: error: dsd.toml exists: name another file with -o, or overwrite it with --force"
    ]
    assert dsd("init", "--force", "--quiet", cwd=tmp_path).stderr == ""
    assert target.read_text(encoding="utf-8") == template_text("lab")


def test_to_stdout(tmp_path: Path) -> None:
    done = dsd("init", "--template", "servo", "-o", "-", cwd=tmp_path)
    assert (done.stdout, done.stderr, list(tmp_path.iterdir())) == (template_text("servo"), "", [])


def test_unknown_template_and_missing_folder(tmp_path: Path) -> None:
    unknown = dsd("init", "--template", "paper", cwd=tmp_path)
    assert unknown.returncode == 2
    assert "templates are damping, lab, paper-delay-change, paper-sine, paper-step, servo" in unknown.stderr
    nowhere = dsd("init", "-o", "no/such/dsd.toml", cwd=tmp_path)
    assert nowhere.returncode == 1
    assert nowhere.stderr.splitlines() == [f"dsd: error: no/such/dsd.toml: no such folder {tmp_path / 'no/such'}"]
