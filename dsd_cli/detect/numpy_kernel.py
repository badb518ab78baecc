"""The kernel in NumPy: the readable twin of `_kernel.c`, and what runs where there is no compiler.

`run` works on whole blocks, `step` on one sample; the same operations in the same order, so the same bits.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import reduce
from math import inf, isfinite
from operator import add, itemgetter
from struct import Struct
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsd_cli.detect.choice import choose
from dsd_cli.detect.numpy_prediction import make_prediction
from dsd_cli.detect.spec import FULL, PARTIAL, WARMUP, KernelSpec
from dsd_cli.signals.log import Array

#: Rows decided at once: a change of label makes the rest of its block be looked at again.
BLOCK = 2048
#: Up to so many states plain floats are faster than arrays in `step`.
FEW = 24
#: Nats behind the best state beyond which a state adds nothing to a sum that is at least 1 (exp(-40) is 4e-18).
FAR = 40.0


class NumpyKernel:
    """See `kernel.Kernel`; the window is a two-block sum: prefix of this block of M, suffix of the one before."""

    def __init__(self, spec: KernelSpec) -> None:
        grid, settings = spec.grid, spec.settings
        self._spec = spec
        self._states = len(grid)
        self._alphas = np.asarray(spec.alphas)
        self._few = self._states <= FEW
        self._plain_alphas = self._alphas.tolist()
        self._c = 0.5 / (settings.rho * settings.rho)
        self._constant, self._floor = spec.log_likelihood_constant, spec.log_likelihood_floor
        # a uniform A adds the same to every cost: left out, as in _kernel.c, or what counts as a tie would differ
        uniform, shape = settings.transition.uniform, (self._states, self._states)
        self._log_a = np.broadcast_to(0.0, shape) if uniform else settings.transition.log_matrix(self._states)
        self._uniform = uniform
        self._axes = grid.axis_indices()
        self._others: dict[int, NDArray[Any]] = {}
        self._pickers: dict[int, Callable[[list[float]], tuple[float, ...]]] = {}
        self._row = Struct(f"{self._states}d")  # packs a row of the ring in half the time of an assignment to it
        self._one: Callable[..., tuple[Any, Any]] = self._plain if self._few else self._arrays
        self._least: Callable[[Any], float] = min if self._few else np.min
        self._label = settings.initial
        self.restart()

    def restart(self) -> None:
        """Forget history and window, keep the label."""
        self._prediction = make_prediction(self._spec)
        self._seen = 0  # samples in windows
        self._prefix: Any = np.zeros(self._states)
        self._ring = np.zeros((self._spec.settings.window + 1, self._states))
        self._bytes = self._ring.data.cast("B")

    # -- one sample ------------------------------------------------------------------------------------------------

    def step(self, u: float, d_hat: float, /) -> tuple[int, float, float, bool]:
        """(state, log likelihood, probability, confident) of the next sample of a regular clock."""
        y, z, warm = self._prediction.step(u, d_hat)
        if not warm:
            return self._label, np.nan, np.nan, False
        settings = self._spec.settings
        missing = not (isfinite(u) and isfinite(d_hat))
        slot = self._seen % settings.window
        distances, costs = self._one(y, z, slot, missing)
        self._seen += 1
        if slot == settings.window - 1:
            self._turn()
        label = self._label
        if missing:
            return label, np.nan, np.nan, False
        best = self._least(costs)
        if costs[label] - best > settings.hold:
            self._label = label = choose(costs, best, label, self._axes, settings.hold)
        distance = float(distances[label])
        ll = self._constant - self._c * distance
        sure = self._seen >= settings.window and ll >= self._floor
        sure = sure and (self._nearest(distances, label) - distance) * self._c >= settings.confidence
        return label, ll, self._probability(costs, best, label), bool(sure)

    def _plain(self, y: float, z: list[float], slot: int, missing: bool) -> tuple[list[float], list[float]]:
        """The squared distances of one sample over its window, and the costs of the states."""
        before, row, c = self._prefix, self._row, self._c
        if not isinstance(before, list):  # `run` was here
            before = before.tolist()
        if missing:
            square = [0.0] * self._states
        else:
            square = [(r := y - mean * alpha) * r for mean in z for alpha in self._plain_alphas]
        self._prefix = prefix = list(map(add, before, square))
        distances = list(map(add, prefix, row.unpack_from(self._bytes, row.size * (slot + 1))))
        row.pack_into(self._bytes, row.size * slot, *square)
        if self._uniform:
            return distances, [distance * c for distance in distances]
        log_a = self._log_a[self._label].tolist()
        return distances, [a * c - b for a, b in zip(distances, log_a, strict=True)]

    def _arrays(self, y: float, z: list[float], slot: int, missing: bool) -> tuple[Array, Array]:
        """`_plain` for many states."""
        square = np.zeros(self._states)
        if not missing:
            np.square(y - (np.array(z)[:, None] * self._alphas).ravel(), out=square)
        self._prefix = self._prefix + square
        dist = self._prefix + self._ring[slot + 1]
        self._ring[slot] = square
        return dist, dist * self._c - self._log_a[self._label]

    def _probability(self, costs: Any, best: float, label: int) -> float:
        """How likely `label` is after this sample, given the label before it; by the operations of `run`."""
        if best == inf:
            return 0.0
        limit, mine = best + FAR, costs[label]
        if not self._few:
            weights = np.where(costs <= limit, np.exp(best - costs), 0.0)
            return float(weights[label] / np.add.reduce(weights))
        if mine > limit:
            return 0.0
        near = [best - cost for cost in costs if cost <= limit]
        if len(near) == 1:
            return 1.0
        shares = np.exp(near).tolist()  # math.exp would do, but its last bit may be another than that of `run`
        return shares[near.index(best - mine)] / reduce(add, shares)

    def _others_of(self, label: int) -> NDArray[Any]:
        """The states that have another value than `label` on some axis."""
        if label not in self._others:
            self._others[label] = np.flatnonzero((self._axes != self._axes[:, [label]]).any(axis=0))
        return self._others[label]

    def _nearest(self, distances: Any, label: int) -> float:
        """The smallest distance of these."""
        if not self._few:
            return float(distances[self._others_of(label)].min(initial=inf))
        if label not in self._pickers:
            others = self._others_of(label).tolist()
            # of one item alone itemgetter makes no tuple
            self._pickers[label] = itemgetter(*others, others[0]) if others else lambda _: (inf,)
        return min(self._pickers[label](distances))

    def _turn(self) -> None:
        """A block of M is complete: turn it into suffix sums."""
        last_first = self._ring[self._spec.settings.window - 1 :: -1]
        np.add.accumulate(last_first, out=last_first)
        self._prefix = [0.0] * self._states if self._few else np.zeros(self._states)

    def _choose(self, cost: Array, best: float) -> None:
        self._label = choose(cost, best, self._label, self._axes, self._spec.settings.hold)

    def _leads(self, dist: Array, label: int) -> Any:
        """Whether `label` leads by `confidence` over what differs on any axis; dist of shape (n, states)."""
        with np.errstate(invalid="ignore"):
            lead = dist[:, self._others_of(label)].min(axis=1, initial=inf) - dist[:, label]
            return lead * self._c >= self._spec.settings.confidence

    # -- many samples ----------------------------------------------------------------------------------------------

    def run(self, *buffers: Any) -> None:
        """run(u, d, t, force, budget, sign, matrix, state, ll, probability, confident, model): arrays or None."""
        u, d, t, force, budget, sign, matrix, *out, model = buffers
        begin = 0
        while begin < len(u):
            slot = self._seen % self._spec.settings.window
            end = min(begin + BLOCK, len(u), begin + self._spec.settings.window - slot)
            part = slice(begin, end)
            cut = [None if a is None else a[part] for a in (u, d, t, force, budget, sign)]
            matrix_part, model_part = (None if a is None else a[part] for a in (matrix, model))
            self._run_block(cut, matrix_part, [a[part] for a in out], model_part)
            begin = end

    def _run_block(self, inputs: list[Any], matrix: Array | None, out: list[Array], model: Array | None) -> None:
        """At most one block of the window: rows of warm-up, then rows that enter the window."""
        y, z, warm = self._prediction.run(*inputs)
        state, ll, probability, confident = out
        cold = len(y) - warm
        if model is not None:
            model[:, 0], model[:, 1:] = y, z
            model[:cold, 0] = np.nan
            model[~(np.isfinite(inputs[0]) & np.isfinite(inputs[1])), 0] = np.nan
        state[:cold], ll[:cold], probability[:cold], confident[:cold] = self._label, np.nan, np.nan, WARMUP
        if warm == 0:
            return
        missing = ~(np.isfinite(inputs[0]) & np.isfinite(inputs[1]))[cold:]
        dist, full = self._window(y[cold:], z[cold:], missing)
        if matrix is not None:
            matrix[cold:] = self._constant - self._c * dist
            state[cold:], ll[cold:], probability[cold:] = self._label, np.nan, np.nan
            confident[cold:] = np.where(missing, WARMUP, np.where(full, FULL, PARTIAL))
            return
        part = slice(cold, None)
        self._decide(dist, missing, full, [state[part], ll[part], probability[part], confident[part]])

    def _window(self, y: Array, z: Array, missing: NDArray[Any]) -> tuple[Array, NDArray[Any]]:
        """Windowed squared distances of eq. 15, shape (n, states), and whether the window was full."""
        n, window = len(y), self._spec.settings.window
        with np.errstate(over="ignore"):  # a spike of 1e200 is an infinite distance for a while
            square = np.square(y[:, None] - (z[:, :, None] * self._alphas).reshape(n, -1))
        square[missing] = 0.0
        slot = self._seen % window
        prefix = np.add.accumulate(np.vstack([self._prefix, square]))[1:]
        dist = prefix + self._ring[slot + 1 : slot + n + 1]
        self._ring[slot : slot + n] = square
        self._prefix = prefix[-1]
        full = self._seen + np.arange(1, n + 1) >= window
        self._seen += n
        if slot + n == window:
            self._turn()
        return dist, full

    def _shares(self, cost: Array, best: Array, label: NDArray[Any]) -> Array:
        """`_probability` of many samples."""
        best = best[:, None]
        with np.errstate(invalid="ignore", over="ignore"):
            weights = np.where(cost <= best + FAR, np.exp(best - cost), 0.0)
            # in the order in which `_probability` adds few shares
            total = np.add.accumulate(weights, axis=1)[:, -1] if self._few else np.add.reduce(weights, axis=1)
            return np.nan_to_num(weights[np.arange(len(label)), label] / total, nan=0.0)

    def _decide(self, dist: Array, missing: NDArray[Any], full: NDArray[Any], out: list[Array]) -> None:
        state, ll, probability, confident = out
        begin, rows = 0, len(dist)
        while begin < rows:  # one pass per change of label
            cost = dist[begin:] * self._c - self._log_a[self._label]
            best = cost.min(axis=1)
            with np.errstate(invalid="ignore"):
                lead = cost[:, self._label] - best
            tie = 1e-9 * (1.0 + np.abs(best))
            moves = np.flatnonzero((lead > np.maximum(self._spec.settings.hold, tie)) & ~missing[begin:])
            end = begin + int(moves[0]) + 1 if moves.size else rows
            count = end - begin
            state[begin:end] = self._label
            if moves.size:
                self._choose(cost[count - 1], best[count - 1])
                state[end - 1] = self._label
            probability[begin:end] = self._shares(cost[:count], best[:count], state[begin:end])
            begin = end
        ll[:] = self._constant - self._c * dist[np.arange(rows), state]
        confident[:] = 0
        for label in np.unique(state):
            here = state == label
            confident[here] = self._leads(dist[here], int(label)) & full[here] & (ll[here] >= self._floor)
        ll[missing], probability[missing], confident[missing] = np.nan, np.nan, 0
