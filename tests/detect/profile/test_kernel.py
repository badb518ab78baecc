"""method = "profile" as an engine: the same bits in any cut, nothing guessed, values between the candidates."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bench.beyond._runs import State, T, excitation, measured
from dsd_cli.detect import DetectorSettings, Engine, Grid, Labels
from dsd_cli.detect.engine import Forces, Measurement
from dsd_cli.errors import UsageError

GRID = Grid((0.0, 0.004, 0.008), (0.5, 1.0, 2.0))
COLUMNS = ("state", "log_likelihood", "probability", "confident")


def make(grid: Grid = GRID, aperture: int = 1, timed: bool = False, **tuning: object) -> Engine:
    tuning = {"window": 60, "rho": 0.1, "initial": len(grid) - 1, **tuning}
    return Engine(grid, DetectorSettings(method="profile", **tuning), Measurement(T, 1.0, 0.01, 1, aperture, timed))


def same_bits(parts: list[Labels], whole: Labels) -> None:
    for name in COLUMNS:
        got = np.concatenate([getattr(part, name) for part in parts])
        np.testing.assert_array_equal(got, getattr(whole, name), err_msg=name)
    for i, column in enumerate(whole.estimates):
        np.testing.assert_array_equal(np.concatenate([part.estimates[i] for part in parts]), column, err_msg=str(i))


@settings(deadline=None, max_examples=25)
@given(
    cuts=st.lists(st.integers(1, 899), max_size=6),
    seed=st.integers(0, 100),
    timed=st.booleans(),
    aperture=st.sampled_from([1, 2]),
    missing=st.sampled_from([0.0, 0.05]),
    window=st.sampled_from([10, 37, 60]),
)
def test_any_cut_gives_the_same_bits(
    cuts: list[int], seed: int, timed: bool, aperture: int, missing: float, window: int
) -> None:
    n = 300 if timed else 900
    u, rng = excitation(n, seed), np.random.default_rng(seed)
    d_hat = measured(u, [State(0.004, 1.0), State(0.006, 1.6)], [n // 2]) + 0.05 * rng.normal(size=n)
    d_hat[rng.uniform(size=n) < missing] = np.nan
    t = np.cumsum(T * rng.uniform(0.7, 1.3, n)) if timed else T * np.arange(n)
    edges = sorted({0, *(cut for cut in cuts if cut < n), n})
    engine, other = (make(timed=timed, aperture=aperture, window=window, change=5.0) for _ in range(2))
    parts = [engine.run(u[a:b], d_hat[a:b], t=t[a:b]) for a, b in itertools.pairwise(edges)]
    same_bits(parts, other.run(u, d_hat, t=t))
    assert engine.changes == other.changes


def test_step_is_run_sample_by_sample() -> None:
    u = excitation(400, 1)
    d_hat = measured(u, [State(0.004, 1.0)])
    engine, whole = make(), make().run(u, d_hat)
    labels = [engine.step(*pair) for pair in zip(u.tolist(), d_hat.tolist(), strict=True)]
    assert [label.state for label in labels] == whole.state.tolist()
    assert [label.confident for label in labels] == whole.confident.tolist()


@pytest.mark.parametrize("state", [State(0.0043, 0.7), State(0.002, 1.4), State(0.0078, 2.6), State(0.004, 1.0)])
def test_without_noise_delay_and_inertia_between_the_candidates_are_exact(state: State) -> None:
    u = excitation(1200, 4)
    labels = make(rho=0.02).run(u, measured(u, [state]))
    delay, _, inertia, _, delay_sure, inertia_sure = labels.estimates
    assert delay_sure[300:].mean() > 0.9
    assert inertia_sure[300:].mean() > 0.9
    np.testing.assert_allclose(delay[300:][delay_sure[300:]], state.delay, atol=1e-8)
    np.testing.assert_allclose(inertia[300:][inertia_sure[300:]], state.inertia, rtol=1e-6)


def test_a_confident_label_is_the_candidate_nearest_to_the_truth() -> None:
    """Over 60 random plants with noise; nearest in L and in 1 / J. None of about 60,000 confident labels is wrong."""
    rng = np.random.default_rng(0)
    confident = wrong = 0
    for seed in range(60):
        state = State(float(rng.uniform(0.0, 0.008)), float(np.exp(rng.uniform(np.log(0.5), np.log(2.0)))))
        u = excitation(2000, seed, float(rng.choice([5.0, 20.0, 60.0])))
        labels = make(rho=0.1).run(u, measured(u, [state]) + 0.1 * rng.normal(size=2000))
        delay = min(GRID.delays, key=lambda value, truth=state.delay: abs(value - truth))
        inertia = min(GRID.inertias, key=lambda value, truth=state.inertia: abs(1 / value - 1 / truth))
        sure = labels.confident
        confident += int(sure.sum())
        wrong += int((sure & ((labels.delay != delay) | (labels.inertia != inertia))).sum())
    assert confident > 30_000
    assert wrong <= 0.002 * confident


def test_no_excitation_is_held_and_never_a_guess() -> None:
    """u moves, then stands still: estimates, label and their errors stay what they were, the flags go."""
    u = excitation(3000, 2)
    u[1000:] = u[999]
    d_hat = measured(u, [State(0.004, 0.8)]) + 0.02 * np.random.default_rng(2).normal(size=3000)
    labels = make(rho=0.02).run(u, d_hat)
    delay, delay_std, _, _, delay_sure, inertia_sure = labels.estimates
    assert delay_sure[500:1000].all()
    assert not delay_sure[1200:].any()
    assert len(set(delay[1200:])) == len(set(delay_std[1200:])) == 1
    assert set(labels.delay[300:]) == {0.004}
    assert inertia_sure[1200:].mean() > 0.9  # a constant u tells J


def test_a_log_at_rest_has_no_estimate_at_all() -> None:
    labels = make().run(np.zeros(500), 0.05 * np.random.default_rng(0).normal(size=500))
    assert np.isnan(labels.estimates[0]).all()
    assert not np.any(labels.estimates[4:])
    assert set(labels.state) == {len(GRID) - 1}


def test_a_delay_beyond_the_candidates_is_not_confident() -> None:
    """15 ms with candidates up to 8 ms: there may be more beyond the edge, so that nothing is founded."""
    u = excitation(3000, 5)
    labels = make(rho=0.5).run(u, measured(u, [State(0.015, 1.0)]) + 0.05 * np.random.default_rng(1).normal(size=3000))
    assert labels.estimates[4][300:].mean() < 0.02
    assert labels.confident[300:].mean() < 0.01


def test_one_delay_or_one_inertia_is_taken_as_known() -> None:
    u = excitation(800, 3)
    d_hat = measured(u, [State(0.004, 1.0)])
    delay = make(Grid((0.004,), (0.5, 1.0, 2.0))).run(u, d_hat)
    assert delay.confident[200:].all()
    assert set(delay.estimates[1][200:]) == {0.0}
    inertia = make(Grid((0.0, 0.004), (1.0,))).run(u, d_hat)
    assert set(inertia.estimates[2][200:]) == {1.0}
    np.testing.assert_allclose(inertia.estimates[0][200:], 0.004, atol=1e-9)


def test_effect_values_of_the_grid_are_told_apart() -> None:
    """A force that is there or not: the combination that fits is chosen, with confidence."""
    n = 1500
    u, force = excitation(n, 6), np.sign(np.sin(np.arange(n) * 0.02))
    both = measured(u, [State(0.004, 1.0)]) + measured(0.5 * force, [State(0.0, 1.0)])
    both -= measured(0.5 * force, [State(0.0, 1e12)])  # of the force, the plant's part alone
    grid = Grid((0.0, 0.004), (0.5, 1.0, 2.0), {"constant_load.force": (0.0, 0.5)})
    applied = np.column_stack([np.zeros(n), 0.5 * np.concatenate([[0.0], force])[:n]])
    forces = Forces(applied, np.zeros((n, 2)), np.zeros(n))
    labels = make(grid).run(u, both, forces=forces)
    assert (grid.axes["constant_load.force"][labels.state[300:]] == 0.5).mean() > 0.99
    assert labels.confident[300:].mean() > 0.9


def test_what_cannot_work_is_refused() -> None:
    with pytest.raises(UsageError, match="needs 10 samples"):
        make(window=5)
    with pytest.raises(UsageError, match="every sample between the candidate delays"):
        make(Grid((0.0, 10.0), (1.0, 2.0)))
    with pytest.raises(UsageError, match="too much memory"):
        make(Grid((0.0, 3.0), (1.0, 2.0)), window=100_000)
