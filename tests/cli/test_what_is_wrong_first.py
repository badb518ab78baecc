"""Errors name what the command line has wrong: the file that is meant, the nearest name, the unit as written."""

from pathlib import Path

import pytest

from dsd_cli.files.recognise import recognise
from tests.cli.rig import dsd, refused
from tests.files import strangers

AXIS = strangers.axis()


@pytest.mark.parametrize("command", ["diagnose", "add", "learn"])
def test_a_log_that_is_not_there_is_said_before_a_config_that_is_not(command: str, tmp_path: Path) -> None:
    more = {"add": ("viscous_friction", "-o", "out.toml")}.get(command, ())
    said = dsd(command, "nope.csv", *more, cwd=tmp_path).stderr
    assert "nope.csv: no such file" in said
    assert "dsd.toml" not in said


def test_the_nearest_effect_is_named(tmp_path: Path) -> None:
    refused(dsd("effects", "coulomb", cwd=tmp_path), 2, "no effect 'coulomb': did you mean coulomb_friction?")


def test_a_value_that_cannot_be_is_one_of_the_file_that_is_to_be_written(tmp_path: Path) -> None:
    strangers.text(tmp_path, "a.csv", ["t,u,v", *strangers.rows(AXIS, AXIS["t"], AXIS["u"], AXIS["v"])])
    said = dsd("init", "a.csv", "-o", "own.toml", "--set", "signals.position_unit=furlong", cwd=tmp_path).stderr
    assert "own.toml with --set" in said
    assert "dsd.toml" not in said


def test_a_unit_in_a_name_is_shown_as_it_is_written() -> None:
    for name, unit in (("current_mA", "mA"), ("torque_mNm", "mNm")):
        found = recognise([name])["u"]
        assert (found.unit, found.factor) == (unit, 1e-3)
