"""Moves one way: dry friction and a constant load are one column of the balance, and rests alone part them.

    moving    u - J a - other forces = c - f = s      c : level of the friction, f : force of the load, along the way
    at rest   |e + f| <= c,  e = u - J a - other forces    ->    2 c >= s - e

Nothing at rest bounds c from above: beside a load against the way any c from there to s does.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from dsd_cli.effects import Role
from dsd_cli.identify.fit.bank import INERTIA, Bank, Terms, inputs_of
from dsd_cli.identify.fit.estimates import known_to
from dsd_cli.identify.fit.row_weights import still_rows
from dsd_cli.identify.fit.solve import Fit
from dsd_cli.identify.fit.values import Fitted
from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.results import Estimate
from dsd_cli.signals.log import Array
from dsd_cli.signals.passes import mixed

#: The two that are one column.
DRY, LOAD = "coulomb_friction", "constant_load"


@dataclass(frozen=True)
class OneWay:
    """What moves one way leave open between dry friction and a load; unit of u.

    way : 1 or -1. level : of the friction. moving : s, friction and load while the axis moves. least : that the level
    is by the rests, 0 without any. both : whether the set has a load as well.
    """

    way: float
    both: bool
    level: float
    moving: float
    least: float

    @property
    def open(self) -> float:
        """How much of the two a load against the way may be, or one that drives the axis must."""
        return abs(self.moving - self.least)

    def proven(self, least: float) -> list[str]:
        """Those of the two of which rests leave no less than this: what holds the axis, and what drives it on."""
        return [name for name, size in ((DRY, self.least), (LOAD, self.least - self.moving)) if size > least]

    @property
    def error(self) -> float:
        """rms by which a level is off that may be anything from the least to `moving`. Where the least is more it is off
        by that without a load; with one nothing is above it: nan."""
        if self.least >= self.moving:
            return math.nan if self.both else self.open
        most = max(self.moving, self.level)
        off = (most - self.level) ** 3 + (self.level - self.least) ** 3
        return math.sqrt(off / (3.0 * max(most - self.least, 1e-300)))


def one_way(bank: Bank, fit: Fit) -> OneWay | None:
    """Of a set that has dry friction; None where it has none, or rows go either way.

    bank : of rows in the unit of u.
    """
    found, equations = {t.id: float(fit.coefficients(t)[0]) for t in fit.terms if t.id in (DRY, LOAD)}, bank.equations
    signs = equations.acting([s.sign for s in equations.stretches], smooth=False, held=True)[equations.kept]
    ways = [way for way in (1.0, -1.0) if np.any(way * signs > POLICY.least_free)]
    if DRY not in found or len(ways) != 1:
        return None
    moving = found[DRY] - ways[0] * found.get(LOAD, 0.0)
    held = ways[0] * _held(bank, fit)[still_rows(equations)]
    least = max(0.5 * (moving - float(held.min())), 0.0) if held.size else 0.0
    level = moving
    if LOAD in found:  # rows part them by the noise of stops alone
        level = min(max(found[DRY], least), max(moving, least) if least > 0.0 else math.inf)
    return OneWay(ways[0], LOAD in found, level, moving, least)


def _held(bank: Bank, fit: Fit) -> Array:
    """e of each row, shape (N,): what dry friction and a load have to hold there."""
    others = [t for t in fit.terms if t.effect.role is Role.APPLIED and t.id != LOAD]
    columns = [x for t in others for x in bank.columns(t, fit.tap)]
    theta = [float(x) for t in others for x in fit.coefficients(t)]
    u = bank.drive(inputs_of(fit.terms), fit.tap)
    return np.asarray(u - mixed([bank.acceleration, *columns], np.array([fit.total[INERTIA], *theta])))


def as_rests_allow(bank: Bank, fitted: Fitted, beside: Terms) -> Fitted:
    """Values of dry friction and a load with what rests leave open in their errors.

    beside : effects that the log may hold as well.
    """
    found = one_way(bank, fitted.fit)
    if found is None or LOAD not in {t.id for t in (*fitted.fit.terms, *beside)}:
        return fitted
    values = {f"{DRY}.level": found.level, f"{LOAD}.force": found.way * (found.level - found.moving)}
    open_ = {n: e for n, e in fitted.estimates.items() if n in values and not e.held}
    if len(open_) < sum(n in fitted.estimates for n in values):  # one that is known says what the other is
        return fitted
    step = bank.equations.sample_time
    made = {n: _as_open(replace(e, value=values[n]), n, found, step) for n, e in open_.items()}
    model = fitted.model.with_values({n: e.value for n, e in made.items()})
    return replace(fitted, model=model, estimates={**fitted.estimates, **made})


def _as_open(one: Estimate, name: str, found: OneWay, step: float) -> Estimate:
    """That estimate with its error; of a set with both what rows alone make of it is none."""
    error = found.error if found.both else math.hypot(one.std_error, found.error)
    return replace(one, std_error=error, grade="not") if math.isnan(error) else known_to(one, name, error, step)
