"""The balance of forces beside which a law is learnt: a target, the columns of the model, and weights of the rows.

    u = J a - sum c_k f_k - law + r          inverse: u on the motion; for laws of the motion
    J0 a = g (u + sum c_k f_k + law) + r     forward: a on u; for laws of u, which beside u would explain u by itself

Friction counts as holding at rest for every law alike: else a law with friction would delete the rows that speak
against it.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from dsd_cli.effects import Effect, Role, Shape
from dsd_cli.identify.fit.bank import drive, inputs_of
from dsd_cli.identify.fit.blocks import Blocks
from dsd_cli.identify.fit.direction import held_weight
from dsd_cli.identify.fit.equations import Equations
from dsd_cli.identify.fit.errors import sensor_variance, whitening_of
from dsd_cli.identify.fit.problem import Problem
from dsd_cli.identify.fit.row_weights import uncertain
from dsd_cli.identify.fit.values import coefficients_of
from dsd_cli.identify.results import DELAY
from dsd_cli.plant.forces import Mask
from dsd_cli.signals.log import Array

#: Knots over each of two channels; rows for each knot at least.
IN_PAIR, ROWS_PER_KNOT = 8, 8
#: Of a log, for the coarsest of the tables: with half as many nearly every other law has wrong channels.
LEAST_ROWS = IN_PAIR * ROWS_PER_KNOT
#: Share of a row in which the axis may rest or turn, up to which it is sure, or counts by what is left there.
_SURE, _HARDLY = 0.02, 0.7
#: Share of J by which that of a fit may differ from the given one, to be held there.
_NEAR = 0.5
#: Of the rms of u, that J a has at least for a law of u to be asked.
_ANSWERED = 0.3


@dataclass(frozen=True)
class Balance:
    """Rows in the unit of u, shape (N,) each, and how they are judged.

    delay : steps, also between, at which u acts. u, acceleration, later : drive, measured a, change of the drive over
        one more step; none where the delay is held.
    own : columns of the model's own effects; given : their coefficients in the model; names : effect of each.
    counts, sure : rows that are judged; those in which the direction of the motion is sure, or all where these are few.
    weight : of each row. whitening : as of `Equations`. noise : variance that the sensor leaves in a whitened row of a.
    """

    problem: Problem
    delay: float
    u: Array
    acceleration: Array
    later: tuple[Array, ...]
    own: tuple[Array, ...]
    given: Array
    names: tuple[str, ...]
    counts: Mask
    sure: Mask
    weight: Array
    whitening: tuple[Array, ...]
    noise: float

    @property
    def equations(self) -> Equations:
        """Rows that are not whitened."""
        return self.problem.errors.equations

    @property
    def blocks(self) -> Blocks:
        """Held-out blocks."""
        return self.problem.blocks

    def fitted(self, forward: bool = False) -> tuple[Array, ...]:
        """Columns of what is fitted along: J or the gain of u, the delay unless it is held, the model's own effects."""
        return (self.u if forward else self.acceleration, *self.later, *self.own)

    @property
    def answered(self) -> bool:
        """Whether u makes the axis accelerate enough for its motion to show a law of u: where u is nearly all friction,
        weight or cogging, the acceleration is noise, and any law of u would explain u by itself."""
        # in a crawl cogging makes the inertia of u on the motion large: the smaller of that and the given one counts
        kept, inertia = self.equations.kept, min(self.inertia, self.problem.model.inertia)
        driven = self.u[kept] - held_weight(self.equations, self.u)
        return float(np.sum((inertia * self.acceleration[kept]) ** 2)) > _ANSWERED**2 * float(np.sum(driven**2))

    def taken(self, held: Sequence[int]) -> Array:
        """What the motion and the model's own effects of these numbers (0 : J a) take of u, shape (N,)."""
        values, columns = (self.inertia, *self.given), (self.acceleration, *self.own)
        return sum((values[i] * columns[i] for i in held), np.zeros(len(self.u)))

    def of_rows(self, channel: str) -> Array:
        """A channel at the centres of the rows, shape (N,); NaN where it is not logged."""
        by_stretch = []
        for s, u in zip(self.equations.stretches, self.drive, strict=True):
            known = {"u": u, "time": s.frame.times}
            name = channel.replace("speed", "velocity")
            by_stretch.append(known[channel] if channel in known else getattr(s.middle, name))
        return self.equations.of_rows(by_stretch)

    @cached_property
    def inertia(self) -> float:
        """J where a law has it as well, so that no log distinguishes the two: as given, or as u is on the motion."""
        given = self.problem.model.inertia
        x = stacked(self, self.fitted())
        found = float(np.linalg.lstsq(x.T, self.white(self.u), rcond=1e-12)[0][0])
        return given if abs(found - given) < _NEAR * given or found <= 0.0 else found

    @cached_property
    def drive(self) -> list[Array]:
        """The delayed u per interval, by stretch: what laws of u look at."""
        return drive(self.equations, (), self.delay * self.problem.solver.bank.tap_time)

    @cached_property
    def net_drive(self) -> list[Array]:
        """The same with the forces of the model's own effects added: what accelerates the axis."""
        found, acting = [], [t for t in self.problem.base if t.effect.role is not Role.INPUT]
        for stretch, u in zip(self.equations.stretches, self.drive, strict=True):
            taken = [x for t in acting for x in stretch.columns(t.effect, t.shape, u)]
            found.append(u - sum(c * x for c, x in zip(self.given, taken, strict=True)))
        return found

    def columns(self, effect: Effect, shape: Shape, net: bool = False) -> list[Array]:
        """Rows of what an effect with this shape takes of u, one for each coefficient; minus the unit force.

        net : it looks at what accelerates the axis in the place of u.
        """
        pairs = zip(self.equations.stretches, self.net_drive if net else self.drive, strict=True)
        by_stretch = [s.columns(effect, shape, u) for s, u in pairs]
        smooth = effect.role is not Role.FRICTION
        return [self.equations.acting(list(x), smooth, True) for x in zip(*by_stretch, strict=True)]

    def white(self, rows: Array) -> Array:
        """Rows made white and weighed."""
        return self._white_equations.whitened(rows)

    @cached_property
    def _white_equations(self) -> Equations:
        return replace(self.equations, whitening=self.whitening, row_weight=self.weight)

    def at(self, delay: float) -> Balance:
        """The same with u so many steps late, or as near as a fit of the model may have it."""
        problem = self.problem
        ends = np.array(problem.solver.known.ends(DELAY)) / problem.solver.bank.tap_time
        low, high = np.clip(ends, 0.0, problem.most_tap).tolist()
        moved = balance_of(problem, min(max(delay, low), high))
        return replace(moved, whitening=self.whitening, noise=self.noise, weight=self.weight)

    def without(self, effects: Collection[str]) -> Balance:
        """The same for a model that lacks these effects."""
        model = self.problem.model
        own = {name: values for name, values in model.effects.items() if name not in effects}
        base = tuple(t for t in self.problem.base if t.id not in effects)
        less = balance_of(replace(self.problem, model=replace(model, effects=own), base=base), self.delay)
        return replace(less, whitening=self.whitening, noise=self.noise, weight=self.weight)

    def beside(self, residual: Array) -> Balance:
        """The same, whitened by the noise in what a richer fit leaves, shape (N,), unit of u."""
        found = self.weighed(residual)
        white = self.equations.with_whitening(*whitening_of(self.equations, residual * found.weight))
        return replace(found, whitening=white.whitening, noise=sensor_variance(white))

    def weighed(self, residual: Array) -> Balance:
        """The same, rows that are not sure weighed by the variance of a residual there, shape (N,), against sure ones.

        Not by the root of it, as noise would be: the direction of friction is left there, and would move all that is
        fitted. Where an axis sticks and slips it is a hundred times the noise, in half of each slip.
        """
        hardly = self.counts & ~self.sure
        left, more = (float(np.sum(residual[rows] ** 2)) / max(int(rows.sum()), 1) for rows in (self.sure, hardly))
        return replace(self, weight=np.where(hardly, left / more if more > left else 1.0, self.weight))


def balance_of(problem: Problem, delay: float | None = None) -> Balance:
    """Of a problem, with u late by so many steps (None: as the problem has it); the noise is that beside functions of
    single channels.

    The change of the drive over a step is taken around that delay: a law that is missing moves the delay of the
    problem by several steps, over which the drive is no line.
    """
    bank, model = problem.errors.bank, problem.model
    delay = float(problem.tap) if delay is None else delay
    inputs = inputs_of(problem.base)
    ends = max(delay - 0.5, 0.0), delay + 0.5
    early, late = (bank.drive(inputs, n, keep=False, held=True) for n in ends)
    acting = [t for t in problem.base if t.effect.role is not Role.INPUT]
    columns = [bank.columns(t, delay, held=True) for t in acting]
    _, given = coefficients_of(model, problem.base, bank.tap_time)
    return Balance(
        problem,
        delay,
        bank.drive(inputs, delay, keep=False, held=True),
        bank.acceleration,
        ((early - late) / (ends[1] - ends[0]),),
        tuple(x for by_coefficient in columns for x in by_coefficient),
        given[2:],
        tuple(t.id for t, by in zip(acting, columns, strict=True) for _ in by),
        *_rows(problem.errors.equations),
        problem.equations.whitening,
        sensor_variance(problem.errors.equations.with_whitening(*problem.equations.whitening)),
    )


def _rows(equations: Equations) -> tuple[Mask, Mask, Array]:
    """(rows that are judged, those in which the direction of the motion is sure, weights to begin with)."""
    doubt = uncertain(equations, creeping=False)
    sure, counts = ((doubt <= most) & equations.kept for most in (_SURE, _HARDLY))
    if sure.sum() < LEAST_ROWS:
        sure = counts = equations.kept
    return counts, sure, counts.astype(np.float64)


def stacked(balance: Balance, rows: Sequence[Array]) -> Array:
    """Whitened rows, shape (p, N)."""
    return np.stack([balance.white(x) for x in rows])


def covariance_of(x: Array) -> Array:
    """Of the coefficients of whitened rows of shape (p, N), per variance of a row, shape (p, p)."""
    size = np.maximum(np.linalg.norm(x, axis=1), 1e-150)  # its square is above 0: a row may be 0, as the motion is
    return np.asarray(np.linalg.pinv((x @ x.T) / np.outer(size, size), rcond=1e-12) / np.outer(size, size))
