"""What a motion is expected to identify: nats for each pair of explanations, standard errors of values.

If A is the plant, B explains a motion but for |(I - P_B) x_A|^2 / 2 s^2 nats: x_A is what A does on it, P_B projects on
all that B may fit (its own columns, inertia, delay, the other effects, slopes over its shapes), s the noise of the rows
that the log has shown. Both are inner products of rows, so those of a log and of parts of a motion add up. B may also
take another shape altogether: the least over these counts. The mean over plants that the logs leave as likely for A.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from dsd_cli.design.explanations import Explanation
from dsd_cli.design.inverse import Path, command_for
from dsd_cli.design.limits import Limits
from dsd_cli.design.reach import Reach, other_shapes
from dsd_cli.design.rows import LikeLogs, Model, MotionRows, Products, left, variance_of
from dsd_cli.design.targets import Targets
from dsd_cli.effects import Ranges
from dsd_cli.identify.fit.bank import INERTIA, has_friction
from dsd_cli.identify.fit.direction import drowns, moved_by
from dsd_cli.identify.fit.equations import Equations
from dsd_cli.identify.fit.values import whole_inertia
from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.search.sets import Search
from dsd_cli.signals.log import Array


@dataclass(frozen=True)
class Case:
    """Inner products that are asked for: plant number `draw` of an explanation, under the effects of another."""

    truth: int
    draw: int
    rival: int
    model: Model


@dataclass(frozen=True)
class Expected:
    """nats : (truth, rival) -> lead of the truth, by the places of explanations. of_use : its power over the least one
    that is of use: below 1 the two explain the same, however many nats there are. errors : of values, by name. ranges :
    of nats, the least and the most of the plants that were simulated."""

    nats: Mapping[tuple[int, int], float]
    of_use: Mapping[tuple[int, int], float]
    errors: Mapping[str, float]
    ranges: Mapping[tuple[int, int], tuple[float, float]] = field(default_factory=dict)


class Expectation:
    """Expected evidence on top of the logs of a search.

    draws : plants of each explanation that are averaged over. only : names of the targets that count; None: all.
    limits : of the motion; None: what the logs reached.
    """

    def __init__(
        self,
        search: Search,
        targets: Targets,
        draws: int,
        only: frozenset[str] | None = None,
        limits: Limits | None = None,
    ) -> None:
        self.search, self.targets, self.draws, self._only, self._limits = search, targets, draws, only, limits
        ranges = search.ranges if limits is None else ranges_within(search.ranges, limits)
        self.cases = cases_of(search, targets, draws, ranges)
        asked = {0, *(i for pair in targets.pairs for i in pair)}
        self.held = any(has_friction(e.fit.terms) for i, e in enumerate(targets.explanations) if i in asked)
        self.reach = Reach.beside(search, targets.explanations[0].model, ranges)
        #: Of all inner products: the cases', and at the end those of the reach.
        self._asked = [*self.cases, Case(0, 0, 0, self.reach.model)]
        self._size = max(case.model.size for case in self._asked)
        self.inverse = search.solver.inverse
        self.longest_delay = max(m.delay for e in targets.explanations for m in e.draws)
        self.like = LikeLogs.of(search, self.longest_delay, self.held)

    @cached_property
    def of_logs(self) -> Products:
        """Inner products of the logs, shape (cases + 1, P, P): of the reach at the end."""
        equations = self.search.equations
        rows, made = MotionRows(equations), dict[Model, Array]()
        for case in self._asked:
            if case.model not in made:
                made[case.model] = rows.gram(case.model)
        moved = moved_by(self.search.problem.errors.bank, self.targets.explanations[0].fit.tap)
        return self._filled([made[case.model] for case in self._asked], equations, moved)

    @property
    def nothing(self) -> Products:
        """Inner products of no motion."""
        return Products(0, np.zeros((len(self._asked), self._size, self._size)), np.zeros(2))

    def most_u(self, path: Path, most: float) -> float:
        """Largest |u| that a plant needs for a motion, up to `most`."""
        return max(float(np.abs(u).max()) for _, u in self._commanded({0: path}, most).values())

    def _commanded(self, paths: Mapping[int, Path], most: float) -> dict[tuple[int, int], tuple[Path, Array]]:
        """(explanation, draw) -> path, and what this plant needs for it, no more than `most`."""
        every = dict.fromkeys((c.truth, c.draw) for c in self.cases)
        path = {key: paths.get(key[0], paths[0]) for key in every}
        return {(e, d): (x, command_for(self.targets.explanations[e].draws[d], x, most)) for (e, d), x in path.items()}

    def of_paths(self, paths: Mapping[int, Path], most: float) -> Products:
        """Inner products of a motion that each plant makes exactly, with no more than so large a u.

        paths : explanation -> its path; that of the first (0) where there is none.
        """
        first, made = dict[int, MotionRows](), dict[tuple[int, int], MotionRows]()
        for key, (path, u) in self._commanded(paths, most).items():
            if id(path) not in first:
                first[id(path)] = MotionRows(self.like.equations(path, u))
            rows = first[id(path)]
            made[key] = rows.under(u) if rows.equations.stretches else rows
        return self._filled(
            [
                rows.gram(case.model) if rows.equations.stretches else np.zeros((case.model.size,) * 2)
                for case in self._asked
                for rows in [made[case.truth, case.draw]]
            ],
            made[0, 0].equations,
            made[0, 0].moved(self.targets.explanations[0].model) if made[0, 0].equations.stretches else np.zeros(2),
        )

    def _filled(self, grams: Sequence[Array], equations: Equations, moved: Array) -> Products:
        found = self.nothing.grams
        for i, gram in enumerate(grams):
            found[i, : len(gram), : len(gram)] = gram
        return Products(equations.counted, found, moved)

    def expected(self, planned: Products) -> Expected:
        """Of the logs and a motion with these inner products: truth and rival have one choice of values for both."""
        nats, of_use, u_of_logs, inverse = {}, {}, self._u_of_logs, self._inverse_with(planned)
        for pair, some in self._leads(planned.grams, inverse).items():
            loss, squares = self._left_by(pair, inverse)
            nats[pair] = float(np.mean([self._in_nats(loss, planned.rows, *one) for one in some]))
            of_use[pair] = min(self._of_use(squares[1] - squares[0] + lead, u_of_logs + u) for lead, u in some)
        return Expected(nats, of_use, self._errors(planned))

    def _inverse_with(self, planned: Products) -> bool:
        """Whether u on the motion will be evidence of logs and motion (`fit.direction`)."""
        js, now = (whole_inertia(self.targets.explanations[0].fit), self.search.problem.model.inertia), self.inverse
        if drowns(self.of_logs.moved, *js) != now:  # something else decided, and will
            return now
        return drowns(self.of_logs.moved + planned.moved, *js)

    def _of_use(self, lead: float, u: float) -> float:
        """A lead in squares over the least that is of use, where u has so large ones (`Problem.least_of_use`)."""
        least = POLICY.least_unknown if self.held else POLICY.least_force
        return lead / (least**2 * u)

    @cached_property
    def now(self) -> dict[tuple[int, int], float]:
        """(truth, rival) -> nats by which the logs prefer the truth: what the search says, but for prices."""
        pairs = {(c.truth, c.rival) for c in self.cases if c.truth != c.rival}
        left = [self.search.nats(e.fit.loss) for e in self.targets.explanations]
        return {(truth, rival): left[rival] - left[truth] for truth, rival in sorted(pairs)}

    def _left_by(self, pair: tuple[int, int], inverse: bool) -> Array:
        """What truth and rival leave in the logs in a form, held out and in all, in squares; shape (2, 2)."""
        if inverse == self.inverse:
            fits = [self.targets.explanations[i].fit for i in pair]
            return np.array([[fit.loss for fit in fits], [fit.squares for fit in fits]])
        return np.array(2 * [[self._left_now[inverse][self._own[i, 0]] for i in pair]])

    @property
    def _u_of_logs(self) -> float:
        """Square of u in the rows of the logs."""
        return float(self.of_logs.grams[0, 0, 0])

    def _leads(self, grams: Array, inverse: bool) -> dict[tuple[int, int], list[tuple[float, float]]]:
        """(truth, rival) -> of each draw, by how much more a motion adds to what the rival leaves than to what the
        truth leaves, and all of its u, in squares; of a rival's shapes the one that then leaves least."""
        squares, before = self._squares((self.of_logs.grams + grams)[:-1], inverse), self._left_now[inverse]
        fitted: dict[tuple[int, int, int], int] = {}  # each begins with the shapes of its fit
        least: dict[tuple[int, int, int], float] = {}
        for i, case in enumerate(self.cases):
            if case.truth != case.rival:
                key = (case.truth, case.rival, case.draw)
                fitted.setdefault(key, i)
                least[key] = min(least.get(key, np.inf), float(squares[i]))
        leads: dict[tuple[int, int], list[tuple[float, float]]] = {}
        for (a, b, draw), joint in least.items():
            i, j = self._own[a, draw], fitted[a, b, draw]
            lead = float(joint - before[j] - (squares[i] - before[i]))
            leads.setdefault((a, b), []).append((max(lead, 0.0), float(grams[i, 0, 0])))
        return leads

    @cached_property
    def _own(self) -> dict[tuple[int, int], int]:
        """(explanation, draw) -> place of the case in which it is the truth and explains itself."""
        return {(c.truth, c.draw): i for i, c in enumerate(self.cases) if c.truth == c.rival}

    @cached_property
    def _left_now(self) -> dict[bool, Array]:
        """Sums of squares in the logs, shape (cases,), by whether the inverse form is evidence."""
        return {inverse: self._squares(self.of_logs.grams[:-1], inverse) for inverse in (False, True)}

    def _in_nats(self, loss: Sequence[float], rows: float, lead: float, u: float) -> float:
        """Nats of logs and motion together, as the search counts them: of both (truth and rival, which leave `loss` in
        the logs) the motion adds the noise of its rows and, for its u (`u`, in squares), what the truth leaves in the
        logs beyond the noise; of the rival a lead."""
        noise = self.search.noise.variance
        misfit = self.targets.doubt * max(loss[0] - self.of_logs.rows * noise, 0.0) / max(self._u_of_logs, 1e-300)
        truth, rival = (x + rows * noise + misfit * u for x in loss)
        return self.search.nats(rival + lead, rows) - self.search.nats(truth, rows)

    def _squares(self, grams: Array, inverse: bool) -> Array:
        """Sums of squares of a form, shape (cases,); where the logs have no word on J, that of the plant."""
        inertia = self.targets.explanations[0].fitted.inertia if self.inverse else self.search.solver.inertia
        return left(grams, 0) if inverse else inertia**2 * left(grams, 1 + INERTIA)

    def _errors(self, planned: Products) -> dict[str, float]:
        if not self.targets.values:
            return {}
        grams = self._with_logs(planned).grams
        own = [i for i, c in enumerate(self.cases) if c.truth == c.rival == 0]
        size = self.targets.explanations[0].model.size
        before = self.of_logs.grams[own[0], 1:size, 1:size]
        after = np.mean(grams[own, 1:size, 1:size], axis=0)
        floor = self.search.noise.variance * self.search.noise.inflation
        found = {}
        for value in self.targets.values:
            was, now = (variance_of(normal, value.slope) for normal in (before, after))
            known = np.isfinite(value.error) and value.error > 0.0
            found[value.name] = value.error * float(np.sqrt(now / was)) if known else float(np.sqrt(floor * now))
        return found

    def _with_logs(self, planned: Products) -> Products:
        """Information of both; of the motion alone, where none of the explanations may hold for the logs."""
        return planned if self.targets.unknown else self.of_logs + planned


def cases_of(search: Search, targets: Targets, draws: int, ranges: Ranges) -> list[Case]:
    """Of all pairs in both directions, and of the truth under itself; the first explanation in any case.

    ranges : what logs and motion together may contain.
    """
    explanations, ids = targets.explanations, [{t.id for t in e.fit.terms} for e in targets.explanations]
    # a rival that has all effects of the truth explains any motion as well, and only its price decides
    pairs = {(a, b) for pair in targets.pairs for a, b in (pair, pair[::-1]) if not ids[a] <= ids[b]}
    pairs |= {(a, a) for p in pairs for a in p} | {(0, 0)}
    shapes = [_shapes(search, e, ranges) for e in explanations]
    return [
        Case(a, d, b, model)
        for a, b in sorted(pairs)
        for d in range(min(draws, len(explanations[a].draws)))
        for model in (shapes[b] if a != b else (explanations[b].model,))
    ]


def _shapes(search: Search, rival: Explanation, ranges: Ranges) -> tuple[Model, ...]:
    """Of a rival: as fitted, and its added effects at other starting shapes."""
    found = [rival.model]
    for term in search.added(rival.fit.terms):
        for other in other_shapes(term, ranges):
            terms = tuple(other if t == term else t for t in rival.fit.terms)
            found.append(replace(rival.model, terms=terms))
    return tuple(found)


def ranges_within(found: Ranges, limits: Limits) -> Ranges:
    """What logs contain, and a motion that goes as far as the limits."""
    return found._replace(
        top_speed=max(found.top_speed, limits.velocity),
        travel=max(found.travel, limits.high - limits.low),
        top_drive=max(found.top_drive, limits.u),
    )
