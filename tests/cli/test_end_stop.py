"""Rows in which the axis touches an end stop are left out of a diagnosis, and said; those of any other law stay."""

import json
from pathlib import Path

import numpy as np
import pytest

from tests.cli.rig import AXIS, FEW, done

#: Of the axis: inertia, viscous friction; where a penalty spring begins, and what it pushes per rad.
J, B, TOUCHED, SPRING = 0.01, 0.02, 0.9, 1.0


def stop(q):
    return SPRING * np.maximum(q - TOUCHED, 0.0)


def spring_that_hardens(q):
    return 0.2 * q**3


#: Effects of the position, each of which could be taken for the stop.
OF_POSITION = ("viscous_friction", "constant_load", "gravity", "stiffness", "cubic_stiffness")


def log_of(law, path: Path, seed: int, way: float = 1.0, zero: float = 0.0) -> Path:
    """A motion that is given, and the u that it takes, with noise; way : -1 turns the axis round; zero : of an encoder
    that has counted many turns before."""
    t, lines = 0.002 * np.arange(5000), [(0.7, 0.4, 0.3), (0.35, 1.1, 1.0)]
    q, v, a = (
        sum(size * (2.0 * np.pi * f) ** k * np.sin(2.0 * np.pi * f * t + p + k * np.pi / 2) for size, f, p in lines)
        for k in range(3)
    )
    u = J * a + B * v + law(q) + 0.002 * np.random.default_rng(seed).normal(size=len(t))
    table = np.column_stack([t, way * u, np.round(way * q + zero, 5)])
    np.savetxt(path / "log.csv", table, "%.9g", ",", header="t,u,position", comments="")
    (path / "axis.toml").write_text(AXIS.replace("delay = 0.004", "delay = 0.0"))
    return path


def asked(path: Path, *more: object, effects: tuple[str, ...] = FEW) -> tuple[dict, list[str]]:
    """(the diagnosis, what is said of stops)."""
    told = ("diagnose", "log.csv", "-c", "axis.toml", "--set", 'signals.u_hold="sampled"', "--format", "json", *more)
    found = json.loads(done(*told, cwd=path, effects=effects).stdout)
    return found, [one for one in (*found["warnings"], *found["advice"]) if "end stop" in one]


def range_of(said: str) -> tuple[float, float]:
    low, high = json.loads(said.split("signals.position_range=")[1].split('"')[0])
    return low, high


@pytest.mark.parametrize(("way", "zero"), [(1.0, 0.0), (-1.0, 6283.0)])
def test_what_an_end_stop_pushes_is_left_out(tmp_path: Path, way: float, zero: float) -> None:
    """Without it the viscous friction is found, its value right, whichever end it is."""
    found, (said,) = asked(log_of(stop, tmp_path, 71, way, zero))
    assert found["verdict"] == "viscous_friction"
    (value,) = next(one["parameters"] for one in found["ranking"] if one["effect"] == "viscous_friction").values()
    assert value["value"] == pytest.approx(B, rel=0.02)
    assert ("is above" in said) == (way > 0)
    low, high = (place - zero for place in range_of(said))
    reached = np.loadtxt(tmp_path / "log.csv", delimiter=",", skiprows=1)[:, 2] - zero
    touched, free = (high, low) if way > 0 else (-low, -high)
    assert TOUCHED - 0.02 < touched < TOUCHED + 0.005
    assert free < (way * reached).min()


def test_a_log_that_is_held_out_may_have_no_position(tmp_path: Path) -> None:
    """Then no row of it could be left out, and the question is not asked."""
    log_of(stop, tmp_path, 71)
    table = np.loadtxt(tmp_path / "log.csv", delimiter=",", skiprows=1)
    speed = np.gradient(table[:, 2], table[:, 0])
    other = np.column_stack([table[:, :2], speed])
    np.savetxt(tmp_path / "held.csv", other, "%.9g", ",", header="t,u,velocity", comments="")
    _, said = asked(tmp_path, "--holdout", "held.csv")
    assert not said


def test_where_nothing_else_is_missing_it_is_unknown_and_the_advice_has_the_key(tmp_path: Path) -> None:
    """The model lacks the stop: "none" would be wrong."""
    path = log_of(stop, tmp_path, 74)
    with (path / "axis.toml").open("a") as config:
        config.write(f"\n[model.effects.viscous_friction]\ncoefficient = {B}\n")
    found, (said,) = asked(path, effects=OF_POSITION)
    assert (found["verdict"], found["depends_on"]) == ("unknown", ["position"])
    assert said == found["advice"][0]
    low, high = range_of(said)
    assert high == pytest.approx(TOUCHED, abs=0.02)
    again, none = asked(path, "--set", f"signals.position_range=[{low}, {high}]")
    assert (again["verdict"], none) == ("none", [])


@pytest.mark.parametrize(
    ("law", "effects"),
    [
        (spring_that_hardens, FEW),
        (lambda q: 0.3 * q**5, ("viscous_friction", "constant_load", "gravity", "stiffness")),
        (lambda q: -stop(q), FEW),
    ],
    ids=["hardens", "hardens late", "draws outwards"],
)
def test_another_law_of_the_position_is_no_stop(law, effects, tmp_path: Path) -> None:
    """Two contacts do for that which hardens late, but without their rows a quarter of it is still there."""
    found, said = asked(log_of(law, tmp_path, 75), effects=effects)
    assert found["depends_on"]
    assert not said
