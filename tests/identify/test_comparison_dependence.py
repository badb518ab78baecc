"""Hidden physics shows on its channel, and nothing shows where nothing is hidden."""

import numpy as np
import pytest

from dsd_cli.identify.compare.comparison import compare
from dsd_cli.identify.compare.dependence import (
    Columns,
    dependence,
    explained_share,
    freeform_columns,
    held_out_folds,
    inputs_of,
    seen_columns,
)
from dsd_cli.identify.compare.evaluation import evaluate
from dsd_cli.plant.model import PlantModel
from tests.identify.comparison_rig import BELIEVED, MOVES, OBSERVER, recorded, rng

GAP = 25


def _shares(recording, model=BELIEVED):
    return {d.on: d.explains for d in dependence(evaluate([recording], model, OBSERVER), GAP)}


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
    recording = recorded(noise=0.0)
    piece = recording.pieces[0]
    evaluation = evaluate([recording], BELIEVED, OBSERVER)
    stretch = evaluation.stretches[0]
    inputs = inputs_of(piece, stretch.model, OBSERVER, stretch.first)
    law = inputs.values["velocity"] * np.sin(4.0 * inputs.values["position"])
    residual = inputs.frame.seen(law, OBSERVER)[stretch.first :]

    def share(*on):
        return explained_share(residual, freeform_columns([inputs], on), GAP)

    assert share("velocity", "position") > max(share("velocity"), share("position"), 0.0) + 0.2
    names = _shares(recorded({"viscous_friction": {"coefficient": 0.02}}))
    assert not [name for name in names if " x " in name]


def test_columns_pass_the_observer_like_forces_do():
    recording = recorded(noise=0.0, duration=2.0)
    inputs = inputs_of(recording.pieces[0], BELIEVED, OBSERVER, 0)
    raw = rng(0).normal(size=(len(recording.pieces[0]), 3))
    one_by_one = np.column_stack([inputs.frame.seen(column, OBSERVER) for column in raw.T])
    np.testing.assert_allclose(seen_columns(raw, inputs), one_by_one, rtol=0, atol=1e-12)


def test_hats_sum_to_one_on_every_channel():
    recording = recorded({"coulomb_friction": {"level": 0.1}}, reference=MOVES, noise=0.0, duration=3.0)
    inputs = inputs_of(recording.pieces[0], PlantModel(0.01, rest_speed=1e-3), OBSERVER, 10)
    for channels in (("position",), ("u",), ("time",), ("u", "position")):
        np.testing.assert_allclose(freeform_columns([inputs], channels).values.sum(axis=1), 1.0)
    columns = freeform_columns([inputs], ("velocity",))
    without_held = columns.values[:, :-1] if np.any(inputs.held) else columns.values
    np.testing.assert_allclose(without_held.sum(axis=1), 1.0)
    assert columns.penalty.shape == (columns.values.shape[1],) * 2


def test_held_out_blocks_are_held_out():
    """No row that is tested, nor its neighbours within the gap, is fitted to; all rows are tested once."""
    rows = 1000
    tested = np.zeros(rows, dtype=int)
    for fold in held_out_folds(rows, GAP):
        omitted = np.zeros(rows, dtype=int)
        for test, omit in fold:
            tested[test] += 1
            omitted[omit] += 1
            assert omit.start == max(test.start - GAP, 0)
            assert omit.stop == min(test.stop + GAP, rows)
        assert omitted.max() == 1
    assert (tested == 1).all()
    assert held_out_folds(11 * GAP, GAP) == []


def test_a_fit_that_saw_what_it_is_judged_on_would_explain_noise():
    """Many columns of noise explain noise within the log; on held-out blocks they do not."""
    noise = rng(7)
    residual = noise.normal(size=600)
    columns = Columns(noise.normal(size=(600, 120)), np.zeros((120, 120)))
    inside = np.linalg.lstsq(columns.values, residual, rcond=None)[1][0]
    assert 1.0 - inside / np.sum(residual**2) > 0.15
    assert explained_share(residual, columns, 5) < 0.0
    assert explained_share(residual[:20], Columns(columns.values[:20], columns.penalty), 5) is None


def test_a_long_log_is_read_in_chunks_with_the_same_answer(monkeypatch):
    recording = recorded({"viscous_friction": {"coefficient": 0.02}})
    whole = _shares(recording)
    monkeypatch.setattr("dsd_cli.identify.compare.dependence.MOST_ROWS", 4000)
    monkeypatch.setattr("dsd_cli.identify.compare.dependence.CHUNK", 500)
    chunks = _shares(recording)
    assert chunks["velocity"] == pytest.approx(whole["velocity"], abs=0.05)


def test_a_constant_is_called_one():
    comparison, _ = compare([recorded({"constant_load": {"force": 0.05}})], BELIEVED, OBSERVER, GAP)
    assert comparison.conclusion == "bias"
    assert comparison.accuracy.bias == pytest.approx(0.05, rel=0.05)


def test_a_log_too_short_for_blocks_says_so():
    """0.4 s leave 170 samples, and blocks of three gaps of 25 (the time that Q needs) do not fit in them four times."""
    recording = recorded({"viscous_friction": {"coefficient": 0.02}}, duration=0.4)
    comparison, _ = compare([recording], BELIEVED, OBSERVER, GAP)
    assert comparison.dependence == ()
    assert comparison.conclusion in ("short", "bias")


def test_a_window_too_wide_for_the_log_gives_way():
    recording = recorded({"viscous_friction": {"coefficient": 0.02}}, duration=3.0)
    comparison, _ = compare([recording], BELIEVED, OBSERVER, 1000)
    assert comparison.dependence[0].on == "velocity"
