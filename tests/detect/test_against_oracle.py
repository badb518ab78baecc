"""Both kernels and all methods against plain loops written from the equations."""

import math

import numpy as np
import pytest

from dsd_cli.detect import DetectorSettings, Engine, Grid, Transition
from dsd_cli.detect.engine import Measurement
from dsd_cli.detect.kernel import active_backend
from tests.oracle import detect_oracle as oracle

BACKENDS = ["numpy"] + (["compiled"] if active_backend() == "compiled" else [])
T, JN, TAU = 0.01, 1.2, 0.03
GRID = Grid(delays=(0.0, 0.05, 0.123, 0.2), inertias=(0.5, 1.0, 2.0))
STATES = list(zip(GRID.axes["delay"].tolist(), GRID.axes["inertia"].tolist(), strict=True))


def recording(seed, n=260, delay=0.123, inertia=1.0, noise=0.05):
    """u (a random walk) and d_hat of a plant with that delay, by the oracle's own loops."""
    rng = np.random.default_rng(seed)
    u = np.cumsum(rng.normal(size=n)) * 0.3
    t = (np.arange(n) * T).tolist()
    z, w = oracle.predictions(t, u.tolist(), delay, TAU)
    d = JN / inertia * np.array(z) - np.array(w) + rng.normal(size=n) * noise
    return t, u, d


def engine(backend, grid=GRID, measurement=None, **settings):
    return Engine(grid, DetectorSettings(**settings), measurement or Measurement(T, JN, TAU), backend)


def compare(labels, rows, states, ll_of):
    assert labels.state.tolist() == states
    for k, row in enumerate(rows):
        if row is None:
            assert math.isnan(labels.log_likelihood[k])
            assert not labels.confident[k]
        else:
            assert labels.log_likelihood[k] == pytest.approx(ll_of(k, states[k]), rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("window", [1, 7, 40])
@pytest.mark.parametrize("observer_filter", [True, False])
def test_dsd_is_eq_18_and_19(backend, window, observer_filter):
    t, u, d = recording(1, noise=2.0)
    rows = oracle.log_likelihoods(t, u.tolist(), d.tolist(), STATES, JN, TAU, 0.3, window, 1, observer_filter)
    uniform = [[1 / 12] * 12 for _ in range(12)]
    expected = oracle.dsd(rows, uniform, 5, STATES)
    got = engine(backend, window=window, initial=5, observer_filter=observer_filter).run(u, d)
    compare(got, rows, expected, lambda k, s: rows[k][0][s])
    for k, row in enumerate(rows):
        if row is None:
            continue
        b = np.array(row[0])
        weights = np.exp(b - b.max())
        assert got.probability[k] == pytest.approx(weights[expected[k]] / weights.sum(), rel=1e-6, abs=1e-6)
        mine = b[expected[k]]
        lead = min(
            mine - max(x for s, x in enumerate(b) if STATES[s][axis] != STATES[expected[k]][axis]) for axis in (0, 1)
        )
        explains = -2.0 * (mine + math.log(math.sqrt(2 * math.pi) * 0.3)) <= 4 * window + 4
        assert got.confident[k] == (row[1] == window and lead >= 3.0 and explains)
    assert len(set(expected)) > 2


@pytest.mark.parametrize("backend", BACKENDS)
def test_sticky_and_any_matrix_with_zeros(backend):
    t, u, d = recording(2, noise=1.0)
    rng = np.random.default_rng(0)
    matrix = rng.uniform(size=(12, 12)) ** 4
    matrix[rng.uniform(size=(12, 12)) < 0.3] = 0.0
    np.fill_diagonal(matrix, 0.2)
    rows = oracle.log_likelihoods(t, u.tolist(), d.tolist(), STATES, JN, TAU, 0.8, 3)
    sticky = [[0.9 if i == j else 0.1 / 11 for j in range(12)] for i in range(12)]
    for transition, a in ((Transition(stay=0.9), sticky), (Transition(matrix=matrix), matrix.tolist())):
        expected = oracle.dsd(rows, a, 0, STATES)
        assert len(set(expected)) > 2
        got = engine(backend, window=3, rho=0.8, transition=transition).run(u, d)
        compare(got, rows, expected, lambda k, s: rows[k][0][s])


@pytest.mark.parametrize("backend", BACKENDS)
def test_hold_keeps_the_last_well_founded_label(backend):
    t, u, d = recording(3, noise=1.5)
    rows = oracle.log_likelihoods(t, u.tolist(), d.tolist(), STATES, JN, TAU, 0.8, 5)
    uniform = [[1 / 12] * 12 for _ in range(12)]
    free, held = oracle.dsd(rows, uniform, 0, STATES), oracle.dsd(rows, uniform, 0, STATES, hold=3.0)
    assert free != held
    assert engine(backend, window=5, rho=0.8, hold=3.0).run(u, d).state.tolist() == held


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("n", [1, 4, 9])
def test_average_is_eq_7_to_9(backend, n):
    t, u, d = recording(4, noise=1.0)
    a = [[0.6 if i == j else 0.4 / 11 for j in range(12)] for i in range(12)]
    rows = oracle.log_likelihoods(t, u.tolist(), d.tolist(), STATES, JN, TAU, 0.8, 2)
    expected = oracle.averaged(rows, a, 3, STATES, n)
    got = engine(backend, method="average", average=n, window=2, rho=0.8, initial=3, transition=Transition(stay=0.6))
    assert got.run(u, d).state.tolist() == expected
    assert len(set(expected)) > 2


SMALL = Grid(delays=(0.0, 0.1), inertias=(1.0, 1.5))
SMALL_STATES = list(zip(SMALL.axes["delay"].tolist(), SMALL.axes["inertia"].tolist(), strict=True))


@pytest.mark.parametrize("backend", BACKENDS)
def test_imm_viterbi_and_smooth_against_every_path(backend):
    rng = np.random.default_rng(5)
    n, initial = 33, 2
    t = (np.arange(n) * T).tolist()
    u, d = rng.normal(size=n), rng.normal(size=n)
    a = rng.uniform(0.05, 1.0, size=(4, 4))
    a /= a.sum(axis=1, keepdims=True)
    rows = oracle.log_likelihoods(t, u.tolist(), d.tolist(), SMALL_STATES, JN, TAU, 1.5, 1)
    used = [k for k, row in enumerate(rows) if row is not None]
    assert len(used) == 7
    paths = oracle.every_path([rows[k][0] for k in used], a.tolist(), initial)
    total = sum(p for _, p in paths)
    settings = {"rho": 1.5, "transition": Transition(matrix=a), "initial": initial}

    viterbi = engine(backend, SMALL, method="viterbi", **settings).run(u, d)
    assert tuple(viterbi.state[used]) == max(paths, key=lambda item: item[1])[0]

    smooth = engine(backend, SMALL, method="smooth", **settings).run(u, d)
    imm = engine(backend, SMALL, method="imm", **settings).run(u, d)
    for i, k in enumerate(used):
        posterior = [sum(p for path, p in paths if path[i] == s) / total for s in range(4)]
        assert smooth.state[k] == int(np.argmax(posterior))
        assert smooth.probability[k] == pytest.approx(max(posterior), rel=1e-9)
        partial = oracle.every_path([rows[j][0] for j in used[: i + 1]], a.tolist(), initial)
        sums = [sum(p for path, p in partial if path[-1] == s) for s in range(4)]
        assert imm.state[k] == int(np.argmax(sums))
        assert imm.probability[k] == pytest.approx(max(sums) / sum(sums), rel=1e-9)


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("aperture", [1, 2])
def test_irregular_stamps_use_the_true_intervals(backend, aperture):
    rng = np.random.default_rng(6)
    n = 150
    t = np.cumsum(rng.uniform(0.3, 1.9, size=n)) * T
    u = np.cumsum(rng.normal(size=n))
    z, w = oracle.predictions(t.tolist(), u.tolist(), 0.123, TAU, aperture)
    d = JN / 2.0 * np.array(z) - np.array(w) + rng.normal(size=n) * 0.01
    rows = oracle.log_likelihoods(t.tolist(), u.tolist(), d.tolist(), STATES, JN, TAU, 0.3, 10, aperture)
    measurement = Measurement(T, JN, TAU, aperture=aperture, timed=True)
    got = engine(backend, measurement=measurement, window=10).run(u, d, t=t)
    compare(got, rows, oracle.dsd(rows, [[1.0] * 12 for _ in range(12)], 0, STATES), lambda k, s: rows[k][0][s])
    assert (got.delay[60:] == 0.123).all()
    assert (got.inertia[60:] == 2.0).all()


@pytest.mark.parametrize("backend", BACKENDS)
def test_position_aperture_on_a_regular_clock(backend):
    t, u, _ = recording(7)
    z, w = oracle.predictions(t, u.tolist(), 0.05, TAU, 2)
    d = JN / 0.5 * np.array(z) - np.array(w)
    rows = oracle.log_likelihoods(t, u.tolist(), d.tolist(), STATES, JN, TAU, 0.3, 20, 2, warmup=37)
    got = engine(backend, measurement=Measurement(T, JN, TAU, aperture=2), window=20).run(u, d)
    compare(got, rows, oracle.dsd(rows, [[1.0] * 12 for _ in range(12)], 0, STATES), lambda k, s: rows[k][0][s])


@pytest.mark.parametrize("backend", BACKENDS)
def test_large_amplitude_small_noise_does_not_cancel(backend):
    """Amplitude 1e3, noise 1e-3: expanding the square is nats wrong here; the windowed residuals are not."""
    rng = np.random.default_rng(8)
    t, u, _ = recording(8)
    u = u * 1e3
    grid = Grid(delays=(0.05,), inertias=(1.0, 1.0 + 2e-9))
    states = [(0.05, 1.0), (0.05, 1.0 + 2e-9)]
    z, w = oracle.predictions(t, u.tolist(), 0.05, TAU)
    d = JN * np.array(z) - np.array(w) + rng.normal(size=len(u)) * 1e-3
    rows = oracle.log_likelihoods(t, u.tolist(), d.tolist(), states, JN, TAU, 1e-3, 50)
    got = engine(backend, grid, window=50, rho=1e-3).run(u, d)
    for k, row in enumerate(rows):
        if row is not None:
            assert got.log_likelihood[k] == pytest.approx(row[0][got.state[k]], abs=1e-3)


@pytest.mark.parametrize("method", ["viterbi", "smooth"])
@pytest.mark.parametrize("noise", [0.0, 0.5, 3.0])
def test_a_uniform_transition_is_the_matrix_of_equal_entries(method, noise):
    """The one takes the states one by one, the other all pairs of them; ties (no noise, a still u) included."""
    _, u, d = recording(8, n=120, noise=noise)
    u[40:80] = u[40]
    every = Transition(matrix=np.full((len(STATES), len(STATES)), 1.0 / len(STATES)))
    one, other = (engine("numpy", method=method, window=5, transition=a).run(u, d) for a in (Transition(), every))
    for name in ("state", "log_likelihood", "probability", "confident"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name), err_msg=name)
