"""Names and texts of a config never become code, in whatever target."""

import csv
import io
import shutil

import pytest

from dsd_cli.errors import UsageError
from dsd_cli.export.base import Joint
from dsd_cli.export.making import make, verify
from dsd_cli.export.targets import get_target, targets
from dsd_cli.plant.model import PlantModel
from dsd_cli.signals.units import Units
from tests.cli.rig import dsd, refused
from tests.export.cases import motion

MODEL = PlantModel(0.5, 0.0, {"viscous_friction": {"coefficient": 0.3}, "coulomb_friction": {"level": 0.5}})
UNITS = ('N"', "N'", "*/ int x;", "*) x", "]]>", "-->", "<a/>", "%n%s", "${x}", "\\", '"""', "{0}", "#if 0", "';x;'")


@pytest.mark.parametrize("target", sorted(targets()))
@pytest.mark.parametrize("unit", UNITS)
def test_a_unit_goes_nowhere_but_into_a_cell(unit: str, target: str) -> None:
    plain, hostile = (
        get_target(target).write(Joint(MODEL, 2e-3, units=Units(u, "rad"))).decode("latin-1") for u in ("N", unit)
    )
    if target != "parameters":
        assert hostile == plain
        return
    cells = {row[1]: row[3] for row in csv.reader(io.StringIO(hostile))}
    assert cells["level"].strip() == unit


@pytest.mark.parametrize("unit", ["=1+1", "+1", "-1", "@SUM(A1)"])
def test_no_cell_is_a_formula(unit: str) -> None:
    text = get_target("parameters").write(Joint(MODEL, 2e-3, units=Units(unit, "rad"))).decode()
    for row in csv.reader(io.StringIO(text)):
        assert not [cell for cell in row if cell[:1] in ("=", "+", "-", "@")]


@pytest.mark.parametrize(
    "name",
    [
        *(
            "Real",
            "abs",
            "Sample",
            "world",
            "a__b",
            "a_",
            "ELSEIF",
            "classdef",
            "floor",
            "min",
            "mod",
            "time",
            "noEvent",
        ),
        *("edge", "homotopy", "terminal", "pi", "i", "numel"),
    ],
)
def test_a_name_that_means_something_in_a_target_is_refused(name: str) -> None:
    with pytest.raises(UsageError, match="--name"):
        Joint(MODEL, 2e-3, name)


def test_a_name_that_is_too_long_is_told_how_long_it_may_be() -> None:
    assert Joint(MODEL, 2e-3, "a" * 63).name == "a" * 63
    with pytest.raises(UsageError, match="at most 63 letters"):
        Joint(MODEL, 2e-3, "a" * 64)


@pytest.mark.skipif(shutil.which("gcc") is None, reason="no gcc")
@pytest.mark.parametrize("target", [name for name, target in targets().items() if target.run])
@pytest.mark.parametrize("name", ["step", "double", "self", "z", "Axis", "START"])
def test_what_is_no_word_of_a_target_is_a_name_in_it(name: str, target: str) -> None:
    found, given = get_target(target), motion(seconds=0.2)
    checked = verify(found, make(found, Joint(MODEL, 2e-3, name), given, drop=False), given)
    if not checked.ran and "not installed" in checked.how:
        pytest.skip(checked.how)
    assert checked.holds, checked.how
    assert checked.ran, checked.how


@pytest.mark.parametrize("value", ["inf", "nan", "1e400", '"1; system(1)"', '"%n"', "[1]", "true"])
def test_a_value_is_a_finite_number_or_nothing_is_written(value: str, tmp_path) -> None:
    (tmp_path / "a.toml").write_text(f"[model]\ninertia = 1.0\n[model.effects.coulomb_friction]\nlevel = {value}\n")
    ran = dsd("export", "a.toml", "--to", "c", "-o", "axis.h", "--no-verify", cwd=tmp_path)
    refused(ran, 2, "model.effects.coulomb_friction.level")
    assert not (tmp_path / "axis.h").exists()


def test_a_table_holds_numbers_alone(tmp_path) -> None:
    for values in ('["1", "2"]', "[1.0, nan]", "[[1.0], 2.0]"):
        (tmp_path / "a.toml").write_text(
            "[model]\ninertia = 1.0\n[model.effects.curve]\nchannels = ['velocity']\nknots = [[0.0, 1.0]]\n"
            f"values = {values}\nfactor = 'one'\nscale = 1.0\n"
        )
        ran = dsd("export", "a.toml", "--to", "python", "-o", "axis.py", "--no-verify", cwd=tmp_path)
        refused(ran, 2, "values")
        assert not (tmp_path / "axis.py").exists()
