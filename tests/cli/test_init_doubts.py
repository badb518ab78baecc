"""Names of an unknown log that what its channels do speaks against: turned back, doubted, or no motion at all."""

from pathlib import Path

import numpy as np
import pytest

from dsd_cli.files.config import load_config
from dsd_cli.identify.roles import Channel, guess_roles
from tests.cli.rig import done
from tests.files import strangers

AXIS = strangers.axis()


def test_names_of_position_and_velocity_that_are_swapped_are_turned_back() -> None:
    named = {"time": "t", "u": "u", "position": "speed", "velocity": "place"}
    channels = [
        Channel("t", AXIS["t"]),
        Channel("u", AXIS["u"]),
        Channel("speed", AXIS["v"]),
        Channel("place", AXIS["q"]),
    ]
    found = guess_roles(channels, named).found
    assert (found["position"].column, found["velocity"].column) == ("place", "speed")
    found = guess_roles(channels, named, told={"position"}).found
    assert (found["position"].column, found["velocity"].column) == ("speed", "place")


def test_a_slope_of_the_other_sign_is_no_velocity() -> None:
    """Of a swing the velocity has the place as its slope, too, with that sign."""
    named = {"time": "t", "u": "u", "position": "speed", "velocity": "place"}
    values = {"t": AXIS["t"], "u": AXIS["u"], "speed": AXIS["v"], "place": -AXIS["q"]}
    found = guess_roles([Channel(*one) for one in values.items()], named).found
    assert (found["position"].column, found["velocity"].column) == ("speed", "place")


def followed() -> dict[str, np.ndarray]:
    """A place that follows what was asked for, by its error and the slope of that."""
    t = np.arange(8000) * 1e-3
    r = 2.0 * np.sin(3.1 * t) + 0.5 * np.sin(10.7 * t)
    q, v, u = np.zeros(t.size), np.zeros(t.size), np.zeros(t.size)
    slope = np.gradient(r, 1e-3)
    for k in range(t.size - 1):
        u[k] = 8.0 * (r[k] - q[k]) + 0.6 * (slope[k] - v[k])
        v[k + 1] = v[k] + 1e-3 * (u[k] - 0.05 * v[k] - 0.1 * np.tanh(20.0 * v[k])) / 0.02
        q[k + 1] = q[k] + 1e-3 * v[k]
    return {"t": t, "r": r, "q": q, "u": u}


def test_the_error_of_a_controller_is_no_motion(tmp_path: Path) -> None:
    a = followed()
    columns = (a["t"], a["r"] - a["q"], a["u"], a["q"], a["r"])
    np.savetxt(tmp_path / "log.csv", np.column_stack(columns), "%.7g", ",", header="t,error,ctrl,y,r", comments="")
    done("init", "log.csv", cwd=tmp_path)
    signals = load_config(tmp_path / "dsd.toml").signals
    assert (signals.u, signals.position, signals.reference) == ("ctrl", "y", "r")
    assert not load_config(tmp_path / "dsd.toml").says("signals.velocity")


def test_a_position_before_another_one_is_doubted(tmp_path: Path) -> None:
    a = followed()
    columns = (a["t"], a["r"], a["q"], a["u"])
    np.savetxt(
        tmp_path / "log.csv", np.column_stack(columns), "%.7g", ",", header="t,position,feedback,torque", comments=""
    )
    said = done("init", "log.csv", cwd=tmp_path).stderr
    assert "feedback is as it, " in said
    assert "samples later: is that what was measured?" in said


def test_the_setpoint_of_a_speed_loop_is_no_reference_of_the_position() -> None:
    t = np.arange(8000) * 1e-3
    asked = 3.0 * np.sin(2.1 * t) + 2.0 * np.sin(7.7 * t)
    v, q = np.zeros(t.size), np.zeros(t.size)
    for k in range(t.size - 1):
        v[k + 1] = v[k] + 1e-3 * 40.0 * (asked[k] - v[k])
        q[k + 1] = q[k] + 1e-3 * v[k]
    u = 40.0 * (asked - v) * 0.02
    values = {"t": t, "u": u, "pos": q, "vel": v, "setpoint": asked}
    named = {"time": "t", "u": "u", "position": "pos", "velocity": "vel", "reference": "setpoint"}
    channels = [Channel(*one) for one in values.items()]
    assert "reference" not in guess_roles(channels, named).found
    of_place = [Channel("setpoint", q + 0.01 * v) if one.name == "setpoint" else one for one in channels]
    assert guess_roles(of_place, named).found["reference"].column == "setpoint"


@pytest.mark.parametrize(("inertia", "u"), [(0.04, None), (0.15, "CH1")])
def test_of_two_channels_without_names_none_is_u_where_each_explains_the_other(inertia: float, u: str | None) -> None:
    """A viscous brake: with little inertia the force is the speed, nearly, and the speed the force."""
    t = np.arange(9000) * 2e-3
    force = np.sin(1.7 * t) + 0.5 * np.sin(5.1 * t)
    v = np.zeros(t.size)
    for k in range(t.size - 1):
        v[k + 1] = v[k] + 2e-3 * (force[k] - 0.5 * v[k]) / inertia
    found = guess_roles([Channel("t", t), Channel("CH1", force), Channel("CH2", v)], {"time": "t"}).found
    assert (found["u"].column if "u" in found else None) == u
