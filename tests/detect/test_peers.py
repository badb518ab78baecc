"""Viterbi and smoothing against hmmlearn, the mode probabilities of eq. 10 against FilterPy: on the same numbers.

The likelihoods that the peers get are those of the oracle's plain loops, not ours.
"""

import numpy as np
import pytest

from dsd_cli.detect import Transition
from tests.detect.test_against_oracle import JN, STATES, TAU, engine, recording
from tests.oracle import detect_oracle as oracle

RHO, INITIAL = 1.2, 4
KINDS = ("sticky", "any")


def matrix(kind):
    """A 12 x 12 transition matrix whose rows sum to one."""
    if kind == "sticky":
        return np.where(np.eye(12) > 0, 0.97, 0.03 / 11)
    a = np.random.default_rng(8).uniform(0.01, 1.0, size=(12, 12)) + 6.0 * np.eye(12)
    return a / a.sum(axis=1, keepdims=True)


@pytest.fixture(scope="module", params=[(kind, seed) for kind in KINDS for seed in (1, 2)], ids=str)
def problem(request):
    """(u, d_hat, A, log likelihoods of the judged samples, which samples these are)."""
    kind, seed = request.param
    t, u, before = recording(seed, noise=1.0)
    _, _, middle = recording(seed, noise=1.0, delay=0.05, inertia=0.5)
    k = np.arange(len(u))
    d = np.where((k > 100) & (k < 170), middle, before)  # the same u: the plant changes twice
    rows = oracle.log_likelihoods(t, u.tolist(), d.tolist(), STATES, JN, TAU, RHO, 1)
    at = [k for k, row in enumerate(rows) if row is not None]
    return u, d, matrix(kind), np.array([rows[k][0] for k in at]), at


def run(method, problem):
    u, d, a, _, at = problem
    labels = engine("numpy", method=method, rho=RHO, initial=INITIAL, transition=Transition(matrix=a)).run(u, d)
    return labels.state[at], labels.probability[at]


def peer(problem):
    """hmmlearn's recursions over the given likelihoods; the first sample comes from the initial state by A."""
    hmm = pytest.importorskip("hmmlearn.base", reason="pip install -e '.[dev]'")
    _, _, a, log_b, _ = problem

    class Given(hmm.BaseHMM):
        def _compute_log_likelihood(self, x):
            return log_b

        def _check(self):
            pass

    model = Given(n_components=12)
    model.startprob_, model.transmat_ = a[INITIAL], a
    return model, np.zeros((len(log_b), 1))


def test_viterbi_is_hmmlearns(problem):
    model, x = peer(problem)
    states, _ = run("viterbi", problem)
    log_probability, path = model.decode(x, algorithm="viterbi")
    assert states.tolist() == path.tolist()
    assert len(set(path.tolist())) > 2
    _, _, a, log_b, _ = problem
    joint = np.log(a[INITIAL, states[0]]) + np.log(a[states[:-1], states[1:]]).sum()
    assert joint + log_b[np.arange(len(states)), states].sum() == pytest.approx(log_probability)


def test_smoothing_is_hmmlearns(problem):
    model, x = peer(problem)
    states, probability = run("smooth", problem)
    posterior = model.predict_proba(x)
    assert states.tolist() == posterior.argmax(axis=1).tolist()
    np.testing.assert_allclose(probability, posterior.max(axis=1), rtol=1e-9)
    assert len(set(states.tolist())) > 2


class Filter:
    """What FilterPy's IMM asks of a filter; its likelihood is that of a state of ours."""

    def __init__(self, log_b):
        self.x, self.P, self.likelihood = np.zeros((1, 1)), np.eye(1), 1.0
        self._b = iter(np.exp(log_b))

    def predict(self, u=None):
        pass

    def update(self, z):
        self.likelihood = next(self._b)


def test_imm_is_filterpys(problem):
    kalman = pytest.importorskip("filterpy.kalman", reason="pip install -e '.[dev]'")
    _, _, a, log_b, _ = problem
    reference = log_b - log_b.max(axis=1, keepdims=True)  # a factor per sample drops out
    states, probability = run("imm", problem)
    initial = np.where(np.arange(12) == INITIAL, 1.0, 0.0)
    imm = kalman.IMMEstimator([Filter(reference[:, j]) for j in range(12)], initial, a)
    found = []
    for _ in range(len(log_b)):
        imm.predict()
        imm.update(np.zeros((1, 1)))
        found.append(imm.mu.copy())
    mu = np.array(found)
    assert states.tolist() == mu.argmax(axis=1).tolist()
    np.testing.assert_allclose(probability, mu.max(axis=1), rtol=1e-6)
