"""Names of an unknown log that what its channels do speaks against: turned back, doubted, or no motion at all."""

import json
import subprocess
from pathlib import Path

import numpy as np
import pytest

from dsd_cli.files.config import load_config
from dsd_cli.roles import Channel, guess_roles
from tests.cli.rig import done, dsd, refused
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
    return {"t": t, "r": r, "q": q, "v": v, "u": u}


@pytest.mark.parametrize("counts", [0, 4096])
def test_of_two_places_without_names_the_speed_is_of_the_measured_one(counts: int) -> None:
    """The target stands first, and is followed so closely that the measured speed is its slope to 0.05 %."""
    a = followed()
    turns = a["q"] / (2.0 * np.pi)
    q = 2.0 * np.pi * (np.round(counts * turns) / counts if counts else turns)
    r = a["q"] + 0.2 * (a["r"] - a["q"])  # a better controller
    channels = [Channel("1", r), Channel("2", q), Channel("3", a["v"]), Channel("4", a["u"])]
    found = {role: one.column for role, one in guess_roles(channels, {}).found.items()}
    assert found == {"position": "2", "velocity": "3", "u": "4", "reference": "1"}


def test_one_wrong_cell_of_u_bends_no_number_and_is_said(tmp_path: Path) -> None:
    """Of one cell of 1000 the inertia was a fifth too small, "identified from this log"."""
    a = followed()
    u = a["u"].copy()
    u[4000] = 1e3
    np.savetxt(tmp_path / "log.csv", np.column_stack([a["t"], u, a["q"]]), "%.9g", ",", header="t,u,q", comments="")
    said = done("init", "log.csv", cwd=tmp_path).stderr
    assert "1 value(s) of u stand alone, up to 1000, first in sample 4000" in said
    assert load_config(tmp_path / "dsd.toml").model.inertia == pytest.approx(0.02, rel=0.02)


def test_kicks_that_acted_stay_in_u(tmp_path: Path) -> None:
    """A sensor of 0.01 rad shows nothing of one sample: without six of twelve kicks J was 0.018."""
    random, step, finer = np.random.default_rng(990960), 0.01, 10
    t = step * np.arange(3000)
    u = 0.05 * np.sin(2.0 * t) + 0.05 * np.sin(5.3 * t)
    u[random.choice(np.arange(50, 2950), 12, replace=False)] += random.choice([-1.0, 1.0], 12)
    place, position, speed = np.zeros(t.size), 0.0, 0.0
    for k, held in enumerate(u.tolist()):
        place[k] = position
        for _ in range(finer):
            speed += step / finer * (held - 0.02 * speed) / 0.02
            position += step / finer * speed
    log = np.column_stack([t, u, np.round(place / 0.01) * 0.01])
    np.savetxt(tmp_path / "log.csv", log, "%.9g", ",", header="t,u,q", comments="")
    said = done("init", "log.csv", cwd=tmp_path).stderr
    assert "of u stand alone" in said
    assert "that no drive gives" not in said
    assert load_config(tmp_path / "dsd.toml").model.inertia == pytest.approx(0.02, rel=0.02)


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


def sysid_tests() -> dict[str, list[list[float]]]:
    """Two tests of a motor under a step of voltage, as FRC teams log them without names: stamp, voltage, position and
    velocity; rows of 5 ms, an encoder that is read every 20 ms and whose velocity is a mean of the last 100."""
    found = {}
    for name, begin, place, volts in (("forward", 68.0, 690.0, 7.0), ("backward", 79.0, 1050.0, -7.0)):
        t = 5e-3 * np.arange(194)
        since = np.maximum(t - 0.02, 0.0)
        travel = 8.0 * volts * (since - 0.05 * (1.0 - np.exp(-since / 0.05)))
        read = np.floor(t / 0.02) * 0.02
        q = place + np.interp(read, t, travel)
        v = (np.interp(read, t, travel) - np.interp(read - 0.1, t, travel)) / 0.1
        rows = np.column_stack([begin + t, np.where(t > 0.0, volts, 0.0), q, v])
        found[name] = np.round(rows, 6).tolist()
    return found


def test_of_two_tests_without_names_u_is_asked_for_and_then_the_rest_is_found(tmp_path: Path) -> None:
    """The velocity, late and in steps, is no cause of the position; all tests count, not the last one alone."""
    (tmp_path / "log.json").write_text(json.dumps(sysid_tests()))
    result = dsd("init", "log.json", cwd=tmp_path)
    assert result.returncode == 1
    assert "which column is the control input (torque, force, current, voltage)? 2, 3, 4;" in result.stderr
    done("init", "log.json", "--force", "--u", "2", cwd=tmp_path)
    signals = load_config(tmp_path / "dsd.toml").signals
    assert (signals.time, signals.u, signals.position, signals.velocity) == ("1", "2", "3", "4")


def test_a_step_of_one_test_is_among_what_u_may_be(tmp_path: Path) -> None:
    np.savetxt(tmp_path / "log.csv", sysid_tests()["backward"], "%.6f", ",")
    result = dsd("init", "log.csv", cwd=tmp_path)
    assert result.returncode == 1
    listed = result.stderr.partition("voltage)? ")[2].partition(";")[0]
    assert sorted(listed.split(", ")) == ["2", "3", "4"]


@pytest.mark.parametrize("many", [2, 5, 12])
def test_what_averages_u_is_neither_its_motion_nor_preferred_to_it(many: int) -> None:
    """A moving mean has less noise, so that the motion explains more of it, and it explains u as a motion would."""
    rng = np.random.default_rng(3)
    t = 4e-3 * np.arange(3000)
    v = np.sin(1.7 * t) + 0.5 * np.sin(5.1 * t)
    u = 0.3 * np.gradient(v, t) + 0.4 * v + 0.2 * np.sign(v) + 0.35 * rng.standard_normal(t.size)
    mean = np.convolve(u, np.ones(many) / many)[: t.size]
    named = [Channel("t", t), Channel("v", v), Channel("mean", mean), Channel("raw", u)]
    assert guess_roles(named, {"time": "t", "velocity": "v"}).found["u"].column == "raw"
    drowned = Channel("raw", mean + 60.0 * rng.standard_normal(t.size))  # what is left of it explains nothing
    assert guess_roles([*named[:3], drowned], {"time": "t", "velocity": "v"}).found["u"].column == "mean"
    rng.shuffle(v)
    assert not {"u", "velocity", "position"} & guess_roles([named[0], *named[2:]], {"time": "t"}).found.keys()


def test_the_speed_of_a_step_response_without_a_clock_is_no_position(tmp_path: Path) -> None:
    """What the friction of a speed asks for is what a spring would ask for at that place."""
    rng = np.random.default_rng(5)
    u = np.repeat([5.0, 9.0, 6.0, 11.0, 8.0, 12.0, 7.0], 60)
    w = np.zeros(u.size)
    for k in range(u.size - 1):
        w[k + 1] = w[k] + 0.1 * (28.0 * u[k] - w[k])
    measured = w + 2.0 * rng.standard_normal(u.size)
    np.savetxt(tmp_path / "log.csv", np.column_stack([u, measured]), "%.3f", ",", header="input,output", comments="")
    done("init", "log.csv", "--set", "signals.sample_time=0.01", cwd=tmp_path)
    signals = load_config(tmp_path / "dsd.toml").signals
    assert (signals.u, signals.velocity) == ("input", "output")


def told(folder: Path, *values: str) -> tuple[str, object]:
    """What `init` says of a log whose stamps are tenths of microseconds, where these are told, and its [signals]."""
    t = 1e-3 * np.arange(3000)
    v = np.sin(3.0 * t) + 0.5 * np.sin(11.0 * t)
    q, a = np.cumsum(v) * 1e-3, np.gradient(v, t)
    u = 0.02 * a + 0.1 * v + 0.05 * np.sign(v)
    table = np.column_stack([np.round(1e7 * t), u, q, v, 0.01 * a - u])
    np.savetxt(folder / "log.csv", table, "%.8g", ",", header="ticks,torque,pos,vel,zz", comments="")
    options = [word for value in values for word in ("--set", f"signals.{value}")]
    said = done("init", "log.csv", "--force", *options, cwd=folder).stderr
    return said, load_config(folder / "dsd.toml").signals


def test_what_is_set_of_the_signals_is_seen_while_the_rest_is_guessed(tmp_path: Path) -> None:
    said, _ = told(tmp_path)
    assert "steps of 10000 are taken as us" in said  # no name says it, and a servo may have 10 ms as well
    said, signals = told(tmp_path, "time_unit=100ns")
    assert "sample time 0.001 s" in said
    assert "velocity_scale" not in said
    said, signals = told(tmp_path, "sample_time=0.001")
    assert (signals.time, signals.sample_time) == (None, 0.001)
    assert "sample time 0.001 s" in said
    said, signals = told(tmp_path, "velocity=", "time_unit=100ns")
    assert 'velocity = "vel"' not in said
    assert (signals.velocity, signals.position) == (None, "pos")
    for name in ("zz", "5"):
        said, signals = told(tmp_path, f"d_hat={name}", "time_unit=100ns")
        assert 'd_hat = "zz": as you say' in said
    refused(dsd("init", "log.csv", "--force", "--set", "signals.d_hat=nix", cwd=tmp_path), 2, 'no column "nix"')


def runs_of_motors(folder: Path) -> Path:
    """Steps of motors one after the other, with the motor and its direction beside them, as test benches log them."""
    lines = ["time,motor,pwm,direction,speed"]
    for motor, gain in (("M1", 2.0), ("M2", 2.4)):
        for pwm, way in ((10, "FWD"), (-10, "REV")):
            t = 0.02 * np.arange(60)
            v = gain * pwm * (1.0 - np.exp(-t / 0.15))
            lines += [f"{a:.3f},{motor},{pwm},{way},{b:.5f}" for a, b in zip(t, v, strict=True)]
    return strangers.text(folder, "bench.csv", lines)


def test_words_beside_runs_name_no_channels_and_the_command_that_keeps_one_axis_does(tmp_path: Path) -> None:
    said = done("init", runs_of_motors(tmp_path).name, cwd=tmp_path).stderr
    signals = load_config(tmp_path / "dsd.toml").signals
    assert (signals.time, signals.u, signals.velocity) == ("time", "pwm", "speed")
    assert "motor (M1, M2) and direction (FWD, REV) split its rows into 4 recordings, read as of one axis" in said
    command = said.partition("of one axis alone: ")[2].splitlines()[0]
    subprocess.run(command, shell=True, check=True, cwd=tmp_path)
    kept = (tmp_path / "one.csv").read_text(encoding="utf-8").splitlines()
    assert (len(kept), {line.split(",")[1] for line in kept[1:]}) == (121, {"M1"})


def test_modes_of_one_recording_split_nothing(tmp_path: Path) -> None:
    lines = runs_of_motors(tmp_path).read_text(encoding="utf-8").splitlines()
    rows = [f"{0.02 * k:.3f},{line.partition(',')[2]}" for k, line in enumerate(lines[1:])]
    strangers.text(tmp_path, "modes.csv", [lines[0], *rows])
    assert "split its rows" not in done("init", "modes.csv", cwd=tmp_path).stderr


def test_a_column_that_is_called_u_and_never_changes_is_named_in_the_question(tmp_path: Path) -> None:
    rows = strangers.rows(AXIS, AXIS["t"], AXIS["q"], AXIS["v"], np.full(AXIS["t"].size, 999.0))
    strangers.text(tmp_path, "log.csv", ["t,pos,vel,duty", *rows])
    result = dsd("init", "log.csv", cwd=tmp_path)
    assert result.returncode == 1
    assert 'this log has no control input that changes: "duty" is 999 in all rows; dsd needs one' in result.stderr


def test_a_setpoint_of_two_levels_is_no_second_speed(tmp_path: Path) -> None:
    asked = np.where(AXIS["t"] < 2.0, 40.0, 60.0)
    rows = strangers.rows(AXIS, AXIS["t"], AXIS["v"], AXIS["u"], asked)
    strangers.text(tmp_path, "log.csv", ["t,speed,torque,speed_sp", *rows])
    assert "could be speed_sp" not in done("init", "log.csv", cwd=tmp_path).stderr


def test_of_tests_one_after_the_other_none_alone_is_the_log(tmp_path: Path) -> None:
    """That the position is at another place in each hides what moves it in all of them together."""
    t = 5e-3 * np.arange(400)
    v = np.sin(4.0 * t) + 0.5 * np.sin(11.0 * t)
    u, q = 0.3 * np.gradient(v, t) + 0.1 * v + 0.2 * np.sign(v), np.cumsum(v) * 5e-3
    tests = {name: np.column_stack([at + t, u, at + q]).tolist() for name, at in (("a", 0.0), ("b", 300.0))}
    (tmp_path / "log.json").write_text(json.dumps(tests))
    dsd("init", "log.json", cwd=tmp_path)
    assert '"a/' not in (tmp_path / "dsd.toml").read_text(encoding="utf-8")
    done("init", "log.json", "--force", "--u", "2", "--position", "3", cwd=tmp_path)
    done("init", "log.json", "--force", "--u", "a/2", "--position", "a/3", cwd=tmp_path)


def test_a_constant_speed_is_not_the_slope_of_whatever_drifts() -> None:
    """A stamp whose steps vary, beside a speed that varies less than it is."""
    rng = np.random.default_rng(11)
    w = 12.0 + 2.5 * np.convolve(rng.standard_normal(1230), np.ones(30) / 30**0.5, "valid")[:1200]
    u = 0.3 * np.gradient(w) + 0.1 * w
    channels = [Channel("u", u), Channel("stamp", np.cumsum(rng.uniform(0.2, 1.8, w.size))), Channel("w", w)]
    assert "position" not in guess_roles(channels, {"u": "u"}).found


def test_a_column_called_sp_alone_may_be_the_speed(tmp_path):
    """speed_sp was asked for; beside a current, sp is what moves."""
    t = 0.002 * np.arange(3000)
    cur = 2.0 * np.sin(3.0 * t) + np.sign(np.sin(7.0 * t))
    speed = np.zeros_like(t)
    for k in range(len(t) - 1):  # with friction that is not small
        speed[k + 1] = speed[k] + 0.002 * (cur[k] - 0.4 * speed[k] - 0.3 * np.sign(speed[k])) / 0.05
    rows = [f"{a:.4f},{b:.6g},{c:.6g}" for a, b, c in zip(t, speed, cur, strict=True)]
    strangers.text(tmp_path, "log.csv", ["t,sp,cur", *rows])
    done("init", "log.csv", "--u", "cur", cwd=tmp_path)
    assert load_config(str(tmp_path / "dsd.toml"), ()).signals.velocity == "sp"
