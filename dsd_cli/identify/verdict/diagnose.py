"""Which physical effect is missing: the verdict of `dsd diagnose`."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

from dsd_cli.identify.fit.solve import Fit
from dsd_cli.identify.recordings.recording import Recording
from dsd_cli.identify.results import INERTIA, NONE, UNKNOWN, Candidate, Ceiling, Diagnosis, Score
from dsd_cli.identify.search.sets import Option
from dsd_cli.identify.verdict.advice import advice_for
from dsd_cli.identify.verdict.beyond import Beyond, beyond_of, pushed
from dsd_cli.identify.verdict.evidence import NOTHING, Membership, membership, probabilities
from dsd_cli.identify.verdict.examination import Examination, Settings
from dsd_cli.identify.verdict.own_values import Own, own_values
from dsd_cli.plant.model import ObserverSettings, PlantModel

__all__ = ["Settings", "diagnose"]

#: Effects that take less than this share of the power that a free-form function takes are not the answer.
SHARE_OF_CEILING = 0.75

#: An effect is named only if it takes this share off the held-out error by itself.
LEAST_ALONE = 0.005
#: Above this inflation the rows are so dependent that the model misfits somewhere.
MOST_INFLATION = 3.0
#: Of effects that explain a recording equally well the one that is met more often is named, the others beside it.
COMMON = ("coulomb_friction", "viscous_friction", "constant_load", "gravity", "load_friction", "stiffness")
#: No verdict is surer than this: the catalogue is not the world.
SUREST = 0.99
#: "Nothing is missing" is not surer than this where some effects could not be tested.
NOT_ALL_TESTED = 0.8

Progress = Callable[[str, float], None]


def diagnose(
    recordings: Sequence[Recording],
    model: PlantModel,
    observer: ObserverSettings,
    settings: Settings | None = None,
    holdout: Sequence[Recording] = (),
    progress: Progress | None = None,
) -> Diagnosis:
    """The effect that is missing most, "inertia" or "delay" if a value is wrong, "none" or "unknown".

    Parameters
    ----------
    recordings : of one rig, fitted together.
    model : what the rig is believed to be; its values are fitted along, its effects stay.
    holdout : recordings that no fit sees; the held-out errors are then those of them.
    progress : called with what is being done and the share that is done.

    Raises
    ------
    DataError : the recordings are too short, the axis does not move, or a needed channel is missing.
    UsageError : recordings of different rates.
    """
    report = progress or (lambda _what, _share: None)
    report("preparing", 0.0)
    exam = Examination(recordings, model, observer, settings or Settings(), holdout)
    report("one effect at a time", 0.15)
    refit = exam.refit
    options = exam.search.options(refit)
    report("sets of effects", 0.4)
    whole = exam.search.run(refit, lambda share: report("sets of effects", 0.4 + 0.4 * share))
    beyond = beyond_of(exam, whole)
    if "external_force" in exam.candidates:
        whole, beyond = pushed(exam, whole, beyond)
    report("how sure", 0.8)
    found = [t.id for t in exam.search.added(whole.terms)]
    reconstructed = any("reconstructed" in r.provenance.get("velocity", "") for r in exam.recordings)
    misfit = beyond.unknown or reconstructed or exam.noise.inflation > MOST_INFLATION
    members = {name: membership(exam.search, whole, name, exam.plain, misfit) for name in found}
    own = own_values(exam)
    report("done", 1.0)
    return _Verdict(exam, options, whole, members, own, beyond).diagnosis()


class _Verdict:
    """Puts the answer together."""

    def __init__(
        self,
        exam: Examination,
        options: list[Option],
        whole: Fit,
        members: dict[str, Membership],
        own: Own,
        beyond: Beyond,
    ) -> None:
        self.exam, self.options, self.whole = exam, options, whole
        self.members, self.own, self.beyond = members, own, beyond
        self._named_for: dict[str, str] = {}
        self.alone = {o.effect: o for o in (*options, *self._events())}

        self.named, self.sure = "", 0.0
        self.named, self.sure = self.verdict()

    def _events(self) -> list[Option]:
        """Pulses alone, where they belong to the answer: they are no candidate of the search."""
        exam = self.exam
        pulses = [t for t in exam.search.added(self.whole.terms) if "edges" in t.shape]
        fits = [(t.id, exam.search.fit((*exam.base, t), self.whole.tap)) for t in pulses]
        return [Option(name, fit, exam.search.evidence(fit)) for name, fit in fits]

    def verdict(self) -> tuple[str, float]:
        """(verdict, probability)."""
        exam, beyond = self.exam, self.beyond
        if self.members:
            best = max(self.members, key=self._worth)
            if not self._lowers(best):
                return UNKNOWN, 0.5
            known = self._share_of_possible(exam.plain.rmse(exam.refit), exam.plain.rmse(self.whole))
            if known < SHARE_OF_CEILING:
                return UNKNOWN, min(1.0 - max(known, 0.0), SUREST)
            group = (best, *self.members[best].alike)
            belief = self.members[best].probabilities
            named = min(group, key=_commonness)
            self._named_for[named] = best
            tied = (best, *self.members[best].rivals)
            shared = sum(belief.get(name, 0.0) for name in tied) / len(tied)
            return named, min(known * max(belief.get(named, 0.0), shared), SUREST)
        known = self._share_of_possible(self.own.score.heldout_rmse, self.own.refitted.heldout_rmse)
        if self.own.wrong and known >= SHARE_OF_CEILING:
            return self.own.wrong, min(known * self.own.probability, SUREST)
        if beyond.unknown:
            return UNKNOWN, 0.9
        return NONE, self._nothing()

    def _share_of_possible(self, before: float, after: float) -> float:
        """How much of the power that could be explained a step explains; 1 where nothing unknown remains."""
        if not self.beyond.unknown:
            return 1.0
        least = min(self.beyond.heldout_rmse, self.beyond.noise)
        return (before**2 - after**2) / max(before**2 - least**2, 1e-300)

    def _lowers(self, name: str) -> bool:
        """Whether the effect alone lowers the held-out error that is shown."""
        option = self.alone.get(name)
        after = self.exam.score(option.fit).heldout_rmse if option is not None else math.inf
        return after < (1.0 - LEAST_ALONE) * self.own.refitted.heldout_rmse

    def _worth(self, name: str) -> tuple[bool, float]:
        """Effects that lower the held-out error by themselves come first."""
        return self._lowers(name), self._alone_evidence(name)

    def _alone_evidence(self, name: str) -> float:
        option = self.alone.get(name)
        return option.evidence if option is not None else -math.inf

    def _nothing(self) -> float:
        """Belief that nothing is missing. Effects that would change next to nothing are no alternatives, and those that
        would have not convinced block by block: at most an even chance."""
        exam = self.exam
        useful = [o for o in self.options if exam.practical(exam.refit, o.fit)]
        surest = SUREST if not exam.untestable else NOT_ALL_TESTED
        return min(0.5 + 0.5 * probabilities(exam.search, exam.refit, useful)[NOTHING], surest)

    def diagnosis(self) -> Diagnosis:
        """The whole answer."""
        exam = self.exam
        verdict, probability = self.named, self.sure
        score, refitted = self.own.score, self.own.refitted
        ranking = self._ranking(score, refitted)
        named = next((c for c in ranking if c.effect == verdict), None)
        fit = self.alone[verdict].fit if verdict in self.alone else exam.refit
        return Diagnosis(
            logs=tuple(r.name for r in exam.recordings),
            samples=sum(r.samples for r in exam.recordings),
            verdict=verdict,
            probability=probability,
            score=score,
            refitted=refitted,
            ranking=ranking,
            ceiling=Ceiling(self.beyond.heldout_rmse, self.beyond.on),
            advice=advice_for(verdict, named, self.beyond.unknown, self.beyond.on, exam.recordings[0].provenance),
            estimates=exam.values(fit).estimates,
            model=exam.scale.model(fit),
            refitted_model=exam.scale.model(exam.refit),
            noise=self.beyond.noise,
            provenance=exam.recordings[0].provenance,
            depends_on=self.beyond.on if self.beyond.unknown else (),
        )

    def _ranking(self, score: Score, refitted: Score) -> tuple[Candidate, ...]:
        exam = self.exam
        found = [self._candidate(o, refitted) for o in self.alone.values()]
        found.sort(key=lambda c: (c.effect != self.named, c.heldout_rmse_after))
        untestable = [
            Candidate(name, math.nan, math.nan, math.nan, 0.0, {}, untestable=reason)
            for name, reason in exam.untestable.items()
        ]
        own = [replace(c, heldout_rmse_before=score.heldout_rmse) for c in self.own.candidates]
        lead = own if self.own.wrong and not self.members else []
        return (*lead, *found, *(c for c in own if c not in lead), *untestable)

    def _candidate(self, option: Option, refitted: Score) -> Candidate:
        exam = self.exam
        score, known = exam.score(option.fit), exam.values(option.fit)
        everything = known.estimates
        prefix = f"{option.effect}."
        values = {name.removeprefix(prefix): e for name, e in everything.items() if name.startswith(prefix)}
        rivals = self._rivals(option.effect)
        if any(name.startswith(prefix) for name in known.tied):
            rivals = (*rivals, INERTIA)
        notes = [f"{name} stands on its bound" for name, e in values.items() if e.at_bound]
        notes += [f"the log does not tell {name}" for name, e in values.items() if math.isnan(e.std_error)]
        return Candidate(
            effect=option.effect,
            rmse_after=score.rmse,
            heldout_rmse_before=refitted.heldout_rmse,
            heldout_rmse_after=score.heldout_rmse,
            probability=self._probability(option.effect),
            parameters=values,
            indistinguishable_from=rivals,
            note="; ".join(notes),
            model=exam.scale.model(option.fit),
            score=score,
            all_values=everything,
        )

    def _rivals(self, effect: str) -> tuple[str, ...]:
        """What cannot be told from it on these recordings."""
        member = self._named_for.get(effect, effect)
        found = self.members[member].rivals if member in self.members else ()
        stands_in = (member,) if member != effect else ()
        return (*stands_in, *(r for r in found if r != effect))

    def _probability(self, effect: str) -> float:
        if effect == self.named:
            return self.sure
        if effect in self.members:
            return min(self.members[effect].probabilities[effect], SUREST)
        return max((m.probabilities.get(effect, 0.0) for m in self.members.values()), default=self._as_only(effect))

    def _as_only(self, effect: str) -> float:
        return probabilities(self.exam.search, self.exam.refit, self.options).get(effect, 0.0)


def _commonness(effect: str) -> int:
    """Place in the list of common effects; behind it for the others."""
    return COMMON.index(effect) if effect in COMMON else len(COMMON)
