"""What the response of the acceleration to the force shows above the band of the balance: a load that swings, or play.

The balance of forces ends where the sensor's noise takes over. A load on a spring or with play shows beyond that as
well, for its resonance is narrow, and the log is long.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from dsd_cli.effects import Role, kind_of
from dsd_cli.identify.fit.bank import Term
from dsd_cli.identify.fit.solve import Fit
from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.search.modes import Modes
from dsd_cli.identify.search.play import LATE, LOG_INERTIA, PART, Play
from dsd_cli.identify.search.seen import COUPLING, PLAY, Seen, is_a_load, same_play, seen_by_contacts
from dsd_cli.identify.search.sets import Search
from dsd_cli.identify.search.signals import (
    Signals,
    correlation_time,
    delay_of,
    enough,
    gains,
    innovations,
    left,
    signals_of,
    strongest_line,
    variance_of,
    without_line,
)
from dsd_cli.plant.model import PlantModel
from dsd_cli.signals.log import Array
from dsd_cli.signals.spread import rms

#: Rounds in which the delay is moved, samples that it moves at most, and less than which it stays.
_ROUNDS, _MOST_MOVED, _NEAR = 5, 3.0, 0.3
#: What a play is sought beside, found or not: a play that nobody knows of hides friction, and friction hides a play.
_IN_ANY_AXIS = ("coulomb_friction", "viscous_friction")
#: Roles of effects that are none of the other forces.
_NO_FORCE = (Role.INPUT, Role.STRUCTURE)


@dataclass(frozen=True)
class Response:
    """What a look at the response came to.

    seen : None where it shows no load for certain.
    rattles : play explains much of it, but no simulation follows the load well enough to be certain of it.
    line_hz : of a push at one frequency above the band, all along; NaN where there is none.
    """

    seen: Seen | None
    rattles: bool = False
    line_hz: float = math.nan


def response_of(search: Search, whole: Fit, asked: Sequence[str], doubtful: bool) -> Response | None:
    """The load that explains the response, beside a set of effects; None where the log has no such response.

    Effects of the set that are late, or loads themselves, may stand in for it and are left out.

    asked : effects that may be the answer. doubtful : the set leaves something unexplained, so that play is looked for
        even where no load swings.
    """
    look = _swinging(search, whole)
    found = _load_in(search, asked, doubtful, look) if look is not None else None
    if PLAY in asked and (doubtful or PLAY in search.problem.model.effects):
        touching = seen_by_contacts(search.excerpt or search)
        if touching is not None:
            return Response(_predicted(found, touching))
    if look is None or found is None or found.seen is not None:
        return found
    return replace(found, line_hz=_steady_line(search, look))


def _predicted(found: Response | None, touching: Seen) -> Seen:
    """The play that contacts show, with the values of a simulation that shows the same one: it predicts impacts. By how
    much the two differ neither knows: another damping of the contact bends what is simulated."""
    seen = found.seen if found is not None else None
    values = {} if seen is None else {name: value for name, (value, _) in seen.values.items()}
    if seen is None or seen.effect != touching.effect or not same_play(values, touching):
        return touching
    told = {n: (x, math.hypot(error, x - touching.values.get(n, (x,))[0])) for n, (x, error) in seen.values.items()}
    return replace(touching, values=told, model=touching.model.changed(None, None, {PLAY: values}))


@dataclass(frozen=True)
class _Look:
    """Signals beside a fit, u so late (s), and the mode that explains them best."""

    part: Search
    fit: Fit
    delay: float
    signals: Signals
    modes: Modes
    at: Array

    def later(self, samples: float) -> tuple[float, Signals]:
        """(delay, signals) with u so much later."""
        delay = max(self.delay + samples * self.signals.step, 0.0)
        moved = signals_of(self.part, self.fit, delay)
        assert moved is not None  # the same rows as before
        return delay, moved

    @cached_property
    def of_counts(self) -> list[Array]:
        """Rows that counts alone are in this motion, read from each beginning."""
        s, made = self.signals, self.part.equations.of_counts()
        rows = ([s.white(x)[k] for x, k in zip(errors, s.kept, strict=True)] for errors in made)
        return [s.inertia * np.concatenate(one) for one in rows]


def _load_in(search: Search, asked: Sequence[str], doubtful: bool, look: _Look) -> Response:
    signals, modes, at = look.signals, look.modes, look.at
    highest = POLICY.response_highest_share / signals.step
    rigid = modes.rigid()
    rival = left(rigid, signals.target)
    swinging = modes.left(at)
    over_rigid = gains(rival, swinging)
    values, damping = modes.values(at, variance_of(swinging))
    frequency, spread = values["frequency"]
    columns, nats = modes.columns(at), float(over_rigid.sum())
    # at constant speed counts are a tone, which a controller feeds back into u: most of the gain has to be more
    of_counts = max((float(gains(left(rigid, x), left(columns, x)).sum()) for x in look.of_counts), default=0.0)
    much = nats - of_counts > max(of_counts, POLICY.response_nats)
    swings = much and frequency > POLICY.value_deviations * spread
    sought = PLAY in asked and (doubtful or swings)
    play = _play(search, look) if sought else None
    if play is not None and play.certain:
        return Response(play.seen(highest))
    correlated = correlation_time(swinging) > POLICY.response_correlated
    unseen = Response(None, play is not None and play.rattles)
    inside = much and frequency < highest  # further out it is how the log samples u
    if COUPLING not in asked or not (
        inside and _agreed(over_rigid) and is_a_load(values["load_share"][0]) and damping < POLICY.response_damping
    ):
        return unseen
    fresh = _whatever_the_noise(signals, rival)
    target = fresh(signals.target)
    if not enough(gains(left(fresh(rigid), target), left(fresh(columns), target))):
        return unseen
    tied = play is not None and play.gapped and not _agreed(gains(play.rest, play.rival))
    fall = _fall(rival, swinging)
    if PLAY in asked and correlated and fall < POLICY.response_fall:
        # friction holds a motor now and then, whose load then swings as no linear response does
        return replace(unseen, rattles=unseen.rattles or not signals.held)
    given = {name: value for name, (value, _) in values.items()}
    model = look.part.problem.scale.model(look.fit).changed(effects={COUPLING: given})
    seen = Seen(COUPLING, values, (PLAY,) if tied else (), nats, fall, highest, values["frequency"][0], model)
    return replace(unseen, seen=seen)


def _steady_line(search: Search, look: _Look) -> float:
    """Hz of a line above the band that pushes all along: most of its power is beyond any line of counts alone."""

    def line(rows: Array) -> tuple[float, Array]:
        hz = strongest_line(look.signals, rows, search.equations.band.hz)
        return hz, rows - without_line(look.signals, hz)(rows)

    rest = left(look.modes.rigid(), look.signals.target)
    (hz, tone), counted = line(rest), max((rms(line(x)[1]) for x in look.of_counts), default=0.0)
    more = rms(tone) ** 2 - counted**2 > counted**2
    return hz if more and _agreed(gains(rest, rest - tone)) else math.nan


def _swinging(search: Search, whole: Fit) -> _Look | None:
    """The mode that explains the signals best, with the delay brought to where it belongs beside the mode."""
    part = search.excerpt or search
    found = [t for t in whole.terms if t not in search.base]
    late = {t for t in found if t.effect.role is Role.STRUCTURE or t.effect.lateness is not None}
    late |= {t for t in found if sum(kind_of(x.id) == kind_of(t.id) for x in found) > 1}  # lines may follow the load
    terms = tuple(t for t in whole.terms if t.id not in (COUPLING, PLAY) and t not in late)
    fit = part.fit(terms, whole.tap if terms == whole.terms else search.refit.tap)
    delay, step = delay_of(part, fit), search.equations.sample_time
    lowest, highest = POLICY.response_lowest_share * search.equations.band.hz, POLICY.response_highest_share / step
    signals = signals_of(part, fit, delay)
    if signals is None or not lowest < highest:
        return None
    modes = Modes(signals)
    look = _Look(part, fit, delay, signals, modes, modes.best(lowest, highest))
    for _ in range(_ROUNDS):
        early = min(max(look.modes.early(look.at), -_MOST_MOVED), _MOST_MOVED)
        if abs(early) < _NEAR:
            break
        delay, signals = look.later(-early)
        modes = Modes(signals)
        look = _Look(part, fit, delay, signals, modes, modes.refined(look.at))
    return look


@dataclass(frozen=True)
class _Found:
    """The play that explains most, its model, what it leaves and its rival does. gapped : it differs from a spring.
    rattles : it explains much, whatever the noise, certain or not."""

    values: dict[str, tuple[float, float]]
    model: PlantModel
    rest: Array
    rival: Array
    gapped: bool
    rattles: bool
    certain: bool

    def seen(self, highest: float) -> Seen:
        share, stiffness = self.values["load_share"][0], self.values["stiffness"][0]
        own = math.sqrt(stiffness / (share * self.model.inertia)) / (2.0 * math.pi)
        nats, fall = float(gains(self.rival, self.rest).sum()), _fall(self.rival, self.rest)
        return Seen(PLAY, self.values, (), nats, fall, highest, own / math.sqrt(1.0 - share), self.model)


def _play(search: Search, look: _Look) -> _Found | None:
    """The play that explains most, beside friction as well."""
    axis = tuple(t for t in look.part.base if t.id not in (COUPLING, PLAY))
    both = ((*x, *(Term(n) for n in _IN_ANY_AXIS if n not in {t.id for t in x})) for x in (axis, look.fit.terms))
    plain, fit = (look.part.fit(terms, look.fit.tap) for terms in both)
    levels = {t.id: float(plain.coefficients(t)[0]) for t in plain.terms if t.id == _IN_ANY_AXIS[0]}
    ids = [t.id for t in fit.terms if t.effect.role not in _NO_FORCE for _ in fit.coefficients(t)]
    friction = np.array([max(levels.get(name, 0.0), 0.0) for name in ids])
    signals = signals_of(look.part, fit, look.delay)
    if signals is None or not search.ranges.travel > 0.0:
        return None
    look = replace(look, fit=fit, signals=signals, modes=Modes(signals))
    starts = Play(look.signals, search.ranges.travel, friction).starts()
    if not starts:
        return None
    delay, signals = look.later(-float(starts[0][LATE]))  # the full rate tells a contact by less than a sample
    moved = np.where(np.arange(len(starts[0])) == LATE, (delay - look.delay) / look.signals.step, 0.0)
    play = Play(signals, search.ranges.travel, friction)
    at, near = play.best([at + moved for at in starts])
    for _ in range(_ROUNDS):
        if abs(at[LATE]) < _NEAR:
            break
        delay, signals = look.later((delay - look.delay) / signals.step - float(at[LATE]))
        play = Play(signals, search.ranges.travel, friction)
        at = play.fitted(np.where(np.arange(len(at)) == LATE, 0.0, at))
    if math.exp(float(at[LOG_INERTIA])) < POLICY.least_inertia * search.solver.inertia:
        return None  # u moves nothing: it is one level a direction, and any load explains that
    rest = play.left(at)
    values = play.values(at, variance_of(rest), near)
    (gap, spread), resolved = values["gap"], search.ranges.resolution / POLICY.resolved_deviations
    share, apart = values["load_share"]
    told = gap > max(POLICY.value_deviations * spread, resolved) and share > POLICY.value_deviations * apart
    free = [signals.rows(x) for x in signals.given]
    others = (look.modes.rigid(), look.modes.columns(look.at))
    rivals = [left(np.column_stack([x, *free]), signals.target) for x in others]
    rival = min([*rivals, *([play.sprung(at)] if "load_level" in values else [])], key=rms)
    # a load that no simulation follows leaves more
    white = correlation_time(rest) < POLICY.response_correlated or _fall(rival, rest) > POLICY.response_fall
    fresh = _whatever_the_noise(signals, rival)
    much = enough(gains(fresh(rival), fresh(rest)))
    certain = much and told and white and is_a_load(share) and _agreed(gains(rival, rest))
    return _Found(values, _told_model(look, play, at, delay, values), rest, rival, told, much, certain)


def _told_model(look: _Look, play: Play, at: Array, delay: float, values: dict[str, tuple[float, float]]) -> PlantModel:
    """The model with the play, and with the inertia, delay and other forces that were fitted beside it. Friction of the
    load that is not identifiable stays the motor's."""
    total = look.fit.total.copy()
    at = at if "load_level" in values else np.where(np.arange(len(at)) == PART, 0.0, at)
    changes = iter(play.changes(at))
    for t in look.fit.terms:
        if t.effect.role not in _NO_FORCE:
            for i in range(*look.fit.columns_of(t).indices(len(total))):
                total[i] += next(changes)
    model, given = look.part.problem.scale.model(replace(look.fit, total=total)), {n: x for n, (x, _) in values.items()}
    late = max(delay - float(at[LATE]) * play.signals.step, 0.0)
    return model.changed(late, math.exp(float(at[LOG_INERTIA])), {PLAY: given})


def _whatever_the_noise(signals: Signals, rival: Array) -> Callable[[Array], Array]:
    """Takes out of rows what a line, and noise of any spectrum, explain of what the rival leaves, and stops."""
    calm = without_line(signals, strongest_line(signals, rival))
    fresh = innovations(calm(rival), signals.step, signals.sliding)
    return lambda rows: fresh(calm(rows))


def _agreed(by_block: Array) -> bool:
    """Whether the gain is certain: enough without the best block, and little lost in the others."""
    lost, won = (float(np.maximum(sign * by_block, 0.0).sum()) for sign in (-1.0, 1.0))
    return enough(by_block) and lost < POLICY.most_lost * won


def _fall(before: Array, after: Array) -> float:
    return 1.0 - rms(after) / max(rms(before), 1e-300)
