"""Where the error is: shares of exclusive parts sum to 1, and a known error is found in its place."""

import numpy as np
import pytest

from dsd_cli.identify.compare.balance import Balance, balance_of, left_of_d_hat, left_of_forces
from dsd_cli.identify.compare.evaluation import evaluate
from dsd_cli.identify.compare.regimes import ACROSS, regime_masks, where
from dsd_cli.identify.recordings.recording import prepare
from dsd_cli.plant.model import ObserverSettings, PlantModel
from dsd_cli.signals.log import Log
from tests.identify.comparison_rig import BELIEVED, MOVES, OBSERVER, recorded, rng

PARTITION = ("rest", "breakaway", "reversal", "slow", "medium", "fast")
HIDDEN = {"coulomb_friction": {"level": 0.15}, "viscous_friction": {"coefficient": 0.01}}


def _recordings():
    return [recorded(HIDDEN, reference=MOVES), recorded(HIDDEN, seed=5)]


def _of_forces(recordings, model=BELIEVED):
    balance = balance_of(recordings, model)
    assert isinstance(balance, Balance)
    return left_of_forces(balance, OBSERVER.time_constant)


@pytest.fixture(scope="module", params=["force", "d_hat"])
def left(request):
    if request.param == "force":
        return _of_forces(_recordings())
    return left_of_d_hat(evaluate(_recordings(), BELIEVED, OBSERVER))


def test_shares_of_exclusive_parts_sum_to_one(left):
    tables = where(left)
    exclusive = [r for r in tables.regimes if not r.overlaps]
    assert {r.regime for r in exclusive} <= set(PARTITION)
    assert {r.regime for r in tables.regimes if r.overlaps} <= set(ACROSS)
    for parts in (exclusive, tables.time, tables.velocity, tables.position, tables.frequency):
        assert sum(part.share_of_error for part in parts) == pytest.approx(1.0)
    for parts in (exclusive, tables.time, tables.velocity, tables.position):
        assert sum(part.share_of_samples for part in parts) == pytest.approx(1.0)


def test_every_row_is_in_one_regime_and_their_errors_are_those_rows(left):
    masks, errors = regime_masks(left), left.errors
    assert (sum(masks[name].astype(int) for name in PARTITION) == 1).all()
    for regime in where(left).regimes:
        own = [e for e, inside in zip(errors, masks[regime.regime], strict=True) if inside]
        assert regime.rmse == pytest.approx(np.sqrt(sum(e * e for e in own) / len(own)))
        assert regime.share_of_error == pytest.approx(sum(e * e for e in own) / sum(e * e for e in errors))


def test_the_force_that_is_missing_is_where_the_axis_moves_and_as_large_as_it_is():
    """0.15 N m of dry friction and a little viscous, to and fro: 0.15 at any speed, more where it is fast."""
    found = {r.regime: r.rmse for r in where(_of_forces(_recordings()[:1])).regimes}
    assert found["slow"] == pytest.approx(0.15, rel=0.15)
    assert found["fast"] > found["medium"] > found["slow"]


def _shaped(velocity, d_hat, u=None):
    t = 0.001 * np.arange(len(velocity))
    u = rng(0).normal(size=len(t)) if u is None else u
    observer = ObserverSettings(1.0, 0.0)
    log = Log({"t": t, "u": u, "velocity": velocity, "d_hat": d_hat}, 0.001)
    return left_of_d_hat(evaluate([prepare(log, observer)], PlantModel(1.0), observer))


def test_rest_breakaway_and_reversal_are_where_they_happen():
    v = np.zeros(3000)
    v[1000:1500] = np.linspace(0.01, 1.0, 500)
    v[1500:2000] = np.linspace(1.0, -1.0, 500)
    v[2000:2500] = np.linspace(-1.0, -0.01, 500)
    left = _shaped(v, np.zeros(3000))
    first = left.parts[0].rows[0]
    masks = {name: np.flatnonzero(mask) + first for name, mask in regime_masks(left).items()}
    assert set(masks["rest"]) == set(range(first, 1000)) | set(range(2500, 3000))
    assert masks["breakaway"].min() == 1000
    assert masks["breakaway"].max() == pytest.approx(1050, abs=2)
    assert masks["reversal"].min() == pytest.approx(1700, abs=3)
    assert masks["reversal"].max() == pytest.approx(1800, abs=3)
    assert np.abs(v[masks["fast"]]).min() >= np.abs(v[masks["medium"]]).max()
    assert np.abs(v[masks["medium"]]).min() >= np.abs(v[masks["slow"]]).max()
    moving = masks["accelerating"]
    assert set(range(1100, 1450)) <= set(moving)
    assert not set(range(1520, 1740)) & set(moving)


def test_saturation_is_a_plateau_at_the_largest_u():
    u = 3.0 * np.sin(0.01 * np.arange(4000))
    limited = np.clip(u, -2.0, 2.0)
    velocity = np.cos(0.01 * np.arange(4000))
    left = _shaped(velocity, np.zeros(4000), limited)
    found = regime_masks(left)["saturated"]
    np.testing.assert_array_equal(found, (np.abs(u) >= 2.0)[left.parts[0].rows])
    assert not regime_masks(_shaped(velocity, np.zeros(4000), u))["saturated"].any()


def test_a_tone_is_in_its_octave_and_a_pulse_in_its_segment():
    t = 0.001 * np.arange(8000)
    velocity = np.sin(3 * t)
    tone = where(_shaped(velocity, np.sin(2 * np.pi * 90.0 * t), np.zeros(8000)))
    band = max(tone.frequency, key=lambda one: one.share_of_error)
    assert band.start < 90.0 < band.end
    assert band.end == pytest.approx(125.0)
    assert band.share_of_error > 0.99
    assert band.rmse == pytest.approx(np.sqrt(0.5), rel=0.01)
    pulse = where(_shaped(velocity, np.where((t > 4.1) & (t < 4.7), 1.0, 0.0), np.zeros(8000)))
    segment = max(pulse.time, key=lambda one: one.share_of_error)
    assert (segment.start, segment.end) == (pytest.approx(4.0, abs=0.01), pytest.approx(4.8, abs=0.01))
    assert segment.share_of_error == pytest.approx(1.0)
