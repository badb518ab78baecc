"""`dsd check` on measurements of real machines: nothing of them is wrong, and what is said of them is so."""

from dataclasses import replace
from pathlib import Path

import pytest

from dsd_cli.files.logs import load_log
from dsd_cli.identify.checks import check_log
from dsd_cli.plant.model import PlantModel
from tests.recordings import recording

RUNS = ("sin_sin", "sin_time_square", "up_and_down", "lift_and_drop")
XL330 = [f"kp{kp}_{run}" for kp in (100, 200, 400, 800) for run in RUNS]


def load(name: str, **signals: str):
    return load_log(Path(recording(name)), {"t": "t_s", **signals})


def check(loaded, **turned: float):
    channels = {name: turned.get(name, 1.0) * x for name, x in loaded.log.channels.items()}
    return check_log(replace(loaded.log, channels=channels), None, None, loaded.restarts, dropped=loaded.dropped)


def texts(result, severity: str) -> list[str]:
    return [one.what for one in result.findings if one.severity == severity]


def test_emps():
    loaded = load("emps/emps_train.csv", u="force_N", position="position_m", reference="reference_m")
    result = check(loaded)
    assert texts(result, "error") == texts(result, "warning") == []
    inertia, delay = result.parameters
    assert inertia.value == pytest.approx(95.1089, rel=0.01)  # Janot, Gautier and Brunot (2019)
    assert delay.value < 1e-3  # none: a sub-sample lag at most
    assert [one.remedy for one in check(loaded, u=-1.0).errors] == ["signals.u_sign = -1"]


@pytest.mark.parametrize("run", XL330)
def test_xl330(run):
    """Irregular stamps; its velocity is filtered by the servo; slow runs up and down are one move."""
    name = f"bam_xl330/{run}.csv"
    position_only = check(load(name, u="u_V", position="position_rad"))
    assert texts(position_only, "error") == []
    both = check(load(name, u="u_V", position="position_rad", velocity="velocity_rad_s"))
    assert texts(both, "error") == []
    (late,) = [one for one in both.findings if "later than the slope" in one.what]
    assert 18.0 < float(late.what.split()[2]) < 22.0  # ms
    assert any("irregular" in what for what in texts(both, "note"))
    assert ("too few" in " ".join(texts(both, "warning"))) == ("up_and_down" in run)


def test_xl330_turned_is_said_where_it_moves_fast():
    for kp in (100, 200, 400, 800):
        loaded = load(f"bam_xl330/kp{kp}_sin_time_square.csv", u="u_V", position="position_rad")
        assert [one.remedy for one in check(loaded, u=-1.0).errors] == ["signals.u_sign = -1"]


@pytest.mark.parametrize("run", ["ddp", "dircol", "energy_shaping"])
@pytest.mark.parametrize("u", ["torque_meas_Nm", "torque_cmd_Nm"])
def test_dfki(run, u):
    """Right in sign and unit; hands push the pendulum in energy_shaping, and nobody logged them."""
    loaded = load(f"dfki_pendulum/{run}.csv", u=u, position="position_rad", velocity="velocity_rad_s")
    result = check(loaded)
    assert texts(result, "error") == texts(result, "warning") == []
    if run == "energy_shaping":
        assert result.parameters[0].identified == "not"


#: As CAD has it, but for friction; the values are starts of a fit.
PENDULUM = PlantModel(
    0.15,
    0.0,
    {
        "gravity": {"amplitude": 3.0, "phase": 0.0},
        "coulomb_friction": {"level": 0.1},
        "viscous_friction": {"coefficient": 0.01},
    },
)


def test_dfki_by_its_reference():
    """Its drive answers noise: what the fit takes it for leans, and the reference says so and by how much."""
    channels = {"u": "torque_meas_Nm", "position": "position_rad", "velocity": "velocity_rad_s"}
    bare, told = (
        check_log(load("dfki_pendulum/ddp.csv", **channels, **more).log, PENDULUM).parameters[0]
        for more in ({}, {"reference": "position_ref_rad"})
    )
    assert bare.identified != "identified"
    assert told.leaning == bare.value
    assert 0.185 < told.value < 0.22
    assert abs(told.value - 0.2) < told.std_error < 0.03


def test_emps_has_no_noise_that_comes_back():
    model = PlantModel(95.0, 0.0, {"coulomb_friction": {"level": 20.0}, "viscous_friction": {"coefficient": 200.0}})
    channels = {"u": "force_N", "position": "position_m"}
    first, second = (
        check_log(load("emps/emps_train.csv", **channels, **more).log, model).parameters
        for more in ({}, {"reference": "reference_m"})
    )
    assert second == first
    assert first[0].identified == "identified"  # the offset of its drive, which the model lacks, does not bend it
    assert abs(first[0].value - 95.1089) < first[0].std_error < 2.0  # Janot, Gautier and Brunot (2019)


def test_dfki_in_degrees():
    loaded = load("dfki_pendulum/ddp.csv", u="torque_meas_Nm", position="position_rad", velocity="velocity_rad_s")
    (error,) = check(loaded, position=57.29577951).errors
    assert error.remedy == "signals.position_scale = 0.0174533"
