"""Add an effect to the model, and the loop diagnose - choose - add until nothing significant is left."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from dsd_cli.effects import catalogue, get_effect
from dsd_cli.errors import DataError, UsageError
from dsd_cli.identify.fit.problem import pose
from dsd_cli.identify.fit.solve import Fit
from dsd_cli.identify.recordings.recording import Recording
from dsd_cli.identify.results import DELAY, INERTIA, NONE, UNKNOWN, Addition, Candidate, Diagnosis, Ladder, Score, Step
from dsd_cli.identify.search.pulses import sharpened, with_pulses
from dsd_cli.identify.search.sets import Search
from dsd_cli.identify.verdict.diagnose import Progress, Settings, diagnose
from dsd_cli.identify.verdict.own_values import own_values
from dsd_cli.plant.model import ObserverSettings, PlantModel

__all__ = ["add_effect", "improve"]

#: Rungs of the ladder; nobody believes a model with more parts than that from one rig.
MOST_STEPS = 10
AS_GIVEN = "as given"


def add_effect(
    recordings: Sequence[Recording],
    model: PlantModel,
    observer: ObserverSettings,
    effect_id: str,
    settings: Settings | None = None,
    holdout: Sequence[Recording] = (),
) -> Addition:
    """The model with this effect in it, all values fitted again; "inertia" or "delay" fits the values it has.

    Raises
    ------
    UsageError : no such effect, or the model has it.
    DataError : it cannot be tested on these recordings, or the held-out error does not fall.
    """
    own = effect_id in (INERTIA, DELAY)
    if not own:
        get_effect(effect_id)
    if effect_id in model.effects:
        raise UsageError(f"{effect_id} is in the model already", "`dsd add LOG inertia` fits the values that are there")
    wanted = () if own else (effect_id,)
    problem = pose(recordings, model, replace(settings or Settings(), effects=wanted), holdout)
    if effect_id in problem.untestable:
        raise DataError(f"{effect_id} is not testable on {recordings[0].name}", problem.untestable[effect_id])
    search = Search(problem)
    before = own_values(search)
    fit = search.refit if own else _with_effect(search, effect_id)
    after = problem.score(fit)
    if not after.heldout_rmse < (before.score if own else before.refitted).heldout_rmse:
        raise DataError(
            f"{effect_id} does not lower the held-out error of {recordings[0].name} "
            f"({before.refitted.heldout_rmse:.4g} without it, {after.heldout_rmse:.4g} with it)",
            "nothing was added; `dsd diagnose` ranks what does",
        )
    return Addition(effect_id, problem.scale.model(fit), before.score, after, problem.values(fit).estimates)


def _with_effect(search: Search, effect_id: str) -> Fit:
    name = search.problem.recordings[0].name
    if effect_id == "external_force":
        found = with_pulses(search, search.refit)
        if found is None:
            raise DataError(f"{name}: no pulse stands out of the residual", "nothing was added")
        return sharpened(search, found)
    options = search.options(search.refit)
    if not options:
        raise DataError(f"{effect_id} is not testable on {name}", "the log does not vary where it would show")
    return options[0].fit


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
) -> Ladder:
    """Diagnose, add what `choose` says, measure again; every step lowers the held-out error.

    Parameters
    ----------
    choose : gets a diagnosis, gives the effect (or value) to take, or None to stop.
    on_step : told of every rung, the model as given first.

    Raises
    ------
    DataError, UsageError : as `diagnose`.
    """
    steps: list[Step] = []

    def climb(effect: str, score: Score, found: Diagnosis | Candidate, new: PlantModel) -> None:
        values = found.estimates if isinstance(found, Diagnosis) else found.all_values
        steps.append(Step(len(steps), effect, score, values, new))
        on_step(steps[-1])

    refused: list[str] = []

    def ladder(reason: str) -> Ladder:
        return Ladder(tuple(steps), last.verdict, reason, last, tuple(r.name for r in holdout))

    while True:
        last = diagnose(recordings, model, observer, _without(settings, refused), holdout, progress)
        if not steps:
            climb(AS_GIVEN, last.score, last, model)
        if last.verdict in (NONE, UNKNOWN):
            return ladder(_why(last, refused))
        stop = _stop(steps, last)
        chosen = None if stop else choose(last)
        if chosen is None:
            return ladder(stop or "stopped before the next step was taken")
        if chosen in (INERTIA, DELAY) or chosen in model.effects:
            if not last.refitted.heldout_rmse < steps[-1].score.heldout_rmse:
                return ladder(f"{chosen} is fitted already: the held-out error does not fall")
            model = last.refitted_model
            climb(chosen, last.refitted, last, model)
            continue
        taken = next((c for c in last.ranking if c.effect == chosen), None)
        if taken is None or taken.model is None or taken.score is None:
            raise UsageError(f"{chosen} is no candidate here", "take one of the ranking")
        if taken.score.heldout_rmse < steps[-1].score.heldout_rmse:
            model = taken.model
            climb(chosen, taken.score, taken, model)
        else:
            refused.append(chosen)


def _without(settings: Settings | None, refused: Sequence[str]) -> Settings:
    """Effects that did not lower the held-out error are not asked again."""
    settings = settings or Settings()
    wanted = settings.effects if settings.effects is not None else tuple(catalogue())
    return replace(settings, effects=tuple(name for name in wanted if name not in refused))


def _stop(steps: Sequence[Step], last: Diagnosis) -> str:
    """Why no further step is possible, or ""."""
    if len(steps) > MOST_STEPS:
        return f"{MOST_STEPS} steps are taken"
    if last.verdict in (INERTIA, DELAY) and steps[-1].effect == last.verdict:
        return f"{last.verdict} was fitted already"
    return ""


def _why(last: Diagnosis, refused: Sequence[str]) -> str:
    if last.verdict == NONE and refused:
        return f"nothing lowers the held-out error any more ({', '.join(refused)} did not)"
    if last.verdict == NONE:
        return "nothing significant is left"
    on = " and ".join(last.depends_on)
    return "something is left that no effect of the catalogue explains" + (f"; it depends on {on}" if on else "")
