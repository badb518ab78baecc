"""The passport of an axis: values fitted anew to each log, held against limits around those of its delivery."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum

from dsd_cli.effects import is_angle
from dsd_cli.identify.fit.problem import pose
from dsd_cli.identify.fit.testability import Settings
from dsd_cli.identify.recordings.recording import Recording
from dsd_cli.identify.results import Estimate, Estimates, Score
from dsd_cli.identify.search.sets import Search
from dsd_cli.plant.model import PlantModel

#: Name of the held-out force error among the values.
RMSE = "rmse"
#: A value is within (outside of) its limits where an interval of so many standard errors is: 95 %.
SURE = 2.0


class Verdict(StrEnum):
    """What a log says of a limit, the worst last.

    UNDECIDED : the interval holds an edge. NOT_IDENTIFIED : it is wider than the limits, or there is none.
    """

    WITHIN = "within"
    UNDECIDED = "undecided"
    NOT_IDENTIFIED = "not identified"
    OUTSIDE = "outside"


@dataclass(frozen=True)
class Limit:
    """What a value may be.

    within : largest change from the reference, in the value's unit; with `relative` a share of the reference.
    lower, upper : limits of the value itself.
    """

    within: float = math.inf
    relative: bool = False
    lower: float = -math.inf
    upper: float = math.inf

    def interval(self, reference: float) -> tuple[float, float]:
        """(smallest, largest) value that the limit allows."""
        change = self.within * (abs(reference) if self.relative else 1.0)
        low, high = (reference - change, reference + change) if math.isfinite(change) else (-math.inf, math.inf)
        return max(low, self.lower), min(high, self.upper)


@dataclass(frozen=True)
class Reference:
    """A value as it was delivered; std_error NaN where nobody knows it."""

    value: float
    std_error: float = math.nan


@dataclass(frozen=True)
class Reading:
    """What one log says of the model's values; `date` ISO 8601 or "", `floor` : error that the sensor alone leaves."""

    log: str
    date: str
    score: Score
    band_hz: float
    floor: float
    estimates: Estimates


@dataclass(frozen=True)
class Judged:
    """A limit and the newest log.

    low, high : what the limit allows. estimate : of the newest log.
    sigma : by how many standard errors of the difference the value has moved from its reference; NaN if not known.
    since : the first of the logs up to the newest of which none is within the limit; None where the newest is not
        outside. outside : logs, in order, that are outside.
    """

    name: str
    reference: Reference
    low: float
    high: float
    estimate: Estimate
    sigma: float
    verdict: Verdict
    since: Reading | None = None
    outside: tuple[str, ...] = ()


@dataclass(frozen=True)
class Passport:
    """Every limit judged by the newest log; `readings` in the order of their dates."""

    limits: tuple[Judged, ...]
    readings: tuple[Reading, ...]
    warnings: tuple[str, ...] = field(default=())

    @property
    def verdict(self) -> Verdict:
        """The worst of all limits."""
        return max((one.verdict for one in self.limits), key=list(Verdict).index)

    @property
    def failed(self) -> bool:
        """Whether it cannot be signed: a limit does not hold, or the newest log does not show whether it does."""
        return self.verdict in (Verdict.OUTSIDE, Verdict.NOT_IDENTIFIED)

    @property
    def worst(self) -> Judged:
        """The limit that decides the verdict; of several the one that moved by most standard errors."""
        candidates = [one for one in self.limits if one.verdict is self.verdict]
        return max(candidates, key=lambda one: abs(one.sigma) if math.isfinite(one.sigma) else 0.0)


def read_values(recording: Recording, model: PlantModel, settings: Settings, log: str, date: str) -> Reading:
    """All values of the model that are not held, fitted to this log alone. Raises as `pose`."""
    problem = pose([recording], model, Settings(known=settings.known, effects=()))
    fit = Search(problem).refit
    score = problem.score(fit)
    return Reading(log, date, score, problem.equations.band.hz, problem.floor, problem.values(fit).estimates)


def judge(
    limits: Mapping[str, Limit], reference: Mapping[str, Reference], readings: Sequence[Reading]
) -> tuple[Judged, ...]:
    """Every limit, in order; `readings` in the order of their dates, at least one."""
    return tuple(_judged(name, limit, reference[name], readings) for name, limit in limits.items())


def _judged(name: str, limit: Limit, reference: Reference, readings: Sequence[Reading]) -> Judged:
    low, high = limit.interval(reference.value)
    verdicts = [_verdict(name, value_of(one, name), limit, reference) for one in readings]
    newest = value_of(readings[-1], name)
    since: Reading | None = None
    if verdicts[-1] is Verdict.OUTSIDE:
        for reading, verdict in zip(reversed(readings), reversed(verdicts), strict=True):
            if verdict is Verdict.WITHIN:
                break
            since = reading if verdict is Verdict.OUTSIDE else since
    spread = math.hypot(newest.std_error, _known(reference.std_error))
    sigma = change(name, newest.value, reference.value) / spread if spread > 0.0 else math.nan
    outside = tuple(one.log for one, verdict in zip(readings, verdicts, strict=True) if verdict is Verdict.OUTSIDE)
    return Judged(name, reference, low, high, newest, sigma, verdicts[-1], since, outside)


def value_of(reading: Reading, name: str) -> Estimate:
    """A value of the model, or its held-out force error."""
    if name == RMSE:
        return Estimate(reading.score.heldout_rmse, 0.0, "{u}")
    return reading.estimates[name]


def change(name: str, value: float, reference: float) -> float:
    """value - reference; of an angle the shorter way round."""
    difference = value - reference
    return math.remainder(difference, 2.0 * math.pi) if is_angle(name) else difference


def _verdict(name: str, found: Estimate, limit: Limit, reference: Reference) -> Verdict:
    """The interval of the value against the limits; where an edge moves with the reference, its error counts too."""
    low, high = limit.interval(reference.value)
    known = math.isfinite(reference.value)
    value = reference.value + change(name, found.value, reference.value) if known else found.value
    if found.held or not math.isfinite(found.std_error):
        return Verdict.NOT_IDENTIFIED
    moving = _known(reference.std_error)
    share = limit.within if limit.relative else 0.0
    below = SURE * math.hypot(found.std_error, moving * abs(1.0 - share) if low > limit.lower else 0.0)
    above = SURE * math.hypot(found.std_error, moving * (1.0 + share) if high < limit.upper else 0.0)
    if value + below < low or value - above > high:
        return Verdict.OUTSIDE
    if value - below >= low and value + above <= high:
        return Verdict.WITHIN
    if value - below < low and value + above > high:
        return Verdict.NOT_IDENTIFIED
    return Verdict.UNDECIDED


def _known(std_error: float) -> float:
    return std_error if math.isfinite(std_error) else 0.0
