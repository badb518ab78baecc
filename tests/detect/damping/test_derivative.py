"""The damping states of eq. 6: exact under the hold, equal to eq. 6 as T goes to 0, the same in chunks of any size."""

import itertools

import numpy as np
import pytest

from dsd_cli.detect import Grid
from dsd_cli.detect.damping.derivative import AXIS, DampingStates
from dsd_cli.detect.engine import Measurement
from dsd_cli.errors import UsageError
from dsd_cli.plant.controllers import ControllerSettings
from dsd_cli.plant.model import ObserverSettings, PlantModel
from dsd_cli.plant.references import Multisine
from dsd_cli.plant.simulation import Measurement as Noise
from dsd_cli.plant.simulation import SimulationSettings, simulate
from tests.cli.rig import done, dsd, refused

DAMPINGS = (0.0, 0.4, 2.5)


def motion(damping, u, inertia, sample_time, delay=0.0):
    """v of J v' = u(t - L) - B v at the samples, u held: the exact solution, interval by interval of 1/20 T."""
    v, out, fine = 0.0, [0.0], 20
    for k in range((len(u) - 1) * fine):
        at = (k + 0.5) / fine - delay / sample_time
        force, h = (u[int(at)] if at >= 0 else 0.0), sample_time / fine
        decay = np.exp(-damping * h / inertia)
        v = decay * v + (force * (1 - decay) / damping if damping else force * h / inertia)
        if (k + 1) % fine == 0:
            out.append(v)
    return np.array(out)


def observed(u, v, nominal, tau, sample_time):
    """Q { Jn a - u } by its recursion, from the velocity."""
    p, d = np.exp(-sample_time / tau) if tau else 0.0, [0.0]
    for k in range(1, len(u)):
        d.append(p * d[-1] + (1 - p) * (nominal * (v[k] - v[k - 1]) / sample_time - u[k - 1]))
    return np.array(d)


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("delay", [0.0, 0.02, 0.025])
@pytest.mark.parametrize("damping", DAMPINGS)
def test_the_true_state_leaves_nothing(damping, delay, sign):
    """Within a sample of 0.025 s u switches: then to first order in B T/J, here up to 0.036."""
    sample_time, nominal, inertia, tau = 0.01, 1.2, 0.7, 0.03
    u = np.concatenate([np.zeros(5), np.random.default_rng(1).normal(size=300)])
    d = sign * observed(u, motion(damping, u, inertia, sample_time, delay), nominal, tau, sample_time)
    grid = Grid((delay,), (inertia,), {AXIS: DAMPINGS})
    states = DampingStates(grid, Measurement(sample_time, nominal, tau, sign))
    rate, forces = states.run(u, d)
    left = sign * rate[:, None] - nominal / inertia * forces.applied
    judged = np.isfinite(rate)
    assert judged.sum() > 280
    rms = np.sqrt(np.mean(left[judged] ** 2, axis=0))
    true = DAMPINGS.index(damping)
    assert rms[true] < (1e-9 if delay != 0.025 else 0.4 * np.delete(rms, true).min())
    assert np.delete(rms, true).min() > 0.1


def test_it_is_eq_6_of_the_paper_as_the_sample_time_goes_to_0():
    """Without Q, J = Jn and L = 0: d' = (dB u' - B d')/J in the paper's sign, which is that of -d_hat."""
    sample_time, inertia, damping = 1e-5, 0.8, 1.5
    t = sample_time * np.arange(4000)
    u = np.sin(300.0 * t)
    d = np.random.default_rng(2).normal() * np.cos(200.0 * t)  # any d_hat: eq. 6 is a function of u and d_hat
    states = DampingStates(Grid((0.0,), (inertia,), {AXIS: (damping,)}), Measurement(sample_time, inertia, 0.0))
    _, forces = states.run(u, d)
    paper = (damping * u - damping * -d) / inertia  # eq. 6 for the paper's d = -d_hat, dB = B
    np.testing.assert_allclose(-forces.applied[2:, 0], paper[2:], atol=0.02)


def test_chunks_of_any_size_give_the_same_bits():
    rng = np.random.default_rng(3)
    u, d = rng.normal(size=400), rng.normal(size=400)
    grid, measurement = Grid((0.0123,), (0.7,), {AXIS: DAMPINGS}), Measurement(1e-3, 1.0, 0.005, aperture=2)
    rate, forces = DampingStates(grid, measurement).run(u, d)
    parts = DampingStates(grid, measurement)
    cuts = [0, 1, 2, 30, 31, 200, 400]
    runs = [parts.run(u[a:b], d[a:b]) for a, b in itertools.pairwise(cuts)]
    np.testing.assert_array_equal(np.concatenate([r for r, _ in runs]), rate)
    np.testing.assert_array_equal(np.concatenate([f.applied for _, f in runs]), forces.applied)


def test_a_constant_force_that_is_no_state_leaves_nothing_after_its_edge():
    model = PlantModel(1.0, 0.0, {"viscous_friction": {"coefficient": 1.0}, "constant_load": {"force": 0.7}})
    reference = Multisine((3.0, 8.0), 1.0, seed=1)
    log = simulate(
        SimulationSettings(model, 3.0, 1e-3, controller=ControllerSettings("open_loop"), reference=reference)
    )
    states = DampingStates(Grid((0.0,), (1.0,), {AXIS: (1.0, 1.5)}), Measurement(1e-3, 1.0, 0.01))
    rate, forces = states.run(log["u"], log["d_hat"])
    left = np.abs(rate[:, None] - forces.applied)[200:]
    assert left[:, 0].max() < 1e-3 < 0.05 < left[:, 1].max()


@pytest.mark.parametrize(
    "grid",
    [Grid((0.0, 0.1), (1.0,), {AXIS: (0.0, 1.0)}), Grid((0.0,), (1.0, 2.0), {AXIS: (0.0, 1.0)}), Grid((0.0,), (1.0,))],
)
def test_other_grids_are_refused(grid):
    with pytest.raises(UsageError, match="distinguishes dampings"):
        DampingStates(grid, Measurement(1e-3))


def test_an_irregular_clock_is_refused():
    with pytest.raises(UsageError, match="regular clock"):
        DampingStates(Grid((0.0,), (1.0,), {AXIS: (0.0, 1.0)}), Measurement(1e-3, timed=True))


def test_the_command_needs_no_velocity(tmp_path):
    done("init", "--template", "damping", cwd=tmp_path)
    done("simulate", "-o", "log.csv", cwd=tmp_path)
    only = ("--set", 'signals.velocity=""', "--set", 'signals.position=""')
    said = done(
        "detect", "log.csv", *only, "--expect", "viscous_friction.coefficient=1", "--after", "0.4", cwd=tmp_path
    )
    assert "rms of d(d_hat)/dt" in said.stdout
    from_position = ("--set", 'signals.velocity=""', "--set", 'signals.d_hat=""')
    done(
        "detect",
        "log.csv",
        *from_position,
        "--expect",
        "viscous_friction.coefficient=1",
        "--after",
        "0.4",
        cwd=tmp_path,
    )
    refused(dsd("detect", "log.csv", "--set", "states.delays=[0.0, 0.1]", cwd=tmp_path), 2, "distinguishes dampings")


def test_the_observer_settings_are_those_of_the_log():
    """tau of the template, not of the paper: a wrong one leaves more."""
    noise = Noise(0.0)
    model = PlantModel(1.0, 0.0, {"viscous_friction": {"coefficient": 1.0}})
    log = simulate(
        SimulationSettings(
            model, 2.0, 1e-3, ObserverSettings(1.0, 0.02), reference=Multisine((9.0,), 1.0), measurement=noise
        )
    )
    grid, left = Grid((0.0,), (1.0,), {AXIS: (1.0,)}), []
    for tau in (0.02, 0.01):
        rate, forces = DampingStates(grid, Measurement(1e-3, 1.0, tau)).run(log["u"], log["d_hat"])
        left.append(float(np.nanmax(np.abs(rate - forces.applied[:, 0])[300:])))
    assert left[0] < 0.05 * left[1]
