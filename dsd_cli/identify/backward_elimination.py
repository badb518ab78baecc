"""The end of a ladder: backward elimination, and a final fit of every value with its standard error."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from dsd_cli.identify.fit.bank import Terms
from dsd_cli.identify.fit.driven_load import both_driven
from dsd_cli.identify.fit.problem import Settings, pose
from dsd_cli.identify.fit.solve import Fit
from dsd_cli.identify.fit.values import terms_of
from dsd_cli.identify.recordings.recording import Recording
from dsd_cli.identify.results import Correlations, Estimates, Score
from dsd_cli.identify.search.sets import Search
from dsd_cli.identify.verdict.contradictions import contradictions
from dsd_cli.plant.model import PlantModel


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

    Parameters
    ----------
    given : the model as it was; its own effects are never taken out. newest : what was taken last, nor is this.
    """
    added = tuple(name for name in reached.effects if name not in given.effects)
    reached = settings.known.applied(reached)
    recordings, holdout = both_driven(recordings, holdout, reached)
    problem = pose(recordings, given, replace(settings, effects=added), holdout)
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
    older = [t.id for t in search.added(fit.terms) if t.id != newest and t.id not in seen]
    less = [(name, search.fit(_without(fit.terms, name), fit.tap)) for name in older]
    needless = [(name, one) for name, one in less if search.lead(one, fit) <= 0.0 or not search.practical(one, fit)]
    found = max(needless, key=lambda pair: search.evidence(pair[1]), default=None)
    return None if found is None else (found[0], search.converged(found[1]))


def _without(terms: Terms, name: str) -> Terms:
    return tuple(t for t in terms if t.id != name)


def _ended(search: Search, fit: Fit, gone: str) -> Ended:
    """Errors are those of the values that are written, as `dsd compare` finds them; the held-out one is the fit's."""
    problem = search.problem
    known = problem.values(fit)
    own = problem.errors_for(known.model, problem.recordings).of_model(known.model)
    return Ended(
        gone,
        known.model,
        replace(own, heldout_rmse=problem.score(fit).heldout_rmse),
        known.estimates,
        known.correlations,
        contradictions(search, fit, known.estimates),
    )
