"""Which set of effects explains the recordings: steps forward, back and sideways until nothing gets better.

One effect at a time would name stand-ins (drag for friction plus damping). So the search goes on to the whole set,
drops what became needless, swaps members for outsiders, and only then is asked which member is worth most on its own.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from dsd_cli.effects import Role
from dsd_cli.identify.fit.bank import Bank, Term, Terms, ranges
from dsd_cli.identify.fit.blocks import Blocks
from dsd_cli.identify.fit.rows import Equations
from dsd_cli.identify.fit.solve import Fit, Solver
from dsd_cli.identify.search.shapes import refined
from dsd_cli.identify.search.starts import Residual, starts

#: Nats that an effect costs: one of some twenty was chosen; and each shape parameter that was searched.
CHOICE, SEARCHED = 3.0, 3.0
#: And each pulse in time: its level and the two edges, found among all rows.
PULSE = 14.0
#: A step must gain so many nats beyond its price; without its best block, too, and lose little in the others.
LEAST_GAIN, MOST_LOST = 6.0, 0.3
#: Effects that are refined in a scan: those whose best start comes within this share of the best gain; loads on the
#: motor earlier, for their best shape is narrow.
WORTH_REFINING, WORTH_FOR_LOADS = 0.5, 0.04
MOST_EFFECTS = 8
#: Pairs of effects that are cross-validated, of all that are fitted.
MOST_PAIRS = 4


@dataclass(frozen=True)
class Noise:
    """variance of a whitened row; inflation: how many rows count as one, because they are not independent."""

    variance: float
    inflation: float


@dataclass(frozen=True)
class Option:
    """A set of effects with one more (or another) in it, fitted; `effect` is that one."""

    effect: str
    fit: Fit
    evidence: float


class Search:
    """Selections of effects for some equations.

    Parameters
    ----------
    base : effects that the model has; they stay.
    allowed : effects that may be added.
    practical : whether a step from one fit to another matters in practice, beyond being certain.
    """

    def __init__(
        self,
        bank: Bank,
        blocks: Blocks,
        base: Terms,
        allowed: Sequence[str],
        noise: Noise,
        practical: Callable[[Fit, Fit], bool],
        most_tap: int,
    ) -> None:
        self.bank, self.solver = bank, Solver(bank, blocks)
        self.base, self.allowed, self.noise = base, tuple(allowed), noise
        self.practical, self.most_tap = practical, most_tap
        self.ranges = ranges(bank.equations)
        self._options: dict[tuple[Terms, int], list[Option]] = {}

    @property
    def equations(self) -> Equations:
        """Of the bank."""
        return self.bank.equations

    # -- evidence --------------------------------------------------------------------------------------------------

    def evidence(self, fit: Fit) -> float:
        """Held-out log-likelihood (up to a constant) less the price of the effects beyond the model's, nats."""
        return -fit.loss / (2.0 * self.noise.variance * self.noise.inflation) - self.price(fit.terms)

    def price(self, terms: Terms) -> float:
        """Nats for having chosen these effects and searched their shapes."""
        added = [t for t in terms if t.id not in {b.id for b in self.base}]
        return sum(CHOICE + SEARCHED * t.effect.searched + PULSE * len(t.shape.get("edges", ())) for t in added)

    def gains(self, before: Fit, after: Fit) -> np.ndarray:
        """Nats per block, shape (B,), without prices."""
        return (before.losses - after.losses) / (2.0 * self.noise.variance * self.noise.inflation)

    def matters(self, before: Fit, after: Fit) -> bool:
        """Whether going from one fit to the other is certain and of use."""
        gain = self.evidence(after) - self.evidence(before)
        if gain < LEAST_GAIN:
            return False
        return _agreed(self.gains(before, after)) and self.practical(before, after)

    # -- fits ------------------------------------------------------------------------------------------------------

    def fit(self, terms: Terms, near: int) -> Fit:
        """At the best delay near `near` samples, walking on while the edge of the neighbourhood is best."""
        tap = near
        while True:
            fit = self.solver.best(terms, self.around(tap))
            if fit.tap in (tap, 0, self.most_tap) or abs(fit.tap - tap) < 1:
                return fit
            tap = fit.tap

    def around(self, tap: int) -> list[int]:
        """The delay and its neighbours, samples."""
        return [n for n in (tap, tap - 1, tap + 1) if 0 <= n <= self.most_tap]

    def taps_for(self, term: Term, tap: int) -> list[int]:
        """Delays to try with an effect: a lag has been taken for delay before it was known."""
        if term.id != "actuator_lag":
            return self.around(tap)
        lag = round(term.shape["time_constant"] / self.equations.sample_time)
        return sorted({max(tap - lag + d, 0) for d in (-1, 0, 1)} | {max(tap - lag // 2, 0)})

    # -- steps -----------------------------------------------------------------------------------------------------

    def options(self, current: Fit) -> list[Option]:
        """Every allowed effect added to `current`, at its best shape; most evidence first."""
        key = (current.terms, current.tap)
        if key not in self._options:
            self._options[key] = self._all_options(current)
        return self._options[key]

    def _all_options(self, current: Fit) -> list[Option]:
        residual = Residual(self.equations, current)
        here = {t.id for t in current.terms}
        found: list[tuple[float, Term, int]] = []
        for effect_id in self.allowed:
            if effect_id not in here and effect_id != "external_force":
                best = self._best_start(current, effect_id, residual)
                if best is not None:
                    found.append(best)
        if not found:
            return []
        least = min(squares for squares, _, _ in found)
        worth, worth_load = (
            current.squares - share * (current.squares - least) for share in (WORTH_REFINING, WORTH_FOR_LOADS)
        )
        options = []
        for squares, term, tap in found:
            terms = (*current.terms, term)
            if term.items and squares <= (worth_load if term.effect.role is Role.STRUCTURE else worth):
                terms, tap = refined(self, terms, len(terms) - 1, tap)
            fit = self.fit(terms, tap)
            options.append(Option(term.id, fit, self.evidence(fit)))
        return sorted(options, key=lambda o: -o.evidence)

    def _best_start(self, current: Fit, effect_id: str, residual: Residual) -> tuple[float, Term, int] | None:
        terms = [Term.of(effect_id, shape) for shape in starts(effect_id, self.ranges, residual)]
        best = None
        for term in terms:
            taps = self.taps_for(term, current.tap) if term.effect.role is Role.INPUT else [current.tap]
            for tap in taps:
                squares = self.solver.squares((*current.terms, term), tap)
                if best is None or squares < best[0]:
                    best = (squares, term, tap)
        return best

    def run(self, start: Fit, report: Callable[[float], None] = lambda _: None) -> Fit:
        """The set of effects that nothing betters any more."""
        current = start
        for step in range(MOST_EFFECTS):
            report(step / MOST_EFFECTS)
            options = self.options(current)
            forward = self.preferred([o for o in options if self.matters(current, o.fit)])
            reached = [self.settled(forward.fit)] if forward is not None else []
            pair = self._best_pair(current, options)
            if pair is not None and (forward is None or self.evidence(pair) > self.evidence(reached[0]) + LEAST_GAIN):
                reached.append(self.settled(pair))
            reached = [fit for fit in reached if self.matters(current, fit)]
            if not reached:
                break
            current = max(reached, key=self.evidence)
        return current

    def _best_pair(self, current: Fit, options: Sequence[Option]) -> Fit | None:
        """Two effects at once, for each may be hidden behind the other: the best pair at the shapes they have alone."""
        found = [(o.fit.terms[-1], o.fit.tap) for o in options]
        pairs = [
            ((*current.terms, a, b), tap)
            for (a, tap_a), (b, tap_b) in combinations(found, 2)
            for tap in dict.fromkeys((tap_a, tap_b))
        ]
        if not pairs:
            return None
        nats = 2.0 * self.noise.variance * self.noise.inflation
        ranked = sorted(pairs, key=lambda p: self.solver.squares(*p) / nats + self.price(p[0]))
        return max((self.fit(terms, tap) for terms, tap in ranked[:MOST_PAIRS]), key=self.evidence)

    def preferred(self, options: Sequence[Option]) -> Option | None:
        """The one with most evidence; a cheaper one if the difference does not matter in practice."""
        if not options:
            return None
        best = max(options, key=lambda o: o.evidence)
        cheaper = [o for o in options if self.price(o.fit.terms) < self.price(best.fit.terms)]
        as_good = [o for o in cheaper if not self.practical(o.fit, best.fit)]
        return max(as_good, key=lambda o: o.evidence) if as_good else best

    def settled(self, fit: Fit) -> Fit:
        """Shapes refined together, needless members dropped, members swapped for better ones."""
        for _ in range(3):
            before = fit
            fit = self.refined(self._without_needless(self.refined(fit)))
            if len(self.added(fit.terms)) > 1:
                fit = self._swapped(fit)
            if fit.terms == before.terms:
                break
        return fit

    def added(self, terms: Terms) -> Terms:
        """Those that the model does not have."""
        return tuple(t for t in terms if t.id not in {b.id for b in self.base})

    def refined(self, fit: Fit) -> Fit:
        """With the shapes of all effects searched around where they are."""
        terms, tap = fit.terms, fit.tap
        for i, term in enumerate(terms):
            if term.items and term.id != "external_force":
                terms, tap = refined(self, terms, i, tap)
        if terms == fit.terms:
            return fit
        better = self.fit(terms, tap)
        return better if better.loss < fit.loss else fit

    def _without_needless(self, fit: Fit) -> Fit:
        for term in self.added(fit.terms):
            less = self.fit(tuple(t for t in fit.terms if t != term), fit.tap)
            if not self.matters(less, fit):
                return self._without_needless(less)
        return fit

    def _swapped(self, fit: Fit) -> Fit:
        for term in self.added(fit.terms):
            rest = self.fit(tuple(t for t in fit.terms if t != term), fit.tap)
            best = self.preferred(self.options(rest))
            if best is None or best.effect == term.id or best.evidence < self.evidence(fit) + 1.0:
                continue
            if self.price(best.fit.terms) <= self.price(fit.terms) or self.practical(fit, best.fit):
                return best.fit
        return fit


def _agreed(gains: np.ndarray) -> bool:
    """Whether the blocks agree that it is a gain: not one block alone, and few blocks lose. Gains may be as unequal
    as they like: a cubic spring shows where the axis goes far."""
    lost = -float(gains[gains < 0.0].sum())
    won = float(gains[gains > 0.0].sum())
    return won - float(gains.max()) - lost > LEAST_GAIN and lost < MOST_LOST * won
