"""The kernel in NumPy: the readable twin of `_kernel.c`, and what runs where there is no compiler.

`run` works on whole blocks, `step` on one sample; the same operations in the same order, so the same bits.
"""

from __future__ import annotations

from collections.abc import Callable
from math import inf, isfinite
from operator import add, itemgetter, mul
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
        self._others: dict[int, list[list[int]]] = {}
        self._pickers: dict[int, list[Callable[[list[float]], tuple[float, ...]]]] = {}
        self._label = settings.initial
        self.restart()

    def restart(self) -> None:
        """Forget history and window, keep the label."""
        self._prediction = make_prediction(self._spec)
        self._seen = 0  # samples in windows
        self._prefix: Any = np.zeros(self._states)
        self._ring = np.zeros((self._spec.settings.window + 1, self._states))

    # -- one sample ------------------------------------------------------------------------------------------------

    def step(self, u: float, d_hat: float, /) -> tuple[int, float, float, bool]:
        """(state, log likelihood, probability, confident) of the next sample of a regular clock."""
        missing = not (isfinite(u) and isfinite(d_hat))
        y, z, warm = self._prediction.step(u, d_hat)
        if not warm:
            return self._label, np.nan, np.nan, False
        settings = self._spec.settings
        slot = self._seen % settings.window
        distances, costs, below = (self._plain if self._few else self._arrays)(y, z, slot, missing)
        self._turn(slot)
        if missing:
            return self._label, np.nan, np.nan, False
        best = min(costs)
        if costs[self._label] - best > settings.hold:
            self._label = choose(costs if self._few else below, best, self._label, self._axes, settings.hold)
        label = self._label
        weights = np.exp(best - below)
        probability = float(weights[label] / np.add.reduce(weights)) if best < inf else 0.0
        ll = self._constant - self._c * distances[label]
        sure = self._seen >= settings.window and ll >= self._floor
        return label, ll, probability, bool(sure and self._leads_one(distances, label))

    def _plain(self, y: float, z: list[float], slot: int, missing: bool) -> tuple[list[float], list[float], Array]:
        """The squared distances of one sample over its window and the costs of the states, as lists and an array."""
        c, before = self._c, self._prefix
        if not isinstance(before, list):  # `run` was here
            before = before.tolist()
        if missing:
            square = [0.0] * self._states
        else:
            residual = [y - mean * alpha for mean in z for alpha in self._plain_alphas]
            square = list(map(mul, residual, residual))
        self._prefix = prefix = list(map(add, before, square))
        distances = list(map(add, prefix, self._ring[slot + 1].tolist()))
        self._ring[slot] = square
        if self._uniform:
            costs = [distance * c for distance in distances]
        else:
            costs = [a * c - b for a, b in zip(distances, self._log_a[self._label].tolist(), strict=True)]
        return distances, costs, np.array(costs)

    def _arrays(self, y: float, z: list[float], slot: int, missing: bool) -> tuple[list[float], list[float], Array]:
        """`_plain` for many states."""
        square = np.zeros(self._states)
        if not missing:
            np.square(y - (np.array(z)[:, None] * self._alphas).ravel(), out=square)
        self._prefix = self._prefix + square
        dist = self._prefix + self._ring[slot + 1]
        self._ring[slot] = square
        cost = dist * self._c - self._log_a[self._label]
        return dist.tolist(), cost.tolist(), cost

    def _others_of(self, label: int) -> list[list[int]]:
        """Per axis the states that have another value there; kept per label, for all states they would be too many."""
        if label not in self._others:
            self._others[label] = [np.flatnonzero(axis != axis[label]).tolist() for axis in self._axes]
        return self._others[label]

    def _leads_one(self, distances: list[float], label: int) -> bool:
        """`_leads` of one sample."""
        if label not in self._pickers:  # of one item alone itemgetter makes no tuple
            self._pickers[label] = [itemgetter(*others, others[0]) for others in self._others_of(label)]
        nearest = min([min(pick(distances)) for pick in self._pickers[label]], default=inf)
        return (nearest - distances[label]) * self._c >= self._spec.settings.confidence

    def _turn(self, slot: int) -> None:
        """Count the sample; when the block of M is complete, turn it into suffix sums."""
        self._seen += 1
        window = self._spec.settings.window
        if slot == window - 1:
            last_first = self._ring[window - 1 :: -1]
            np.add.accumulate(last_first, out=last_first)
            self._prefix = [0.0] * self._states if self._few else np.zeros(self._states)

    def _choose(self, cost: Array, best: float) -> None:
        self._label = choose(cost, best, self._label, self._axes, self._spec.settings.hold)

    def _leads(self, dist: Array, label: int) -> Any:
        """Whether `label` leads by `confidence` on every axis; dist of shape (..., states)."""
        result: Any = True
        for others in self._others_of(label):
            with np.errstate(invalid="ignore"):
                lead = (dist[..., others].min(axis=-1) - dist[..., label]) * self._c
            result = np.logical_and(result, lead >= self._spec.settings.confidence)
        return result

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
        self._seen += n - 1
        self._turn(slot + n - 1)
        return dist, full

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
            with np.errstate(invalid="ignore", divide="ignore"):
                total = np.exp(best[:count, None] - cost[:count]).sum(axis=1)
                mine = np.exp(best[:count] - cost[np.arange(count), state[begin:end]])
                probability[begin:end] = np.nan_to_num(mine / total, nan=0.0)
            begin = end
        ll[:] = self._constant - self._c * dist[np.arange(rows), state]
        confident[:] = 0
        for label in np.unique(state):
            here = state == label
            confident[here] = self._leads(dist[here], int(label)) & full[here] & (ll[here] >= self._floor)
        ll[missing], probability[missing], confident[missing] = np.nan, np.nan, 0
