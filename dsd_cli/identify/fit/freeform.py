"""What the best free-form function of the channels could reach: how much of the residual is law, and how much noise.

Hats over each channel, and over pairs of them, are fitted together with the model's effects, in the same equations.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from dsd_cli.identify.fit.bank import FIXED, Bank, has_friction
from dsd_cli.identify.fit.bank import drive as delayed
from dsd_cli.identify.fit.basis import APART, Units, basis
from dsd_cli.identify.fit.blocks import Blocks, Grams, grams, losses, solve, total_gram
from dsd_cli.identify.fit.equations import Equations
from dsd_cli.identify.fit.laws_of_u import is_law_of_u, shrinks, slopes
from dsd_cli.identify.fit.solve import Fit
from dsd_cli.identify.fit.stretches import Stretch
from dsd_cli.identify.results import DELAY
from dsd_cli.signals.log import Array
from dsd_cli.signals.passes import mixed

#: Groups of channels whose functions are tried, the simple ones first. The acceleration is excluded: as measured, it
#: contains the unknown force. `GAIN`: u times a function of the other channel, which an inertia that varies shows, too.
GAIN = "gain of u"
SINGLES = (("velocity",), ("position",), ("u",), ("time",))
PAIRS = (
    ("velocity", "position"),
    ("velocity", "time"),
    ("velocity", "u"),
    ("position", "time"),
    (GAIN, "velocity"),
    (GAIN, "position"),
    (GAIN, "time"),
)
HATS, HATS_IN_PAIR, FINE_HATS = 12, 6, 40
#: Hats over time are wider than three held-out blocks, so that a held-out block can be interpolated.
BLOCKS_PER_TIME_HAT = 3
#: Penalty on bends, and on size, as a share of the mean information on a hat.
BENDS, SIZE = 1e-3, 1e-5
#: A function of one channel has so many rows to a hat, and so many hats at least; a rich fit is taken to use this share
#: of the degrees of freedom at most.
ROWS_PER_HAT, FEWEST_HATS, MOST_USED = 15, 4, 0.7
STRENGTHS = (1.0, 30.0, 1e3, 3e4)


@dataclass(frozen=True)
class Freeform:
    """A fit with a free-form function of these channels beside the model.

    losses : held-out sums of squares per block, shape (B,); `without` : the same without the free-form function.
    """

    on: tuple[str, ...]
    losses: Array
    without: Array

    @property
    def gain(self) -> float:
        """By how much the held-out sum of squares falls."""
        return float(self.without.sum() - self.losses.sum())

    @property
    def loss(self) -> float:
        """Held-out sum of squares."""
        return float(self.losses.sum())


@dataclass(frozen=True)
class Piece:
    """Channels of a stretch per interval; `sign` NaN where friction may hold."""

    values: Mapping[str, Array]
    sign: Array


@dataclass(frozen=True)
class FreeformFits:
    """Free-form functions beside a fit.

    Pulses of the fit keep their coefficients, in every fold as in the fit itself. base : what is explained, and the
    columns that explain it; owners : the effect of each of these, or `DELAY`, "" of what is neither's. apart : see
    `basis`. made : hats in the unit of u, by what they are functions of.
    """

    equations: Equations
    blocks: Blocks
    fit: Fit
    base: Sequence[Array]
    owners: Sequence[str]
    pieces: Sequence[Piece]
    apart: float = APART
    made: dict[Any, tuple[list[Array], Array]] = field(default_factory=dict)
    _grams: dict[tuple[tuple[str, ...], bool], Grams] = field(init=False, default_factory=dict)

    def groups(self) -> list[tuple[str, ...]]:
        """Groups whose channels all stretches have, and that vary."""
        values = [p.values for p in self.pieces]
        have = {n for n in values[0] if all(n in v and float(np.ptp(v[n])) > 0.0 for v in values)}
        have = have - {"u"} if self.fit.inverse else have | ({GAIN} if "u" in have else set())
        return [g for g in (*SINGLES, *PAIRS) if set(g) <= have]

    def fit_with(self, on: tuple[str, ...]) -> Freeform:
        """Cross-validated."""
        return Freeform(on, self.without("", on), self.without(""))

    def left_of(self, rmse: float, on: tuple[str, ...]) -> float:
        """What a function leaves of the held-out error of the fit, unit of u.

        The fit has no delay below 0, the base may have one. Where that alone is likelier than the function alone (a u
        that was sampled, not held, is early), the function has what it takes off beside it, else what both take off.
        """
        alone = DELAY if self.without(DELAY, on).sum() < self.without("").sum() else ""
        squares = (self.without(alone, whitened=False), self.without("", on, whitened=False))
        before, left = (float(x.sum()) / max(int(self.equations.kept.sum()), 1) for x in squares)
        return math.sqrt(max(rmse**2 - before + left, left, 0.0))  # of no noise a sum of squares is below 0 by rounding

    def without(self, effect_id: str, on: tuple[str, ...] = (), whitened: bool = True) -> Array:
        """Held-out squares per block, shape (B,), with a function of these channels (none: without any) in the place of
        an effect, or of the delay (`DELAY`); "" : beside all. Not `whitened`: of rows that count, in the unit of u."""
        every = self._found(on, whitened)
        hats = range(len(self.base), every.total.shape[-1])
        found = every.of([*(i for i, owner in enumerate(self.owners) if not owner or owner != effect_id), *hats])
        left = self._left(found, self.columns(on)[1]) if on else [losses(solve(found.fitted), found, self.blocks)]
        return min(left, key=lambda squares: float(squares.sum()))

    def _found(self, on: tuple[str, ...], whitened: bool) -> Grams:
        """Of the base, and of the hats over these channels behind it."""
        if (on, whitened) not in self._grams:
            rows = [*self.base, *(self.columns(on)[0] if on else ())]
            rows = [self.equations.whitened(x) if whitened else x * self.equations.kept for x in rows]
            self._grams[on, whitened] = grams(rows, self.blocks)
        return self._grams[on, whitened]

    def _left(self, found: Grams, penalty: Array) -> Iterator[Array]:
        """Held-out squares per block with the hats that come last, at each strength of the penalty."""
        hats, fixed = len(penalty), found.total.shape[-1] - 1 - len(penalty)
        for strength in STRENGTHS:
            ridge = 1e-9 * np.eye(fixed + hats)
            ridge[fixed:, fixed:] += strength * (BENDS * penalty + SIZE * np.eye(hats))
            yield losses(solve(found.fitted, ridge), found, self.blocks)

    def share_of_u(self, groups: Sequence[tuple[str, ...]]) -> float:
        """Of the squares of u, what the acceleration, the fit's effects and functions of these groups explain of blocks
        that no fit saw; below 0 where they explain nothing. Each log may have an offset of its own, which counts as no
        part of u."""
        first, second, _later, *others = self.base
        u, acceleration = (first, second) if self.fit.inverse else (second, first)
        made = [self.columns(group) for group in groups]
        rows = [u, acceleration, *others, *(x for columns, _ in made for x in columns)]
        kept, logs = self.equations.kept, self.equations.logs_of_rows
        counts = np.maximum(np.bincount(logs, kept), 1.0)
        if len(self.equations.recordings) > 1:
            rows = [x - (np.bincount(logs, x * kept, len(counts)) / counts)[logs] for x in rows]
        found = grams([x * kept for x in rows], self.blocks)
        sizes = np.cumsum([0, *(len(penalty) for _, penalty in made)])
        penalty = np.zeros((sizes[-1], sizes[-1]))
        for (_, own), a, b in zip(made, sizes, sizes[1:], strict=False):
            penalty[a:b, a:b] = own
        return 1.0 - min(float(left.sum()) for left in self._left(found, penalty)) / float(found.total[0, 0])

    def columns(self, on: tuple[str, ...]) -> tuple[list[Array], Array]:
        """Hats as rows in the unit of u, and the penalty on their bends, (c, c)."""
        held, of_u = has_friction(self.fit.terms), not {"u", GAIN}.isdisjoint(on)
        key = (on, held, self.fit.tap if of_u else None, self.apart, self.blocks.count)
        if key not in self.made:
            raw, penalty = self._raw(on)
            every = ([units.column(i) for units in raw] for i in range(raw[0].size))
            self.made[key] = [self.equations.acting(x, smooth=False, held=held) for x in every], penalty
        return self.made[key]

    def _raw(self, on: tuple[str, ...]) -> tuple[list[Units], Array]:
        """c hats per interval of each stretch, and the penalty on their bends, (c, c)."""
        if on == ("time",):
            count = max(self.blocks.count // BLOCKS_PER_TIME_HAT, 3)
            return basis(self.pieces, on, [count], self.apart)
        most = max(self.blocks.rows // ROWS_PER_HAT, FEWEST_HATS)
        if on[0] == GAIN:
            return self._gain(on[1], min(HATS, most))
        if len(on) == 1:
            return basis(self.pieces, on, [min(FINE_HATS if on == ("position",) else HATS, most)], self.apart)
        return basis(self.pieces, on, [min(HATS_IN_PAIR, max(math.isqrt(most), 2))] * len(on), self.apart)

    def _gain(self, channel: str, count: int) -> tuple[list[Units], Array]:
        """u times hats over a channel. Where J varies over the position, J' v^2 / 2 comes with it: v^2 times hats."""
        hats, penalty = basis(self.pieces, (channel,), [count])
        u = [piece.values["u"] for piece in self.pieces]
        if channel != "position" or any("velocity" not in piece.values for piece in self.pieces):
            return [h.times(x) for h, x in zip(hats, u, strict=True)], penalty
        squares = [piece.values["velocity"] ** 2 for piece in self.pieces]
        scale = float(np.std(np.concatenate(u))) / max(float(np.std(np.concatenate(squares))), 1e-300)
        made = [h.times(x).beside(h.times(scale * v)) for h, x, v in zip(hats, u, squares, strict=True)]
        return made, np.asarray(np.kron(np.eye(2), penalty))


def freeform_fits(bank: Bank, equations: Equations, blocks: Blocks, fit: Fit, inertia: float) -> FreeformFits:
    """Free-form functions beside a fit.

    bank : in the unit of u. equations : the same rows with the whitening in which they are judged. inertia : that of
        the forward form.
    """
    drive, acceleration, later, *columns = rows = bank.rows(fit.terms, fit.tap, keep=False)
    taken = shrinks(bank, fit.terms, fit.widths, fit.tap, fit.forward[None]) if fit.inverse else 1.0
    error = mixed(rows, fit.forward) / (fit.forward[0] * taken) if fit.inverse else np.zeros(len(drive))
    target, other = (-drive, acceleration) if fit.inverse else (inertia * acceleration, drive)
    base, owners, at = [other, later], ["", "", DELAY], FIXED
    for term, width in zip(fit.terms, fit.widths, strict=True):
        own = columns[at - FIXED : at - FIXED + width]
        if fit.inverse and is_law_of_u(term.effect):  # at the u that is explained: what is left is then the error of u
            own = [own[0] - slopes(bank, term, fit.tap) * error]
        if term.effect.listed:  # an event that a fold did not see has no coefficient of its own there
            target = target + mixed(own, fit.forward[1 + at : 1 + at + width])
        else:
            base += own
            owners += [term.id] * width
        at += width
    late = delayed(bank.equations, (), fit.tap * bank.tap_time)
    pieces = [piece_of(s, u) for s, u in zip(bank.equations.stretches, late, strict=True)]
    return FreeformFits(equations, blocks, fit, [target, *base], owners, pieces, APART, dict(bank.hats))


def piece_of(stretch: Stretch, u: Array) -> Piece:
    """Channels of a stretch under this u, the delayed drive per interval."""
    values = {"u": u, "time": stretch.frame.times - 0.5 * stretch.frame.intervals}
    for name in ("velocity", "position"):
        if name in stretch.log:
            values[name] = getattr(stretch.mean, name)
    return Piece(values, np.where(stretch.free > 0.0, stretch.sign, np.nan))


def rich_residual(fits: FreeformFits) -> Array:
    """Residual of a fit with functions of every single channel at once; rows in the unit of u."""
    functions = (x for on in fits.groups() if len(on) == 1 for x in fits.columns(on)[0])
    target, columns = fits.base[0], [*fits.base[1:], *functions]
    theta = solve(total_gram([target, *columns])[None], SIZE)[0]
    used = min(len(columns) / max(len(target), 1), MOST_USED)  # degrees of freedom: a fit leaves less than the noise
    return np.asarray((target - mixed(columns, theta)) / math.sqrt(1.0 - used))
