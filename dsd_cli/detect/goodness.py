"""Does the label explain its window, or does it only explain it better than the other candidates?

A lead of so many nats counts every sample as independent evidence of standard deviation rho. What a model lacks (a
friction, a late sensor, an inertia off the grid) lasts for many samples, and a wrong candidate may then lead far. So the
lead of a confident label must hold after three corrections, each nothing where the model is right and rho is the noise:

1. *The noise is what is left.* Of white noise the sums over m samples have the variance m rho^2, for every m. Where the
   residual of the label exceeds that on any time scale, the lead is divided by as much.
2. *No value between or beyond the candidates is much better.* What the best inertia and delay near the label would
   gain (the score test: two values, from the label's own residual) is subtracted from the lead.
3. *No force that the model lacks.* Where the model has effects, their values are never quite right: the lead must also
   stand with a constant, a viscous and a dry force of any size in the model.

The sums are of blocks, a sixteenth of the window each; a verdict stands for the next block.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsd_cli.detect.kernel import KernelSpec
from dsd_cli.signals.log import Array

#: Blocks per window; sums over 1, 2 and 4 of them are looked at.
BLOCKS = 16
SCALES = (1, 2, 4)
#: Standard deviations of a mean square (of n sums: sqrt(2 / n)) that chance may add, in units of sqrt(1 / n).
CHANCE = 3.0
#: Share of a force's square below which it is a sum of the others.
ROUNDING = 1e-9
#: Numbers that one pass may hold in an array.
PASS = 1 << 19


class _Sums(NamedTuple):
    """Sums over the windows that end at n blocks; groups are delays x combinations of effect values.

    y, z : of the blocks, shape (n, BLOCKS) and (n, BLOCKS, groups). yy : (n,). zz, zy, zd, dd, dy : (n, groups), with
    d the slope of z by the delay. xx (n, k, k), xy (n, k), xz (n, k, groups) : of the unknown forces, k may be 0.
    """

    y: Array
    z: Array
    yy: Array
    zz: Array
    zy: Array
    zd: Array
    dd: Array
    dy: Array
    xx: Array
    xy: Array
    xz: Array


class Goodness:
    """Fed with y and z of every sample (`Engine.run`), it says which labels do not explain their window.

    Parameters
    ----------
    spec : what the kernel works with.
    forces : how many unknown forces each sample comes with.
    """

    def __init__(self, spec: KernelSpec, forces: int) -> None:
        self._spec, self._forces = spec, forces
        self._size = max(spec.settings.window // BLOCKS, 1)
        self._groups = len(spec.grid.delays) * len(spec.grid.combinations)
        self._alphas = np.asarray(spec.alphas, dtype=np.float64)
        self._free = (self._alphas.size > 1, len(spec.grid.delays) > 1)
        self._c = 0.5 / spec.settings.rho**2
        self.restart()

    def restart(self) -> None:
        """Forget the window."""
        self._left: Array | None = None  # rows of a block that is not whole yet
        self._past: Array | None = None  # the last BLOCKS sums of blocks
        self._before = np.zeros(self._groups)  # z of the sample before
        self._started = False

    def unfounded(
        self, model: Array, state: NDArray[np.int32], confident: NDArray[np.bool_], forces: Array | None
    ) -> NDArray[np.bool_]:
        """Which confident labels of the next samples do not stand, shape (n,).

        Parameters
        ----------
        model : y and z, shape (n, 1 + groups); y is NaN where nothing is judged.
        forces : what unknown forces would do to y, shape (n, k).
        """
        wrong = np.zeros(state.size, dtype=np.bool_)
        rows = max(PASS // (2 + 7 * self._groups), self._size)
        for begin in range(0, state.size, rows):
            part = slice(begin, begin + rows)
            x = np.zeros((len(model[part]), 0)) if forces is None else forces[part]
            wrong[part] = self._part(model[part], state[part], confident[part], x)
        return wrong

    def _part(
        self, model: Array, state: NDArray[np.int32], confident: NDArray[np.bool_], x: Array
    ) -> NDArray[np.bool_]:
        wrong = np.zeros(state.size, dtype=np.bool_)
        judged = np.isfinite(model[:, 0])
        cold = 0 if self._started else int(judged.argmax()) if judged.any() else len(model)
        self._started |= cold < len(model)
        left = 0 if self._left is None else len(self._left)
        products = self._products(model[cold:], judged[cold:], x[cold:])
        windows, had = self._blocks(products)
        at = cold + np.flatnonzero(confident[cold:])
        if at.size == 0:
            return wrong
        # a label rests on the blocks that are whole by then; `had` of them were before these samples
        block = (left + at - cold + 1) // self._size + had - BLOCKS
        pairs, inverse = np.unique(np.column_stack([block, state[at]]), axis=0, return_inverse=True)
        known = pairs[:, 0] >= 0
        stands = np.zeros(len(pairs), dtype=np.bool_)
        if known.any():
            sums = self._sums(windows[pairs[known, 0]])
            stands[known] = self._stands(sums, pairs[known, 1])
        wrong[at] = ~stands[inverse.ravel()]
        return wrong

    # -- sums ------------------------------------------------------------------------------------------------------

    def _products(self, model: Array, judged: NDArray[np.bool_], x: Array) -> Array:
        """What is summed, shape (n, columns); a sample that is not judged adds nothing."""
        y, z = model[:, 0], model[:, 1:]
        slope = np.vstack([self._before[None, :], z])[: len(z)] - z
        self._before = z[-1].copy() if len(z) else self._before
        columns = [y[:, None], (y * y)[:, None], z, z * z, z * y[:, None], z * slope, slope * slope, slope * y[:, None]]
        columns += [x * x[:, [i]] for i in range(self._forces)]
        columns += [x * y[:, None], *(z * x[:, [i]] for i in range(self._forces))]
        products = np.column_stack(columns)
        products[~judged] = 0.0
        return products

    def _blocks(self, products: Array) -> tuple[Array, int]:
        """Sums of blocks, shape (windows, columns, BLOCKS), and how many blocks there were before these samples."""
        if self._left is not None:
            products = np.concatenate([self._left, products])
        whole = len(products) // self._size
        cut = products[: whole * self._size].reshape(whole, self._size, products.shape[1])
        self._left = products[whole * self._size :].copy()
        past = np.zeros((0, products.shape[1])) if self._past is None else self._past
        blocks = np.concatenate([past, cut.sum(axis=1)])
        self._past = blocks[-BLOCKS:].copy()
        if len(blocks) < BLOCKS:
            return np.zeros((0, products.shape[1], BLOCKS)), len(past)
        return np.lib.stride_tricks.sliding_window_view(blocks, BLOCKS, axis=0), len(past)

    def _sums(self, windows: Array) -> _Sums:
        """The columns by name."""
        n, groups, k = len(windows), self._groups, self._forces
        whole = windows.sum(axis=2)
        y, z = windows[:, 0], windows[:, 2 : 2 + groups].swapaxes(1, 2)
        parts = [whole[:, 2 + i * groups : 2 + (i + 1) * groups] for i in range(1, 6)]
        rest = whole[:, 2 + 6 * groups :]
        xx, xy = rest[:, : k * k].reshape(n, k, k), rest[:, k * k : k * k + k]
        return _Sums(y, z, whole[:, 1], *parts, xx, xy, rest[:, k * k + k :].reshape(n, k, groups))

    # -- verdicts --------------------------------------------------------------------------------------------------

    def _stands(self, sums: _Sums, state: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Whether the lead of `state` at every window, shape (n,), holds after the corrections."""
        need = self._spec.settings.confidence
        # two sums of this size may differ by so many nats for no other reason than rounding
        slack = 1e-15 * (self._size * BLOCKS + 10.0) * sums.yy * self._c
        lead, mine = self._lead(sums.yy, sums.zy, sums.zz, state)
        lead = lead + slack - np.maximum(self._gain(sums, state) - slack, 0.0)
        stands = lead >= need * self._excess(sums, state, np.maximum(mine - slack / self._c, 0.0))
        if self._forces:
            robust, _ = self._lead(*_without_forces(sums), state)
            stands &= robust + slack >= need
        return np.asarray(stands)

    def _lead(self, yy: Array, zy: Array, zz: Array, state: NDArray[np.int64]) -> tuple[Array, Array]:
        """Nats by which `state` leads over every other, and its residual sum of squares; both shape (n,)."""
        a = self._alphas
        distances = yy[:, None, None] - 2.0 * a * zy[:, :, None] + a**2 * zz[:, :, None]
        distances = distances.reshape(len(yy), -1)
        rows = np.arange(len(yy))
        mine = distances[rows, state].copy()
        distances[rows, state] = np.inf
        return (distances.min(axis=1) - mine) * self._c, mine

    def _gain(self, sums: _Sums, state: NDArray[np.int64]) -> Array:
        """Nats that the best inertia and delay near `state` would gain: the score test, shape (n,)."""
        rows, group, a = np.arange(len(state)), state // self._alphas.size, self._alphas[state % self._alphas.size]
        zz, zy, zd, dd, dy = (column[rows, group] for column in sums[3:8])
        along = (zy - a * zz) * self._free[0]  # residual along z: another alpha
        across = (dy - a * zd) * self._free[1]  # and along d: another delay
        with np.errstate(divide="ignore", invalid="ignore"):
            alone = [np.where(s > 0.0, c * c / s, 0.0) for c, s in ((along, zz), (across, dd))]
            if not all(self._free):
                return np.asarray(sum(alone)) * self._c
            det = zz * dd - zd * zd
            both = (dd * along**2 - 2.0 * zd * along * across + zz * across**2) / det
        return np.asarray(np.where(det > ROUNDING * zz * dd, both, alone[0])) * self._c

    def _excess(self, sums: _Sums, state: NDArray[np.int64], mine: Array) -> Array:
        """Variance of the residual's sums over that of white noise of rho, on the worst time scale; 1 or more."""
        rows, group, a = np.arange(len(state)), state // self._alphas.size, self._alphas[state % self._alphas.size]
        residual = sums.y - a[:, None] * sums.z[rows, :, group]
        samples = self._size * BLOCKS
        worst = np.maximum(1.0, _over_chance(mine * 2.0 * self._c / samples, samples))
        for scale in SCALES:
            n = BLOCKS // scale
            summed = residual.reshape(len(state), n, scale).sum(axis=2)
            mean = (summed**2).mean(axis=1) / (scale * self._size)
            worst = np.maximum(worst, _over_chance(mean * 2.0 * self._c, n))
        return worst


def _over_chance(ratio: Array, n: int) -> Array:
    """A mean square of n values, in units of its expectation, less what chance may add."""
    return ratio / (1.0 + CHANCE / np.sqrt(n))


def _without_forces(sums: _Sums) -> tuple[Array, Array, Array]:
    """yy, zy and zz of what is left of y and z when any combination of the unknown forces is taken out."""
    scale = np.sqrt(np.maximum(np.einsum("nkk->nk", sums.xx), 1e-300))
    values, vectors = np.linalg.eigh(sums.xx / (scale[:, :, None] * scale[:, None, :]))
    inverse = np.where(values > ROUNDING, 1.0 / np.maximum(values, ROUNDING), 0.0)
    root = np.swapaxes(vectors, 1, 2) * np.sqrt(inverse)[:, :, None] / scale[:, None, :]  # root' root = xx^-1
    y = (root * sums.xy[:, None, :]).sum(axis=2)
    z = (root[:, :, :, None] * sums.xz[:, None, :, :]).sum(axis=2)
    yy = np.maximum(sums.yy - (y * y).sum(axis=1), 0.0)
    return yy, sums.zy - (z * y[:, :, None]).sum(axis=1), np.maximum(sums.zz - (z * z).sum(axis=1), 0.0)
