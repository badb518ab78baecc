"""What comes out of files is shown, never obeyed: no control character reaches the terminal raw."""

import os
import re
from pathlib import Path

import pytest

from dsd_cli.effects.user import load_effects
from dsd_cli.errors import UsageError, printable
from dsd_cli.report.figure import in_picture
from dsd_cli.report.terminal import escaped, json_text
from tests.cli.rig import CONFIG, csv_text, dsd, make_log, refused, write

#: Sets the clipboard; clears the screen by C1; turns the direction of writing; a bell.
EVIL = "\x1b]52;c;aGk=\x07\x9b2J\u202egnp"
RAW = re.compile("[\x00-\x09\x0b-\x1f\x7f-\x9f\u202a-\u202e]")
MODEL = "\n[model]\ninertia = 1.0\ndelay = 0.005\n"


@pytest.fixture
def rig(tmp_path: Path) -> Path:
    (tmp_path / "dsd.toml").write_text(CONFIG + MODEL)
    write(tmp_path, "log.csv", make_log(600))
    os.link(tmp_path / "log.csv", tmp_path / f"a{EVIL}.csv")
    return tmp_path


def safe(result) -> str:
    for text in (result.stdout, result.stderr):
        assert not RAW.search(text), text
    assert "unexpected" not in result.stderr
    return result.stdout + result.stderr


def test_names_of_files(rig):
    name = f"a{EVIL}.csv"
    for arguments in (("detect", name), ("detect", name, "--format", "json"), ("compare", name),
                      ("detect", name, "-o", f"o{EVIL}.csv"), ("compare", name, "--format", "json"),
                      ("check", name), ("check", name, "--format", "json")):  # fmt: skip
        result = dsd(*arguments, cwd=rig)
        assert result.returncode == 0, result.stderr
        safe(result)
    for arguments in (("detect", f"none{EVIL}.csv"), ("detect", "log.csv", "-c", f"{EVIL}.toml"), ("check" + EVIL,),
                      ("detect", "log.csv", "-o", EVIL), ("detect", "log.csv", f"--{EVIL}")):  # fmt: skip
        result = dsd(*arguments, cwd=rig)
        assert result.returncode in (1, 2)
        safe(result)


def test_a_name_is_no_picture(rig):
    """`:bomb:` is one to the library that prints tables."""
    os.link(rig / "log.csv", rig / ":bomb:.csv")
    for command in ("detect", "compare", "check"):
        assert ":bomb:.csv" in safe(dsd(command, ":bomb:.csv", cwd=rig))


def test_cells_and_names_of_columns(rig):
    text = csv_text(make_log(600))
    lines = text.splitlines()
    (rig / "cell.csv").write_text("\n".join([*lines[:300], f"{EVIL},1,2", *lines[301:]]) + "\n")
    (rig / "head.csv").write_text(text.replace("d_hat", EVIL, 1))
    refused(dsd("detect", "cell.csv", cwd=rig), 1, "line 301", "\\x1b]52")
    for name in ("cell.csv", "head.csv"):
        safe(dsd("detect", name, cwd=rig))
        safe(dsd("detect", "-", cwd=rig, stdin=(rig / name).read_text()))


def test_keys_values_and_history(rig):
    toml = EVIL.replace("\x1b", "\\u001b").replace("\x07", "\\u0007").replace("\x9b", "\\u009b")
    for extra in (f'["{toml}"]\nx = 1\n', f'[simulate]\n"{toml}" = 1\n', f'[signals]\nu = "{toml}"\n',
                  f'[signals]\ntime_unit = "{toml}"\n', f'[model.effects."{toml}"]\nlevel = 1\n'):  # fmt: skip
        (rig / "bad.toml").write_text(extra + CONFIG)
        result = dsd("detect", "log.csv", "-c", "bad.toml", cwd=rig)
        assert result.returncode in (1, 2)
        safe(result)
    step = f'[[history]]\neffect = "{toml}"\ndate = "2026-01-31T12:00:00Z"\nlogs = ["{toml}"]\n'
    step += f'values = {{ "{toml}" = 1.0 }}\n'
    (rig / "hist.toml").write_text(CONFIG + MODEL + step)
    for form in ("table", "json"):
        result = dsd("improve", "-c", "hist.toml", "--history", "--format", form, cwd=rig)
        assert result.returncode == 0, result.stderr
        assert "]52;c" in safe(result)


@pytest.mark.parametrize("text", ["a\x1b[31mb", "\x9b2J", "x\ry", "\ud800", "\u202egnp"])
def test_every_way_of_saying_it(text):
    for said in (printable(text), escaped(text), in_picture(text), json_text({"x": text})):
        assert not RAW.search(said)
        said.encode()


def test_long_names_are_shortened():
    assert len(printable("error in " + 5000 * "x" + ".csv: no such file")) < 300


@pytest.mark.parametrize(
    "name", ["none", "unknown", "inertia", "delay", "refit", "x y", "[/x]", "", "A", "a.b", "é", "1a"]
)
def test_names_of_user_effects_are_checked(tmp_path, name):
    source = (Path(__file__).parents[2] / "sample_logs/my_effect.py").read_text()
    (tmp_path / "effect.py").write_text(source.replace('id="eddy_brake"', f"id={name!r}"))
    with pytest.raises(UsageError, match="effect"):
        load_effects(tmp_path / "effect.py")
    if name not in ("none", "unknown", "inertia", "delay", "refit"):
        (tmp_path / "effect.py").write_text(source.replace('Parameter("force"', f"Parameter({name!r}"))
        with pytest.raises(UsageError, match="name of a parameter"):
            load_effects(tmp_path / "effect.py")
