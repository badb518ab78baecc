"""What the next experiment is for: explanations that the logs leave open, and weakly identifiable values."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from dsd_cli.effects import find_effect, get_effect
from dsd_cli.errors import UsageError
from dsd_cli.identify.design.rows import Model, shapes_of
from dsd_cli.identify.fit.bank import INERTIA as AT_INERTIA
from dsd_cli.identify.fit.bank import SHARE
from dsd_cli.identify.fit.covariance import information
from dsd_cli.identify.fit.solve import Fit
from dsd_cli.identify.fit.values import flat
from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.results import DELAY, INERTIA, NONE, UNKNOWN, Diagnosis
from dsd_cli.identify.search.sets import Option, Search
from dsd_cli.plant.model import PlantModel
from dsd_cli.signals.log import Array

#: A value of the config that no motion tells while all forces are per unit of u.
GAIN = "gain"
#: Draws of the values of an explanation, their seed, and how far they go: standard errors, and shares of the value.
DRAWS, _SEED, _FARTHEST, _WIDEST = 8, 20261123, 2.0, 0.5
#: Explanations that are told apart at most, and the belief from which on another effect is within reach.
_MOST, _WITHIN_REACH = 4, 0.05


@dataclass(frozen=True)
class Explanation:
    """One way to explain the logs: a set of effects, fitted.

    name : of what distinguishes it: an effect, several with "+", "none".
    fitted : model and its values as they stand. draws : plants out of what the logs leave open, the fitted one first.
    """

    name: str
    fit: Fit
    model: Model
    draws: tuple[PlantModel, ...]

    @property
    def fitted(self) -> PlantModel:
        """The plant with the values of the fit."""
        return self.draws[0]


@dataclass(frozen=True)
class Value:
    """A value to identify better: `slope` of it over coefficients and shapes of an explanation, shape (m,).

    error : its standard error now, by the logs; `size` : what it is to be small against.
    """

    name: str
    size: float
    error: float
    slope: Array


@dataclass(frozen=True)
class Targets:
    """explanations : each once. pairs : of their places, to be distinguished. values : of the first explanation.
    asked : names that the user gave."""

    explanations: tuple[Explanation, ...]
    pairs: tuple[tuple[int, int], ...]
    values: tuple[Value, ...]
    asked: tuple[str, ...] = ()


def targets_of(search: Search, whole: Fit, diagnosis: Diagnosis | None, wanted: Sequence[str] = ()) -> Targets:
    """What a diagnosis leaves open, or what the user asks for.

    Raises
    ------
    UsageError : a name that is neither an effect nor a value, or that these logs cannot test.
    """
    for name in wanted:
        _check(name, search)
    made = _Explanations(search, whole)
    pairs = made.asked_for(wanted) if wanted or diagnosis is None else made.left_open(diagnosis)
    names = list(dict.fromkeys(name for pair in pairs for name in pair))[:_MOST]
    unknown = diagnosis is not None and diagnosis.verdict == UNKNOWN and not wanted
    first = names[0] if unknown and names else NONE if unknown else made.name_of(whole)
    names = [first, *(n for n in names if n != first)]
    explanations = tuple(_explanation(search, name, made.fits[name]) for name in names)
    places = tuple((names.index(a), names.index(b)) for a, b in pairs if a in names and b in names)
    values = [n for n in wanted if n in flat(explanations[0].fitted)] if wanted else None
    return Targets(explanations, places, _values(search, explanations[0], values), tuple(wanted))


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

    def name_of(self, fit: Fit) -> str:
        """Of the effects that the model does not have."""
        return " + ".join(t.id for t in self.search.added(fit.terms)) or NONE

    def left_open(self, diagnosis: Diagnosis) -> list[tuple[str, str]]:
        """Ties and rivals of each member; where the verdict is unknown, the best few effects alone."""
        if diagnosis.verdict == UNKNOWN or not self.found:
            return self._best_alone(3 if diagnosis.verdict == UNKNOWN else 1, diagnosis.nearest)
        pairs: list[tuple[str, str]] = []
        ranking = {c.effect: c for c in diagnosis.ranking if not c.untestable}
        whole = self.name_of(self.whole)
        for member in self.found:
            rivals = ranking[member].indistinguishable_from if member in ranking else ()
            pairs += [(whole, self.instead(member, rival)) for rival in rivals]
        if len(self.found) == 1:
            near = sorted((c for c in ranking.values() if c.effect not in self.found), key=lambda c: -c.probability)
            reach = [c.effect for c in near[:2] if c.probability > _WITHIN_REACH and self._may_be(c.effect)]
            pairs += [(whole, self.instead(self.found[0], effect)) for effect in reach]
            pairs.append((whole, NONE))
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
                names.append(self._added(name))
        return list(combinations(dict.fromkeys(names), 2))

    def instead(self, member: str, rival: str) -> str:
        """The set with a rival in the place of a member; a value of the model needs no effect for that."""
        rest = tuple(t for t in self.whole.terms if t.id != member)
        fit = self.search.fit(rest, self.whole.tap)
        if rival not in (INERTIA, DELAY):
            fit = next((o.fit for o in self.search.options(fit) if o.effect == rival), fit)
        return self._keep(fit)

    def _added(self, name: str) -> str:
        options = [o.fit for o in self.search.options(self.whole) if o.effect == name]
        return self._keep(options[0] if options else self.whole)

    def _best_alone(self, most: int, nearest: str) -> list[tuple[str, str]]:
        options = [o for o in self.search.options(self.search.refit) if self._may_be(o.effect)]
        options = [o for o in options if self._credible(o)]
        options.sort(key=lambda o: (o.effect != nearest, -o.evidence))
        alone = [self._keep(o.fit) for o in options[:most]]
        return [*combinations(alone, 2), *((name, NONE) for name in alone)]

    def _credible(self, option: Option) -> bool:
        """Whether it explains a part of what the model leaves: what does not would need any force on another motion."""
        search, rmse = self.search, self.search.problem.errors.rmse
        falls = rmse(option.fit) < (1.0 - POLICY.near_fall) * rmse(search.refit)
        return falls and option.evidence > search.evidence(search.refit)

    def _may_be(self, effect: str) -> bool:
        """A push, or a line in time, does not come again with another motion."""
        found = get_effect(effect) if find_effect(effect) is not None else None
        return found is not None and not found.listed and (found.periods is None or bool(found.needs))

    def _keep(self, fit: Fit) -> str:
        name = self.name_of(fit)
        self.fits.setdefault(name, fit)
        return name


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


def _explanation(search: Search, name: str, fit: Fit) -> Explanation:
    bank = search.solver.bank
    model = Model(fit.terms, fit.tap * bank.tap_time, bank.tap_time, fit.total, fit.widths)
    return Explanation(name, fit, model, _draws(search, fit))


def _draws(search: Search, fit: Fit) -> tuple[PlantModel, ...]:
    """The plant of a fit, and others that the logs leave as likely: normal, but within what the values allow."""
    scale, noise = search.problem.scale, search.noise
    covariance = information(fit, search.solver).covariance(noise.variance * noise.inflation)
    sizes, vectors = np.linalg.eigh(covariance)
    spread = vectors * np.sqrt(np.maximum(sizes, 0.0))
    random = np.random.default_rng(_SEED)
    given, told = search.problem.model, search.problem.values(fit).estimates

    def plant(changed: Fit) -> PlantModel:
        """With what the model says where the logs say nothing."""
        found = scale.model(changed)
        lost = {n: v for n, v in flat(given).items() if n in told and told[n].told == "not"}
        effects: dict[str, dict[str, float]] = {}
        for name, value in lost.items():
            effect, _, parameter = name.partition(".")
            if parameter:
                effects.setdefault(effect, {})[parameter] = value
        return found.changed(lost.get(DELAY), lost.get(INERTIA), effects)

    plants = [plant(fit)]
    linear = len(fit.total)
    most = np.concatenate([_WIDEST * np.abs(fit.total), np.full(len(covariance) - linear, _WIDEST)])
    most[SHARE] = 1.0
    for _ in range(DRAWS - 1):
        z = np.clip(random.standard_normal(len(spread)), -_FARTHEST, _FARTHEST)
        change = np.clip(spread @ z, -most, most)
        plants.append(plant(_changed(fit, change)))
    return tuple(plants)


def _changed(fit: Fit, change: Array) -> Fit:
    """A fit with other coefficients, and logarithms of shapes."""
    linear = len(fit.total)
    terms = list(fit.terms)
    for (i, name, value), step in zip(shapes_of(fit.terms), change[linear:], strict=True):
        terms[i] = type(terms[i]).of(terms[i].id, {**terms[i].shape, name: value * math.exp(step)})
    return replace(fit, total=fit.total + change[:linear], terms=tuple(terms))


def _values(search: Search, first: Explanation, wanted: Sequence[str] | None) -> tuple[Value, ...]:
    """Weak ones, or those that were asked for, with their slopes."""
    estimates = search.problem.values(first.fit).estimates
    if wanted is None:
        weak = [n for n, e in estimates.items() if e.told in ("weak", "not") and not e.held]
        wanted = [n for n in weak if not _of_angle(n)]
    found, at = [], _flat_of(search, first.fit)
    for name in wanted:
        value, error = estimates[name].value, estimates[name].std_error
        slope = _slope(lambda x, name=name: at(x)[name], first)  # type: ignore[misc]
        size = search.problem.recordings[0].sample_time if name == DELAY else abs(value)
        found.append(Value(name, size, error, slope))
    return tuple(found)


def _of_angle(name: str) -> bool:
    """A phase is no size."""
    effect, _, value = name.partition(".")
    return bool(value) and get_effect(effect).parameter(value).whole_turn


def _flat_of(search: Search, fit: Fit) -> Callable[[Array], dict[str, float]]:
    scale = search.problem.scale
    return lambda change: flat(scale.model(_changed(fit, change)))


def _slope(value: Callable[[Array], float], first: Explanation) -> Array:
    """Numerical, over coefficients and logarithms of shapes, shape (m,)."""
    size, total = first.model.size - 1, first.model.total
    steps = np.concatenate([1e-4 * np.maximum(np.abs(total), 1e-3 * abs(total[AT_INERTIA])), np.full(size, 1e-4)])
    steps = steps[:size]
    steps[SHARE] = 1e-3
    found = np.zeros(size)
    for i, step in enumerate(steps):
        change = np.zeros(size)
        change[i] = step
        found[i] = (value(change) - value(-change)) / (2.0 * step)
    return found
