"""Which set of effects explains the recordings: steps forward, back and sideways until nothing gets better."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cached_property
from itertools import combinations

import numpy as np

from dsd_cli.effects import Role, get_effect
from dsd_cli.identify.fit.bank import Term, Terms, has_friction
from dsd_cli.identify.fit.direction import LOAD, OneWay, best_delay, one_way
from dsd_cli.identify.fit.laws_of_u import is_law_of_u
from dsd_cli.identify.fit.priors import averaged
from dsd_cli.identify.fit.solve import Fit
from dsd_cli.identify.fit.values import Fitted, flat
from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.search.evidence import Evidence, Option, in_common_terms, preferred
from dsd_cli.identify.search.shapes import Lines, apart, names_to_try, refined, starts
from dsd_cli.signals.once import once

#: Effects that are refined in a scan: those whose best start comes within this share of the best gain; loads on the
#: motor and lags earlier, for their best shape (with the delay beside it) is narrow.
WORTH_REFINING, WORTH_FOR_NARROW = 0.5, 0.04
#: Rounds in which the shapes of the model's own effects are searched, and the gain below which they are found.
MOST_REFINEMENTS, STALLED = 6, 1e-3
#: Rounds in which several shapes of one effect are searched while it is only a candidate.
ROUNDS_IN_SCAN = 2
#: Outsiders that are fitted in the place of a member, and the share of its gain that they must have before refinement.
MOST_CHALLENGERS, WORTH_CHALLENGING = 3, 0.5
#: Pairs of effects that are cross-validated, of all that are fitted.
MOST_PAIRS = 4
#: Nats from which on an effect is there, for all that a number shows.
_SURE = 50.0

__all__ = ["Option", "Search"]


class Search(Evidence):
    """Selections of effects for a problem."""

    #: A search over a part of the rows, which finds candidates for all of them (`task.Judge`).
    excerpt: Search | None = None

    def searched(self, fit: Fit) -> tuple[Search, Fit]:
        """Where functions without a law are tried: the excerpt with the same set, if there is one, else all rows."""
        return (self, fit) if self.excerpt is None else (self.excerpt, self.excerpt.fit(fit.terms, fit.tap))

    @cached_property
    def refit(self) -> Fit:
        """The model's own effects with all values free."""
        delay = best_delay(
            self.solver, self.problem.beside, self.problem.most_tap, self.problem.tap, believed=self.problem.model.delay
        )
        return self.converged(self.fit(self.base, delay))

    @cached_property
    def before(self) -> Fit:
        """Without those of them that the climb took of the set that it is in the middle of."""
        return self.refit if self.problem.before == self.base else self.fit(self.problem.before, self.refit.tap)

    def converged(self, fit: Fit) -> Fit:
        """With the shapes of all effects refined until that gains nothing any more."""
        for _ in range(MOST_REFINEMENTS):
            before, fit = fit, self.refined(fit)
            if fit.squares > (1.0 - STALLED) * before.squares:
                break
        return fit

    @once
    def options(self, current: Fit) -> list[Option]:
        """Every allowed effect added to `current`, at its best shape; most evidence first."""
        return sorted(self._all_options(current), key=lambda o: -o.evidence)

    def _all_options(self, current: Fit) -> list[Option]:
        found = self._at_best_starts(current)
        most = max((gain for gain, *_ in found), default=0.0)
        options = []
        for gain, tap, term in found:
            terms = (*current.terms, term)
            narrow = term.effect.role is Role.STRUCTURE or term.effect.lateness is not None
            worth = gain >= (WORTH_FOR_NARROW if narrow else WORTH_REFINING) * most
            fit = self._at_its_best(terms, tap) if worth else self.solver.fit(terms, tap)
            options.append(Option(term.id, fit, self.evidence(fit)))
        return options

    def _at_its_best(self, terms: Terms, tap: int) -> Fit:
        """With the shape of the last of these effects searched from where it is."""
        return self.fit(*refined(self, terms, len(terms) - 1, tap, ROUNDS_IN_SCAN) if terms[-1].items else (terms, tap))

    def _at_best_starts(self, current: Fit, member: str = "", closely: bool = False) -> list[tuple[float, int, Term]]:
        """(gain, delay, term) of every allowed effect at the best of its starts; of laws alone in place of a member."""
        lines, scan = Lines(self.problem.errors, current), self.scan(current.terms, current.tap)
        found = []
        for effect_id in names_to_try(self.allowed, {t.id for t in current.terms}, self.ranges):
            effect = get_effect(effect_id)
            if effect.listed or (member and (effect_id == member or effect.of_time)):  # `pulses` looks for the listed
                continue
            begun = effect.closely(self.ranges) if closely else starts(effect_id, self.ranges, lines)
            terms = dict.fromkeys(Term.of(effect_id, self.solver.known.pinned(effect_id, shape)) for shape in begun)
            tried = ((*scan.gain(x, not closely), x) for x in terms if apart(x, current.terms, self.ranges))
            found += sorted(tried, key=lambda f: -f[0])[:1]
        return found

    @once
    def values(self, whole: Fit) -> Fitted:
        """Values of a set, with standard errors over it and over the same with one effect more, each as likely as the
        recordings say (Bayesian model averaging; Hoeting, Madigan, Raftery and Volinsky 1999).

        Over a small travel a spring, a cubic one and a weight differ by less than matters: one is left out, the others
        take its place, and their own standard errors know nothing of that.
        """
        found, scale = self.problem.values(whole), self.problem.scale
        options = [o for o in self.options(whole) if o.effect != LOAD or self.one_way(whole) is None]
        if not options:
            return found
        here, leads = flat(scale.model(whole)), np.array([self.lead(whole, o.fit) for o in options])
        others = [flat(scale.model(o.fit)) for o in options]
        moves = np.array([[_apart(n, there.get(n, 0.0), here[n]) for n in found.estimates] for there in others])
        odds = np.exp(np.minimum(leads, _SURE))
        known, together = averaged(found.estimates, odds, moves, self.equations.sample_time)
        return replace(found, estimates=known, correlations=together)

    @once
    def one_way(self, fit: Fit) -> OneWay | None:
        """What moves one way leave open between the dry friction of a set and a load; None where they leave nothing."""
        return one_way(self.problem.errors.bank, fit)

    def proven(self, whole: Fit) -> list[str]:
        """Of a set with both those that are there, whatever their values."""
        found = self.one_way(whole)
        return found.proven(self.problem.least_of_use(whole)) if found is not None and found.both else []

    def left_open(self, whole: Fit) -> tuple[str, ...]:
        """A load that is one column with the dry friction of a set, and may be a part of it that is of use."""
        found = self.one_way(whole)
        if found is None or found.both or LOAD not in self.allowed:
            return ()
        return (LOAD,) if found.open > self.problem.least_of_use(whole) else ()

    def challenger(self, rest: Fit, member: str, own: float) -> Option | None:
        """The best replacement of a member that gains `own`, by evidence; None if no candidate comes near it."""
        found = [f for f in self._at_best_starts(rest, member) if f[0] > WORTH_CHALLENGING * own]
        best = sorted(found, key=lambda f: -f[0])[:MOST_CHALLENGERS]
        fits = [self._at_its_best((*rest.terms, term), tap) for _, tap, term in best]
        return preferred(self, [Option(fit.terms[-1].id, fit, self.evidence(fit)) for fit in fits])

    def run(self, start: Fit, report: Callable[[float], None] = lambda _: None, *, to_friction: bool = False) -> Fit:
        """The set of effects that nothing betters any more; `to_friction`: or the first step's that has friction.

        Of a motion that is a few sines any law of it is lines in time, and a share of u is one of any law that is not
        found yet: those are asked of what the laws leave.
        """
        current = start
        while (there := len(self.added(current.terms))) < POLICY.most_effects:
            report(there / POLICY.most_effects)
            options = tuple(self.options(current))
            every = [(o, get_effect(o.effect)) for o in options]
            laws = tuple(o for o, e in every if not (e.of_time or (self.solver.inverse and is_law_of_u(e))))
            reached = self._forward(current, laws) or self._forward(current, options)
            if not reached:
                break
            current = max(reached, key=self.evidence)
            if to_friction and has_friction(current.terms):
                break
        return current

    def with_play(self, fit: Fit) -> Fit:
        """With a play in the place of lines and loads, if that has more evidence. To and fro a play leaves the same at
        the same places each time: lines explain a part of that, and beside them its valley is not seen any more."""
        others = {t for t in self.added(fit.terms) if t.effect.repeats is not None or t.effect.role is Role.STRUCTURE}
        laws = [t for t in fit.terms if t not in others]
        narrow = [e for e in map(get_effect, self.allowed) if e.valley]
        if not narrow or any(t.effect.role is Role.STRUCTURE for t in laws):
            return fit
        beside = {n for e in narrow for n in e.hidden_by if n in self.allowed} - {t.id for t in laws}
        rest = self.fit((*laws, *map(Term, sorted(beside))), fit.tap)
        if self.problem.errors.rmse(rest) < self.problem.least_missing:
            return fit
        found = [self._near(self.fit((*rest.terms, x), tap)) for _, tap, x in self._at_best_starts(rest, closely=True)]
        return max((fit, *(self._near(self.settled(x, rest)) for x in found)), key=self.evidence)

    def _near(self, fit: Fit) -> Fit:
        """With the shape of an effect that is in its narrow valley searched there."""
        at = [i for i, t in enumerate(fit.terms) if t.effect.valley]
        return self.fit(*refined(self, fit.terms, at[0], fit.tap, near=True)) if at else fit

    @once
    def _forward(self, current: Fit, options: tuple[Option, ...]) -> list[Fit]:
        """Sets with one effect more, or two, that matter."""
        forward = preferred(self, [o for o in options if self.matters(current, o.fit)])
        reached = [self.settled(forward.fit, current)] if forward is not None else []
        pair = self._best_pair(current, options)
        single = -math.inf if forward is None else self.evidence(reached[0])
        if pair is not None and self.evidence(pair) > single + POLICY.least_gain:
            reached.append(self.settled(pair, current))
        return [fit for fit in reached if self.matters(current, fit)]

    def _best_pair(self, current: Fit, options: Sequence[Option]) -> Fit | None:
        """Two effects at once, for each may be hidden behind the other: the best pair at the shapes they have alone."""
        sets: dict[int, list[Terms]] = {}
        for a, b in combinations(options, 2):
            for tap in dict.fromkeys((a.fit.tap, b.fit.tap)):
                sets.setdefault(tap, []).append((*current.terms, a.fit.terms[-1], b.fit.terms[-1]))
        tried = [(x, t, tap) for tap, pairs in sets.items() for t, x in self.solver.squares_of(pairs, tap).items()]
        ranked = sorted(tried, key=lambda p: self.nats(p[0]) + self.price(p[1]))
        return max((self.fit(terms, tap) for _, terms, tap in ranked[:MOST_PAIRS]), key=self.evidence, default=None)

    def settled(self, fit: Fit, reached: Fit | None = None) -> Fit:
        """Shapes refined together, needless members dropped, members swapped for better ones.

        reached : the set that this one goes on from; by default what the model was when the climb to it began.
        """
        for _ in range(3):
            before = fit
            found = self.refined(fit)
            fit = found if (less := self.without_needless(found, reached)) is found else self.refined(less)
            if len(self.added(fit.terms)) > 1:
                fit = self.swapped(fit)
            if fit.terms == before.terms:
                break
        if (common := in_common_terms(self, fit)) is not fit:
            less = self.without_needless(common, reached)  # commoner names of which none is certain are none
            fit = fit if self._certain(fit) and not self.matters(self.before, less) else less
        return fit

    def _certain(self, fit: Fit) -> bool:
        """Whether every member matters beside the others."""
        return all(self.matters(self.without(fit, term), fit) for term in self.added(fit.terms))

    def refined(self, fit: Fit) -> Fit:
        """With the shapes of all effects searched around where they are."""
        terms, tap = fit.terms, fit.tap
        for i, term in enumerate(terms):
            if term.effect.searched:
                terms, tap = refined(self, terms, i, tap)
        if terms == fit.terms:
            return fit
        better = self.fit(terms, tap)
        return better if better.loss < fit.loss else fit

    def without_needless(self, fit: Fit, reached: Fit | None = None) -> Fit:
        """Without members that do not matter beside the others; where two explain surely more than the set that was
        reached, and neither of them alone does, both stay."""
        reached = reached or self.before
        for term in self.added(fit.terms):
            less = self.without(fit, term)
            needless = not self.matters(less, fit)
            if needless and (self.matters(reached, less) or not self.matters(reached, fit)):
                return self.without_needless(less, reached)
        return fit

    def swapped(self, fit: Fit) -> Fit:
        """With the first member that an outsider betters replaced by it."""
        for term in self.added(fit.terms):
            rest = self.without(fit, term)
            best = self.challenger(rest, term.id, rest.squares - fit.squares)
            if best is None or best.evidence < self.evidence(fit) + 1.0:
                continue
            if self.price(best.fit.terms) <= self.price(fit.terms) or self.matters(fit, best.fit):
                return best.fit
        return fit


def _apart(name: str, one: float, other: float) -> float:
    """Between two numbers of a value, the shorter way round of a phase; none of an effect that is gone (0): whether it
    is there is another question."""
    if one == 0.0 and "." in name:
        return 0.0
    return math.remainder(one - other, 2.0 * math.pi) if name.endswith(".phase") else one - other
