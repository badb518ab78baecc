"""The error numbers against plain loops over the definition."""

import math

import numpy as np
import pytest

from dsd_cli.errors import DataError
from dsd_cli.identify.compare.evaluation import accuracy, evaluate
from dsd_cli.identify.recordings.recording import prepare
from dsd_cli.identify.verdict.diagnose import diagnose
from dsd_cli.plant.model import ObserverSettings, PlantModel
from dsd_cli.signals.log import Log
from tests.identify.comparison_rig import BELIEVED, OBSERVER, T, recorded, rng

TAU, JN, J, N = 0.004, 2.0, 1.6, 400


def _log(seed=0):
    noise = rng(seed)
    u = np.cumsum(noise.normal(size=N)) * 0.3
    velocity = np.cumsum(u + noise.normal(size=N)) * T
    return {"t": T * np.arange(N), "u": u, "velocity": velocity, "d_hat": -0.3 * u + 0.1 + noise.normal(size=N)}


def _loops(log, first):
    """All numbers for a model without delay and effects: d_model = (Jn/J - 1) Q u, with u of the interval before."""
    p, w = math.exp(-T / TAU), log["u"][0]
    e, y, net, drive = [], [], [], []
    for k in range(N):
        u = log["u"][max(k - 1, 0)]
        w = p * w + (1 - p) * u
        if k >= first:
            y.append(log["d_hat"][k])
            e.append(y[-1] - (JN / J * w - w))
            net.append(y[-1] + w)
            drive.append(w)
    n = len(e)
    mean_e, mean_y = sum(e) / n, sum(y) / n
    power = sum(x * x for x in e)
    spread = sum((x - mean_y) ** 2 for x in y)
    return {
        "samples": n,
        "rmse": math.sqrt(power / n),
        "fit_percent": 100 * (1 - math.sqrt(power / spread)),
        "vaf_percent": 100 * (1 - sum((x - mean_e) ** 2 for x in e) / spread),
        "bias": mean_e,
        "max_error": max(abs(x) for x in e),
        "relative_error_percent": 100 * math.sqrt(power / sum(x * x for x in net)),
        "relative_force_error_percent": 100 * J / JN * math.sqrt(power / sum(x * x for x in drive)),
    }


def test_the_numbers_are_those_of_plain_loops():
    observer, columns = ObserverSettings(JN, TAU), _log()
    evaluation = evaluate([prepare(Log(columns, T), observer)], PlantModel(J), observer)
    assert evaluation.lead == pytest.approx(0.02)
    assert evaluation.skipped == 10
    found = accuracy(evaluation)
    for name, value in _loops(columns, 10).items():
        assert getattr(found, name) == pytest.approx(value, rel=1e-9), name


def test_a_sign_of_minus_one_changes_no_number_but_that_of_d_hat():
    columns = _log()
    flipped = {**columns, "d_hat": -columns["d_hat"]}
    plus, minus = ObserverSettings(JN, TAU), ObserverSettings(JN, TAU, -1)
    one = accuracy(evaluate([prepare(Log(columns, T), plus)], PlantModel(J), plus))
    other = accuracy(evaluate([prepare(Log(flipped, T), minus)], PlantModel(J), minus))
    assert one == other


def test_the_fit_is_not_clipped_and_the_delay_lengthens_what_is_left_out():
    observer, columns = ObserverSettings(JN, TAU), _log()
    recording = prepare(Log(columns, T), observer)
    assert accuracy(evaluate([recording], PlantModel(0.01), observer)).fit_percent < -1000
    assert evaluate([recording], PlantModel(J, delay=0.1), observer).skipped == 60


def test_a_true_model_leaves_the_noise_and_nothing_else():
    effects = {"viscous_friction": {"coefficient": 0.01}, "coulomb_friction": {"level": 0.1}}
    model = PlantModel(BELIEVED.inertia, BELIEVED.delay, effects)
    found = accuracy(evaluate([recorded(effects, noise=0.01)], model, OBSERVER))
    assert found.rmse == pytest.approx(0.01, rel=0.03)
    assert abs(found.bias) < 0.001


def test_several_logs_are_pooled():
    recordings = [recorded(seed=1, duration=2.0), recorded({"constant_load": {"force": 0.05}}, seed=2, duration=4.0)]
    each = [accuracy(evaluate([r], BELIEVED, OBSERVER)) for r in recordings]
    together = accuracy(evaluate(recordings, BELIEVED, OBSERVER))
    assert together.samples == sum(one.samples for one in each)
    pooled = sum(one.samples * one.rmse**2 for one in each) / together.samples
    assert together.rmse == pytest.approx(math.sqrt(pooled))


def test_what_cannot_be_compared_is_said():
    observer, columns = ObserverSettings(JN, 0.2), _log()
    with pytest.raises(DataError, match="too short"):
        evaluate([prepare(Log({k: x[:480] for k, x in columns.items()}, T), observer)], PlantModel(J), observer)
    slow = {**_log(), "t": 1.12 * T * np.arange(N)}
    pair = [prepare(Log(columns, T), observer), prepare(Log(slow, 1.12 * T), observer)]
    for command in (lambda: evaluate(pair, PlantModel(J), observer), lambda: diagnose(pair, PlantModel(J), observer)):
        with pytest.raises(DataError, match=r"0\.00224 s between samples, .* has 0\.002 s"):
            command()
