"""The verdicts of goodness.py in NumPy: the readable twin of `_goodness.c`, and what runs where there is no compiler.

The sums are of blocks, a sixteenth of the window each; a verdict stands for the next block. Every block is summed
sample by sample, whole windows in pairs of blocks, as in `_goodness.c`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsd_cli.detect.kernel import KernelSpec
from dsd_cli.detect.trust import BLOCKS, Trust
from dsd_cli.signals.log import Array

#: Blocks whose sums are looked at together.
SCALES = (1, 2, 4)
#: Standard deviations of a mean square (of n sums: sqrt(2 / n)) that chance may add, in units of sqrt(1 / n).
CHANCE = 3.0
#: Nats that one free value gains by chance.
CHANCE_GAIN = 0.5
#: Share of a force's square below which it is a sum of the others.
ROUNDING = 1e-9
#: Numbers that one pass may hold in an array.
PASS = 1 << 19


class _Sums(NamedTuple):
    """Sums over the windows that end at n blocks; groups are delays x combinations of effect values.

    y, z : of the blocks, shape (n, BLOCKS) and (n, groups, BLOCKS). yy : (n,). zz, zy, zd, dd, dy : (n, groups), with
    d the slope of z by the delay. xx (n, k, k), xy (n, k), xz, xd (n, k, groups) : of the unknown forces, k may be 0.
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
    xd: Array


class NumpyGoodness:
    """See `goodness.Goodness`.

    Parameters
    ----------
    spec : what the kernel works with.
    window : samples that a label must explain.
    forces : how many unknown forces each sample comes with.
    """

    def __init__(self, spec: KernelSpec, window: int, forces: int) -> None:
        self._spec, self._forces = spec, forces
        self._size = max(window // BLOCKS, 1)
        self._groups = len(spec.grid.delays) * len(spec.grid.combinations)
        self._alphas = np.asarray(spec.alphas, dtype=np.float64)
        self._free = (self._alphas.size > 1, len(spec.grid.delays) > 1)
        self._c = 0.5 / spec.settings.rho**2
        self._wanted = self._layout()
        self.restart()

    def restart(self) -> None:
        """Forget the window."""
        self._left: Array | None = None  # rows of a block that is not whole yet
        self._past: Array | None = None  # the last BLOCKS sums of blocks
        self._before = np.zeros(self._groups)  # z of the sample before
        self._started = False
        self._trust = Trust()

    def unfounded(
        self, model: Array, state: NDArray[np.int32], confident: NDArray[np.bool_], forces: Array | None
    ) -> NDArray[np.bool_]:
        """See `goodness.Goodness`."""
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
        rows = self._rows(model[cold:], judged[cold:], x[cold:])
        blocks, had = self._blocks(rows)
        at = cold + np.flatnonzero(confident[cold:])
        if at.size == 0:
            return wrong
        # a label rests on the blocks that are whole by then; `had` of them were before these samples
        block = (left + at - cold + 1) // self._size + had - BLOCKS
        # runs of samples that share blocks and label share the verdict
        new = np.concatenate([[True], (np.diff(block) != 0) | (np.diff(state[at]) != 0)])
        inverse, block, label = np.cumsum(new) - 1, block[new], state[at][new]
        known = block >= 0
        stands, robust, bad = (np.zeros(block.size, dtype=np.bool_) for _ in range(3))
        if known.any():
            sums = self._sums(blocks, block[known])
            stands[known], robust[known], bad[known] = self._verdicts(sums, label[known])
        if self._forces:
            ends = (left + at - cold + 1) % self._size == 0
            trusted = self._trust.follow(bad[inverse[ends]])[np.cumsum(ends)]
            wrong[at] = ~(stands[inverse] & (trusted | robust[inverse]))
        else:
            wrong[at] = ~stands[inverse]
        return wrong

    # -- sums ------------------------------------------------------------------------------------------------------

    def _rows(self, model: Array, judged: NDArray[np.bool_], x: Array) -> Array:
        """y, z, d, x and 1 of every sample, shape (n, 2 + 2 groups + k); one that is not judged adds nothing."""
        groups = self._groups
        rows = np.empty((len(model), 2 + 2 * groups + self._forces))
        rows[:, : 1 + groups] = model
        slope = rows[:, 1 + groups : 1 + 2 * groups]
        if len(model):
            np.subtract(model[:-1, 1:], model[1:, 1:], out=slope[1:])
            slope[0] = self._before - model[0, 1:]
            self._before = model[-1, 1:].copy()
        rows[:, 1 + 2 * groups : -1] = x
        rows[:, -1] = 1.0
        if not judged.all():
            rows[~judged] = 0.0
        return rows

    def _blocks(self, rows: Array) -> tuple[Array, int]:
        """Sums of blocks, shape (blocks, columns), and how many of them were before these samples."""
        if self._left is not None:
            rows = np.concatenate([self._left, rows])
        whole = len(rows) // self._size
        first, second = self._wanted
        cut, self._left = rows[: whole * self._size], rows[whole * self._size :].copy()
        products = (cut[:, first] * cut[:, second]).reshape(whole, self._size, first.size)
        blocks = np.add.reduce(products, axis=1)
        if self._past is not None:
            blocks = np.concatenate([self._past, blocks])
        self._past = blocks[-BLOCKS:].copy()
        return blocks, len(blocks) - whole

    def _layout(self) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Which two columns of `_rows` are multiplied: y1, z1, yy, zz, zy, zd, dd, dy, xx, xy, xz, xd."""
        groups, k = self._groups, self._forces
        z = 1 + np.arange(groups)
        d, x, y = z + groups, 1 + 2 * groups + np.arange(k), np.zeros(1, dtype=np.intp)
        one = y + 1 + 2 * groups + k
        pairs = [(y, one), (z, one), (y, y), (z, z), (z, y), (z, d), (d, d), (d, y)]
        pairs += [(np.repeat(x, k), np.tile(x, k)), (x, y)]
        pairs += [(np.repeat(x, groups), np.tile(column, k)) for column in (z, d)]
        both = [np.broadcast_arrays(a, b) for a, b in pairs if a.size]
        first, second = (np.concatenate(side) for side in zip(*both, strict=True))
        return first, second

    def _sums(self, blocks: Array, at: NDArray[np.intp]) -> _Sums:
        """The sums over the windows that begin at these blocks, by name."""
        n, groups, k, last = len(at), self._groups, self._forces, len(blocks)
        whole, length = blocks[:, 1 + groups :], 1
        while length < BLOCKS:  # of 2, 4, 8, 16 blocks
            whole = whole[: last - 2 * length + 1] + whole[length : last - length + 1]
            length *= 2
        whole = whole[at]
        linear = np.lib.stride_tricks.sliding_window_view(blocks[:, : 1 + groups], BLOCKS, axis=0)[at]
        zz, zy, zd, dd, dy = (whole[:, 1 + i * groups : 1 + (i + 1) * groups] for i in range(5))
        rest = whole[:, 1 + 5 * groups :]
        xx, xy = rest[:, : k * k].reshape(n, k, k), rest[:, k * k : k * k + k]
        crossed = rest[:, k * k + k :].reshape(n, 2, k, groups)
        columns = (zz, zy, zd, dd, dy, xx, xy, crossed[:, 0], crossed[:, 1])
        return _Sums(linear[:, 0], linear[:, 1:], whole[:, 0], *columns)

    # -- verdicts --------------------------------------------------------------------------------------------------

    def _verdicts(self, sums: _Sums, state: NDArray[np.int64]) -> tuple[NDArray[np.bool_], ...]:
        """At every window, each of shape (n,): whether `state` stands; whether it does so beside unknown forces;
        whether it left more than the noise."""
        need, group = self._spec.settings.confidence, state // self._alphas.size
        # two sums of this size may differ by so many nats for no other reason than rounding
        slack = 1e-15 * (self._size * BLOCKS + 10.0) * sums.yy * self._c
        lead, mine = self._lead(sums, state)
        excess = self._excess(sums, state, np.maximum(mine - slack / self._c, 0.0))
        better = np.maximum(self._gain(sums, state) - slack, 0.0)
        stands = (lead >= need * excess + better - slack) & self._nearest(sums, group, slack)
        if not self._forces:
            return stands, stands, excess > 1.0
        left = _without_forces(sums)
        lead, _ = self._lead(left, state)
        better = np.maximum(better, self._gain(left, state) - slack)
        robust = (lead >= need * excess + better - slack) & self._nearest(left, group, slack)
        return stands, robust, excess > 1.0

    def _lead(self, sums: _Sums, state: NDArray[np.int64]) -> tuple[Array, Array]:
        """Nats by which `state` leads over every other, and its residual sum of squares; both shape (n,)."""
        a, n = self._alphas, len(state)
        distances = sums.yy[:, None, None] - 2.0 * a * sums.zy[:, :, None] + a**2 * sums.zz[:, :, None]
        distances = distances.reshape(n, -1)
        rows = np.arange(n)
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

    def _nearest(self, sums: _Sums, group: NDArray[np.int64], slack: Array) -> NDArray[np.bool_]:
        """Whether no other group explains the window better than `group`, each with its best inertia; shape (n,)."""
        if not self._free[0]:
            return np.ones(len(group), dtype=np.bool_)
        rows = np.arange(len(group))
        with np.errstate(divide="ignore", invalid="ignore"):  # what of yy each explains
            shares = np.where((sums.zz > 0.0) & (sums.zy > 0.0), sums.zy**2 / sums.zz, 0.0)
        own = shares[rows, group].copy()
        shares[rows, group] = 0.0
        return np.asarray((shares.max(axis=1) - own) * self._c <= CHANCE_GAIN + slack)

    def _excess(self, sums: _Sums, state: NDArray[np.int64], mine: Array) -> Array:
        """Variance of the residual's sums over that of white noise of rho, on the worst time scale; 1 or more."""
        rows, group, a = np.arange(len(state)), state // self._alphas.size, self._alphas[state % self._alphas.size]
        residual = sums.y - a[:, None] * sums.z[rows, group]
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


def _without_forces(sums: _Sums) -> _Sums:
    """The products of what is left of y, z and d when any combination of the unknown forces is taken out: Cholesky.

    What rounding leaves of z or d is nothing.
    """
    out = _Sums(*(column.copy() for column in sums))
    xx, xy, xz, xd = out.xx, out.xy, out.xz, out.xd
    for i in range(xy.shape[1]):
        pivot = xx[:, i, i]
        known = pivot > ROUNDING * sums.xx[:, i, i]  # else it is a sum of the forces before it
        inverse = np.divide(1.0, pivot, out=np.zeros_like(pivot), where=known)
        y, scaled = (xy[:, i] * inverse)[:, None], inverse[:, None]
        out.yy[:] -= xy[:, i] ** 2 * inverse
        for product, left, right in (
            (out.zy, xz[:, i], y),
            (out.zz, xz[:, i], xz[:, i] * scaled),
            (out.zd, xz[:, i], xd[:, i] * scaled),
            (out.dd, xd[:, i], xd[:, i] * scaled),
            (out.dy, xd[:, i], y),
        ):
            product[:] -= left * right
        for j in range(i + 1, xy.shape[1]):
            share = xx[:, i, j] * inverse
            xx[:, j, i + 1 :] -= share[:, None] * xx[:, i, i + 1 :]
            xy[:, j] -= share * xy[:, i]
            xz[:, j] -= share[:, None] * xz[:, i]
            xd[:, j] -= share[:, None] * xd[:, i]
    for square, before, products in ((out.zz, sums.zz, (out.zy, out.zd)), (out.dd, sums.dd, (out.dy, out.zd))):
        nothing = ~(square > ROUNDING * before)
        for column in (square, *products):
            column[nothing] = 0.0
    return out._replace(yy=np.maximum(out.yy, 0.0))
