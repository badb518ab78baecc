"""Change points: both directions of every value, the place and its interval, false alarms."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import chi2, norm

from bench.beyond._runs import State, T, engine, excitation, measured
from bench.beyond.changes import alarms_per_hour, score
from dsd_cli.detect import DetectorSettings, Engine, Grid
from dsd_cli.detect.engine import Forces, Measurement
from dsd_cli.detect.profile.alarms import false_alarms_per_hour
from dsd_cli.detect.profile.changes import split_costs

RUNS = 12


@pytest.mark.parametrize("back", [False, True], ids=["there", "back"])
@pytest.mark.parametrize(
    "after", [State(0.004, 1.5), State(0.007, 1.0), State(0.002, 0.8)], ids=["inertia", "delay", "both"]
)
def test_a_change_is_found_once_and_placed_whichever_way_it_goes(after: State, back: bool) -> None:
    """12 seeds; noise 10 % of u, 20 nats, windows of 100 samples."""
    found = score(after, RUNS, back=back)
    assert found.found >= 11 / RUNS
    assert found.extra == 0.0
    assert found.lag <= 100
    assert found.inside >= 9 / RUNS


@pytest.mark.parametrize("levels", [(0.2, 0.6), (0.6, 0.2)])
def test_a_change_of_friction_is_found_whichever_way_it_goes(levels: tuple[float, float]) -> None:
    """Coulomb friction as an axis of the grid; the axis moves to and fro."""
    n, cut = 4000, 2000
    u, sign = excitation(n, 8), np.sign(np.sin(np.arange(n) * 0.02))
    grid = Grid((0.0, 0.004), (0.5, 1.0, 2.0), {"coulomb_friction.level": (0.2, 0.6)})
    level = np.where(np.arange(n) < cut, *levels)
    push = -level * sign  # on the axis in the interval that ends at a sample
    d_hat = measured(u, [State(0.004, 1.0)])
    d_hat += measured(np.append(push[1:], 0.0), [State(0.0, 1.0)]) - measured(
        np.append(push[1:], 0.0), [State(0.0, 1e12)]
    )
    d_hat += 0.1 * np.random.default_rng(8).normal(size=n)
    settings = DetectorSettings(method="profile", window=200, rho=0.1)
    found = Engine(grid, settings, Measurement(T, 1.0, 0.01))
    forces = Forces(np.zeros((n, 2)), np.tile([0.2, 0.6], (n, 1)), sign)
    labels = found.run(u, d_hat, t=T * np.arange(n), forces=forces)
    assert [change.low - 0.0015 <= T * cut <= change.high + 0.0015 for change in found.changes] == [True]
    change = found.changes[0]
    assert [grid.combinations[side.combination]["coulomb_friction.level"] for side in change[5:]] == list(levels)
    assert labels.grid.axes["coulomb_friction.level"][labels.state[-1]] == levels[1]


def test_a_log_without_changes_has_none() -> None:
    """60 s at the default threshold: 0.0003 false alarms are to be expected."""
    assert alarms_per_hour(20.0, 100, 60_000) == 0.0


@pytest.mark.parametrize(("threshold", "window"), [(5.0, 100), (6.0, 50)])
def test_the_stated_rate_of_false_alarms_is_the_seen_one(threshold: float, window: int) -> None:
    """300 s, 5 seeds: some 180 and 110 alarms are stated, so that a factor of 1.35 is four standard deviations."""
    seen = np.mean([alarms_per_hour(threshold, window, 60_000, seed=10 * seed) for seed in range(5)])
    stated = false_alarms_per_hour(threshold, window, T, 0.01)
    assert stated / 1.35 < seen < 1.35 * stated


@pytest.mark.parametrize("freedom", [1, 2, 3, 4])
def test_stated_false_alarms_against_numerical_integration(freedom: int) -> None:
    """The mean over a normal variance and the chi-squared tail, by SciPy's quadrature."""
    h, window, tau = 7.0, 80, 0.01
    spread = np.sqrt(2.0 / (2 * window - 4))

    def of_variance(w: float) -> float:
        return max(w, 1.0) * np.exp(-h * (max(w, 1.0) - 1.0)) * norm.pdf(w, 1.0, spread)

    mean = sum(quad(of_variance, *limits)[0] for limits in ((1.0 - 9 * spread, 1.0), (1.0, 1.0 + 9 * spread)))
    rate = 3.0 / window * h * chi2.sf(2.0 * h, freedom) * np.exp(-0.583 * np.sqrt(6.0 * h / window)) * mean
    expected = 3600.0 / T * rate / (1.0 + rate * (window + 12.0 * tau / T))
    assert false_alarms_per_hour(h, window, T, tau, freedom) == pytest.approx(expected, rel=1e-6)


def test_two_changes_are_two() -> None:
    u = excitation(5000, 9)
    d_hat = measured(u, [State(0.004, 1.0), State(0.004, 1.5), State(0.007, 1.5)], [1500, 3000])
    found = engine()
    found.run(u, d_hat + 0.1 * np.random.default_rng(9).normal(size=5000))
    assert [round(change.time, -2) for change in found.changes] == [1500, 3000]
    assert found.changes[0].after.inertia == pytest.approx(1.5, rel=0.15)
    assert found.changes[1].after.delay == pytest.approx(0.007, abs=0.001)


def test_a_change_that_q_smears_is_followed_sample_by_sample() -> None:
    """`split_costs` against the plant simulated anew for every split."""
    n, pole, rng = 40, 0.8, np.random.default_rng(3)
    raw_before, raw_after = rng.normal(size=(2, n))
    start_before, start_after = rng.normal(size=2)

    def passed(raw: np.ndarray, state: float) -> np.ndarray:
        out = []
        for value in raw:
            state = (1.0 - pole) * value + pole * state
            out.append(state)
        return np.array(out)

    y = rng.normal(size=n)
    z_before, z_after = passed(raw_before, start_before), passed(raw_after, start_after)
    costs = split_costs(y - z_before, y - z_after, pole)
    for i in range(1, n):
        late = passed(raw_after[i:], z_before[i - 1])
        expected = ((y[:i] - z_before[:i]) ** 2).sum() + ((y[i:] - late) ** 2).sum()
        assert costs[i - 1] == pytest.approx(expected, rel=1e-9)


def test_a_change_right_before_a_gap_is_kept() -> None:
    u = excitation(2060, 9)
    d_hat = measured(u, [State(0.004, 1.0), State(0.004, 2.0)], [2000])
    found = engine()
    found.run(u, d_hat + 0.1 * np.random.default_rng(9).normal(size=2060))
    before = found.changes
    assert len(before) == 1
    found.restart()
    found.run(u[:200], d_hat[:200])
    assert found.changes == before


def test_zero_looks_for_none() -> None:
    u = excitation(3000, 1)
    found = engine(change=0.0)
    found.run(u, measured(u, [State(0.004, 1.0), State(0.004, 2.0)], [1500]))
    assert found.changes == []
