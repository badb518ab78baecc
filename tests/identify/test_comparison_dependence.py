"""Hidden physics shows on its channel, and nothing shows where nothing is hidden."""

import numpy as np
import pytest

from dsd_cli.identify.compare.balance import Balance, balance_of
from dsd_cli.identify.compare.comparison import channels_of, compare, dependence, explained_share
from dsd_cli.identify.fit.blocks import lay_blocks
from dsd_cli.identify.recordings.recording import prepare
from dsd_cli.plant.model import ObserverSettings, PlantModel
from dsd_cli.signals.log import Log
from tests.identify.comparison_rig import BELIEVED, MOVES, OBSERVER, recorded, rng
from tests.oracle.rig_strange import make

GAP = 25


def _balance(recording, model=BELIEVED):
    found = balance_of([recording], model)
    assert isinstance(found, Balance)
    return found


def _shares(recording, model=BELIEVED):
    return {d.on: d.explains for d in dependence(_balance(recording, model))}


@pytest.mark.parametrize(
    ("hidden", "reference", "on", "least"),
    [
        ({"viscous_friction": {"coefficient": 0.02}}, None, "velocity", 0.8),
        ({"gravity": {"amplitude": 0.1, "phase": 0.5}}, None, "position", 0.9),
        ({"stiffness": {"coefficient": 0.1}}, None, "position", 0.9),
        ({"coulomb_friction": {"level": 0.1}}, MOVES, "direction", 0.9),
        ({"periodic_disturbance": {"amplitude": 0.05, "frequency": 0.03, "phase": 0.3}}, None, "time", 0.6),
    ],
)
def test_hidden_physics_shows_on_its_channel(hidden, reference, on, least):
    recording = recorded(hidden, **({} if reference is None else {"reference": reference}))
    comparison, _ = compare([recording], BELIEVED, OBSERVER, GAP)
    shares = {d.on: d.explains for d in comparison.dependence}
    assert shares[on] > least
    assert comparison.conclusion == on
    assert [d.explains for d in comparison.dependence] == sorted(shares.values(), reverse=True)


def test_a_wrong_inertia_shows_on_acceleration_and_u():
    shares = _shares(recorded(), PlantModel(1.3 * BELIEVED.inertia, BELIEVED.delay))
    assert shares["acceleration"] > 0.5
    assert shares["acceleration"] > shares["velocity"] + 0.3
    assert shares["u"] > 0.5


@pytest.mark.parametrize("seed", range(4))
def test_the_true_model_leaves_nothing(seed):
    effects = {"viscous_friction": {"coefficient": 0.02}, "coulomb_friction": {"level": 0.1}}
    truth = PlantModel(BELIEVED.inertia, BELIEVED.delay, effects)
    recording = recorded(effects, seed=seed, reference=MOVES)
    comparison, _ = compare([recording], truth, OBSERVER, GAP)
    assert comparison.dependence[0].explains < 0.05
    assert all(d.explains >= 0.0 for d in comparison.dependence)
    assert comparison.conclusion == "noise"
    assert not comparison.residual.remembers


def test_a_pair_is_named_only_if_it_says_more_than_its_channels():
    """v and q together: a damping that grows along the way."""
    errors = _balance(recorded(noise=0.0)).errors
    equations, channels = errors.equations, channels_of(errors.equations, BELIEVED)
    law = [p.values["velocity"] * np.sin(4.0 * p.values["position"]) for p in channels.pieces]
    residual = equations.acting(law, smooth=True, held=True)[equations.kept]

    def share(*on):
        return explained_share(residual, *channels.columns(on), lay_blocks([len(residual)], 5, "log"))

    assert share("velocity", "position") > max(share("velocity"), share("position"), 0.0) + 0.2
    names = _shares(recorded({"viscous_friction": {"coefficient": 0.02}}))
    assert not [name for name in names if " x " in name]


def test_hats_sum_to_one_on_every_channel():
    """Their sum is a force of 1 wherever the axis moves; the rows that count may touch a rest."""
    recording = recorded({"coulomb_friction": {"level": 0.1}}, reference=MOVES, noise=0.0, duration=3.0)
    equations = _balance(recording, PlantModel(0.01, rest_speed=1e-3)).errors.equations
    channels = channels_of(equations, PlantModel(0.01))
    one = equations.acting([np.ones(len(s.log)) for s in equations.stretches], False, True)[equations.kept]
    for on in (("position",), ("u",), ("time",), ("u", "position"), ("velocity",)):
        columns, penalty = channels.columns(on)
        np.testing.assert_allclose(np.sum(columns, axis=0), one, atol=1e-12)
        assert penalty.shape == (len(columns),) * 2


def test_a_fit_that_saw_what_it_is_judged_on_would_explain_noise():
    """Many columns of noise explain noise within the log; on held-out blocks they do not."""
    noise = rng(7)
    residual, columns = noise.normal(size=600), noise.normal(size=(120, 600))
    inside = np.linalg.lstsq(columns.T, residual, rcond=None)[1][0]
    assert 1.0 - inside / np.sum(residual**2) > 0.15
    blocks = lay_blocks([600], 5, "log")
    assert explained_share(residual, list(columns), np.zeros((120, 120)), blocks) < 0.0


def test_a_long_log_is_read_in_excerpts_with_the_same_answer():
    long = _balance(recorded({"viscous_friction": {"coefficient": 0.02}}, duration=120.0))
    assert sum(long.excerpt.equations.lengths) < 0.6 * sum(long.errors.equations.lengths)
    few = _shares(recorded({"viscous_friction": {"coefficient": 0.02}}))
    shares = {d.on: d.explains for d in dependence(long)}
    assert shares["velocity"] == pytest.approx(few["velocity"], abs=0.05)


def test_the_encoder_above_the_band_hides_no_law():
    """A spot with more dry friction behind a coarse encoder: most of the error of d_hat is the encoder's, above the
    band; the force that is missing, which tables and picture show, is the law."""
    log = make("friction_spot", 3, "enc4096", "moves")
    observer = ObserverSettings(log.inertia, 0.01)
    recording = prepare(Log(dict(log.channels), 1e-3, "log"), observer)
    comparison, series = compare([recording], PlantModel(log.inertia, log.delay, log.believed), observer)
    errors, balance = series.evaluation.errors, series.balance
    power = np.abs(np.fft.rfft(errors)) ** 2
    above = np.fft.rfftfreq(len(errors), 1e-3) > comparison.force.log.band_hz
    assert power[above].sum() > 0.3 * power.sum()
    assert comparison.where_of == "force"
    assert comparison.conclusion == "velocity x position"
    assert comparison.dependence[0].explains > 0.6
    forces, equations = balance.forces, balance.errors.equations
    true = equations.of_rows([log.truth])[equations.kept]
    left = forces.measured - forces.modelled
    fast = np.abs(balance.at_rows("velocity")) > 0.5
    assert np.corrcoef(left[fast], true[fast])[0, 1] > 0.95
    assert np.sum(left[fast] * true[fast]) / np.sum(true[fast] ** 2) == pytest.approx(1.0, abs=0.05)


def test_a_constant_is_called_one():
    comparison, _ = compare([recorded({"constant_load": {"force": 0.05}})], BELIEVED, OBSERVER, GAP)
    assert comparison.conclusion == "bias"
    assert comparison.accuracy.bias == pytest.approx(0.05, rel=0.05)


def test_a_log_too_short_for_blocks_says_so():
    """0.16 s leave 53 samples of d_hat, and no rows for two blocks of forces."""
    recording = recorded({"viscous_friction": {"coefficient": 0.02}}, duration=0.16)
    comparison, series = compare([recording], BELIEVED, OBSERVER, GAP)
    assert (comparison.dependence, series.balance, comparison.where_of) == ((), None, "d_hat")
    assert "too short" in comparison.force.missing
    assert comparison.conclusion in ("no balance", "bias")


def test_a_window_too_wide_for_the_log_gives_way():
    recording = recorded({"viscous_friction": {"coefficient": 0.02}}, duration=3.0)
    comparison, _ = compare([recording], BELIEVED, OBSERVER, 1000)
    assert comparison.dependence[0].on == "velocity"
