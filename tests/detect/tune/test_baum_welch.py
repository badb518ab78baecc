"""The fit of rho and stay: its posterior against the sum over every path, its rounds, and what it finds."""

import itertools

import numpy as np
import pytest

from dsd_cli.detect.tune.baum_welch import fit, posterior


@pytest.mark.parametrize("stay", [0.3, 0.9, 0.999])
def test_the_posterior_is_that_of_every_path(stay):
    """3 states, 7 samples: 2187 paths, each with its probability by the definition of a Markov chain."""
    n, states = 7, 3
    log_b = np.random.default_rng(1).normal(size=(n, states)) * 2.0
    gamma, stays, total = np.zeros((n, states)), 0.0, 0.0
    for path in itertools.product(range(states), repeat=n):
        p = 1.0 / states
        for k, state in enumerate(path):
            if k:
                p *= stay if state == path[k - 1] else (1.0 - stay) / (states - 1)
            p *= np.exp(log_b[k, state])
        total += p
        stays += p * sum(a == b for a, b in itertools.pairwise(path))
        for k, state in enumerate(path):
            gamma[k, state] += p
    got = posterior(log_b, stay)
    np.testing.assert_allclose(got.gamma, gamma / total, rtol=1e-9)
    assert got.stays == pytest.approx(stays / total, rel=1e-9)
    assert got.log_likelihood == pytest.approx(np.log(total), rel=1e-9)


def chain(n, stay, rho, seed):
    """Squared errors of four states whose predictions are sines, one of which is true at each sample."""
    rng = np.random.default_rng(seed)
    state, path = 0, []
    for _ in range(n):
        if rng.random() > stay:
            state = int(rng.choice([s for s in range(4) if s != state]))
        path.append(state)
    predicted = np.column_stack([np.sin(0.05 * np.arange(n) + 1.5 * s) for s in range(4)])
    d = predicted[np.arange(n), path] + rho * rng.standard_normal(n)
    return (d[:, None] - predicted) ** 2, np.array(path)


@pytest.mark.parametrize("seed", range(4))
def test_noise_dwell_time_and_path_are_found(seed):
    squares, path = chain(6000, 0.998, 0.3, seed)
    fitted = fit(squares)
    changes = int((np.diff(path) != 0).sum())
    assert fitted.rho == pytest.approx(0.3, rel=0.03)
    assert (1.0 - fitted.stay) * len(path) == pytest.approx(changes, rel=0.5, abs=3)
    assert np.mean(fitted.posterior.gamma.argmax(axis=1) == path) > 0.99


def test_no_round_makes_the_log_less_likely():
    """What expectation-maximisation promises; the weak prior on `stay` may cost a hair."""
    squares, _ = chain(3000, 0.995, 0.8, 5)
    rounds = np.array(fit(squares).rounds)
    assert len(rounds) > 3
    assert np.diff(rounds).min() > -1e-3
    assert rounds[-1] > rounds[0]


def test_a_log_that_a_state_explains_to_the_last_bit_ends():
    squares = np.zeros((500, 2))
    squares[:, 1] = 1.0
    fitted = fit(squares)
    assert np.isfinite(fitted.rho)
    assert (fitted.posterior.gamma.argmax(axis=1) == 0).all()
