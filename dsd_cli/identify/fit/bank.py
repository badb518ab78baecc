"""Columns of the balance as rows, each computed once and cached by its effect, shape and delay."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import chain
from typing import Any, NamedTuple

import numpy as np

from dsd_cli.effects import Effect, Role, Shape, get_effect
from dsd_cli.identify.fit.equations import Equations
from dsd_cli.identify.fit.stretches import DelayTap, finite
from dsd_cli.identify.policy import POLICY
from dsd_cli.signals.log import Array


@dataclass(frozen=True)
class Term:
    """An effect with given shape parameters: its coefficients are what a fit solves for."""

    id: str
    items: tuple[tuple[str, Any], ...] = ()

    @classmethod
    def of(cls, effect_id: str, shape: Shape) -> Term:
        """From a mapping."""
        return cls(effect_id, tuple(sorted(shape.items())))

    @property
    def shape(self) -> dict[str, Any]:
        """The shape parameters by name."""
        return dict(self.items)

    @cached_property
    def effect(self) -> Effect:
        """The effect itself."""
        return get_effect(self.id)


#: Effects of one model; those that change the command act in this order.
Terms = tuple[Term, ...]


def inputs_of(terms: Iterable[Term]) -> Terms:
    """The effects that change the command."""
    return tuple(t for t in terms if t.effect.role is Role.INPUT)


def has_friction(terms: Iterable[Term]) -> bool:
    """Whether there is friction among them, which holds the axis at rest."""
    return any(t.effect.role is Role.FRICTION for t in terms)


class Design(NamedTuple):
    """What a fit of some effects at a whole-step delay solves: drive = columns x coefficients.

    rows : the drive, then the columns: acceleration (J), change of the drive over one more step of delay (share of
        that step), then those of the effects; shape (N,) each.
    signed : of the columns, whether the coefficient must not be negative.
    widths : columns of each effect; one on the command has none.
    noise : covariance of what the sensor's noise adds to each column in a row, shape (p, p), unit of u squared.
    """

    rows: list[Array]
    signed: list[bool]
    widths: tuple[int, ...]
    noise: Array


#: Columns before those of the effects.
FIXED = 2
#: Rows of effects that are there for a while, the oldest of which go first: 32 MB a column of each.
_RECENT = 1 << 22
#: Of the coefficients: the inertia's, and the share of a further step of delay.
INERTIA, SHARE = 0, 1


class Bank:
    """Columns of some equations, each made once.

    source : a bank of the same rows in the unit of u, which this one whitens, or white, which it weighs; None: neither.
    variance : of the sensor's noise in a row of the acceleration. It would pull the inertia down (errors in variables).
    around : share of a step of delay at which the drive is exact, and linear beside it, and so are columns of u; None
        mixes two whole steps, which takes up to an eighth of (w step)^2 off the drive.
    delay_step : samples from one whole-step delay ("tap") to the next. hats : of free-form functions (`fit.freeform`).
    slopes : of laws of u (`fit.laws_of_u`).
    """

    def __init__(
        self, equations: Equations, source: Bank | None = None, variance: float = 0.0, around: float | None = None
    ) -> None:
        self.equations, self._source, self.variance, self._around = equations, source, variance, around
        self.delay_step = max(1, int(equations.band.step * POLICY.delay_step_share))
        self._known: dict[Any, list[Array]] = {}
        self.hats: dict[Any, tuple[list[Array], Array]] = {}
        self.slopes: dict[tuple[Term, int], Array] = {}
        self._drives: dict[Any, Array] = {}
        self._last_drive: dict[Any, Array] = {}
        self._last_commands: tuple[Terms | None, list[Array]] = (None, [])
        self._last_parts: dict[tuple[Terms, bool], dict[DelayTap, Array]] = {}
        self._recent: dict[Any, list[Array]] = {}

    def between(self, around: float) -> Bank:
        """The same columns, with the drive exact at a share of a step."""
        found = Bank(self.equations, self._source, self.variance, around)
        found._known, found.acceleration, found._last_parts = self._known, self.acceleration, self._last_parts
        return found

    def weighing(self, row_weight: Array, variance: float) -> Bank:
        """The same white rows, each times its weight; `variance` is then that of the sensor's noise."""
        return Bank(replace(self.equations, row_weight=row_weight), self, variance)

    def _passed(self, rows: Array) -> Array:
        """Rows of the source as they are here."""
        source, weight = self._source, self.equations.row_weight
        if source is None or source._source is None or weight is None:
            return self.equations.whitened(rows)
        return rows * weight

    @property
    def tap_time(self) -> float:
        """s, from one tap to the next."""
        return self.delay_step * self.equations.sample_time

    def design(self, terms: Terms, tap: int, keep: bool = True) -> Design:
        """The equations of these effects at a delay of `tap` steps; `keep` caches new columns."""
        rows, widths = self._rows(terms, tap, keep)
        signed = [s for t, n in zip(terms, widths, strict=True) for s in [not_negative(t, n)] * n]
        return Design(rows, FIXED * [True] + signed, widths, self._noise_of(terms, widths))

    def rows(self, terms: Terms, tap: int, keep: bool = True) -> list[Array]:
        """Those of `design`."""
        return self._rows(terms, tap, keep)[0]

    def _rows(self, terms: Terms, tap: int, keep: bool) -> tuple[list[Array], tuple[int, ...]]:
        """(drive, the columns that stand before effects and those of effects; how many each of these has)."""
        held, at = has_friction(terms), tap + (self._around or 0.0)
        drive, step = self._drive_and_step(inputs_of(terms), tap, keep, held)
        columns = [[] if t.effect.role is Role.INPUT else self.columns(t, at, keep, held) for t in terms]
        return [drive, self.acceleration, step, *chain.from_iterable(columns)], tuple(map(len, columns))

    def _drive_and_step(self, inputs: Terms, tap: int, keep: bool, held: bool) -> tuple[Array, Array]:
        """(drive, its change over one more step of delay): drive - share x change is the drive between steps."""
        if self._around is None:
            drive, later = (self.drive(inputs, n, keep, held) for n in (tap, tap + 1))
            return drive, drive - later
        ends = max(tap + self._around - 0.5, 0.0), tap + self._around + 0.5
        early, late = (self.drive(inputs, n, keep, held) for n in ends)
        step = (early - late) / (ends[1] - ends[0])
        return self.drive(inputs, tap + self._around, keep, held) + self._around * step, step

    @cached_property
    def acceleration(self) -> Array:
        """Rows of the measured acceleration."""
        return self.equations.acceleration() if self._source is None else self._passed(self._source.acceleration)

    def _noise_of(self, terms: Terms, widths: tuple[int, ...]) -> Array:
        """Covariance of the sensor noise in the columns: it enters the acceleration, and through it that of a load. Its
        share in a load's column and the covariance of both are estimated by adding a synthetic realisation."""
        found = np.zeros((FIXED + sum(widths),) * 2)
        found[INERTIA, INERTIA] = self.variance
        at = FIXED
        for term, width in zip(terms, widths, strict=True):
            if term.effect.role is Role.STRUCTURE and self.variance > 0.0:
                own, common = self._noise_of_load(term)
                found[at, at] = own * self.variance
                found[INERTIA, at] = found[at, INERTIA] = common * self.variance
            at += width
        return found

    def _noise_of_load(self, term: Term) -> tuple[float, float]:
        """(variance by noise of a load's column, its covariance with the acceleration), per variance of the latter."""
        if any(s.pushed is not None and s.pushed[0] == term.id for s in self.equations.stretches):
            return 0.0, 0.0  # a force drives it
        if (shares := self._known.get(("noise", term))) is None:
            noisy, quiet = (raw_columns(one, term, 0.0)[0] for one in (self.equations.noisy, self.equations))
            load = [finite(x - y) for x, y in zip(noisy, quiet, strict=True)]
            made = self.equations.whitened(self.equations.acting(load, smooth=True, held=False))
            acceleration = self._noise_acceleration
            shares = [np.array([made @ made, made @ acceleration]) / float(acceleration @ acceleration)]
            self._known["noise", term] = shares
        return float(shares[0][0]), float(shares[0][1])

    @cached_property
    def _noise_acceleration(self) -> Array:
        rows = self.equations.plain([s.sensed.noise * s.clear for s in self.equations.stretches])
        return self.equations.whitened(rows)

    def drive(self, inputs: Terms, tap: float, keep: bool = True, held: bool = False) -> Array:
        """The command after these input effects, `tap` steps late, also between, and what acts in single logs alone;
        `held`: see `Stretch.acting`."""
        key = (inputs, tap, held)
        if (known := self._drives.get(key, self._last_drive.get(key))) is not None:
            return known
        parts = {} if any(s.levels for s in self.equations.stretches) else self.equations.parts(tap * self.tap_time)
        if len(parts) > 1:
            made = np.asarray(sum(weight * self._part(inputs, part, held) for part, weight in parts.items()))
        elif self._source is not None:
            # delays between steps are asked for by one fit alone
            made = self._passed(self._source.drive(inputs, tap, keep and self._around is None, held))
        else:
            made = self.equations.commanded(self._commands(inputs), tap * self.tap_time, held)
            for smooth, taken in of_single_logs(self.equations, tap * self.tap_time):
                made = made - self.equations.acting(taken, smooth, held)
        if keep:
            self._drives[key] = made
        else:
            self._last_drive = {key: made}  # where delays are tried in turn the next one begins with it
        return made

    def command(self, inputs: Terms, tap: float, held: bool = False) -> Array:
        """`drive` without forces of single logs, in the unit of u."""
        if not any(s.levels for s in self.equations.stretches):
            return self.drive(inputs, tap, held=held)
        return self.equations.commanded(self._commands(inputs), tap * self.tap_time, held)

    def _part(self, inputs: Terms, part: DelayTap, held: bool) -> Array:
        """Rows of a part of the command. White ones of the last command stay, for delays between the same samples."""
        if self._source is None:
            return self.equations.part(self._commands(inputs), part, held)
        if (inputs, held) not in self._last_parts:
            self._last_parts.clear()
        parts = self._last_parts.setdefault((inputs, held), {})
        if part not in parts:
            parts[part] = self._passed(self._source._part(inputs, part, held))
        return parts[part]

    def _commands(self, inputs: Terms) -> list[Array]:
        """The last ones stay: the same effects are asked for at several delays."""
        if self._last_commands[0] != inputs:
            self._last_commands = inputs, commands(self.equations, inputs)
        return self._last_commands[1]

    def columns(self, term: Term, tap: float, keep: bool = True, held: bool = False) -> list[Array]:
        """An effect on the plant, a column per coefficient; `tap`: delay of the u that reaches it, steps."""
        key = (term, tap if "u" in term.effect.needs else None, held)
        if (known := self._known.get(key, self._recent.get(key))) is not None:
            return known
        if term.effect.listed and len(term.shape["edges"]) > 1:  # edges are moved one by one
            apart = (Term.of(term.id, {"edges": (event,)}) for event in term.shape["edges"])
            made = [self.columns(e, tap, False, held)[0] for e in apart]
        elif self._source is not None:
            made = [*map(self._passed, self._source.columns(term, tap, keep and self._around is None, held))]
        else:
            made = columns_of(self.equations, term, tap * self.tap_time, held)
        if keep:
            self._known[key] = made
        elif self._source is None:  # searches beside other effects, and of other delays, ask for the same shapes
            self._recent[key] = made
            while len(self._recent) * len(made[0]) > _RECENT:
                del self._recent[next(iter(self._recent))]
        return made


def columns_of(equations: Equations, term: Term, delay: float, held: bool) -> list[Array]:
    """An effect on the plant as rows in the unit of u, a column per coefficient; `held`: see `Stretch.acting`."""
    smooth = term.effect.role is not Role.FRICTION
    return [equations.acting(x, smooth, held) for x in raw_columns(equations, term, delay)]


def not_negative(term: Term, columns: int) -> bool:
    """Whether the one coefficient has 0 as its lower bound."""
    linear = [p for p in term.effect.parameters if p.linear and not p.listed]
    return columns == 1 and len(linear) == 1 and linear[0].lower >= 0.0


def drive(equations: Equations, inputs: Terms, delay: float) -> list[Array]:
    """The command after these input effects, `delay` s late: mean per interval, by stretch."""
    return [s.frame.mean_u(u, delay) for s, u in zip(equations.stretches, commands(equations, inputs), strict=True)]


def commands(equations: Equations, inputs: Terms) -> list[Array]:
    """The command after these input effects, by stretch."""
    found = [s.log["u"] for s in equations.stretches]
    for t in inputs:
        found = [s.frame.changed_command(t.id, t.shape, u) for s, u in zip(equations.stretches, found, strict=True)]
    return found


def raw_columns(equations: Equations, term: Term, delay: float) -> list[list[Array]]:
    """Regressor of each coefficient, mean per interval: [coefficient][stretch]; minus the unit force."""
    late = drive(equations, (), delay) if "u" in term.effect.needs else [s.log["u"] for s in equations.stretches]
    by_stretch = [s.columns(term.effect, term.shape, u) for s, u in zip(equations.stretches, late, strict=True)]
    return [list(map(finite, column)) for column in zip(*by_stretch, strict=True)]


def of_single_logs(equations: Equations, delay: float) -> Iterator[tuple[bool, list[Array]]]:
    """(whether it is smooth, what it takes of the drive: mean per interval, by stretch) of levels of single logs."""
    for name, column in dict.fromkeys((e, c) for s in equations.stretches for e, c, _ in s.levels):
        by = [sum(x for e, c, x in s.levels if (e, c) == (name, column)) for s in equations.stretches]
        raw = raw_columns(equations, Term(name), delay)[column]
        yield get_effect(name).role is not Role.FRICTION, [c * x for c, x in zip(by, raw, strict=True)]
