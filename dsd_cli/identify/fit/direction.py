"""The form of a balance of forces: the motion on u (forward) or u on the motion (inverse), and its whole-step delay;
and what is left of friction where all motion has one direction.

Of moves one way dry friction and a constant load are one column, and rests alone part them:

    moving    u - J a - other forces = c - f = s      c : level of the friction, f : force of the load, along the way
    at rest   |e + f| <= c,  e = u - J a - other forces    ->    2 c >= s - e

Nothing at rest bounds c from above: beside a load against the way any c from there to s does.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from dsd_cli.effects import Role, catalogue, get_effect
from dsd_cli.identify.fit.bank import INERTIA, Bank, Terms, inputs_of
from dsd_cli.identify.fit.blocks import total_gram, without_noise
from dsd_cli.identify.fit.equations import Equations
from dsd_cli.identify.fit.laws_of_u import ONE_COLUMN, drives_and_brakes, is_law_of_u
from dsd_cli.identify.fit.priors import known_to
from dsd_cli.identify.fit.row_weights import shared_inflation, still_rows
from dsd_cli.identify.fit.solve import Fit, Solver
from dsd_cli.identify.fit.values import Fitted, whole_inertia
from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.results import Estimate
from dsd_cli.signals.log import Array
from dsd_cli.signals.passes import mixed

#: Why an effect cannot be told in the inverse form.
NEEDS_ACCELERATION = "u is judged by the motion here (J a is little of it, or it is noisy), which shows little of this"


def inverse_is_evidence(solver: Solver, beside: Terms, inertia: float, tap: int) -> bool:
    """Whether J a, without the sensor's noise, is too small a part of u (`POLICY.fair_part`) to be evidence.

    J is that of the log beside functions of the motion, as far as it is to be believed (`POLICY.believed_inertia`): a
    controller that follows the motion leaves any inertia open, down to none at all.

    solver : on rows in the unit of u. beside : all effects that are functions of the motion without a shape, whether
        asked for or not. inertia, tap : those of the model.
    """
    one = Solver(solver.bank, solver.blocks, solver.inertia, solver.known, inverse=True)
    fitted = whole_inertia(one.fit(beside, tap))
    return drowns(moved_by(solver.bank, tap), fitted, inertia) and tells_by_motion(solver.bank, tap, inertia)


def tells_by_motion(bank: Bank, tap: int, inertia: float) -> bool:
    """Whether u is more than one level a direction, by a fair part of J a.

    bank : of rows in the unit of u.
    """
    signs, u = [s.sign for s in bank.equations.stretches], bank.drive((), tap, held=True)
    both = (signs, [np.ones_like(sign) for sign in signs])
    levels = np.stack([bank.equations.acting(x, smooth=False, held=True) for x in both], axis=1)
    left = u - levels @ np.linalg.lstsq(levels, u, rcond=None)[0]
    return bool(left @ left > (POLICY.fair_part * inertia) ** 2 * moved_by(bank, tap)[0])


def moved_by(bank: Bank, tap: int) -> Array:
    """Squares of a, without the sensor's noise, and of u beside a weight that it holds, in the rows, shape (2,)."""
    design = bank.design((), tap)
    gram = without_noise(total_gram(design.rows), design.noise, len(design.rows[0]))
    u = design.rows[0]
    return np.array([gram[1 + INERTIA, 1 + INERTIA], np.sum((u - held_weight(bank.equations, u)) ** 2)])


def held_weight(equations: Equations, u: Array) -> float:
    """What u, rows of shape (N,), has in both directions alike: a weight, which hides no acceleration, however large.
    Of a motion in one direction dry friction is as constant, and a law of u would explain u by itself: 0."""
    signs = equations.acting([s.sign for s in equations.stretches], smooth=False, held=True)
    ways = [u[equations.kept & (way * signs > 0.0)] for way in (1.0, -1.0)]
    return 0.5 * sum(float(x.mean()) for x in ways) if all(map(len, ways)) else 0.0


def drowns(moved: Array, fitted: float, inertia: float) -> bool:
    """Whether J a is too small a part of u, with the J that was fitted as far as it is to be believed.

    moved : squares of a and u, shape (2,). inertia : of the model.
    """
    likely = min(max(fitted, inertia / POLICY.believed_inertia), inertia * POLICY.believed_inertia)
    return bool(likely**2 * moved[0] < POLICY.fair_part**2 * moved[1])


def needs_acceleration(effect_id: str) -> bool:
    """Whether the forward form alone identifies an effect: one on u, of time, a mass, or of u but no law of it."""
    effect = get_effect(effect_id)
    of_u = "u" in effect.needs and not is_law_of_u(effect)
    return effect.role in (Role.INPUT, Role.STRUCTURE) or of_u or effect.of_time


def shown_by_no_motion(candidates: Sequence[str], equations: Equations) -> dict[str, str]:
    """Candidate -> why the inverse form does not identify it."""
    found = {name: NEEDS_ACCELERATION for name in candidates if needs_acceleration(name)}
    if not drives_and_brakes(equations):
        of_u = (name for name in candidates if is_law_of_u(get_effect(name)))
        found |= {name: ONE_COLUMN for name in of_u if get_effect(name).role is Role.FRICTION}
    return found


#: Delays that are tried first, and coarse steps to either side of a delay that is about right.
_COARSE, _AROUND = 40, 2


def best_delay(solver: Solver, terms: Terms, most_tap: int, near: int | None = None, *, believed: float = 0.0) -> int:
    """The likeliest whole-step delay, found from coarse to fine: N/2 ln SSE, a nat for each `POLICY.least_delay_range`
    from the believed one, and a far delay only for what it gains beyond chance.

    near : the best delay of nearly the same rows; all are tried only where the best one is not around it.
    believed : s.
    """
    allowed = solver.taps(most_tap)
    first, last, known = allowed[0], allowed[-1], dict[int, float]()

    def distance(tap: int) -> float:
        return abs(tap * solver.bank.tap_time - believed) / POLICY.least_delay_range

    def nats(tap: int) -> float:
        if tap not in known:  # the first one keeps the columns that do not depend on the delay
            left = max(solver.squares(terms, tap, keep=not known), 1e-300)
            known[tap] = 0.5 * solver.bank.equations.counted * math.log(left) + distance(tap)
        return known[tap]

    def refined(tap: int, width: int) -> int:
        while width > 1:
            beside = range(max(tap - width, first), min(tap + width, last) + 1, max(width // 4, 1))
            tap, width = min(beside, key=nats), max(width // 4, 1)
        return tap

    nats(first)
    step = max(1, (len(allowed) - 1) // _COARSE)
    tried = coarse = allowed[::step]
    if near is not None:
        near = min(max(near, first), last)
        around = range(max(near - _AROUND * step, first), min(near + _AROUND * step, last) + 1, step)
        tried = around if around[0] < min(around, key=nats) < around[-1] else tried
    best = refined(min(tried, key=nats), step)
    near_by = [tap for tap in {*coarse, *known} if distance(tap) < 1.0]
    if distance(best) < 1.0 or not near_by:
        return best
    here, kept = refined(min(near_by, key=nats), step), solver.bank.equations.kept
    further = distance(best) - distance(here)
    was, left = (mixed(solver.bank.rows(terms, n), solver.fit(terms, n).forward) for n in (here, best))
    by_chance = max(shared_inflation(left[kept], (was - left)[kept]), 1.0)  # Bartlett's factor
    return best if nats(here) - nats(best) + further > further * by_chance else here


#: Samples by which u is late at least: sampled from what is continuous it is early by a half, and the mean of the
#: interval that ends at its stamp, as many a drive logs it, late by one.
LEAST_LATE = 0.75
#: Share of the squares that a u which is late may leave, on time: a missing force leans like lag, but leaves more.
_EXPLAINED = 0.5


def certainly_late(lead: float, error: float, sample_time: float) -> bool:
    """Whether a u that comes earlier by `lead` +- `error` (s) does so beyond chance, and how it may be sampled."""
    return lead > max(POLICY.value_deviations * error, LEAST_LATE * sample_time)


def explains_most(left: float, before: float, free: int) -> bool:
    """Whether a u on time surely leaves so little of the squares of one that is late that no missing force leans like
    that. free : independent equations beyond the values, of which a few do where nearly nothing is left."""
    nats = 0.5 * free * math.log(max(before, 1e-300) / max(left, 1e-300))
    return left < _EXPLAINED * before and nats > POLICY.response_nats


def _plainest(role: Role, needs: tuple[str, ...]) -> str:
    """The commonest force of that kind that is one size of what looks at these channels alone."""
    like = [e for e in catalogue().values() if e.role is role and e.needs == needs and e.sizes == 1]
    return min((e for e in like if not (e.searched or e.listed)), key=lambda e: e.rarity).id


#: The two that are one column.
DRY, LOAD = _plainest(Role.FRICTION, ("velocity",)), _plainest(Role.APPLIED, ())


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
        """rms by which a level is off that may be anything from the least to `moving`. Where the least is more it is
        off by that without a load; with one nothing is above it: nan."""
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
    held = ways[0] * _held(bank, fit)
    least = max(0.5 * (moving - float(held.min())), 0.0) if held.size else 0.0
    level = moving
    if LOAD in found:  # rows part them by the noise of stops alone
        level = min(max(found[DRY], least), max(moving, least) if least > 0.0 else math.inf)
    return OneWay(ways[0], LOAD in found, level, moving, least)


def _held(bank: Bank, fit: Fit) -> Array:
    """e of each row of a rest, shape (n,): what dry friction and a load have to hold there. Of none in which u is
    exactly 0 for half of it: a drive that is off holds nothing, and a brake may."""
    others = [t for t in fit.terms if t.effect.role is Role.APPLIED and t.id != LOAD]
    columns = [x for t in others for x in bank.columns(t, fit.tap)]
    theta = [float(x) for t in others for x in fit.coefficients(t)]
    u, still = bank.drive(inputs_of(fit.terms), fit.tap), still_rows(bank.equations)
    off = 2.0 * bank.equations.plain([1.0 * (s.log["u"] == 0.0) for s in bank.equations.stretches]) > 1.0
    left = np.asarray(u - mixed([bank.acceleration, *columns], np.array([fit.total[INERTIA], *theta])))
    return left[still & ~off]


def as_rests_allow(bank: Bank, fitted: Fitted, beside: Terms) -> Fitted:
    """Values of dry friction and a load with what rests leave open in their errors.

    beside : effects that the log may hold as well.
    """
    found = one_way(bank, fitted.fit)
    if found is None or LOAD not in {t.id for t in (*fitted.fit.terms, *beside)}:
        return fitted
    names = [f"{one}.{get_effect(one).parameters[0].name}" for one in (DRY, LOAD)]
    values = dict(zip(names, (found.level, found.way * (found.level - found.moving)), strict=True))
    open_ = {n: e for n, e in fitted.estimates.items() if n in values and not e.held}
    if len(open_) < sum(n in fitted.estimates for n in values):  # one that is known says what the other is
        return fitted
    step = bank.equations.sample_time
    moved = {n: replace(e, value=values[n], at_bound=e.at_bound and values[n] == e.value) for n, e in open_.items()}
    made = {n: _as_open(e, n, found, step) for n, e in moved.items()}
    model = fitted.model.with_values({n: e.value for n, e in made.items()})
    return replace(fitted, model=model, estimates={**fitted.estimates, **made})


def _as_open(one: Estimate, name: str, found: OneWay, step: float) -> Estimate:
    """That estimate with its error; of a set with both what rows alone make of it is none."""
    error = found.error if found.both else math.hypot(one.std_error, found.error)
    return replace(one, std_error=error, grade="not") if math.isnan(error) else known_to(one, name, error, step)
