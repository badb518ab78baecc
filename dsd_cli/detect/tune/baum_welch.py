"""Expectation-maximisation of a hidden Markov model whose states predict and whose noise is one: rho and `stay`.

Baum-Welch (Rabiner, 1989) with the emissions of eq. 5 and a sticky A: stays with probability p, changes to each of the
other states alike. Per sample the posterior gamma (forward-backward) and the expected number of stays; then

    rho^2 = sum gamma_i(t) e_i(t)^2 / n,     p = (expected stays + 1) / (n - 1 + 2)

The ones are a weak prior: without a single change in the log p would be 1, and no change could ever be found.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from dsd_cli.errors import DataError
from dsd_cli.signals.log import Array

#: Rounds at most, and the relative change of rho and of 1 - p that ends them.
ROUNDS, CLOSE = 25, 1e-3
#: Least rho, of the largest error of a state: where one explains a log to the last bit, what is left is rounding.
ROUNDING = 1e-12


class Posterior(NamedTuple):
    """Of one pass: gamma, shape (n, states); expected stays (of n - 1); log likelihood of all samples."""

    gamma: Array
    stays: float
    log_likelihood: float


class Fitted(NamedTuple):
    """rho (unit of u), probability of staying, the posterior under them, and the log likelihood of every round."""

    rho: float
    stay: float
    posterior: Posterior
    rounds: tuple[float, ...]


def posterior(log_b: Array, stay: float) -> Posterior:
    """Forward-backward for a sticky A, O(n states), from any first state alike."""
    n, states = log_b.shape
    move = (1.0 - stay) / (states - 1)
    best = log_b.max(axis=1)
    b = np.exp(log_b - best[:, None])
    forward, scale = np.empty_like(b), np.empty(n)
    prior = np.full(states, 1.0 / states)
    for t in range(n):
        joint = prior * b[t]
        scale[t] = joint.sum()
        forward[t] = joint / scale[t]
        prior = move + (stay - move) * forward[t]
    backward = np.empty_like(b)
    last = backward[-1] = np.ones(states)
    for t in range(n - 1, 0, -1):
        weighted = b[t] * last / scale[t]
        last = backward[t - 1] = move * weighted.sum() + (stay - move) * weighted
    gamma = forward * backward
    gamma /= gamma.sum(axis=1, keepdims=True)
    stays = (forward[:-1] * stay * b[1:] * backward[1:] / scale[1:, None]).sum()
    return Posterior(gamma, float(stays), float(np.log(scale).sum() + best.sum()))


def fit(squares: Array) -> Fitted:
    """rho and stay from the squared errors of every state, shape (n, states).

    Raises
    ------
    DataError : no sample distinguishes the states.
    """
    n = len(squares)
    least, most = squares.min(axis=1), squares.max(axis=1)
    if (least == most).all():
        raise DataError("the candidates predict the same in every sample", "tune on a log in which u moves the axis")
    floor = ROUNDING * float(np.sqrt(most.max()))
    # 0.455: median of chi^2 with 1 degree. Where the axis rests for most of the log, without any noise, the rms begins
    rho = max(float(np.sqrt(np.median(least) / 0.455) or np.sqrt(least.mean())), floor)
    stay, rounds = 1.0 - 1.0 / max(50.0, 0.05 * n), []  # type: tuple[float, list[float]]
    for _ in range(ROUNDS):
        found = posterior(_log_b(squares, rho), stay)
        rounds.append(found.log_likelihood)
        new_rho = max(float(np.sqrt((found.gamma * squares).sum() / n)), floor)
        new_stay = (found.stays + 1.0) / (n + 1.0)
        done = abs(new_rho - rho) < CLOSE * rho and abs(new_stay - stay) < CLOSE * (1.0 - stay)
        rho, stay = new_rho, new_stay
        if done:
            break
    return Fitted(rho, stay, posterior(_log_b(squares, rho), stay), tuple(rounds))


def _log_b(squares: Array, rho: float) -> Array:
    return np.asarray(-0.5 * squares / rho**2 - np.log(rho) - 0.5 * np.log(2.0 * np.pi))
