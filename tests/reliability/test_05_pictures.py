"""A picture is written whole or not at all, takes any name, and never costs the result."""

import shutil
from pathlib import Path

import pytest

from dsd_cli.cli.pictures import put_picture
from dsd_cli.report.figure import sheet
from tests.cli.engine import engine, rig, run
from tests.cli.rig import done

__all__ = ["engine", "rig"]

SAMPLES = Path(__file__).parents[2] / "sample_logs"
CONFIG = SAMPLES / "servo-bare.toml"


@pytest.mark.parametrize("name", ["a$\\frac{$.csv", "$x^{$b$.csv"])
def test_a_dollar_in_the_name_of_a_log(tmp_path, name):
    shutil.copy(SAMPLES / "servo-friction.csv", tmp_path / name)
    done("compare", name, "-c", CONFIG, "--plot", "c.png", cwd=tmp_path)
    assert (tmp_path / "c.png").read_bytes().endswith(b"IEND\xaeB`\x82")


def test_the_config_is_written_though_the_picture_fails(rig, engine, capsys):
    (rig / "full.png").symlink_to("/dev/full")
    assert run("improve", "a.csv", "--auto", "-o", "better.toml", "--plot", "full.png") == 0
    out, err = capsys.readouterr()
    assert "dsd: warning: full.png: cannot be written" in err
    assert "held-out force error" in out
    assert "coulomb_friction" in (rig / "better.toml").read_text()


def broken() -> None:
    raise ValueError("in a library")


def empty() -> object:
    return sheet(1.0, 1.0)


def test_half_a_picture_is_none(tmp_path, monkeypatch, capsys):
    """The old one stays, and the warning is said even where messages are not wanted."""
    (tmp_path / "x.png").write_bytes(b"old")

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.replace", full)
    put_picture(tmp_path / "x.png", empty, quiet=True)
    assert "No space left" in capsys.readouterr().err
    put_picture(tmp_path / "x.png", broken, quiet=True)
    assert "x.png: cannot be drawn (ValueError: in a library); the rest is done" in capsys.readouterr().err
    assert [(p.name, p.read_bytes()) for p in tmp_path.iterdir()] == [("x.png", b"old")]
