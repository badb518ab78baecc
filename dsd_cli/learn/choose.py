"""Which family of laws: the simplest within one standard error of the best, and a further one as long as it helps."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from dsd_cli.effects.general import HYSTERESIS
from dsd_cli.identify.fit.blocks import spread_over_blocks
from dsd_cli.identify.fit.problem import Problem
from dsd_cli.identify.fit.testability import constant_u
from dsd_cli.identify.policy import POLICY
from dsd_cli.learn.families import FAMILIES, INERTIA_OVER_TIME, MEMORY, Columns, Family, columns_of
from dsd_cli.learn.forgetting import is_hysteresis, where_known
from dsd_cli.learn.formula import AS_GOOD
from dsd_cli.learn.judge import Judge, LawFit, standard_error
from dsd_cli.learn.one_lag import is_shown, with_one_lag
from dsd_cli.learn.rows import LEAST_ROWS, Balance
from dsd_cli.learn.state_laws import STATE_LAWS, springs_of, state_laws
from dsd_cli.plant.forces import Mask
from dsd_cli.signals.log import Array

#: Laws that stand beside each other at most; rounds in which the noise and the delay are measured beside the best, and
#: the change of the delay, steps, that ends them.
MOST_LAWS, _ROUNDS, _SETTLED = 3, 4, 0.05
#: Laws whose loss is so many times the best one's are no ties, whatever the standard error.
_TIED = 1.5
#: Why nothing is learnt.
CONSTANT = "u is constant, which a load explains whatever moves the axis"
OF_SENSOR = "what is left may be the sensor's noise"
AT_STOPS = "what is left lies at stops and turns, where the direction of the motion is not sure"
#: Times as many knots as a family begins with, at most.
FINEST = 8


@dataclass(frozen=True)
class Choice:
    """What was chosen.

    base : the model alone. fit : with the laws, `base` where there is none. tied : other families as good as the first.
    richest : the fit with the least held-out loss. refused : why the best law was not taken, "" if one was;
    undecided : because the log cannot say of any.
    finer : the laws of `fit` with finer curves, which are no better: how far the two differ is what the curves smooth.
    """

    judge: Judge
    base: LawFit
    fit: LawFit
    tied: tuple[LawFit, ...]
    richest: LawFit
    best: LawFit
    refused: str
    finer: LawFit | None = None
    undecided: bool = False

    def rmse(self, fit: LawFit) -> float:
        """Held-out rms of r, of the rows that count, unit of u."""
        return left_of(self.judge, fit)


def left_of(judge: Judge, fit: LawFit, rows: Mask | None = None, held_out: bool = True) -> float:
    """Rms of r, of the rows that count or of these, unit of u."""
    keep = judge.balance.equations.kept if rows is None else rows
    return float(np.sqrt(np.mean(judge.residual(fit, held_out)[keep] ** 2)))


def surely_left(judge: Judge, fit: LawFit) -> float:
    """Held-out rms of r, of all rows or of those where the direction is sure, if that is less; unit of u."""
    return min(left_of(judge, fit), left_of(judge, fit, judge.balance.sure))


def choose(balance: Balance, report: Callable[[float], None] = lambda _: None) -> Choice:
    """The laws that stand beside the model's own effects."""
    few = f"the log is too short: it has {balance.blocks.rows} independent samples, a curve needs {LEAST_ROWS}"
    if (constant := constant_u(balance.problem.recordings)) or balance.blocks.rows < LEAST_ROWS:
        base = (judge := Judge(balance)).fit(())
        return Choice(judge, base, base, (), base, base, CONSTANT if constant else few, undecided=True)
    look = _beside_the_best(balance, report)
    judge, base, fits = look.judge, look.base, look.fits
    if not fits:
        return Choice(judge, base, base, (), base, base, "the log has no channel that a law could depend on")
    first, tied = simplest(fits)
    if first.laws[0].family in STATE_LAWS:  # as good as springs that are as many as the log supports?
        first = simplest([first, refined(judge, springs_of(fits))[0]])[0]
    tied += also_an_inertia(judge, first)
    left = surely_left(judge, base)
    refused = why_not(judge, base, first) if left > sensed(balance.problem, first.forward) else OF_SENSOR
    if refused:
        return Choice(judge, base, base, (), look.richest, first, refused, undecided=refused == AT_STOPS)
    # a law is as fine as it gets before another is asked for: that would explain what a coarse curve leaves
    fit, finer = refined(judge, with_one_lag(judge, in_parts(judge, first, look.columns)))
    while first.laws[0].family.of_motion and len(fit.laws) < MOST_LAWS:
        following = _following(judge, fit, look.columns)
        if following is None:
            break
        fit, finer = refined(judge, with_one_lag(judge, following))
    return Choice(judge, base, fit, tied, min(look.richest, fit, key=lambda f: f.loss), first, "", finer)


@dataclass(frozen=True)
class _Look:
    """Every family alone beside the model, on one balance; base : the model alone."""

    judge: Judge
    base: LawFit
    columns: list[Columns]
    fits: list[LawFit]

    @property
    def richest(self) -> LawFit:
        return min(self.fits, key=lambda f: f.loss, default=self.base)


def _look(balance: Balance) -> _Look:
    judge = Judge(balance)
    made = (columns_of(f, balance) for f in FAMILIES if balance.answered or not f.of_u)
    columns = [c for c in made if c is not None]
    return _Look(judge, judge.fit(()), columns, [judge.fit((c,)) for c in columns])


def _by_sure(balance: Balance) -> Balance:
    """Weighed by what the model alone leaves that is fitted where the direction of the motion is sure."""
    judge = Judge(replace(balance, weight=balance.sure.astype(np.float64)))
    return balance.weighed(judge.residual(judge.fit(()), held_out=False))


def _with_states(look: _Look, before: Sequence[LawFit]) -> _Look:
    """Where what explains the log best has a memory, with hysteresis of one state; `before` : the fits on another
    balance."""
    if not look.fits or look.richest.laws[0].family.on != (MEMORY,):
        return look
    return replace(look, fits=[*state_laws(look.judge, springs_of(look.fits), before), *look.fits])


def _beside_the_best(balance: Balance, report: Callable[[float], None]) -> _Look:
    """The families with the noise and the delay measured beside the best of them.

    A law that is missing makes u look early or late: the delay that the problem was posed with may be far away, so that
    of the given model is a start as well. Where the best one is none that a fit of the model may have, as one below 0,
    it is held at the nearest: what a law explains beside another would be left in the model.
    """
    given = balance.problem.model.delay / balance.problem.solver.bank.tap_time
    starts = [balance] if abs(given - balance.delay) < 1.0 else [balance, balance.at(given)]
    look = min((_look(_by_sure(one)) for one in starts), key=lambda found: found.richest.loss)
    for turn in range(1, _ROUNDS):
        report(turn / _ROUNDS)
        before = look.judge.balance.delay
        delay = look.judge.delay(look.richest)
        beside = look.judge.residual(look.richest, held_out=False)
        known = where_known(look.judge.balance) if is_hysteresis(look.richest) else look.judge.balance
        look = _with_states(_look(known.at(delay).beside(beside)), look.fits)
        if abs(delay - before) < _SETTLED:
            break
    delay = look.judge.delay(look.richest)
    nearest = look.judge.balance.at(delay)
    if nearest.delay == delay:
        return look
    return _with_states(_look(replace(nearest, later=())), look.fits)


def also_an_inertia(judge: Judge, gain: LawFit) -> tuple[LawFit, ...]:
    """An inertia over time, where a gain of u over time was found and it explains the log as well.

    The two differ by the model's own forces alone, which a gain of u does not scale: where these are small no log
    distinguishes them.
    """
    if set(gain.laws[0].family.on) != {"u", "time"}:
        return ()
    columns = columns_of(INERTIA_OVER_TIME, judge.balance)
    if columns is None:
        return ()
    other = judge.fit((columns,))
    return (other,) if as_good(other, gain) else ()


def in_parts(judge: Judge, whole: LawFit, columns: Sequence[Columns]) -> LawFit:
    """Two laws over one channel each in the place of one over both, where they leave no more on held-out blocks: a
    table over two channels has few knots in each."""
    over = set(whole.laws[0].family.over)
    if len(over) < 2:
        return whole
    single = [c for c in columns if not c.family.of_u and len(c.family.over) == 1 and set(c.family.over) < over]
    pairs = [two for two in combinations(single, 2) if {name for c in two for name in c.family.over} == over]
    fits = [judge.fit(two) for two in pairs]
    best = min(fits, key=lambda fit: fit.loss, default=whole)
    as_fine = [refined(judge, fit)[0] for fit in fits if as_good(fit, best)]
    return min([whole, *as_fine], key=lambda fit: fit.loss)


def refined(judge: Judge, fit: LawFit) -> tuple[LawFit, LawFit | None]:
    """(the fit with curves as fine as held-out blocks support, the next finer one), both of the same laws.

    Knots are doubled while the held-out loss falls by more than one standard error. Where the log has no rows for
    more knots, the second is the next coarser one.
    """
    coarser = None
    while True:
        following = judge.fit([_finer(judge, law) for law in fit.laws])
        if len(following.total) <= len(fit.total):
            return fit, coarser
        if fit.loss - following.loss <= standard_error(fit.losses, following.losses):
            return fit, following
        fit, coarser = following, fit


def _finer(judge: Judge, law: Columns) -> Columns:
    """A curve over one channel with twice the knots, hysteresis with twice the springs; any other law as it is."""
    if (len(law.family.over) != 1 and law.family.effect is not HYSTERESIS) or law.finer >= FINEST:
        return law
    return columns_of(law.family, judge.balance, 2 * law.finer) or law


def _following(judge: Judge, fit: LawFit, all_of_them: Sequence[Columns]) -> LawFit | None:
    """One law more, if it is certain and of use; no law of u beside one of the motion: it would follow its noise."""
    others = [
        c
        for c in all_of_them
        if not any(contains(law.family, c.family) for law in fit.laws)
        and c.family.of_motion
        and c.family.of_u == fit.forward
        and len(c.family.over) < 2
    ]
    found = [judge.fit((*fit.laws, c)) for c in others]
    if not found:
        return None
    best, _ = simplest(found)
    return None if why_not(judge, fit, best) else best


def contains(family: Family, other: Family) -> bool:
    """Whether a law of the first may be one of the second as well: beside each other the two are collinear, large and
    opposite. So are two with memory: each imitates what the other does after a turn."""
    both = len(family.over) > 1 and "u" not in other.on
    return (
        family.name == other.name
        or (family.on == other.on == (MEMORY,))
        or (both and set(other.on) <= {*family.on, "direction"})
    )


def simplest(fits: Sequence[LawFit]) -> tuple[LawFit, tuple[LawFit, ...]]:
    """(the simplest fit within one standard error of the best, others of other channels that are as good)."""
    best = min(fits, key=lambda f: f.loss)
    near = [f for f in fits if as_good(f, best)]
    first = min(near, key=lambda f: f.laws[-1].family.rank)
    own = set(first.laws[-1].family.on)
    return first, tuple(f for f in near if f is not first and not own <= set(f.laws[-1].family.on))


def as_good(other: LawFit, best: LawFit) -> bool:
    """Whether a fit is within one standard error of a better one, and in all blocks but the worst as well: where that
    alone goes to an end of a channel, it is most of the loss of any fit without it, and says nothing of the others."""
    worst = int(np.argmax(np.maximum(other.losses, best.losses)))
    rest = np.arange(len(best.losses)) != worst
    return all(_near(other.losses[part], best.losses[part]) for part in (rest, slice(None)))


def _near(other: Array, best: Array) -> bool:
    """Of losses by block; where one has most of them the standard error says nothing, so they must be near as well."""
    apart, whole = float(np.sum(other - best)), float(np.sum(best))
    return apart <= max(standard_error(other, best), AS_GOOD * whole) and apart < (_TIED - 1.0) * max(whole, 1e-300)


def sensed(problem: Problem, of_u: bool) -> float:
    """What the sensor may leave, unit of u: functions of the motion explain a part of what a coarse one does. A law of
    u needs what a diagnosis calls something: where an axis sticks, friction is what u is."""
    return problem.least_missing if of_u else POLICY.floor_factor * problem.floor


def why_not(judge: Judge, before: LawFit, after: LawFit) -> str:
    """Why the last law of a fit is not taken, "" if it is: it must be certain, spread, of use, not at stops alone.

    Of use in the fit to all rows as well: where one block alone goes to an end of a channel, or the model's own values
    are loose without one, any law makes up for that on held-out blocks, and lacks nothing in the log.
    """
    gains = (judge.without(after) - after.losses) / judge.nats(after)
    if float(gains.sum()) < POLICY.unknown_nats or not spread_over_blocks(gains):
        return "no function of the channels explains what is left, on blocks that it was not fitted to"
    problem = judge.balance.problem
    least = POLICY.least_unknown * problem.errors.force
    if not all(_takes(judge, before, after, least, held_out=held_out) for held_out in (True, False)):
        return "what a function of the channels explains is too small to matter"
    noise = 0.0 if before.laws else sensed(problem, of_u=False)  # beside a law that is sure a small one may be
    spread = _takes(judge, before, after, noise, judge.balance.sure)
    return "" if spread and is_shown(judge, after) else AT_STOPS


def _takes(
    judge: Judge, before: LawFit, after: LawFit, least: float, rows: Mask | None = None, held_out: bool = True
) -> bool:
    """Whether the last law takes enough of what is left in these rows, and `least` of it, unit of u."""
    was, now = (left_of(judge, fit, rows, held_out) for fit in (before, after))
    return now < (1.0 - POLICY.unknown_fall) * was and was**2 - now**2 > least**2
