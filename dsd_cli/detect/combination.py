"""The combination of eq. 12: k(t) = sum_j k_j p_j^N(t), delay and inertia between the candidates."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsd_cli.detect.profile.cells import Estimates, held
from dsd_cli.detect.recursions import Averaged, Decisions
from dsd_cli.detect.settings import DetectorSettings
from dsd_cli.detect.spec import FULL, WARMUP
from dsd_cli.signals.log import Array

#: Share of the weights that two neighbouring candidates must have together: the values between others mean nothing.
NEIGHBOURS = 0.95


class Combined(Averaged):
    """Labels of eq. 7-9; estimates are the mean of the candidates with their likelihoods p^N (eq. 8) as weights.

    `delay_std` and `inertia_std` are the spread of the weights, not a standard error. An estimate is founded
    (`..._confident`) where the window is full, the label explains it to within about 2 rho, the candidates of the axis
    differ by `confidence` nats at least, and two neighbours have 95 % of the weights: eq. 12 is for "monotonic
    relationship" only. Else the last founded one stands.

    Parameters
    ----------
    delays, inertias : of every state, shape (states,).
    """

    def __init__(
        self, settings: DetectorSettings, axes: Array, states: int, floor: float, values: tuple[Array, Array]
    ) -> None:
        super().__init__(settings, axes, states, floor)
        self._floor, self._confidence = floor, settings.confidence
        self._values = [_Axis(column) for column in values]
        self._last = np.full(4, np.nan)

    def feed(self, log_likelihoods: Array, status: NDArray[Any]) -> Decisions:
        """Decide and combine for every row."""
        self._rows: list[Array] = []
        out = super().feed(log_likelihoods, status)
        judged = np.asarray(status) != WARMUP
        means = np.full(log_likelihoods.shape, np.nan)
        if self._rows:
            means[judged] = np.array(self._rows)
        ready = (np.asarray(status) == FULL) & (out.log_likelihood >= self._floor)
        return out._replace(estimates=self._estimates(means, out.state, ready))

    def _mean(self, log_b: Array) -> Array:
        mean = super()._mean(log_b)
        self._rows.append(mean + self._log_a[self._labels[0]])
        return mean

    def _estimates(self, scores: Array, states: NDArray[Any], ready: NDArray[Any]) -> Estimates:
        """From the logs of a p^N of every state, shape (n, states)."""
        columns: list[Array] = []
        flags: list[NDArray[Any]] = []
        for axis, last in zip(self._values, (self._last[:2], self._last[2:]), strict=True):
            weights, lead = axis.weights(scores)
            value = weights @ axis.candidates
            spread = np.sqrt(np.maximum(weights @ axis.candidates**2 - value**2, 0.0))
            pairs = weights if weights.shape[1] == 1 else weights[:, 1:] + weights[:, :-1]
            with np.errstate(invalid="ignore"):
                founded = ready & (pairs.max(axis=1) >= NEIGHBOURS) & (lead >= self._confidence)
            columns += [held(value, founded, last[0]), held(spread, founded, last[1])]
            flags.append(founded)
        if len(states):
            self._last = np.array([column[-1] for column in columns])
        return Estimates(*columns, *flags)  # type: ignore[arg-type]


class _Axis:
    """Candidates of an axis in their order, and which states have them."""

    def __init__(self, values: Array) -> None:
        self.candidates, self._of = np.unique(values, return_inverse=True)

    def weights(self, scores: Array) -> tuple[Array, Array]:
        """(weight of every candidate, shape (n, candidates); by how many nats the best leads the worst, shape (n,))."""
        best = np.column_stack([scores[:, self._of == i].max(axis=1) for i in range(self.candidates.size)])
        with np.errstate(invalid="ignore", under="ignore"):
            p = np.exp(scores - scores.max(axis=1, keepdims=True))
        p = p / p.sum(axis=1, keepdims=True)
        total = np.column_stack([p[:, self._of == i].sum(axis=1) for i in range(self.candidates.size)])
        return total, best.max(axis=1) - best.min(axis=1)
