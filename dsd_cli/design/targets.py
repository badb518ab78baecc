"""What the next experiment is for: explanations that the logs leave open, and weakly identifiable values."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from dsd_cli.design.explanations import Explanation, Value, acts, draws_of, explanation_of, falling, held, values_of
from dsd_cli.design.explanations import wave_law as law_of_a_wave
from dsd_cli.effects import Role, find_effect, get_effect
from dsd_cli.errors import UsageError
from dsd_cli.identify.fit.bank import Term
from dsd_cli.identify.fit.direction import LOAD
from dsd_cli.identify.fit.solve import Fit
from dsd_cli.identify.fit.testability import Settings
from dsd_cli.identify.fit.values import flat
from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.results import DELAY, INERTIA, NONE, UNKNOWN, Diagnosis, Unexplained
from dsd_cli.identify.search.evidence import in_plain_laws
from dsd_cli.identify.search.sets import Option, Search
from dsd_cli.identify.search.task import posed
from dsd_cli.plant.model import PlantModel

#: A value of the config that no motion identifies while all forces are per unit of u.
GAIN = "gain"
#: Explanations that are distinguished at most, and the belief from which on another effect is within reach.
_MOST, _WITHIN_REACH = 4, 0.05
#: Effects that may be there instead.
_AS_GOOD = 3


@dataclass(frozen=True)
class Targets:
    """explanations : each once; beside : plants that keep the limits, too: the first with what the logs say little of,
    and the delay, as the model has it (with unknown, what that lacks as a wave over the place), and friction that is
    gone beyond the speeds of the logs. pairs : of their places, to be distinguished. values : of the first explanation.
    asked : names that the user gave. unknown : the motion is for the whole catalogue. doubtful : what is missing may be
    none of the explanations, so that more of them are there to keep the limits. doubt : probability that what the logs
    leave beyond the noise is a force. grown : plants in which one grows with the speed, of which the worst run."""

    explanations: tuple[Explanation, ...]
    beside: tuple[PlantModel, ...]
    pairs: tuple[tuple[int, int], ...]
    values: tuple[Value, ...]
    asked: tuple[str, ...] = ()
    unknown: bool = False
    doubtful: bool = False
    doubt: float = 1.0
    grown: tuple[PlantModel, ...] = ()

    @property
    def nothing(self) -> bool:
        """Whether there is nothing to find out."""
        return not (self.pairs or self.values or self.unknown)


def targets_of(
    search: Search,
    whole: Fit,
    diagnosis: Diagnosis | None,
    wanted: Sequence[str] = (),
    *,
    doubted: bool = False,
    start: float = 0.0,
) -> Targets:
    """What a diagnosis leaves open, or what the user asks for.

    doubted : what was found cannot be: as if the verdict were unknown. start : position of rest.

    Raises
    ------
    UsageError : a name that is neither an effect nor a value, or that these logs cannot test.
    """
    for name in wanted:
        _check(name, search)
    made = _Explanations(search, whole)
    doubtful = diagnosis is not None and (doubted or nobody_knows(diagnosis))
    unknown = doubtful and not wanted
    pairs = made.asked_for(wanted) if wanted or diagnosis is None else made.left_open(diagnosis, unknown)
    names = list(dict.fromkeys(name for pair in pairs for name in pair))[: _MOST + _MOST * unknown]
    pairs = [pair for pair in pairs if set(pair) <= set(names)]
    if doubtful and not unknown and diagnosis is not None:  # asked for by name: the plant may yet be another
        names += [name for pair in made.left_open(diagnosis, unknown=True) for name in pair]
    as_good = [*([] if unknown else made.as_good()), *made.wave(unknown)]
    names = list(dict.fromkeys([NONE if unknown else made.name_of(whole), *names, *as_good]))
    apart_from = [*pairs, *((name, NONE) for name in as_good)]
    own, left = {name: _own(name, apart_from) for name in names}, diagnosis.unexplained if diagnosis else Unexplained()
    explanations = tuple(
        explanation_of(made.posed.get(name, search), name, made.fits[name], doubtful, own[name]) for name in names
    )
    unexplained = float(np.nan_to_num(left.share_of_u))
    gone = falling(search, explanations[0].fitted, whole, unexplained)
    if unknown:  # none of them stands: the limits are kept under each, and the motion is for the whole catalogue
        first, wave = held(search, explanations[0], whole, unexplained, start)
        return Targets((first, *explanations[1:]), (wave, *gone), (), (), unknown=True, doubtful=True)
    places = tuple((names.index(a), names.index(b)) for a, b in pairs)
    values = [n for n in wanted if n in flat(explanations[0].fitted)] if wanted else None
    doubt, found = float(np.fmin(left.probability, 1.0)), values_of(search, explanations[0], values)
    believed = next(draws_of(search, made.fits[names[0]], doubtful=True, own=own[names[0]]))
    return Targets(explanations, (believed, *gone), places, found, tuple(wanted), doubtful=doubtful, doubt=doubt)


def _own(name: str, pairs: Sequence[tuple[str, str]]) -> set[str]:
    """Effects by which an explanation is distinguished from those that it is paired with."""
    beside = [other.split(" + ") for a, b in pairs for one, other in ((a, b), (b, a)) if one == name]
    return {effect for rival in beside for effect in name.split(" + ") if effect not in rival}


def nobody_knows(diagnosis: Diagnosis) -> bool:
    """Whether nobody knows what is missing: that something else is left is likelier than any effect that was found, or
    the verdict is a value of the model of which the logs say nothing, as an inertia that hardly moved."""
    value = diagnosis.estimates.get(diagnosis.verdict)
    nothing_said = value is not None and value.grade == "not"
    return nothing_said or diagnosis.verdict == UNKNOWN or diagnosis.unexplained.probability > diagnosis.probability


def _check(name: str, search: Search) -> None:
    if (why := why_not(name, search)) is not None:
        raise UsageError(f"--for {name}: {why[0]}", why[1])


def why_not(name: str, search: Search) -> tuple[str, str] | None:
    """What keeps a name from being a target, and what there is instead; None: nothing."""
    if name == GAIN or name in (INERTIA, DELAY, NONE):
        return None
    effect, _, value = name.partition(".")
    if find_effect(effect) is None or (value and value not in {p.name for p in get_effect(effect).parameters}):
        known = ", ".join((*search.problem.candidates, INERTIA, DELAY, GAIN))
        return "neither an effect nor a value", f"there are {known}"
    reason = search.problem.untestable.get(effect)
    return None if reason is None else ("these logs cannot test it", reason)


class _Explanations:
    """Sets of effects by the name of what distinguishes them, each fitted once."""

    def __init__(self, search: Search, whole: Fit) -> None:
        self.search, self.whole = search, whole
        self.found = [t.id for t in search.added(whole.terms)]
        self.fits: dict[str, Fit] = {self.name_of(whole): whole}
        self.fits.setdefault(NONE, search.refit)
        self.posed: dict[str, Search] = {}

    def name_of(self, fit: Fit) -> str:
        """Of the effects that the model does not have."""
        return " + ".join(t.id for t in self.search.added(fit.terms)) or NONE

    def left_open(self, diagnosis: Diagnosis, unknown: bool) -> list[tuple[str, str]]:
        """Ties and rivals of each member; where it is unknown what is missing, the best few effects alone before them:
        what moves the axis may be the one that was found in doubt, or what that is tied to (several may be forces that
        cancel out), but for what acts on u."""
        pairs = self._best_alone(_AS_GOOD if unknown else 1, diagnosis.nearest) if unknown or not self.found else []
        ranking = {c.effect: c for c in diagnosis.ranking if not c.untestable}
        whole = self.name_of(self.whole)
        for member in self.found if not unknown or len(self.found) == 1 else ():
            rivals = ranking[member].indistinguishable_from if member in ranking else ()
            rivals = tuple(x for x in rivals if not (unknown and (find_effect(x) is None or _of_u(x))))
            pairs += [(whole, self.instead(member, rival)) for rival in rivals]
            pairs += [(whole, name) for name in self._together(member, rivals)]
        if not unknown and (len(self.found) == 1 or (not self.found and diagnosis.verdict != NONE)):
            member = self.found[0] if self.found else ""  # a value of the model is wrong, or an effect is there
            near = sorted((c for c in ranking.values() if c.effect not in self.found), key=lambda c: -c.probability)
            own = (c for c in ranking.values() if not member and c.effect == diagnosis.verdict)
            reach = [rival for c in own for rival in c.indistinguishable_from]
            reach += [c.effect for c in near[:2] if c.probability > _WITHIN_REACH]
            pairs += [*((whole, self.instead(member, x)) for x in reach if self._may_be(x)), (whole, NONE)]
        return [p for p in dict.fromkeys(pairs) if p[0] != p[1]]

    def asked_for(self, wanted: Sequence[str]) -> list[tuple[str, str]]:
        """All pairs of the effects that were asked for, beside all else that was found; one alone against none. What
        was not found takes the place of the member, of those asked for, for which it stands in best, or comes on top.
        """
        effects = [n for n in wanted if find_effect(n) is not None or n == NONE]
        if len(effects) == 1:
            effects.append(NONE)
        tied = [m for m in self.found if m in effects]
        names = []
        for name in effects:
            if name in self.found:
                names.append(self.name_of(self.whole))
            elif name == NONE:
                rest = tuple(t for t in self.whole.terms if t.id not in tied)
                names.append(self._keep(self.search.fit(rest, self.whole.tap) if tied else self.whole))
            elif tied:
                places = [self.instead(member, name) for member in tied]
                names.append(max(places, key=lambda n: self.search.evidence(self.fits[n])))
            else:
                names.append(self._keep(self._beside(self.whole, name)))
        return list(combinations(dict.fromkeys(names), 2))

    def instead(self, member: str, rival: str) -> str:
        """The set with a rival in the place of a member; a value of the model needs no effect for that."""
        fit = self._without(member)
        return self._keep(fit if rival in (INERTIA, DELAY) else self._beside(fit, rival))

    def _together(self, member: str, rivals: Sequence[str]) -> list[str]:
        """The set with plain laws in the place of a member that they are together over this travel, where tied."""
        term = next(t for t in self.whole.terms if t.id == member)
        fit = in_plain_laws(self.search, self.whole, term)
        tied = fit is not None and {t.id for t in fit.terms} <= {t.id for t in self.whole.terms} | {*rivals}
        return [self._keep(fit)] if fit is not None and tied else []

    def as_good(self) -> list[str]:
        """The few sets with another effect in the place of one that was found that explain all rows of the logs best.
        Blocks that no fit saw are few in a poor log, and may lie where one force goes on and another does not."""
        options = [o for name in self.found for o in self.search.options(self._without(name)) if self._may_be(o.effect)]
        others = [o.fit for o in options if not _of_u(o.effect) and o.effect not in self.found]
        return [self._keep(fit) for fit in sorted(others, key=lambda fit: float(fit.squares))[:_AS_GOOD]]

    def wave(self, unknown: bool) -> list[str]:
        """The set with one sine over the place instead of its laws of the position: where the logs have not been
        nothing says which of them goes on. Half a wave is as long as the way of the logs to begin with, for less of it
        shows in no residual; those that do not explain the logs as well are not likely. unknown : also where no law of
        the position was found, and beside forces as the model has them: any go with a sine that is not there."""
        law, (shape,) = law_of_a_wave()
        over = [t for t in self.search.added(self.whole.terms) if "position" in t.effect.needs]
        way, search = self.search.ranges.travel, self._believed() if unknown else self.search
        if not (over or unknown) or not way > 0.0:
            return []
        rests = [[t for t in self.whole.terms if t not in over and t.id not in gone] for gone in ((), (LOAD,))]
        one = Term.of(law.id, {shape: math.pi / way})
        sets = [(*rest, one) for rest in rests if all(t.id != law.id for t in rest)]
        fits = [search.converged(search.fit(terms, self.whole.tap)) for terms in sets]
        best = max(fits, key=search.evidence, default=self.whole)
        name = self.name_of(best)
        if name == self.name_of(self.whole):
            return []
        self.fits[name], self.posed[name] = best, search
        return [name]

    def _believed(self) -> Search:
        """With the forces of the model held as it has them."""
        problem, known, model = self.search.problem, self.search.solver.known, self.search.problem.model
        forces = flat(replace(model, effects={n: v for n, v in model.effects.items() if acts(n)}))
        held = {n: x for n, x in forces.items() if n not in (INERTIA, DELAY)}
        asked = Settings(effects=problem.candidates, known=replace(known, fixed={**held, **known.fixed}))
        return posed(problem.recordings, model, asked, model.delay) if held else self.search

    def _without(self, member: str) -> Fit:
        return self.search.fit(tuple(t for t in self.whole.terms if t.id != member), self.whole.tap)

    def _beside(self, fit: Fit, effect: str) -> Fit:
        return next((o.fit for o in self.search.options(fit) if o.effect == effect), fit)

    def _best_alone(self, most: int, nearest: str) -> list[tuple[str, str]]:
        options = [o for o in self.search.options(self.search.refit) if self._may_be(o.effect) and self._credible(o)]
        if most == 1:  # nothing is missing: what takes less than is of use off it is no question
            rmse, clear = self.search.problem.errors.rmse, 1.0 - POLICY.clear_fall
            options = [o for o in options if rmse(o.fit) < clear * rmse(self.search.refit)]
        options.sort(key=lambda o: (o.effect != nearest, -o.evidence))
        alone = [self._keep(o.fit) for o in options[:most]]
        return [*combinations(alone, 2), *((name, NONE) for name in alone)]

    def _credible(self, option: Option) -> bool:
        """Whether blocks that it did not see speak for it: else it would need any force on another motion. What acts on
        u explains u by u, and a poor log is no word for it."""
        return not _of_u(option.effect) and option.evidence > self.search.evidence(self.search.refit)

    def _may_be(self, effect: str) -> bool:
        """A push, or a line in time, does not come again with another motion."""
        found = get_effect(effect) if find_effect(effect) is not None else None
        return found is not None and not found.listed and (found.periods is None or bool(found.needs))

    def _keep(self, fit: Fit) -> str:
        name = self.name_of(fit)
        self.fits.setdefault(name, fit)
        return name


def _of_u(effect: str) -> bool:
    law = get_effect(effect)
    return law.role is Role.INPUT or "u" in law.needs


def apart(a: str, b: str) -> tuple[str, str]:
    """Names of two explanations without the effects that both have."""
    sides = [name.split(" + ") for name in (a, b)]
    rest = [" + ".join(x for x in side if x not in other) for side, other in (sides, sides[::-1])]
    return rest[0] or NONE, rest[1] or NONE


def within_reach(targets: Targets, possible: Sequence[bool]) -> Targets:
    """The targets without explanations that are none: the first stays."""
    kept = [i for i, one in enumerate(possible) if one or i == 0]
    pairs = tuple((kept.index(a), kept.index(b)) for a, b in targets.pairs if a in kept and b in kept)
    return replace(targets, explanations=tuple(targets.explanations[i] for i in kept), pairs=pairs)
