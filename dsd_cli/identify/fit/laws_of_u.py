"""Friction that grows with the load, where u by the motion is evidence: no law of u gains by what it takes of u itself.

    r = u - c x(u) - J a - ...        dr/du = 1 - c dx/du

r is dr/du times as large as the error of the u that solves the balance. With x = |u| sgn v that leaves (1 - c) of u,
and of its error, where the axis is driven: least squares of r go to c = 1, where nothing is left of u. So c is where
the error of u is least, with the others by least squares of r, and that error is what is judged.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from dsd_cli.effects import Effect, Role
from dsd_cli.identify.fit.bank import FIXED, Bank, Design, Term, Terms, drive
from dsd_cli.identify.fit.equations import Equations
from dsd_cli.identify.fit.priors import PriorKnowledge
from dsd_cli.identify.fit.stretches import finite
from dsd_cli.identify.policy import POLICY
from dsd_cli.signals.golden import golden_section
from dsd_cli.signals.log import Array
from dsd_cli.signals.passes import Starts, mixed

#: Why it is not testable where `drives_and_brakes` is false.
ONE_COLUMN = "u drives the axis all the time, or brakes it: friction by the load is then a share of all other forces"
#: Share of its largest by which u is changed, away from 0, to see what a law of u does.
_STEP = 1e-6
#: Friction by the load of gears and screws: standard deviation, and the most, with which a tenth of u gets through.
_USUAL, _MOST = 0.3, 0.9
#: Golden section steps. Share of u that counts as nothing.
_STEPS, _NOTHING = 40, 1e-6
#: Coefficients, shape (p,), by what is known.
Values = Callable[[PriorKnowledge], Array]


def grows_with_u(effect: Effect) -> bool:
    """Whether it is friction with one coefficient, a share of u: a table over channels may have no u in it."""
    shares = [p.linear and p.unit == "1" for p in effect.parameters]
    return effect.role is Role.FRICTION and "u" in effect.needs and shares == [True]


def drives_and_brakes(equations: Equations) -> bool:
    """Whether u does both, each in more rows than count as none: else friction by the load is a share of all forces."""
    ways = np.concatenate([np.sign(s.log["u"]) * s.sign for s in equations.stretches])
    counts = np.count_nonzero(ways > 0.0), np.count_nonzero(ways < 0.0)
    return bool(min(counts) > POLICY.least_unknown * sum(counts))


def law_of_u(terms: Terms) -> Term | None:
    """The friction of a set that grows with u."""
    return next((t for t in terms if grows_with_u(t.effect)), None)


def at_law(
    bank: Bank, design: Design, law: Term, tap: int, values: Values, known: PriorKnowledge, variance: float
) -> PriorKnowledge:
    """With the coefficient of a law of u held where the error of u is least; where all are alike, as of an axis that u
    drives all the time, at none, or what is known of it.

    values : coefficients of the set, linear in what is held. variance : of squares, per nat.
    """
    if (name := f"{law.id}.{law.effect.parameters[0].name}") in known.fixed:
        return known
    usual, spread = known.priors.get(name, (0.0, _USUAL))
    fixed = [replace(known, fixed={**known.fixed, name: c}) for c in (0.0, 1.0)]
    own, beside = (mixed(design.rows, np.append(1.0, -values(one))) for one in fixed)
    slope = slopes(bank, law, tap)

    def judged(c: float) -> float:
        errors = ((1.0 - c) * own + c * beside) / np.maximum(np.abs(1.0 - c * slope), _NOTHING)
        return float(errors @ errors) + variance * ((c - usual) / spread) ** 2

    low, high = (min(max(end, 0.0), _MOST) for end in known.limits(name))
    found = min((low, golden_section(judged, low, high, _STEPS)), key=judged)  # where all are alike, none
    return replace(known, fixed={**known.fixed, name: found})


def grown(bank: Bank, design: Design, terms: Terms, tap: int, weights: Array, starts: Starts = (0,)) -> Array:
    """By how much squares of r grow where they are those of the error of u, shape (segments,); see `shrinks`."""
    if law_of_u(terms) is None:
        return np.ones(len(weights))
    left = mixed(design.rows, weights, starts)
    errors = left / shrinks(bank, terms, design.widths, tap, weights, starts)
    return np.add.reduceat(errors**2, starts) / np.maximum(np.add.reduceat(left**2, starts), 1e-300)


def shrinks(bank: Bank, terms: Terms, widths: Sequence[int], tap: int, weights: Array, starts: Starts = (0,)) -> Array:
    """|dr/du| of each row, shape (N,); 1 without a law of u.

    widths : columns of each effect. weights : of the rows of a design, of each segment that begins at `starts`, shape
        (segments, p+1).
    """
    if (law := law_of_u(terms)) is None:
        return np.ones(1)
    at = 1 + FIXED + sum(widths[: terms.index(law)])
    taken = mixed([slopes(bank, law, tap)], weights[:, at : at + 1] / weights[:, :1], starts)
    return np.maximum(np.abs(1.0 + taken), _NOTHING)


def slopes(bank: Bank, law: Term, tap: int) -> Array:
    """dx/du in each row, shape (N,): mean over the samples of it that count."""
    if (law, tap) not in bank.slopes:
        made, equations = [], bank.equations
        for s, u in zip(equations.stretches, drive(equations, (), tap * bank.tap_time), strict=True):
            more = u + _STEP * np.where(u < 0.0, -1.0, 1.0) * max(float(np.abs(u).max()), 1e-300)
            (after,), (before,) = (s.columns(law.effect, law.shape, x) for x in (more, u))
            made.append(finite((after - before) / (more - u)))
        sums, count = (equations.acting(x, False, True) for x in (made, [np.ones_like(x) for x in made]))
        mean = np.where(count > _NOTHING, sums / np.maximum(count, _NOTHING), 0.0)
        bank.slopes[law, tap] = np.clip(mean, min(map(np.min, made)), max(map(np.max, made)))  # a low-pass overshoots
    return bank.slopes[law, tap]
