"""The model of a log fitted as every command fits it, as it is and with functions of the motion beside it."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from dsd_cli.errors import DsdError
from dsd_cli.identify.fit.bank import SHARE, Terms
from dsd_cli.identify.fit.direction import best_delay, certainly_late, explains_most
from dsd_cli.identify.fit.problem import functions_of_motion, pose
from dsd_cli.identify.fit.row_weights import residual_of_u
from dsd_cli.identify.fit.solve import Fit
from dsd_cli.identify.fit.testability import Settings, candidates_of
from dsd_cli.identify.fit.values import Fitted
from dsd_cli.identify.recordings.excerpts import earlier, excerpts
from dsd_cli.identify.recordings.recording import Recording, prepare
from dsd_cli.identify.results import DELAY, INERTIA
from dsd_cli.identify.search.sets import Search
from dsd_cli.plant.model import ObserverSettings, PlantModel
from dsd_cli.signals.log import Log


@dataclass(frozen=True)
class Side:
    """A fit, and what it was made in."""

    search: Search
    fit: Fit

    @cached_property
    def values(self) -> Fitted:
        """With their standard errors."""
        return self.search.problem.values(self.fit)

    @property
    def weightless(self) -> bool:
        """Whether friction and a delay explain u by itself: inertia and delay mean nothing then."""
        return math.isnan(self.values.estimates[INERTIA].std_error)

    @cached_property
    def left(self) -> float:
        """Squares of what the motion leaves of u, its unit squared."""
        left = residual_of_u(self.fit, self.search.problem.errors.bank)
        return float(left @ left)


@dataclass(frozen=True)
class Sides:
    """own : the model as it is. beside : with friction, weight, springs and all other functions of the motion that the
    log shows and the model lacks, of any size. late : s by which u is later than the motion, and its standard error."""

    own: Side
    beside: Side
    late: tuple[float, float] | None


@np.errstate(over="ignore", invalid="ignore", divide="ignore")
def sides_of(log: Log, restarts: tuple[int, ...], model: PlantModel, observer: ObserverSettings | None) -> Sides | None:
    """None where no fit can be made of the log."""
    channels = {name: x for name, x in log.channels.items() if observer is not None or name != "d_hat"}
    stands_in = ObserverSettings(model.inertia, 5.0 * log.sample_time)
    try:
        whole = prepare(replace(log, channels=channels), observer or stands_in, restarts, model.rest_speed)
        recordings = excerpts([whole])
        own = _own(recordings[0], model)
        beside = _beside(own)
        return Sides(own, beside, _late(beside))
    except (
        DsdError,
        ValueError,
        ArithmeticError,
        np.linalg.LinAlgError,
    ):  # of a corrupt cell (1e300) no square is a number
        return None


def _own(recording: Recording, model: PlantModel) -> Side:
    search = Search(pose([recording], model, Settings(effects=())))
    return Side(search, search.refit)


def _beside(own: Side) -> Side:
    """At the delay that is best then."""
    problem = own.search.problem
    names, _ = candidates_of(problem.recordings, (), problem.model, Settings())
    more = (t for t in functions_of_motion(names) if t.id not in problem.model.effects)
    terms: Terms = (*own.search.refit.terms, *more)
    tap = best_delay(own.search.solver, terms, problem.most_tap, own.fit.tap, believed=problem.model.delay)
    search = Search(problem.measured_again(own.search.fit(terms, tap)))
    return Side(search, search.fit(terms, tap))


#: s that u is looked for after its motion, and the shares of a stretch and of a cycle of the motion that it is at most.
_EARLIEST, _OF_STRETCH, _OF_CYCLE = 0.05, 0.05, 0.25


def _late(beside: Side) -> tuple[float, float] | None:
    """By the same fit with u so much earlier, where the delay stands at 0: less than no delay is one there."""
    if beside.fit.tap or beside.fit.total[SHARE] > 0.0:
        return None
    problem = beside.search.problem
    recording, step = problem.recordings[0], problem.equations.sample_time
    longest = max(map(len, recording.pieces)) * step
    ahead = min(_EARLIEST, _OF_STRETCH * longest, _OF_CYCLE * recording.cycle)
    model = replace(problem.model, delay=problem.model.delay + ahead)
    try:
        search = Search(pose([earlier(recording, ahead, "")], model, Settings(effects=())))
    except DsdError:
        return None
    terms = beside.fit.terms
    tap = best_delay(search.solver, terms, search.problem.most_tap, believed=ahead)
    search = Search(search.problem.measured_again(search.fit(terms, tap)))
    moved = Side(search, search.fit(terms, tap))
    delay = moved.values.estimates[DELAY]
    error = math.inf if math.isnan(delay.std_error) else delay.std_error
    lead = ahead - delay.value
    rows = search.problem.blocks.rows / problem.blocks.rows
    on_time = certainly_late(lead, error, step) and explains_most(moved.left, rows * beside.left)
    return (lead, error) if on_time else None
