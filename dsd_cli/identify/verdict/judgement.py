"""The verdict on a search, and the whole answer: what is named, how sure, beside what else."""

from __future__ import annotations

import math
from dataclasses import replace

from dsd_cli.effects import get_effect
from dsd_cli.identify.fit.solve import Fit
from dsd_cli.identify.fit.values import Fitted
from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.results import INERTIA, NONE, UNKNOWN, Candidate, Ceiling, Diagnosis, Missing, Score
from dsd_cli.identify.search.sets import Option, Search
from dsd_cli.identify.verdict.belief import without_imitating
from dsd_cli.identify.verdict.contradictions import contradictions
from dsd_cli.identify.verdict.discrepancy import (
    Discrepancy,
    above_floor,
    before_climb,
    in_creeping,
    only_at_stops,
    said_of_left,
    weightless,
)
from dsd_cli.identify.verdict.limits import Limits, advice_for
from dsd_cli.identify.verdict.own_values import ParameterCheck
from dsd_cli.identify.verdict.probability import (
    Membership,
    hidden_in_friction,
    left_over,
    lowering_together,
    missing_of,
    nothing_missing,
    perhaps_missing,
    probabilities,
    probability_of,
    surest_of,
    unexplained_of,
)
from dsd_cli.identify.verdict.resonance import Resonance, note_on


class Verdict:
    """Derives the verdict from the search and assembles the result."""

    def __init__(
        self,
        search: Search,
        options: list[Option],
        whole: Fit,
        members: dict[str, Membership],
        own: ParameterCheck,
        beyond: Discrepancy,
        shown: Resonance,
        limits: Limits,
    ) -> None:
        self.search, self.problem, self.seen, self.shown = search, search.problem, shown.seen, shown
        self.options, self.whole, self.members, self.own = options, whole, members, own
        self.limits, self._named_for = limits, dict[str, str]()
        imitating = {name for name, member in members.items() if member.imitates}
        self.named_part, self.beyond = without_imitating(search, whole, imitating, beyond)
        self.surest, self.alone = surest_of(search, whole, limits), {o.effect: o for o in options}
        for one in self._members_alone():
            self.alone[one.effect] = max(self.alone.get(one.effect, one), one, key=lambda o: o.evidence)
        self.together = lowering_together(search, self.named_part, own.refitted.heldout_rmse)
        self.rising = self.doubted = ""  # it would be named, but the error rises with it; it stands in for another law
        self.named, self.sure = self.verdict()
        most = min(self.surest, POLICY.even if self.named == UNKNOWN else 1.0)
        self.missing = missing_of(members, most, dict.fromkeys((self.named, *self._named_for.values()), self.sure))
        if self.named == UNKNOWN and not (members or limits.blocked):
            self.own, self.missing = own.beside_unknown(beyond, self.surest)
        if self.named in members and not beyond.unknown:
            self.missing += perhaps_missing(search, whole, limits) or hidden_in_friction(search, whole, members)
        if self.named in self.alone:  # what is to be added takes the shapes of the model's own effects along
            fit = search.converged(self.alone[self.named].fit)
            self.alone[self.named] = Option(self.named, fit, search.evidence(fit))

    def _members_alone(self) -> list[Option]:
        """Effects of the set alone, in the shape and at the delay that they have there: candidates of the search began
        elsewhere, and pulses are none. A second line of one kind is nothing without the first."""
        search, added = self.search, self.search.added(self.whole.terms)
        asked = [t for t in added if t.id in self.alone or t.effect.listed]
        base = tuple(t for t in self.whole.terms if t not in added)
        fits = [search.fit((*base, t), self.whole.tap) for t in asked]
        return [Option(fit.terms[-1].id, fit, search.evidence(fit)) for fit in fits]

    def verdict(self) -> tuple[str, float]:
        """(verdict, probability)."""
        search, beyond = self.search, self.beyond
        if self.limits.blocked:
            return self._unknown()
        if self.seen is not None:
            return self.seen.effect, POLICY.surest / (1.0 + len(self.seen.rivals))
        if self.shown.other is not None:
            return self.own.wrong, self.own.probability
        if self.members:
            return self._of_members()
        known = self._share_of_possible(self.own.score.heldout_rmse, self.own.refitted.heldout_rmse)
        above, surest = above_floor(search, search.refit), min(self.surest, self.limits.surest_of_nothing)
        likely, varies = known * self.own.probability, beyond.unknown and beyond.of_gain  # then no one inertia is right
        if self.own.wrong and known >= POLICY.share_of_possible and not above and not varies:
            return self.own.wrong, min(likely, surest)
        if beyond.unknown or above or self.shown.said:
            return self._unknown()
        return NONE, min(nothing_missing(search, self.options, beyond), surest)

    def _unknown(self) -> tuple[str, float]:
        """As sure as what is left of u is a force; a push above the band, or play, is rather there than not."""
        likely = left_over(self.search, self.named_part, self.beyond)
        return UNKNOWN, min(max(likely, POLICY.even if self.shown.said else 0.0), self.limits.surest)

    def _of_members(self) -> tuple[str, float]:
        """(verdict, probability) where effects were found: the one that is worth most."""
        best, rmse = self._first(), self.problem.errors.rmse
        member = self.members[best]
        group = [name for name in (best, *member.alike) if self._lowers(name)]
        if not group or weightless(self.search, self.whole):
            self.rising = best if self._explains(best) else ""
            return self._unknown()
        begun = before_climb(self.search, self.whole, self.beyond, self.shown.settings, best)
        known = self._share_of_possible(rmse(begun), rmse(self.whole))
        named = min(group, key=lambda name: get_effect(name).rarity)
        belief = probability_of(member, member.drawn(named), self.surest)
        unsure = self.beyond.of_channels(best) and probability_of(member, member.place, self.surest) <= POLICY.even
        doubtful = get_effect(named).of_time or unsure  # on a motion that repeats any law is one of time
        more = unexplained_of(self.search, self.named_part, self.beyond).probability
        first, before = begun is self.search.refit, math.exp(-POLICY.effect_price)  # a set that is taken is taken whole
        if member.imitates or (doubtful and known < POLICY.share_of_possible) or (first and belief < min(more, before)):
            self.doubted = best
            return self._unknown()
        self._named_for[named] = best
        return named, belief

    def _first(self) -> str:
        """The one worth most alone of those that, or what ties with them, are rather there; of near ones a commoner."""
        likely = {n: probability_of(m, m.place, self.surest) for n, m in self.members.items()}
        believed = [name for name in self.members if likely[name] >= POLICY.even and self._lowers(name)]
        members = believed or [max(likely, key=lambda n: (self._lowers(n), likely[n], self._worth(n)))]
        best = max(members, key=self._worth)
        if best not in self.alone:
            return best
        limit = (1.0 + POLICY.nearly_the_same) * self.problem.errors.rmse(self.alone[best].fit)
        near = [m for m in members if m in self.alone and self.problem.errors.rmse(self.alone[m].fit) <= limit]
        return min((best, *near), key=lambda name: get_effect(name).rarity)

    def _share_of_possible(self, before: float, after: float) -> float:
        """Explained share of the power that could be explained; 1 where nothing unknown remains."""
        if not (self.beyond.unknown or above_floor(self.search, self.whole)):
            return 1.0
        least = self.beyond.least if self.beyond.unknown else POLICY.floor_factor * self.problem.floor
        return (before**2 - after**2) / max(before**2 - least**2, 1e-300)

    def _lowers(self, name: str) -> bool:
        """Whether an effect, alone or beside others, lowers the held-out error of the values that would be written."""
        score, before = self.problem.score, self.own.refitted.heldout_rmse
        alone = self._explains(name) and score(self.alone[name].fit).heldout_rmse < before
        return alone or (name in self.alone and name in self.together)

    def _explains(self, name: str) -> bool:
        """Whether the effect alone lowers the held-out error of the form that is evidence."""
        rmse = self.problem.errors.rmse
        return name in self.alone and rmse(self.alone[name].fit) < rmse(self.search.refit)

    def _worth(self, name: str) -> tuple[bool, bool, float]:
        """Effects that lower the held-out error by themselves come first; of those, what leaves less than the model as
        given does: inertia and delay, fitted without what is missing, may have raised it."""
        option, lowers = self.alone.get(name), self._lowers(name)
        if option is None:
            return False, False, -math.inf
        return lowers, lowers and self.problem.errors.rmse(option.fit) < self.own.score.rmse, option.evidence

    def diagnosis(self) -> Diagnosis:
        """The whole answer."""
        problem, verdict, score, refitted = self.problem, self.named, self.own.score, self.own.refitted
        left, said = said_of_left(self.search, self.whole), (*self.shown.warnings, *self.own.said)
        nearest = self._nearest()
        ranking = self._ranking(score, refitted, nearest)
        named = next((c for c in ranking if c.effect == verdict), None)
        fit = self.alone[verdict].fit if verdict in self.alone else self.search.refit
        known, given, several = self._values(fit), self.shown.given or self.search, len(self.members) > 1
        refit = given.problem.values(given.refit)
        joint = self._values(self.whole) if several else known
        unknown, source, own = self.beyond.unknown, problem.recordings[0].provenance, verdict in problem.model.effects
        one = self.seen is not None or verdict == self.own.wrong != ""
        more = {NONE: 1.0 - self.sure, UNKNOWN: self.sure}
        return Diagnosis(
            logs=tuple(r.name for r in problem.recordings),
            samples=sum(r.samples for r in problem.recordings),
            verdict=verdict,
            probability=self.sure,
            score=score,
            refitted=refitted,
            ranking=ranking,
            ceiling=Ceiling(self.beyond.heldout_rmse, self.beyond.on),
            advice=advice_for(verdict, named, unknown, self.beyond.on, source, "" if self.doubted else nearest, own),
            estimates=joint.estimates,
            correlations=joint.correlations,
            given=problem.model,
            refitted_values=refit.estimates,
            refitted_correlations=refit.correlations,
            model=known.model,
            refitted_model=refit.model,
            whole_model=problem.scale.model(self.whole) if self.members else None,
            whole_values=joint.estimates if several else {},
            whole_heldout_rmse=problem.score(self.whole).heldout_rmse if several else math.nan,
            noise=self.beyond.noise,
            found=() if self.limits.blocked else tuple(t.id for t in self.search.added(self.whole.terms)),
            band_hz=self.search.equations.band.hz,
            floor=problem.floor,
            provenance=source,
            warnings=self.limits.said + contradictions(self.search, fit, known.estimates) + left + said,
            at_stops=only_at_stops(self.search, self.whole),
            blocked=self.limits.blocked,
            depends_on=self.beyond.on if unknown else (),
            held_out=tuple(r.name for r in problem.holdout),
            nearest=nearest,
            missing=(Missing(verdict, self.sure),) if one else self.missing,
            unexplained=unexplained_of(self.search, self.named_part, self.beyond, more.get(verdict, 0.0)),
        )

    def _nearest(self) -> str:
        """The effect that would explain much of what is unknown, but not in all blocks, or is believed less."""
        if self.named == NONE:
            return creeping.effect if (creeping := in_creeping(self.search, self.options)) is not None else ""
        alike = self.beyond.of_gain and not self.members  # u times something is no effect
        if self.doubted or self.named != UNKNOWN or not self.options or self.limits.blocked or alike:
            return self.doubted
        refit, best = self.search.refit, self.options[0]
        before, after = self.problem.errors.rmse(refit), self.problem.errors.rmse(best.fit)
        likely = best.evidence > self.search.evidence(refit) and after < (1.0 - POLICY.clear_fall) * before
        return best.effect if likely and self._lowers(best.effect) else ""

    def _ranking(self, score: Score, refitted: Score, nearest: str) -> tuple[Candidate, ...]:
        tested = [(o, self.problem.score(o.fit)) for o in self.alone.values()]
        tested.sort(key=lambda one: (one[0].effect != self.named, one[1].heldout_rmse))
        others = [o.effect for o, _ in tested if o.effect not in (self.named, *self.members)]
        shown = {self.named, self.doubted, nearest, *others[:1], *self.members}
        found = [self._candidate(o, refitted, errors, shown=o.effect in shown) for o, errors in tested]
        no = 3 * (math.nan,)
        untestable = [Candidate(name, *no, 0.0, {}, untestable=why) for name, why in self.problem.untestable.items()]
        own = [replace(c, heldout_rmse_before=score.heldout_rmse) for c in self.own.candidates]
        leads = self.own.wrong and not self.members and not self.shown.by_contacts
        return (*own, *found, *untestable) if leads else (*found, *own, *untestable)

    def _candidate(self, option: Option, refitted: Score, score: Score, *, shown: bool) -> Candidate:
        """What is surely not there, and not shown, is not worth all rows: those that were searched do."""
        likely, fit = self._probability(option.effect), option.fit
        part = None if shown or likely > 1.0 - POLICY.surest else self.search.excerpt
        known = self._values(fit) if part is None else part.problem.values(part.fit(fit.terms, fit.tap))
        rivals, prefix, of = self._rivals(option.effect), f"{option.effect}.", "excerpt of the log" if part else "log"
        values = {name.removeprefix(prefix): e for name, e in known.estimates.items() if name.startswith(prefix)}
        if any(name.startswith(prefix) for name in known.tied):
            rivals = (*rivals, INERTIA)
        notes = [f"{name} stands on its bound" for name, e in values.items() if e.at_bound]
        notes += [f"not identifiable from this {of}: {name}" for name, e in values.items() if math.isnan(e.std_error)]
        seen = self.seen if self.seen and self.seen.effect == option.effect else None
        if seen is not None:  # the load is driven by the values that are written, as in `dsd compare`
            notes.append(note_on(seen, self.search.equations.band.hz))
            own = self.problem.errors_for(known.model, self.problem.recordings).of_model(known.model)
            score = replace(own, heldout_rmse=score.heldout_rmse)
        return Candidate(
            option.effect,
            *(score.rmse, refitted.heldout_rmse, score.heldout_rmse),
            likely,
            values,
            rivals,
            note="; ".join(notes),
            seen=seen.values if seen else {},
            model=known.model,
            score=score,
            all_values=known.estimates,
            of_excerpt=part is not None,
        )

    def _values(self, fit: Fit) -> Fitted:
        """Of the set that was found with what one effect more would move; of others as they are."""
        found = self.members and {t.id for t in fit.terms} == {t.id for t in self.whole.terms}
        return self.search.values(fit) if found else self.problem.values(fit)

    def _rivals(self, effect: str) -> tuple[str, ...]:
        """Effects that these recordings cannot distinguish from it."""
        if self.seen is not None:
            return self.seen.rivals if effect == self.seen.effect else ()
        member = self._named_for.get(effect, effect)
        found = self.members[member].rivals if member in self.members else ()
        return (*([member] if member != effect else []), *(r for r in found if r != effect))

    def _probability(self, effect: str) -> float:
        if effect == self.named:
            return self.sure
        if self.limits.blocked:  # none is in an answer
            return 0.0
        if said := [one.probability for one in self.missing if one.effect == effect]:
            return said[0]
        if not self.members:
            likely = probabilities(self.search, self.search.refit, self.options).get(effect, 0.0)
            return likely if self.named != UNKNOWN or self._lowers(effect) else 0.0
        return max(probability_of(m, m.belief(effect), self.surest) for m in self.members.values())  # stands in for one
