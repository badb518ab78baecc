"""The other methods, as recursions over log-likelihoods of shape (samples, states).

`Averaged` is eq. 7-9, `Mixed` the mode probabilities of eq. 10; both are online and carry their state from block to
block. `viterbi` and `smoothed` need the whole log. All work in logs: exp(-s / 2 rho^2) underflows for every state at
once.
"""

from __future__ import annotations

from collections import deque
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from dsd_cli.detect.choice import choose
from dsd_cli.detect.settings import DetectorSettings
from dsd_cli.detect.spec import FULL, WARMUP
from dsd_cli.signals.log import Array


class Decisions(NamedTuple):
    """Per sample: state, log likelihood of that state, its probability, confident; each of shape (n,).

    `estimates` of the method "combination", () elsewhere.
    """

    state: NDArray[Any]
    log_likelihood: Array
    probability: Array
    confident: NDArray[Any]
    estimates: Any = ()


class Recursion(Protocol):
    """An online method."""

    def feed(self, log_likelihoods: Array, status: NDArray[Any]) -> Decisions: ...

    def restart(self) -> None: ...


class _Choice:
    """Eq. 9 / 19 on any score: the last label stays on a tie and unless another leads by more than `hold`."""

    def __init__(self, settings: DetectorSettings, axes: Array, floor: float) -> None:
        self._settings = settings
        self._floor = floor
        self._axes = axes
        self.label = settings.initial

    def choose(self, score: Array) -> int:
        with np.errstate(invalid="ignore"):
            self.label = choose(-score, -score.max(), self.label, self._axes, self._settings.hold)
        return self.label

    def sure(self, evidence: Array, label: int, log_likelihood: float) -> bool:
        """Whether `label` explains the data, and leads by `confidence` nats over all with another value on an axis."""
        if not log_likelihood >= self._floor:
            return False
        for axis in self._axes:
            other = evidence[axis != axis[label]].max()
            if not evidence[label] - other >= self._settings.confidence:
                return False
        return True


def _normalised(score: Array) -> Array:
    best = score.max()
    if not np.isfinite(best):
        return np.zeros_like(score)
    weights = np.exp(score - best)
    return weights / weights.sum()


def _empty(n: int) -> Decisions:
    return Decisions(np.zeros(n, dtype=np.int32), np.full(n, np.nan), np.full(n, np.nan), np.zeros(n, dtype=bool))


class Averaged:
    """p_i^N(t) = a_{D(t-N) i} * mean of b_i over the last N samples (eq. 8), label = argmax (eq. 9)."""

    def __init__(self, settings: DetectorSettings, axes: Array, states: int, floor: float) -> None:
        self._n = settings.average
        self._log_a = settings.transition.log_matrix(states)
        self._choice = _Choice(settings, axes, floor)
        self._states = states
        self.restart()

    def restart(self) -> None:
        """Forget the likelihoods, keep the label."""
        self._seen = 0
        self._labels = deque([self._choice.label] * self._n, maxlen=self._n)
        self._prefix = np.full(self._states, -np.inf)
        self._ring = np.full((self._n + 1, self._states), -np.inf)

    def _mean(self, log_b: Array) -> Array:
        """log of the mean of b over the last N samples; two-block sums, as in the kernel."""
        slot = self._seen % self._n
        self._prefix = np.logaddexp(self._prefix, log_b)
        total = np.logaddexp(self._prefix, self._ring[slot + 1])
        self._ring[slot] = log_b
        self._seen += 1
        if slot == self._n - 1:
            self._ring[: self._n] = np.logaddexp.accumulate(self._ring[: self._n][::-1])[::-1]
            self._prefix = np.full(self._states, -np.inf)
        return total - np.log(min(self._seen, self._n))

    def feed(self, log_likelihoods: Array, status: NDArray[Any]) -> Decisions:
        """Decide for every row; `status` (WARMUP, PARTIAL, FULL) says what a row rests on."""
        out = _empty(len(status))
        for i, (log_b, rests_on) in enumerate(zip(log_likelihoods, status, strict=True)):
            out.state[i] = self._choice.label
            if rests_on == WARMUP:
                continue
            mean = self._mean(log_b)
            score = self._log_a[self._labels[0]] + mean
            label = self._choice.choose(score)
            self._labels.append(label)
            out.state[i], out.log_likelihood[i] = label, mean[label]
            out.probability[i] = _normalised(score)[label]
            ready = rests_on == FULL and self._seen >= self._n
            out.confident[i] = ready and self._choice.sure(mean, label, mean[label])
        return out


class Mixed:
    """mu_j(t) = b_j(t)/c * sum_i a_ij mu_i(t-1) (eq. 10), label = argmax."""

    def __init__(self, settings: DetectorSettings, axes: Array, states: int, floor: float) -> None:
        self._uniform = settings.transition.uniform
        self._log_a = settings.transition.log_matrix(states)
        self._choice = _Choice(settings, axes, floor)
        self.restart()

    def restart(self) -> None:
        """Start again from the transition out of the last label."""
        self._prior = self._log_a[self._choice.label]

    def feed(self, log_likelihoods: Array, status: NDArray[Any]) -> Decisions:
        """Decide for every row."""
        out = _empty(len(status))
        for i, (log_b, rests_on) in enumerate(zip(log_likelihoods, status, strict=True)):
            out.state[i] = self._choice.label
            if rests_on == WARMUP:
                continue
            log_mu = self._prior + log_b
            log_mu = log_mu - np.logaddexp.reduce(log_mu)
            label = self._choice.choose(log_mu)
            out.state[i], out.log_likelihood[i] = label, log_b[label]
            out.probability[i] = np.exp(log_mu[label])
            out.confident[i] = rests_on == FULL and self._choice.sure(log_mu, label, log_b[label])
            if not self._uniform:  # else the prior is the same whatever mu was, as mu sums to one
                self._prior = np.logaddexp.reduce(log_mu[:, None] + self._log_a, axis=0)
        return out


def _forward_backward(log_b: Array, log_a: Array, first: Array, uniform: bool) -> Array:
    """log of the posterior of every state at every sample, shape (n, states)."""
    forward = np.empty_like(log_b)
    prior = first
    for i, row in enumerate(log_b):
        joint = prior + row
        forward[i] = joint - np.logaddexp.reduce(joint)
        if uniform:  # all columns are alike: one sum is all of them
            prior = np.logaddexp.reduce(forward[i] + log_a[0])
        else:
            prior = np.logaddexp.reduce(forward[i][:, None] + log_a, axis=0)
    backward = np.zeros(log_b.shape[1])
    for i in range(len(log_b) - 2, -1, -1) if not uniform else ():  # what comes after tells a uniform A nothing
        backward = np.logaddexp.reduce(log_a + (log_b[i + 1] + backward), axis=1)
        backward -= backward.max()
        forward[i] += backward
    return forward - np.logaddexp.reduce(forward, axis=1, keepdims=True)


def _best_path(log_b: Array, log_a: Array, first: Array, choice: _Choice, uniform: bool) -> NDArray[Any]:
    """The most likely sequence of states (Viterbi), shape (n,); on a tie it stays, and ends as near as it began."""
    n, states = log_b.shape
    back = np.zeros((n, states), dtype=np.int32)
    score = first + log_b[0]
    columns = np.arange(states)
    for i in range(1, n):
        tie = 1e-9 * (1.0 + abs(score.max()))
        if uniform:
            back[i], best = _best_or_stay(score + log_a[0], tie)
        else:
            joint = score[:, None] + log_a
            back[i] = (joint + tie * np.eye(states)).argmax(axis=0)
            best = joint[back[i], columns]
        score = best + log_b[i]
    path = np.zeros(n, dtype=np.int32)
    path[-1] = choice.choose(score)
    for i in range(n - 1, 0, -1):
        path[i - 1] = back[i, path[i]]
    return path


def _best_or_stay(joint: Array, tie: float) -> tuple[NDArray[Any], Array]:
    """Where each state comes from if every change is as likely, and the score: the best one, itself on a tie."""
    best = int(joint.argmax())
    own = np.arange(joint.size)
    stays = joint + tie
    back = np.where(stays > joint[best], own, np.where(stays == joint[best], np.minimum(own, best), best))
    return back, joint[back]


def whole_log(
    settings: DetectorSettings, axes: Array, floor: float, log_likelihoods: Array, status: NDArray[Any]
) -> Decisions:
    """`viterbi` or `smooth` over a whole log; both report the posterior of forward-backward as probability."""
    out = _empty(len(status))
    out.state[:] = settings.initial
    use = status != WARMUP
    if not use.any():
        return out
    log_b = log_likelihoods[use]
    log_a = settings.transition.log_matrix(log_b.shape[1])
    first, uniform = log_a[settings.initial], settings.transition.uniform
    posterior = _forward_backward(log_b, log_a, first, uniform)
    choice = _Choice(settings, axes, floor)
    if settings.method == "viterbi":
        states = _best_path(log_b, log_a, first, choice, uniform)
    else:
        states = np.array([choice.choose(row) for row in posterior], dtype=np.int32)
    rows = np.flatnonzero(use)
    out.state[rows] = states
    out.log_likelihood[rows] = log_b[np.arange(len(rows)), states]
    out.probability[rows] = np.exp(posterior[np.arange(len(rows)), states])
    full = status[use] == FULL
    out.confident[rows] = [
        bool(f) and choice.sure(row, state, b[state])
        for f, row, state, b in zip(full, posterior, states, log_b, strict=True)
    ]
    # rows without evidence (holes) carry the label of the row before
    last = np.maximum.accumulate(np.where(use, np.arange(len(use)), -1))
    out.state[last >= 0] = out.state[last[last >= 0]]
    return out
