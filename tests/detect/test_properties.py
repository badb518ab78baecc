"""What must hold for any input: chunking, units, the order of states, the two kernels, missing samples, spikes."""

from itertools import pairwise, permutations

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from dsd_cli.detect import DetectorSettings, Engine, Grid, Transition
from dsd_cli.detect.engine import Forces, Measurement
from dsd_cli.detect.kernel import active_backend
from dsd_cli.errors import UsageError

BACKENDS = ["numpy"] + (["compiled"] if active_backend() == "compiled" else [])
FIELDS = ("state", "log_likelihood", "probability", "confident")
GRID = Grid(delays=(0.0, 0.0043, 0.02), inertias=(0.5, 1.0, 2.0, 3.0, 4.0))


def data(seed, n=400, missing=0.0):
    rng = np.random.default_rng(seed)
    u = np.cumsum(rng.normal(size=n)) * rng.choice([0.01, 1.0, 100.0])
    d = np.roll(u, 4) - u + rng.normal(size=n) * 0.3
    for column in (u, d):
        column[rng.uniform(size=n) < missing] = np.nan
    return u, d


def make(backend=None, grid=GRID, timed=False, aperture=1, tau=0.01, jn=1.0, **tuning):
    return Engine(grid, DetectorSettings(**tuning), Measurement(0.001, jn, tau, 1, aperture, timed), backend)


TUNINGS = st.sampled_from(
    [
        {"window": 1},
        {"window": 13},
        {"window": 50, "hold": 2.0},
        {"window": 7, "transition": Transition(stay=0.9)},
        {"window": 5, "transition": Transition(matrix=np.eye(15) + np.eye(15, k=1))},
        {"window": 10, "observer_filter": False},
        {"window": 3, "method": "average", "average": 5},
        {"method": "imm", "rho": 3.0},
    ]
)


def same_bits(a, b):
    for field in FIELDS:
        np.testing.assert_array_equal(getattr(a, field), getattr(b, field), err_msg=field)


@pytest.mark.parametrize("backend", BACKENDS)
@settings(deadline=None, max_examples=25)
@given(
    seed=st.integers(0, 1000),
    tuning=TUNINGS,
    cuts=st.lists(st.integers(0, 400), max_size=6),
    timed=st.booleans(),
    aperture=st.sampled_from([1, 2]),
    missing=st.sampled_from([0.0, 0.05]),
    forced=st.booleans(),
)
def test_any_chunking_gives_the_same_bits(backend, seed, tuning, cuts, timed, aperture, missing, forced):
    u, d = data(seed, missing=missing)
    rng = np.random.default_rng(seed)
    t = np.cumsum(rng.uniform(0.5, 1.5, size=400)) * 1e-3
    sign = np.where(rng.uniform(size=400) < 0.2, np.nan, rng.choice([-1.0, 1.0], size=400))
    forces = Forces(rng.normal(size=(400, 1)), rng.uniform(size=(400, 1)), sign)

    def run(engine, part):
        cut = Forces(*(a[part] for a in forces)) if forced else None
        return engine.run(u[part], d[part], t=t[part], forces=cut)

    whole = run(make(backend, timed=timed, aperture=aperture, **tuning), slice(None))
    engine = make(backend, timed=timed, aperture=aperture, **tuning)
    edges = [0, *sorted(cuts), 400]
    parts = [run(engine, slice(a, b)) for a, b in pairwise(edges)]
    for field in FIELDS:
        joined = np.concatenate([getattr(part, field) for part in parts])
        np.testing.assert_array_equal(joined, getattr(whole, field), err_msg=field)


@pytest.mark.parametrize("backend", BACKENDS)
@settings(deadline=None, max_examples=15)
@given(seed=st.integers(0, 1000), tuning=TUNINGS, missing=st.sampled_from([0.0, 0.05]))
def test_step_by_step_gives_the_same_bits(backend, seed, tuning, missing):
    u, d = data(seed, missing=missing)
    whole = make(backend, **tuning).run(u, d)
    engine = make(backend, **tuning)
    for k in range(len(u)):
        if k == 200:  # in the middle the array form takes over
            same_bits_tail = engine.run(np.column_stack([u, d])[k:])
            for field in FIELDS:
                np.testing.assert_array_equal(getattr(same_bits_tail, field), getattr(whole, field)[k:])
            break
        label = engine.step(float(u[k]), float(d[k]))
        for field in FIELDS:
            np.testing.assert_array_equal(getattr(label, field), getattr(whole, field)[k], err_msg=f"{field} at {k}")
        assert label.delay == whole.delay[k]
        assert label.inertia == whole.inertia[k]


def summed(u, d, tuning, alpha):
    """(S_yy + alpha^2 S_zz) / 2 rho^2 from above, nats, shape (n,): the largest that eq. 15 has summed so far.

    z and w = Q u are means of past u, so neither exceeds the largest |u| so far; y = w + d_hat. The largest window so
    far, not the last: method average has older windows in it.
    """
    detector = DetectorSettings(**tuning)
    z = np.maximum.accumulate(np.abs(np.nan_to_num(u)))
    y = z + np.abs(np.nan_to_num(d))
    window = np.ones(detector.effective_window)
    s_yy, s_zz = (np.maximum.accumulate(np.convolve(a * a, window)[: len(u)]) for a in (y, z))
    return (s_yy + alpha**2 * s_zz) / (2.0 * detector.rho**2)


@pytest.mark.skipif(len(BACKENDS) < 2, reason="no compiled kernel in this build")
@settings(deadline=None, max_examples=40)
@example(seed=263, tuning={"window": 1}, timed=True, aperture=1, missing=0.05)  # 3e-9 nats between two states
@example(seed=270, tuning={"window": 1}, timed=False, aperture=1, missing=0.0)  # the best two, 2e-9 nats apart
@given(
    seed=st.integers(0, 1000),
    tuning=TUNINGS,
    timed=st.booleans(),
    aperture=st.sampled_from([1, 2]),
    missing=st.sampled_from([0.0, 0.05]),
)
def test_numpy_and_compiled_agree_label_by_label(seed, tuning, timed, aperture, missing):
    """Labels are equal; log likelihoods to the rounding of what they are summed from.

    log b is a constant less a distance and passes through 0, where any rounding is large beside the result. Same
    operations in the same order leave one difference: exp, whose last bit is the library's, in the pole of Q. Q carries
    it on for tau / T = 10 samples, and a square doubles it: 20 eps of the summed, and of the constant (order one).
    """
    u, d = data(seed, missing=missing)
    t = np.cumsum(np.random.default_rng(seed).uniform(0.5, 1.5, size=400)) * 1e-3
    a = make("numpy", timed=timed, aperture=aperture, **tuning).run(u, d, t=t)
    b = make("compiled", timed=timed, aperture=aperture, **tuning).run(u, d, t=t)
    np.testing.assert_array_equal(a.state, b.state)
    np.testing.assert_array_equal(a.confident, b.confident)
    np.testing.assert_array_equal(np.isnan(a.log_likelihood), np.isnan(b.log_likelihood))
    error = np.nan_to_num(np.abs(a.log_likelihood - b.log_likelihood))
    size = 1.0 + summed(u, d, tuning, alpha=1.0 / a.inertia)
    np.testing.assert_array_less(error, 20.0 * np.finfo(float).eps * size)
    np.testing.assert_allclose(a.probability, b.probability, atol=1e-6)


@settings(deadline=None, max_examples=25)
@given(seed=st.integers(0, 1000), exponent=st.integers(-20, 20))
def test_labels_do_not_depend_on_the_unit_of_u(seed, exponent):
    """Scaling u, d_hat and rho together (by a power of two: exact) changes nothing but the density's constant."""
    u, d = data(seed)
    scale = 2.0**exponent
    a = make(rho=0.3).run(u, d)
    b = make(rho=0.3 * scale).run(u * scale, d * scale)
    np.testing.assert_array_equal(a.state, b.state)
    np.testing.assert_array_equal(a.confident, b.confident)
    np.testing.assert_allclose(a.log_likelihood, b.log_likelihood + np.log(scale), rtol=1e-12, atol=1e-9)


@settings(deadline=None, max_examples=25)
@given(seed=st.integers(0, 1000), order=st.permutations(range(3)), others=st.permutations(range(5)))
def test_the_order_of_the_candidates_does_not_matter(seed, order, others):
    u, d = data(seed)
    permuted = Grid(tuple(GRID.delays[i] for i in order), tuple(GRID.inertias[i] for i in others))
    a = make(window=20, initial=GRID.index(0.02, 2.0)).run(u, d)
    b = make(grid=permuted, window=20, initial=permuted.index(0.02, 2.0)).run(u, d)
    np.testing.assert_array_equal(a.delay, b.delay)
    np.testing.assert_array_equal(a.inertia, b.inertia)
    np.testing.assert_array_equal(a.confident, b.confident)


@pytest.mark.parametrize("backend", BACKENDS)
def test_without_excitation_the_initial_label_stays_and_is_not_confident(backend):
    u = np.zeros(500)
    labels = make(backend, window=20, initial=7).run(u, u)
    assert (labels.state == 7).all()
    assert not labels.confident.any()
    constant = make(backend, window=20, initial=7).run(u + 1.0, u)  # every delay predicts the same: only J is known
    assert (labels.delay == GRID.axes["delay"][7]).all()
    assert (constant.inertia[100:] == 1.0).all()
    assert not constant.confident.any()


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("bad", [1e9, np.nan, np.inf, 1e200])
def test_a_spike_leaves_no_trace(backend, bad):
    u, d = data(3, n=900)
    clean = make(backend, window=30).run(u, d)
    hit = d.copy()
    hit[300] = bad
    dirty = make(backend, window=30).run(u, hit)
    part = slice(300 + 61, None)
    np.testing.assert_array_equal(dirty.state[part], clean.state[part])
    np.testing.assert_array_equal(dirty.log_likelihood[part], clean.log_likelihood[part])
    assert np.isfinite(bad) or not dirty.confident[300]
    np.testing.assert_array_equal(dirty.state[:300], clean.state[:300])


@pytest.mark.parametrize("backend", BACKENDS)
def test_restart_forgets_the_history_and_keeps_the_label(backend):
    u, d = data(5)
    engine = make(backend, window=30)
    before = engine.run(u, d)
    engine.restart()
    after = engine.run(u, d)
    fresh = make(backend, window=30, initial=int(before.state[-1])).run(u, d)
    same_bits(after, fresh)
    assert (after.state[:16] == before.state[-1]).all()


def test_effect_axes_are_told_apart():
    """A grid over Coulomb levels: the level is found where it is the only thing that differs."""
    rng = np.random.default_rng(0)
    n = 600
    u = np.cumsum(rng.normal(size=n)) * 0.2
    sign = np.where(np.arange(n) // 50 % 2 == 0, 1.0, -1.0)
    grid = Grid((0.0,), (1.0,), {"coulomb_friction.level": (0.0, 0.5, 1.0)})
    budget = np.tile([0.0, 0.5, 1.0], (n, 1))
    raw = np.concatenate([[0.0], -0.5 * sign[1:]])
    d = np.zeros(n)
    for k in range(1, n):
        d[k] = np.exp(-0.1) * d[k - 1] + (1 - np.exp(-0.1)) * raw[k]
    labels = make(grid=grid, window=50, rho=0.05).run(u, d, forces=Forces(np.zeros((n, 3)), budget, sign))
    assert (labels.grid.axes["coulomb_friction.level"][labels.state[200:]] == 0.5).all()
    assert labels.confident[200:].all()


def test_bad_matrices_are_refused():
    for matrix, word in ((np.ones((2, 2)), "2 x 2"), (-np.ones((15, 15)), "negative"), (np.zeros((15, 15)), "row 0")):
        with pytest.raises(UsageError, match=word):
            make(transition=Transition(matrix=matrix))
    with pytest.raises(UsageError, match="whole log"):
        make(method="viterbi").step(0.0, 0.0)
    for delays, inertias in (((), (1.0,)), ((0.1, 0.1), (1.0,)), ((-0.1,), (1.0,)), ((0.1,), (0.0,))):
        with pytest.raises(UsageError, match="candidates"):
            Grid(delays, inertias)
    with pytest.raises(UsageError, match="candidates are"):
        GRID.index(delay=0.7)


@pytest.mark.parametrize("tau", [0.01, 0.05])
def test_a_log_cut_in_motion_gives_no_confident_wrong_label(tau):
    """Q of the observer remembers what was before the cut; nobody who starts here knows it."""
    rng = np.random.default_rng(1)
    n, pole = 6000, np.exp(-0.001 / tau)
    u = 1.0 + np.convolve(rng.normal(size=n + 99), np.ones(100) / 10, "valid")
    d = np.zeros(n)
    for k in range(1, n):  # J = 2, L = 4 samples
        drive = 0.5 * u[max(k - 5, 0)] - u[k - 1]
        d[k] = pole * d[k - 1] + (1.0 - pole) * drive
    d += rng.normal(size=n) * 0.05
    grid = Grid((0.0, 0.004, 0.02), (0.5, 1.0, 2.0, 3.0, 4.0))
    confident = wrong = 0
    for start in range(2000, 4600, 200):
        labels = make(grid=grid, window=50, rho=0.05, tau=tau).run(u[start : start + 1400], d[start : start + 1400])
        sure = labels.confident
        confident += int(sure.sum())
        wrong += int((sure & ((labels.inertia != 2.0) | (labels.delay != 0.004))).sum())
    assert confident > 500
    assert (
        wrong <= 0.005 * confident
    )  # a lead of 3 nats is odds of 20 to 1 against noise, less what the window sees twice


@pytest.mark.parametrize("method", ["dsd", "average", "imm", "viterbi", "smooth", "profile"])
@pytest.mark.parametrize("backend", BACKENDS)
def test_no_method_moves_a_label_without_evidence(backend, method):
    u = np.zeros(300)
    silent = make(backend, window=20, initial=7, method=method).run(u, u)
    assert (silent.state == 7).all()
    assert not silent.confident.any()
    constant = make(backend, window=20, initial=7, method=method).run(u + 1.0, u)
    assert (constant.delay == GRID.axes["delay"][7]).all()


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("order", list(permutations((0.0, 0.9, 1.6))))
def test_the_best_two_tie_whatever_the_order_of_the_states(backend, order):
    """Three inertias whose costs are 0, 0.9 and 1.6 ties apart: the best ties with the second, so the label stays."""
    tie = 1e-9 * (1.0 + 0.5)  # cost (y - alpha z)^2 / 2 rho^2 = 1 / 2 for y = 2, alpha = z = 1
    alphas = (0.5, *(1.0 + part * tie for part in order))
    engine = make(backend, Grid((0.0,), tuple(1.0 / a for a in alphas)), window=1, rho=1.0, tau=0.0, hold=0.1)
    labels = engine.run(np.ones(30), np.ones(30))
    assert (labels.state == 0).all()


@pytest.mark.parametrize("backend", BACKENDS)
def test_hold_keeps_the_delay_while_only_the_inertia_is_known(backend):
    """Constant u and noise: the inertia jumps, nothing speaks for another delay, so with hold = 3 the delay stays."""
    n, initial = 1500, GRID.index(0.0043, 1.0)
    for seed in range(10):
        rng = np.random.default_rng(seed)
        u = 1.0 + 0.02 * rng.normal(size=n)
        d = np.where(np.arange(n) < 700, 1.0, 0.5) - 1.0 + 0.3 * rng.normal(size=n)
        labels = make(backend, window=100, rho=0.3, hold=3.0, initial=initial).run(u, d)
        assert (labels.delay == 0.0043).all()
        assert labels.inertia[650] == 1.0
        assert labels.inertia[900] in (2.0, 3.0)
