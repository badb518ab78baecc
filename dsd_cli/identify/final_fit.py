"""Effects put into a model, or taken out of it one by one: every value fitted again, with its standard error."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from dsd_cli.effects import free_name, get_effect, kind_of
from dsd_cli.errors import DataError, UsageError
from dsd_cli.identify.fit.driven_load import both_driven
from dsd_cli.identify.fit.problem import pose
from dsd_cli.identify.fit.solve import Fit
from dsd_cli.identify.fit.testability import Settings
from dsd_cli.identify.fit.values import terms_of
from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.recordings.recording import Recording
from dsd_cli.identify.results import DELAY, INERTIA, Addition, Correlations, Estimates, Score
from dsd_cli.identify.search.pulses import sharpened, with_pulses
from dsd_cli.identify.search.sets import Search
from dsd_cli.identify.verdict.contradictions import contradictions
from dsd_cli.identify.verdict.own_values import own_values
from dsd_cli.identify.verdict.probability import is_told
from dsd_cli.identify.verdict.resonance import response_settings
from dsd_cli.plant.model import ObserverSettings, PlantModel


def add_effect(
    recordings: Sequence[Recording],
    model: PlantModel,
    observer: ObserverSettings,
    effect_id: str,
    settings: Settings | None = None,
    holdout: Sequence[Recording] = (),
) -> Addition:
    """The model with this effect in it, all values fitted again; "inertia" or "delay" fits the values it has.

    Raises UsageError : no such effect, or the model has it.
    DataError : it cannot be tested on these recordings, or the held-out error does not fall.
    """
    own = effect_id in (INERTIA, DELAY)
    if not own:
        get_effect(effect_id)
    if effect_id in model.effects:
        another = free_name(kind_of(effect_id), model.effects)
        more = f"; `dsd add LOG {another}` adds one more of its kind" if another else ""
        raise UsageError(
            f"{effect_id} is in the model already", f"`dsd add LOG inertia` fits the values that are there{more}"
        )
    wanted = () if own else (effect_id,)
    asked = replace(settings or Settings(), effects=wanted)
    problem = pose(recordings, model, asked, holdout)
    if effect_id in problem.untestable:
        raise DataError(f"{effect_id} is not testable on {recordings[0].name}", problem.untestable[effect_id])
    search = Search(problem)
    before = own_values(search)
    told = response_settings(search, effect_id, asked)
    if told is not None:
        there = told.known.added_to(model, effect_id)
        driven, aside = both_driven(recordings, holdout, there)
        problem = pose(driven, model, told, aside)
        search = Search(problem)
    fit = search.refit if own else _with_effect(search, effect_id)
    after = problem.score(fit)
    most = 1.0 + POLICY.least_fall if told is not None else 1.0
    if not after.heldout_rmse < most * (before.score if own else before.refitted).heldout_rmse:
        raise DataError(
            f"{effect_id} does not lower the held-out error of {recordings[0].name} "
            f"({before.refitted.heldout_rmse:.4g} without it, {after.heldout_rmse:.4g} with it)",
            "nothing was added; `dsd diagnose` ranks what does",
        )
    known = problem.values(fit)
    said: tuple[str, ...] = contradictions(search, fit, known.estimates)
    if not own and not is_told(effect_id, known.estimates):  # it is written, but not seen
        said += (
            f"not identifiable from this log: {effect_id}: its values may be 0, within twice their standard errors",
        )
    return Addition(
        effect_id, known.model, before.score, after, known.estimates, said, before.refitted, known.correlations
    )


def _with_effect(search: Search, effect_id: str) -> Fit:
    name = search.problem.recordings[0].name
    if get_effect(effect_id).listed:
        found = with_pulses(search, search.refit)
        if found is None:
            raise DataError(f"{name}: no pulse stands out of the residual", "nothing was added")
        return sharpened(search, found)
    options = search.options(search.refit)
    if not options:
        raise DataError(f"{effect_id} is not testable on {name}", "the log does not vary where it would show")
    return search.converged(options[0].fit)


@dataclass(frozen=True)
class Ended:
    """A model fitted once more, with the noise as it is beside it; `without` is what was taken out to get there."""

    without: str
    model: PlantModel
    score: Score
    values: Estimates
    correlations: Correlations
    warnings: tuple[str, ...]


def ended(
    recordings: Sequence[Recording],
    given: PlantModel,
    reached: PlantModel,
    settings: Settings,
    holdout: Sequence[Recording] = (),
    newest: str = "",
) -> Iterator[Ended]:
    """The model that was reached, then one less for every added effect that no longer matters; the last one stays.

    given : the model as it was; its own effects are never taken out. newest : what was taken last, nor is this.
    """
    reached = settings.known.applied(reached)
    recordings, holdout = both_driven(recordings, holdout, reached)
    problem = pose(recordings, given, settings, holdout)
    search = Search(problem)
    terms = terms_of(problem.solver.known.applied(reached))
    tap = round(reached.delay / problem.solver.bank.tap_time)
    search = Search(problem.measured_again(search.fit(terms, tap)))
    fit, gone = search.converged(search.fit(terms, tap)), ""
    while True:
        yield _ended(search, fit, gone)
        found = _needless(search, fit, newest)
        if found is None:
            return
        gone, fit = found


def _needless(search: Search, fit: Fit, newest: str) -> tuple[str, Fit] | None:
    """(an added effect without which the model is as good, the fit without it); the one that is missed least.

    The newest was taken just now, and nothing came after it that could stand in for it. What only the response above
    the band shows is not judged by what the band shows.
    """
    seen = {name.partition(".")[0] for name in search.solver.known.seen}
    older = [t for t in search.added(fit.terms) if t.id != newest and t.id not in seen]
    less = [(t.id, search.without(fit, t)) for t in older]

    def missed(one: Fit) -> bool:  # by the evidence or, beside a force without a name, by the error of what is written
        was, now = (search.problem.score(x).heldout_rmse for x in (one, fit))
        return (search.lead(one, fit) > 0.0 and search.practical(one, fit)) or search.problem.falls(was, now, fit)

    needless = [(name, one) for name, one in less if not missed(one)]
    found = max(needless, key=lambda pair: search.evidence(pair[1]), default=None)
    return None if found is None else (found[0], search.converged(found[1]))


def _ended(search: Search, fit: Fit, gone: str) -> Ended:
    """Errors are those of the values that are written, as `dsd compare` finds them; the held-out one is the fit's."""
    problem = search.problem
    known = search.values(fit)
    own = problem.errors_for(known.model, problem.recordings).of_model(known.model)
    return Ended(
        gone,
        known.model,
        replace(own, heldout_rmse=problem.score(fit).heldout_rmse),
        known.estimates,
        known.correlations,
        contradictions(search, fit, known.estimates),
    )
