"""The loop diagnose - choose - add until nothing significant is left."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

from dsd_cli.errors import DataError, UsageError
from dsd_cli.identify.final_fit import Ended, add_effect, ended
from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.recordings.excerpts import with_levels
from dsd_cli.identify.recordings.recording import Mended, Recording
from dsd_cli.identify.results import (
    DELAY,
    INERTIA,
    NONE,
    UNKNOWN,
    Addition,
    Candidate,
    Diagnosis,
    Estimates,
    Ladder,
    LogLevels,
    Missing,
    Score,
    Step,
    StepKind,
)
from dsd_cli.identify.verdict.contradictions import beside_told, kept_values
from dsd_cli.identify.verdict.diagnose import Progress, Settings, Told, diagnose, prior_check
from dsd_cli.identify.verdict.levels import log_levels, said_of
from dsd_cli.plant.model import ObserverSettings, PlantModel

AS_GIVEN, REFIT = "as given", "refit"
_KINDS: dict[str, StepKind] = {AS_GIVEN: "given", REFIT: "refit", INERTIA: "refit", DELAY: "refit"}


def improve(
    recordings: Sequence[Recording],
    model: PlantModel,
    observer: ObserverSettings,
    settings: Settings | None = None,
    holdout: Sequence[Recording] = (),
    *,
    choose: Callable[[Diagnosis], str | None],
    on_step: Callable[[Step], None] = lambda _: None,
    progress: Progress | None = None,
    on_told: Told = lambda _: None,
) -> Ladder:
    """Diagnose, add what `choose` says, measure again; every step lowers the held-out error, but for one that only the
    response above the band identifies: that one must not raise it by more than `POLICY.least_fall`.

    choose : gets a diagnosis, gives the effect (or value) to take, or None to stop.
    on_step : called with every rung, the model as given first. on_told : see `diagnose`.

    Raises DataError, UsageError : as `diagnose`.
    """
    report = progress or (lambda _what, _share: None)
    climb = _Climb(recordings, observer, settings or Settings(), holdout, on_step)
    climb.told_again(model, report, on_told)
    refused: list[str] = []
    while True:
        last = diagnose(recordings, model, observer, climb.settings.without(refused), holdout, progress)
        recordings, holdout = climb.as_asked(last)
        if last.mended is not None and not climb.settings.against and climb.told_again(model, report, on_told):
            continue
        if not climb.steps:
            climb.up(AS_GIVEN, last.score, last.refitted_values, last.given)
            model = last.given
        climb.levels, set_before = last.levels, climb.settings
        climb.settings = replace(climb.settings, begun=None, begun_with=())
        if last.verdict in (NONE, UNKNOWN):
            return climb.ladder(last, _why(last, refused))
        chosen = None if (stop := _stop(climb.steps, last)) else choose(last)
        if chosen is None:
            values = ", ".join(last.stand_ins.get(last.verdict, ()))
            not_taken = f"{last.verdict} may only stand in for {values}" if values else ""
            return climb.ladder(last, stop or not_taken or "stopped before the next step was taken")
        own = chosen in (INERTIA, DELAY) or chosen in model.effects
        if own and not climb.lowered_by(last.refitted):
            return climb.ladder(last, f"{chosen} is fitted already: the held-out error does not fall")
        if own:
            model = climb.up(chosen, last.refitted, last.refitted_values, last.refitted_model)
            continue
        taken = next((c for c in last.ranking if c.effect == chosen), None)
        if taken is None or taken.model is None or taken.score is None:
            raise UsageError(f"{chosen} is no candidate here", "take one of the ranking")
        if (with_it := climb.up_with(last, taken)) is None:
            refused.append(chosen)
            climb.settings = set_before
            continue
        model = with_it
        if chosen in last.found:
            climb.settings = replace(climb.settings, begun=last.whole_model, begun_with=_taken_of(set_before, chosen))


@dataclass
class _Climb:
    """The steps so far."""

    recordings: Sequence[Recording]
    observer: ObserverSettings
    settings: Settings
    holdout: Sequence[Recording]
    on_step: Callable[[Step], None]
    mended: Mended | None = None
    steps: list[Step] = field(default_factory=list)
    added: dict[str, Missing] = field(default_factory=dict)
    levels: tuple[LogLevels, ...] = ()

    def as_asked(self, last: Diagnosis) -> tuple[Sequence[Recording], Sequence[Recording]]:
        """(recordings, held-out ones) of the last answer, with which the climb goes on; what was wrong with the others
        is said at the end."""
        if (mended := last.mended) is not None:
            self.mended = replace(mended, said=(*(self.mended.said if self.mended else ()), *mended.said))
            self.recordings, self.holdout = mended.recordings, mended.holdout
            self.steps[-1:] = [replace(top, score=last.score) for top in self.steps[-1:]]
        return self.recordings, self.holdout

    def told_again(self, model: PlantModel, report: Progress, on_told: Told) -> bool:
        """Whether the logs, without what was wrong with them, are against what was given: asked anew of mended ones."""
        asked = replace(self.settings, against=None) if self.mended else self.settings
        self.settings, against = prior_check(self.recordings, model, asked, report)
        if against:
            on_told(against)
        return bool(against)

    def up(
        self, effect: str, score: Score, values: Estimates, model: PlantModel, kind: StepKind = "added"
    ) -> PlantModel:
        """One more rung; the model that stands on it."""
        kind = _KINDS.get(effect, kind)
        step = Step(len(self.steps), effect, score, values, model, kind, self._with_mean(values))
        self.steps.append(step)
        self.on_step(step)
        return model

    def _with_mean(self, values: Estimates) -> tuple[LogLevels, ...]:
        """The levels of the logs around the means that were fitted in this rung."""
        logs = [r.name for r in self.recordings]
        return log_levels([one.deviations for one in self.levels], values, logs) if self.steps else ()

    def up_with(self, last: Diagnosis, taken: Candidate) -> PlantModel | None:
        """The model with an effect that lowers the held-out error, alone or beside the set; None if it does not."""
        chosen, before = taken.effect, self.steps[-1].model
        if taken.of_excerpt:  # what a user takes is fitted to all rows
            added = self._added(chosen, self.settings)
            if added is None:
                return None
            taken = replace(taken, model=added.model, score=added.after, all_values=added.estimates)
        assert taken.score is not None
        assert taken.model is not None
        if not self.lowered_by(taken.score, -POLICY.least_fall if taken.seen else 0.0):
            beside = self._beside_the_set(last, chosen)
            if beside is None:
                return None
            self._take(taken)
            return self.up(chosen, beside.after, beside.estimates, beside.model)
        moves = last.refitted_model.inertia > POLICY.least_inertia * before.inertia  # else it explains u without motion
        if moves and self.lowered_by(last.refitted, POLICY.least_fall):  # the rest of the fall is the effect's own
            self.up(REFIT, last.refitted, last.refitted_values, last.refitted_model)
        self._take(taken)
        return self.up(chosen, taken.score, taken.all_values, taken.model)

    def _take(self, taken: Candidate) -> None:
        """An effect was taken; what the response identified of it stays so."""
        self.settings = replace(self.settings, taken=(*self.settings.taken, taken.effect))
        self.added[taken.effect] = Missing(taken.effect, taken.probability)
        if taken.seen:
            known = self.settings.known.seeing(taken.effect, taken.seen, {})
            self.settings = replace(self.settings, known=known)

    def _beside_the_set(self, last: Diagnosis, chosen: str) -> Addition | None:
        """An effect that only the whole set lets lower the error, beside the inertia and the delay of that set: fitted
        beside it alone, they make up for what else is missing; they are held for this rung. None if it does not lower
        the error there either."""
        whole, known = last.whole_model, self.settings.known
        if whole is None or len(last.found) < 2 or chosen not in last.found or {INERTIA, DELAY} & set(known.names):
            return None
        held = replace(known, fixed={**known.fixed, INERTIA: whole.inertia, DELAY: whole.delay})
        return self._added(chosen, replace(self.settings, known=held))

    def _added(self, chosen: str, asked: Settings) -> Addition | None:
        """An effect fitted to all rows beside what stands; None if that does not lower the held-out error."""
        recordings = with_levels(self.recordings, [one.deviations for one in self.levels])
        try:
            added = add_effect(recordings, self.steps[-1].model, self.observer, chosen, asked, self.holdout)
        except DataError:
            return None
        return added if self.lowered_by(added.after) else None

    def lowered_by(self, score: Score, share: float = 0.0) -> bool:
        """Whether the held-out error falls, by that share."""
        return score.heldout_rmse < (1.0 - share) * self.steps[-1].score.heldout_rmse

    def ladder(self, last: Diagnosis, stopped: str) -> Ladder:
        """The whole ladder: needless effects removed again, every value with its standard error."""
        names = tuple(r.name for r in self.holdout)
        if self.mended is not None:
            said = tuple(dict.fromkeys((*self.mended.said, *last.warnings)))
            last = replace(last, mended=self.mended, warnings=said)
        settings = replace(self.settings, inverse=last.inverse)
        if len(self.steps) == 1:
            found = (last.refitted_values, last.refitted_correlations, last.warnings, last.levels)
            return Ladder(tuple(self.steps), last.verdict, stopped, last, names, *found, last.missing)
        given, reached = self.steps[0].model, self.steps[-1].model
        end: Ended | None = None
        recordings = with_levels(self.recordings, [one.deviations for one in self.levels])
        newest = next((s.effect for s in reversed(self.steps) if s.kind == "added"), "")
        for end in ended(recordings, given, reached, settings, self.holdout, newest):
            if end.without:
                self.up(end.without, end.score, end.values, end.model, "taken back")
            else:  # the values of the rung, as the whole set and its noise have them; the error is the verdict's
                score = replace(end.score, heldout_rmse=last.refitted.heldout_rmse)
                levels, top = self._with_mean(end.values), self.steps[-1]
                self.steps[-1] = replace(top, model=end.model, estimates=end.values, score=score, levels=levels)
        assert end is not None
        levels, before = self._with_mean(end.values), said_of(last.levels)
        stay = tuple(one for one in last.warnings if one not in before)
        last = replace(last, levels=levels, warnings=(*stay, *said_of(levels)))
        warnings, last = tuple(dict.fromkeys((*last.warnings, *end.warnings))), beside_told(last, end.warnings)
        stayed = tuple(one for name, one in self.added.items() if name in end.model.effects)
        found = (end.values, end.correlations, warnings, levels)
        return Ladder(tuple(self.steps), last.verdict, stopped, last, names, *found, (*stayed, *last.missing))


def _taken_of(asked: Settings, chosen: str) -> tuple[str, ...]:
    """What was taken, with this one, of the set that it belongs to: a new set unless the last rung found it."""
    goes_on = asked.begun is not None and chosen in asked.begun.effects
    return (*asked.begun_with, chosen) if goes_on else (chosen,)


def _stop(steps: Sequence[Step], last: Diagnosis) -> str:
    """Why no further step is possible, or ""."""
    if len(steps) > POLICY.most_effects:
        return f"{POLICY.most_effects} steps are taken"
    if last.verdict in (INERTIA, DELAY) and steps[-1].effect == last.verdict:
        return f"{last.verdict} was fitted already"
    return ""


def _why(last: Diagnosis, refused: Sequence[str]) -> str:
    if last.verdict == NONE and refused:
        return f"nothing lowers the held-out error any more ({', '.join(refused)} did not)"
    if last.verdict == NONE:
        return "nothing significant is left"
    if kept := kept_values(last.warnings):
        return f"what is left may come from the given values of {', '.join(kept)}"
    if last.nearest and last.nearest not in last.found:
        return f"something is left; {last.nearest} comes nearest, but the log does not confirm it"
    on = " and ".join(last.depends_on)
    return "something is left that no effect of the catalogue explains" + (f"; it depends on {on}" if on else "")
