"""Machines that repeat one move: what repeats with the motion is no line in time, and a creeping axis sticks."""

import pytest

from dsd_cli.identify.recordings.recording import prepare
from dsd_cli.identify.verdict.diagnose import diagnose
from dsd_cli.plant.model import ObserverSettings, PlantModel
from dsd_cli.signals.log import Log
from tests.oracle.production import Axis, logged


def diagnosed(kind, axis):
    observer = ObserverSettings(axis.inertia, 0.02)
    recording = prepare(Log(logged(kind, axis), 1e-3, "log.csv"), observer)
    return diagnose([recording], PlantModel(axis.inertia, axis.late), observer)


@pytest.mark.parametrize("kind", ["index", "shuttle"])
def test_dry_friction_alone_is_found_where_one_move_repeats(kind):
    """Ten effects were missing once, at 99 %, and a delay of two cycles."""
    axis = Axis()
    found = diagnosed(kind, axis)
    assert found.found == ("coulomb_friction",)
    assert found.verdict == "coulomb_friction"
    level = found.estimates["coulomb_friction.level"].value
    assert level == pytest.approx(axis.friction, rel=0.05)
    assert found.estimates["inertia"].value == pytest.approx(axis.inertia, rel=0.01)
    assert found.estimates["delay"].value == pytest.approx(axis.late, abs=1e-3)


def test_drag_beside_it_is_found_there_and_nothing_else():
    axis = Axis(drag=2e-3)
    found = diagnosed("shuttle", axis)
    assert set(found.found) == {"coulomb_friction", "viscous_friction"}
