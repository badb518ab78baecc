"""tau and Jn are settings of the detector: where we compute d_hat, no answer of an identification depends on them.

Every run tries the extremes on a few effects; `DSD_FULL=1`, as `make bench` sets it, all settings on the catalogue.
"""

import math
import os
from itertools import product

import numpy as np
import pytest

from dsd_cli.identify.fit.problem import Settings
from dsd_cli.identify.recordings.recording import prepare
from dsd_cli.identify.verdict.diagnose import diagnose
from dsd_cli.plant.model import ObserverSettings, PlantModel
from dsd_cli.signals.log import Log
from tests.oracle.machine_cases import EFFECT_IDS, cases
from tests.oracle.machines import run

FULL = os.environ.get("DSD_FULL") == "1"
TAUS, FACTORS = (0.001, 0.005, 0.02, 0.1, 0.2), (0.1, 1.0, 10.0)  # s, and shares of Jn
ALL_SETTINGS = list(product(TAUS, FACTORS))
FEW_SETTINGS = [(0.001, 0.1), (0.02, 1.0), (0.2, 10.0)]
SENSINGS = ("position", "velocity")
EFFECTS = EFFECT_IDS if FULL else ("coulomb_friction", "gravity", "none")
#: Few candidates where time is short; the true one is among them.
CANDIDATES = None if FULL else ("coulomb_friction", "viscous_friction", "gravity", "stiffness", "dead_zone")
WORK = [(effect, SENSINGS[k % 2]) for k, effect in enumerate(EFFECTS)] if FULL else list(product(EFFECTS, SENSINGS))


@pytest.fixture(scope="module")
def machines():
    """{(effect, sensing): recording}, integrated together."""
    made = [case for effect, sensing in WORK for case in cases(effect, [1], sensing=sensing, duration=5.0)]
    found = dict(zip(WORK, run(made), strict=True))
    for (_, sensing), machine in found.items():
        if sensing == "velocity":
            machine.channels.pop("position")  # so that the speed is the only sensor
    return found


def _prepared(machine, tau, factor):
    case = machine.truth
    observer = ObserverSettings(factor * case.nominal_inertia, tau)
    log = Log(machine.channels, case.sample_time, "log.csv")
    return prepare(log, observer), PlantModel(case.believed_inertia, case.believed_delay, dict(case.base)), observer


def _answer(machine, tau, factor):
    recording, model, observer = _prepared(machine, tau, factor)
    names = CANDIDATES if CANDIDATES is None else tuple(n for n in CANDIDATES if n not in model.effects)
    return diagnose([recording], model, observer, Settings(effects=names))


def _numbers(answer):
    yield from (answer.probability, answer.noise, answer.floor, answer.band_hz, answer.ceiling.heldout_rmse)
    yield from vars(answer.score).values()
    yield from vars(answer.refitted).values()
    for estimate in answer.estimates.values():
        yield from (estimate.value, estimate.std_error)
    for c in answer.ranking:
        yield from (c.rmse_after, c.heldout_rmse_before, c.heldout_rmse_after, c.probability)
        for estimate in c.parameters.values():
            yield from (estimate.value, estimate.std_error)


def _words(answer):
    return answer.verdict, answer.found, answer.depends_on, tuple(c.effect for c in answer.ranking), answer.advice


@pytest.mark.parametrize(("effect", "sensing"), WORK)
def test_verdict_values_and_errors_are_equal_whatever_tau_and_jn(machines, effect, sensing):
    first, *others = (_answer(machines[effect, sensing], *s) for s in (ALL_SETTINGS if FULL else FEW_SETTINGS))
    if not FULL:
        assert first.verdict == effect
    for other in others:
        assert _words(other) == _words(first)
        assert list(_numbers(other)) == pytest.approx(list(_numbers(first)), rel=1e-9, abs=1e-12, nan_ok=True)


@pytest.mark.parametrize(("effect", "sensing"), WORK)
def test_the_recording_that_is_fitted_is_the_same_for_all_settings(machines, effect, sensing):
    """Every channel but d_hat itself, and `turning`, which belongs to forecasts of d_hat."""
    first, *others = (_prepared(machines[effect, sensing], *s)[0] for s in ALL_SETTINGS)
    assert first.provenance["d_hat"].startswith("computed")
    for other in others:
        assert (other.rest_speed, other.missing) == (first.rest_speed, first.missing)
        assert (other.sensor.kind, other.sensor.noise.scale) == (first.sensor.kind, first.sensor.noise.scale)
        for mine, its in zip(first.pieces, other.pieces, strict=True):
            for name in ("t", "u", "velocity", "position", "acceleration"):
                np.testing.assert_array_equal(mine[name], its[name], err_msg=name)


def test_the_settings_do_change_d_hat(machines):
    """Else the two tests above would say nothing."""
    machine = machines[EFFECTS[0], SENSINGS[0]]
    rms = [float(np.sqrt(np.mean(_prepared(machine, *s)[0].pieces[0]["d_hat"] ** 2))) for s in FEW_SETTINGS]
    assert max(rms) > 2.0 * min(rms)
    assert all(math.isfinite(x) for x in rms)
