"""Friction by the load, or a gain that droops, where u by the motion is evidence: no law of u gains by what it takes of
u itself.

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
#: Share of u that gears, screws and drives take where they take most: standard deviation, and the most, with which a
#: tenth of u gets through.
_USUAL, _MOST = 0.3, 0.9
#: Golden section steps; turns of several laws, of a true 0.2 three find 0.13. Share of u that counts as nothing.
_STEPS, _TURNS, _NOTHING = 40, 12, 1e-6
#: Coefficients, shape (p,), by what is known.
Values = Callable[[PriorKnowledge], Array]


def is_law_of_u(effect: Effect) -> bool:
    """Whether it takes of u, by one coefficient: a table over channels may have no u in it."""
    force = effect.role in (Role.APPLIED, Role.FRICTION)
    return force and "u" in effect.needs and [p.linear for p in effect.parameters] == [True]


def drives_and_brakes(equations: Equations) -> bool:
    """Whether u does both, each in more rows than count as none: else friction by the load is a share of all forces."""
    ways = np.concatenate([np.sign(s.log["u"]) * s.sign for s in equations.stretches])
    counts = np.count_nonzero(ways > 0.0), np.count_nonzero(ways < 0.0)
    return bool(min(counts) > POLICY.least_unknown * sum(counts))


def laws_of_u(terms: Terms) -> Terms:
    """The members of a set that take of u."""
    return tuple(t for t in terms if is_law_of_u(t.effect))


def at_laws(
    bank: Bank, design: Design, laws: Terms, tap: int, values: Values, known: PriorKnowledge, variance: float
) -> PriorKnowledge:
    """With the coefficients of laws of u held where the error of u is least; where all are alike, as of an axis that u
    drives all the time, at none, or what is known of it. Of several one after the other, beside the others.

    values : coefficients of the set, linear in what is held. variance : of squares, per nat.
    """
    slope = {f"{law.id}.{law.effect.parameters[0].name}": slopes(bank, law, tap) for law in laws}
    held = {**dict.fromkeys(slope, 0.0), **known.fixed}
    floor = {f"{law.id}.{law.effect.parameters[0].name}": law.effect.parameters[0].lower for law in laws}

    def least(name: str) -> float:
        whole = 1.0 / max(float(np.abs(slope[name]).max()), 1e-300)  # takes all of u, in some row
        usual, spread = known.priors.get(name, (0.0, _USUAL * whole))
        fixed = [replace(known, fixed={**held, name: c}) for c in (0.0, whole)]
        own, beside = (mixed(design.rows, np.append(1.0, -values(one))) for one in fixed)
        kept = 1.0 - sum(held[other] * x for other, x in slope.items() if other != name)

        def judged(c: float) -> float:
            errors = (own + c / whole * (beside - own)) / np.maximum(np.abs(kept - c * slope[name]), _NOTHING)
            return float(errors @ errors) + variance * ((c - usual) / spread) ** 2

        low, high = (min(max(end, floor[name], -_MOST * whole), _MOST * whole) for end in known.limits(name))
        # where all are alike, none
        return min((min(max(0.0, low), high), golden_section(judged, low, high, _STEPS)), key=judged)

    free = [name for name in slope if name not in known.fixed]
    for name in free * (1 if len(free) == 1 else _TURNS):
        held[name] = least(name)
    return replace(known, fixed=held)


def grown(bank: Bank, design: Design, terms: Terms, tap: int, weights: Array, starts: Starts = (0,)) -> Array:
    """By how much squares of r grow where they are those of the error of u, shape (segments,); see `shrinks`."""
    if not laws_of_u(terms):
        return np.ones(len(weights))
    left = mixed(design.rows, weights, starts)
    errors = left / shrinks(bank, terms, design.widths, tap, weights, starts)
    return np.add.reduceat(errors**2, starts) / np.maximum(np.add.reduceat(left**2, starts), 1e-300)


def shrinks(bank: Bank, terms: Terms, widths: Sequence[int], tap: int, weights: Array, starts: Starts = (0,)) -> Array:
    """|dr/du| of each row, shape (N,); 1 without a law of u.

    widths : columns of each effect. weights : of the rows of a design, of each segment that begins at `starts`, shape
        (segments, p+1).
    """
    if not (laws := laws_of_u(terms)):
        return np.ones(1)
    at = [1 + FIXED + sum(widths[: terms.index(law)]) for law in laws]
    taken = mixed([slopes(bank, law, tap) for law in laws], weights[:, at] / weights[:, :1], starts)
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
