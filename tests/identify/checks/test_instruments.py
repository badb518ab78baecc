"""The reference as instrument: a loop whose controller answers the error of its sensor, and one that has none."""

import re
from dataclasses import replace

import numpy as np
import pytest

from dsd_cli.cli.recordings import load_recording
from dsd_cli.files.config import parse_config
from dsd_cli.identify.checks import _leaning, biased_by_noise, check_log
from dsd_cli.identify.checks.results import Parameter
from dsd_cli.identify.recordings.recording import prepare
from dsd_cli.plant.model import ObserverSettings, PlantModel
from dsd_cli.signals.log import Log
from tests.cli.rig import write

OBSERVER = "[observer]\nnominal_inertia = 0.15\ntime_constant = 0.05\n"
T, J, WEIGHT, LEVEL, DAMPING = 0.002, 0.2, 3.7, 0.15, 0.02
BELIEVED = PlantModel(
    0.15,
    0.0,
    {
        "gravity": {"amplitude": 3.0, "phase": 0.0},
        "coulomb_friction": {"level": 0.1},
        "viscous_friction": {"coefficient": 0.01},
    },
)


def pendulum(seed: int, error: float, steps: int = 8) -> dict[str, np.ndarray]:
    """10 s under PD of position and speed, whose sensor is off by noise below 15 Hz of that size, rad."""
    rng, n = np.random.default_rng(seed), 5000
    t = T * np.arange(n)
    hz, phase, size = rng.uniform(0.1, 0.7, 4), rng.uniform(0.0, 2.0 * np.pi, 4), rng.uniform(0.3, 0.8, 4)
    angle = 2.0 * np.pi * np.multiply.outer(t, hz) + phase
    wanted, wanted_speed = (np.sin(angle) - np.sin(phase)) @ size, np.cos(angle) @ (2.0 * np.pi * hz * size)
    off = np.fft.irfft(np.fft.rfft(rng.standard_normal(n)) / (1.0 + 1j * np.fft.rfftfreq(n, T) / 15.0) ** 2, n)
    off *= error / np.std(off)
    off_speed = np.gradient(off, T)
    q, v, shown = wanted[0], wanted_speed[0], np.empty((3, n))

    def acceleration(q: float, v: float, u: float) -> float:
        return (u - WEIGHT * np.sin(q) - LEVEL * np.tanh(v / 0.02) - DAMPING * v) / J

    for k in range(n):
        seen, seen_speed = q + off[k], v + off_speed[k]
        u = 40.0 * (wanted[k] - seen) + 2.0 * (wanted_speed[k] - seen_speed)
        shown[:, k] = u, seen_speed, seen
        h = T / steps
        for _ in range(steps):  # midpoint rule
            a = acceleration(q, v, u)
            q, v = q + h * (v + 0.5 * h * a), v + h * acceleration(q + 0.5 * h * v, v + 0.5 * h * a, u)
    return {"t": t, **dict(zip(("u", "velocity", "position"), shown, strict=True)), "reference": wanted}


def checked(channels):
    log = Log(channels, T, "log")
    result = check_log(log, BELIEVED)
    assert biased_by_noise(prepare(log, ObserverSettings(BELIEVED.inertia, 5.0 * T)), BELIEVED) == [
        one for one in result.findings if one.remedy.startswith("give what")
    ]
    return {one.name: one for one in result.parameters}, [one for one in result.findings if "reference" in one.what]


def without_reference(channels):
    return {name: x for name, x in channels.items() if name != "reference"}


@pytest.mark.parametrize("seed", range(4))
def test_what_the_controller_answers_bends_least_squares_and_not_the_instruments(seed):
    channels = pendulum(seed, 0.003)
    bent, nothing = checked(without_reference(channels))
    assert bent["inertia"].value < 0.5 * J
    assert nothing == []
    found, (said,) = checked(channels)
    assert found["inertia"].value == pytest.approx(J, rel=0.06)
    assert abs(found["inertia"].value - J) < 2.0 * found["inertia"].std_error
    assert found["gravity.amplitude"].value == pytest.approx(WEIGHT, rel=0.05)
    assert found["inertia"].leaning == pytest.approx(bent["inertia"].value)
    assert said.severity == "warning"
    inertia = found["inertia"]
    assert inertia.identified == "weak"  # so that no fit takes it for certain
    assert said.remedy.endswith(
        f"finds none of these missing: --prior inertia={inertia.value:.4g}+-{inertia.std_error:.2g}"
    )
    delay = found["delay"]  # by the reference 0.04 to 0.08 s uncertain: least squares need not be wrong
    assert delay.leaning is None
    assert "delay" not in said.what


def test_what_the_reference_identifies_enters_a_fit_with_its_error():
    """Held, it would leave all noise that came back as a force of the acceleration that the model lacks."""
    found, (said,) = checked(pendulum(0, 0.0005))
    assert found["inertia"].identified == "identified"
    assert f"--prior inertia={found['inertia'].value:.4g}+-{found['inertia'].std_error:.2g}" in said.remedy
    assert "--fix" not in said.remedy
    assert abs(found["delay"].value) < 2.0 * found["delay"].std_error  # the pendulum has none
    assert "delay is" not in said.what  # least squares are as unsure of it


@pytest.mark.parametrize("seed", range(2))
def test_a_sensor_that_is_hardly_off_leaves_least_squares_alone(seed):
    """Both are right, and least squares is the surer one."""
    channels = pendulum(seed, 1e-6)
    assert checked(channels) == checked(without_reference(channels))
    assert checked(channels)[0]["inertia"].value == pytest.approx(J, rel=0.01)


def test_commands_that_fit_say_it_first_unless_the_value_is_given(tmp_path):
    """`diagnose` said 0.008 +- 0.004 of 0.2 and no word of it, where `dsd check` knew."""
    write(tmp_path, "log.csv", pendulum(0, 0.003))
    effects = {name: f"[model.effects.{name}]\n" for name in BELIEVED.effects}
    text = f'[signals]\nreference = "reference"\n{OBSERVER}[model]\ninertia = 0.15\n' + "".join(
        head + "".join(f"{key} = {value}\n" for key, value in BELIEVED.effects[name].items())
        for name, head in effects.items()
    )

    def warned(config: str) -> list[str]:
        loaded = load_recording(str(tmp_path / "log.csv"), parse_config(config, "dsd.toml"))
        return [one for one in loaded.warnings if "by the reference" in one]

    (said,) = warned(text)
    values = re.match(
        r"inertia is ([\d.]+) by least squares and ([\d.]+) by the reference: the controller answers", said
    )
    assert values is not None
    assert float(values[1]) < 0.02
    assert float(values[2]) == pytest.approx(0.2, rel=0.05)
    assert "--prior inertia=0.2" in said
    assert warned(text + f'[fit.prior]\ninertia = "{J}+-0.01"\n') == []
    assert warned(text.replace('reference = "reference"', 'reference = ""')) == []


def test_a_reference_that_the_axis_does_not_follow_changes_nothing():
    """Instruments that explain no motion have errors so large that they contradict nothing."""
    channels = pendulum(0, 0.003)
    channels["reference"] = np.zeros_like(channels["t"])
    assert checked(channels) == checked(without_reference(channels))


def test_where_a_force_is_missing_no_noise_is_blamed():
    """Friction that the model lacks made delay -3.9 ms, or -5.4 by the reference: no finer encoder mends it."""
    delay = Parameter("delay", "not", -0.0054, 0.01, leaning=-0.0039)
    assert len(_leaning([delay])) == 1
    assert _leaning([replace(delay, beside=0.004, lacks_force=True)]) == []
    assert len(_leaning([replace(delay, beside=0.004)])) == 1


def test_what_a_missing_force_bends_is_no_prior():
    """Friction made 0.0221 +- 0.0008 of 0.0131 by the reference, and noise of the sensor was blamed for it."""
    step, t = 0.01, 0.01 * np.arange(3000)
    wanted = 1.2 * np.sin(1.3 * t) * np.sin(0.31 * t + 0.4) + 0.3 * np.sin(3.1 * t)
    q, v, shown = 0.0, 0.0, np.empty((3, t.size))
    for k in range(t.size):
        u = 60.0 * (wanted[k] - np.round(q / 0.0015) * 0.0015) - 2.0 * v
        shown[:, k] = u, v, np.round(q / 0.0015) * 0.0015
        for _ in range(50):
            v += step / 50 * (u - 6.0 * np.tanh(v / 0.005) - 1.2 * v) / J
            q += step / 50 * v
    channels = {"t": t, **dict(zip(("u", "velocity", "position"), shown, strict=True)), "reference": wanted}
    result = check_log(Log(channels, step, "log"), PlantModel(J))
    assert not [one for one in result.findings if "--prior" in one.remedy or "noise of the sensor" in one.what]
