"""What a motion is expected to identify: nats for each pair of explanations, standard errors of values.

If A is the plant, B explains a motion but for |(I - P_B) x_A|^2 / 2 s^2 nats: x_A is what A does on it, P_B projects on
all that B may fit (its own columns, inertia, delay, the other effects, slopes over its shapes), s the noise of the rows
that the log has shown. Both are inner products of rows, so those of a log and of parts of a motion add up. B may also
take another shape altogether: the least over these counts. The mean over plants that the logs leave as likely for A.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from dsd_cli.effects import get_effect
from dsd_cli.identify.design.inverse import Path, as_recording, command_for
from dsd_cli.identify.design.rows import Model, MotionRows, equations_like, left
from dsd_cli.identify.design.targets import Explanation, Targets, apart
from dsd_cli.identify.fit.bank import Term, has_friction
from dsd_cli.identify.fit.equations import Equations
from dsd_cli.identify.search.sets import Search
from dsd_cli.signals.log import Array

#: Other shapes that a rival may take.
_MOST_SHAPES = 3
#: Nats below which all is nothing, and from which on (of a value: (value / standard error)^2 / 2) nothing is open.
LEAST, ENOUGH = 1e-3, 50.0


@dataclass(frozen=True)
class Expected:
    """nats : (truth, rival) -> lead of the truth, by the places of explanations. errors : of values, by name."""

    nats: Mapping[tuple[int, int], float]
    errors: Mapping[str, float]


@dataclass(frozen=True)
class Case:
    """Inner products that are asked for: plant number `draw` of an explanation, under the effects of another."""

    truth: int
    draw: int
    rival: int
    model: Model


class Measure:
    """Expected evidence on top of the logs of a search.

    Parameters
    ----------
    draws : plants of each explanation that are averaged over. only : names of the targets that count; None: all.
    """

    def __init__(self, search: Search, targets: Targets, draws: int, only: frozenset[str] | None = None) -> None:
        self.search, self.targets, self.draws, self._only = search, targets, draws, only
        self.cases = self._cases(targets.explanations)
        self.held = any(has_friction(e.fit.terms) for e in targets.explanations)
        self._size = max(case.model.size for case in self.cases)
        self.template = search.problem.recordings[0]
        self.longest_delay = max(m.delay for e in targets.explanations for m in e.draws)

    @property
    def known(self) -> Equations:
        """Rows of the logs."""
        return self.search.equations

    def _cases(self, explanations: Sequence[Explanation]) -> list[Case]:
        pairs = {p for a, b in self.targets.pairs for p in ((a, b), (b, a)) if not _within(explanations, *p)}
        pairs |= {(a, a) for p in pairs for a in p} | {(0, 0)}
        shapes = [self._shapes(e) for e in explanations]
        return [
            Case(a, d, b, model)
            for a, b in sorted(pairs)
            for d in range(min(self.draws, len(explanations[a].draws)))
            for model in (shapes[b] if a != b else (explanations[b].model,))
        ]

    def _shapes(self, rival: Explanation) -> tuple[Model, ...]:
        """Of a rival: as fitted, and its added effects at other starting shapes."""
        added, found = self.search.added(rival.fit.terms), [rival.model]
        for term in added:
            if not term.effect.searched or term.effect.listed:
                continue
            starts = get_effect(term.id).starts(self.search.ranges)
            for shape in starts[:: max(len(starts) // _MOST_SHAPES, 1)][:_MOST_SHAPES]:
                terms = tuple(Term.of(t.id, shape) if t == term else t for t in rival.fit.terms)
                found.append(replace(rival.model, terms=terms))
        return tuple(found)

    @cached_property
    def of_logs(self) -> Array:
        """Inner products of the logs, shape (cases, P, P)."""
        rows, made = MotionRows(self.known), dict[Model, Array]()
        for case in self.cases:
            if case.model not in made:
                made[case.model] = rows.gram(case.model)
        return self._filled([made[case.model] for case in self.cases])

    @property
    def nothing(self) -> Array:
        """Inner products of no motion."""
        return np.zeros((len(self.cases), self._size, self._size))

    def most_u(self, path: Path, most: float) -> float:
        """Largest |u| that a plant needs for a motion, up to `most`."""
        return max(float(np.abs(u).max()) for u in self._commands(path, most).values())

    def of_path(self, path: Path, most: float) -> Array:
        """Inner products of a motion that each plant makes exactly, with no more than so large a u."""
        return self.of_runs({key: (path, u) for key, u in self._commands(path, most).items()})

    def _commands(self, path: Path, most: float) -> dict[tuple[int, int], Array]:
        keys = dict.fromkeys((c.truth, c.draw) for c in self.cases)
        return {(e, d): command_for(self.targets.explanations[e].draws[d], path, most) for e, d in keys}

    def of_runs(self, runs: Mapping[tuple[int, int], tuple[Path, Array]]) -> Array:
        """Inner products of motions: (explanation, draw) -> the path that this plant took, and its command."""
        paths, made = dict[int, MotionRows](), dict[tuple[int, int], MotionRows]()
        for key, (path, u) in runs.items():
            if id(path) not in paths:
                paths[id(path)] = MotionRows(self.equations_of(path, u))
            rows = paths[id(path)]
            made[key] = rows.under(u) if rows.equations.stretches else rows
        return self._filled(
            [
                rows.gram(case.model) if rows.equations.stretches else np.zeros((case.model.size,) * 2)
                for case in self.cases
                for rows in [made[case.truth, case.draw]]
            ]
        )

    def equations_of(self, path: Path, u: Array) -> Equations:
        """Rows of a planned motion like those of the logs; the axis rests before and after it."""
        recording = as_recording(self.template, path, u, self.search.problem.model.rest_speed)
        return equations_like(self.known, recording, self.longest_delay, self.held)

    def _filled(self, grams: Sequence[Array]) -> Array:
        found = self.nothing
        for i, gram in enumerate(grams):
            found[i, : len(gram), : len(gram)] = gram
        return found

    def expected(self, planned: Array) -> Expected:
        """Of the logs and a motion with these inner products."""
        grams = self.of_logs + planned
        squares = self.search.solver.inertia**2 * left(grams)
        own = {(c.truth, c.draw): s for c, s in zip(self.cases, squares, strict=True) if c.truth == c.rival}
        least: dict[tuple[int, int, int], float] = {}
        for case, s in zip(self.cases, squares, strict=True):
            if case.truth != case.rival:
                key = (case.truth, case.rival, case.draw)
                least[key] = min(least.get(key, np.inf), float(s - own[case.truth, case.draw]))
        leads: dict[tuple[int, int], list[float]] = {}
        for (a, b, _), lead in least.items():
            leads.setdefault((a, b), []).append(lead / self.search.noise.nats)
        nats = {pair: float(np.mean(some)) for pair, some in leads.items()}
        return Expected(nats, self._errors(grams))

    def _errors(self, grams: Array) -> dict[str, float]:
        if not self.targets.values:
            return {}
        own = [i for i, c in enumerate(self.cases) if c.truth == c.rival == 0]
        size = self.targets.explanations[0].model.size
        before = self.of_logs[own[0], 1:size, 1:size]
        after = np.mean(grams[own, 1:size, 1:size], axis=0)
        floor = self.search.noise.variance * self.search.noise.inflation
        found = {}
        for value in self.targets.values:
            was, now = (_variance(normal, value.slope) for normal in (before, after))
            known = np.isfinite(value.error) and value.error > 0.0
            found[value.name] = value.error * float(np.sqrt(now / was)) if known else float(np.sqrt(floor * now))
        return found

    def nats(self, planned: Array) -> dict[str, float]:
        """Of every target: "a, not b" where a is true, and of a value (value / error)^2 / 2."""
        found = self.expected(planned)
        nats = {self._name(*pair): lead for pair, lead in found.nats.items()}
        for v in self.targets.values:
            nats[v.name] = 0.5 * (v.size / max(found.errors[v.name], 1e-300)) ** 2
        return nats

    def _name(self, truth: int, rival: int) -> str:
        names = [self.targets.explanations[i].name for i in (truth, rival)]
        return ", not ".join(apart(*names))

    def told_apart(self, expected: Expected, a: int, b: int) -> float:
        """Nats of the smaller direction of a pair; a direction that no motion identifies, or whose truth the logs
        have ruled out, is not counted beside the other."""
        found = {self._name(*p): expected.nats[p] for p in ((a, b), (b, a)) if p in expected.nats}
        told = {name: nats for name, nats in found.items() if name in self.open}
        return min((told or found).values())

    @cached_property
    def open(self) -> frozenset[str]:
        """Targets that count."""
        names = frozenset(self.nats(self.nothing)) - self.ruled_out
        return names if self._only is None else names & self._only

    @cached_property
    def ruled_out(self) -> frozenset[str]:
        """Directions "a, not b" with b so far ahead of a by the logs that a is not the truth: no motion is for them."""
        now = self.expected(self.nothing).nats
        return frozenset(self._name(*pair) for pair, lead in now.items() if lead < -ENOUGH)

    def without(self, names: Sequence[str]) -> Measure:
        """The same without these targets."""
        return Measure(self.search, self.targets, self.draws, self.open - set(names)) if names else self

    def smallest(self, planned: Array) -> float:
        """Expected nats of the target that is identified least."""
        nats = self.nats(planned)
        return min(nats[name] for name in self.open)

    def worth(self, planned: Array) -> float:
        """Logarithm of the smallest expected nats; a little of their mean."""
        nats = self.nats(planned)
        logs = np.log(np.maximum([nats[name] for name in self.open], LEAST))
        return float(logs.min() + 0.05 * np.minimum(logs, 8.0).mean())


def _within(explanations: Sequence[Explanation], truth: int, rival: int) -> bool:
    """Whether the rival has all effects of the truth: then it explains any motion as well, and only its price
    decides."""
    ids = [{t.id for t in explanations[i].fit.terms} for i in (truth, rival)]
    return ids[0] <= ids[1]


def _variance(normal: Array, slope: Array) -> float:
    """Of a value per variance of a row, by the inverse of the normal matrix."""
    size = np.sqrt(np.maximum(np.diag(normal), 1e-300))
    inverse = np.linalg.pinv(normal / np.outer(size, size), rcond=1e-10, hermitian=True)
    found = float((slope / size) @ inverse @ (slope / size))
    return max(found, 1e-300)
