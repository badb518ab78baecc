"""The model of a log fitted as every command fits it, as it is and with functions of the motion beside it.

A controller puts the noise of its sensor into u, and least squares of u on the motion takes that for an answer of the
axis: inertia and delay lean. The motion that was asked for drives both and has none of that noise: the same columns
along the reference are instruments (two-stage least squares, as IDIM-IV of Janot, Vandanjon and Gautier, 2014). Where
the reference explains little of the motion, errors are large and values not wrong.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from dsd_cli.errors import DsdError
from dsd_cli.identify.fit.bank import SHARE, Bank, Terms
from dsd_cli.identify.fit.blocks import grams
from dsd_cli.identify.fit.covariance import Information
from dsd_cli.identify.fit.direction import best_delay, certainly_late, explains_most
from dsd_cli.identify.fit.equations import equations_of
from dsd_cli.identify.fit.priors import grade, known_to
from dsd_cli.identify.fit.problem import functions_of_motion, pose
from dsd_cli.identify.fit.row_weights import residual_of_u
from dsd_cli.identify.fit.solve import Fit
from dsd_cli.identify.fit.testability import Settings, candidates_of
from dsd_cli.identify.fit.values import Fitted, fitted_values
from dsd_cli.identify.recordings.excerpts import earlier, excerpts
from dsd_cli.identify.recordings.recording import Recording, prepare
from dsd_cli.identify.results import DELAY, INERTIA
from dsd_cli.identify.search.sets import Search
from dsd_cli.plant.model import ObserverSettings, PlantModel
from dsd_cli.plant.prediction import Frame
from dsd_cli.signals.log import Array, Log, with_channels
from dsd_cli.signals.windows import smooth_size


@dataclass(frozen=True)
class Side:
    """A fit, and what it was made in."""

    search: Search
    fit: Fit

    @cached_property
    def values(self) -> Fitted:
        """With their standard errors."""
        return self.search.problem.values(self.fit)

    @cached_property
    def by_reference(self) -> ByReference | None:
        """Its values by instruments."""
        return leaning_of(self)

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


#: What is raised where no fit can be made, as on a corrupt cell (1e300), of which no square is a number.
_NO_FIT = suppress(DsdError, ValueError, ArithmeticError)


@np.errstate(over="ignore", invalid="ignore", divide="ignore")
def sides_of(log: Log, restarts: tuple[int, ...], model: PlantModel, observer: ObserverSettings | None) -> Sides | None:
    """None where no fit can be made of the log."""
    channels = {name: x for name, x in log.channels.items() if observer is not None or name != "d_hat"}
    observer = observer or ObserverSettings(model.inertia, 5.0 * log.sample_time)
    with _NO_FIT:
        return sides_in(prepare(replace(log, channels=channels), observer, restarts, model.rest_speed), model)
    return None


@np.errstate(over="ignore", invalid="ignore", divide="ignore")
def sides_in(recording: Recording, model: PlantModel) -> Sides | None:
    """Of a log that is ready to be fitted; None where no fit can be made of it."""
    with _NO_FIT:
        search = Search(pose(excerpts([recording]), model, Settings(effects=())))
        own = Side(search, search.refit)
        beside = _beside(own)
        return Sides(own, beside, _late(beside))
    return None


def _beside(own: Side) -> Side:
    """At the delay that is best then."""
    problem = own.search.problem
    names, _ = candidates_of(problem.recordings, (), problem.model, Settings())
    more = (t for t in functions_of_motion(names) if t.id not in problem.model.effects)
    terms: Terms = (*own.search.refit.terms, *more)
    tap = best_delay(own.search.solver, terms, problem.most_tap, own.fit.tap, believed=problem.model.delay)
    return _measured_again(own.search, terms, tap)


def _measured_again(search: Search, terms: Terms, tap: int) -> Side:
    """With the noise as it is beside these effects."""
    search = Search(search.problem.measured_again(search.fit(terms, tap)))
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
        search = Search(pose([earlier(recording, ahead)], model, Settings(effects=())))
    except DsdError:
        return None
    terms = beside.fit.terms
    tap = best_delay(search.solver, terms, search.problem.most_tap, believed=ahead)
    moved = _measured_again(search, terms, tap)
    delay = moved.values.estimates[DELAY]
    error = math.inf if math.isnan(delay.std_error) else delay.std_error
    lead = ahead - delay.value
    rows = moved.search.problem.blocks.rows
    before = rows / problem.blocks.rows * beside.left
    on_time = certainly_late(lead, error, step) and explains_most(moved.left, before, rows - len(moved.fit.total))
    return (lead, error) if on_time else None


#: An axis follows its reference within this, s.
_FOLLOWS = 0.25
#: Least squares leans where it is off the instruments by more than so many standard errors of the difference.
_LEANS = 3.0
#: Share of a column that the reference explains at least, beside the others, to be an instrument of it.
_EXPLAINS = 1e-6


@dataclass(frozen=True)
class ByReference:
    """values : by the instruments. leaning : inertia and delay by least squares, where these differ from the
    instruments' by more than chance, and than an identified value may be off."""

    values: Fitted
    leaning: Mapping[str, float]


def leaning_of(side: Side) -> ByReference | None:
    """None where the reference explains too little of the motion, or none is logged.

    Hausman's test (1978): least squares is the surer of both and right unless noise comes back through a controller;
    instruments are right in any loop. Their difference scatters by what each block pulls at it, and by no less than
    the one is less sure than the other.
    """
    problem, fit = side.search.problem, side.fit
    if not all("reference" in piece for r in problem.recordings for piece in r.pieces):
        return None
    bank, step = problem.solver.bank, problem.equations.sample_time
    model, logs = problem.model, problem.recordings
    asked = tuple(replace(r, pieces=tuple(_along_reference(p, model, r) for p in r.pieces)) for r in logs)
    along = equations_of(asked, problem.equations.startup, problem.equations.bands)
    white = Bank(along.with_whitening(*problem.equations.whitening), Bank(along))
    x, z = (np.stack(one.rows(fit.terms, fit.tap, keep=False)) for one in (bank, white))
    sizes = np.sqrt(np.mean(x[1:] ** 2, axis=1))
    if not sizes.all():
        return None
    hat = x[1:] @ np.linalg.pinv(z[1:]) @ z[1:]
    if np.linalg.svd(hat / sizes[:, None] / math.sqrt(hat.shape[1]), compute_uv=False)[-1] < _EXPLAINS:
        return None
    theta, pulls, found = _solved(x, hat, side)
    _, pulled, _ = _solved(x, x[1:], side)
    left = x[0] - theta @ x[1:]
    values = fitted_values(replace(fit, total=theta), problem.solver, problem.scale, float(np.mean(left**2)), found)
    error = math.sqrt(float(values.covariance[SHARE, SHARE])) * bank.tap_time
    delay = replace(values.estimates[DELAY], value=(fit.tap + float(theta[SHARE])) * bank.tap_time)
    delay = known_to(delay, DELAY, error, step)  # without a bound
    values = replace(values, estimates={**values.estimates, DELAY: delay})
    spread = np.linalg.norm(pulls - pulled, axis=0)
    leaning = {}
    for name, chance in ((INERTIA, float(spread[0])), (DELAY, float(spread[SHARE]) * bank.tap_time)):
        one, by = side.values.estimates[name], values.estimates[name]
        moved, judged = abs(by.value - one.value), step if name == DELAY else math.nan
        chance = max(chance, math.sqrt(max(by.std_error**2 - one.std_error**2, 0.0)))
        if moved > _LEANS * chance and grade(abs(by.value), moved, judged) != "identified":
            leaning[name] = one.value
    return ByReference(values, leaning)


def _solved(x: Array, hat: Array, side: Side) -> tuple[Array, Array, Information]:
    """(coefficients, by how much each block pulls at them, shape (B, p), what the rows say of them).

    x : the drive and the columns, shape (p+1, N). hat : what the instruments explain of the columns, shape (p, N).
    """
    blocks = side.search.problem.blocks
    theta = np.linalg.lstsq(hat.T, x[0], rcond=None)[0]
    sums = grams([x[0] - theta @ x[1:], *hat], blocks)
    normal, scores = sums.total[1:, 1:], sums.held_out[:, 1:, 0]
    return theta, scores @ np.linalg.pinv(normal), Information(normal, sums.held_out[:, 1:, 1:], scores, ())


def _along_reference(piece: Log, model: PlantModel, recording: Recording) -> Log:
    """With the motion along the reference, as late as the axis follows, and the u that the model needs for it."""
    wanted, step, n = piece["reference"], piece.sample_time, len(piece)
    lag = lag_of(wanted, piece["position"], min(n // 4, round(_FOLLOWS / step))) if "position" in piece else 0
    position = np.concatenate([np.full(lag, wanted[0]), wanted[: n - lag]])
    speed = np.gradient(position, step)
    second = np.pad(np.diff(position, 2) / step**2, 1, mode="edge")
    a = second if recording.sensor.two_intervals else np.pad(np.diff(speed) / step, (1, 0), mode="edge")
    moved = with_channels(piece, position=position, velocity=speed, acceleration=a, turning=np.full(n, np.nan))
    needed = model.motor_inertia * a - Frame(with_channels(moved, u=np.zeros(n))).net_force(model)
    ahead = round(model.delay / step)
    return with_channels(moved, u=np.concatenate([needed[ahead:], np.full(min(ahead, n), needed[-1])])[:n])


def lag_of(first: Array, then: Array, most: int) -> int:
    """Samples by which one channel follows another, 0 to `most`."""
    middle, n = first.mean(), first.size
    first, then = first - middle, then - middle  # or the squares of a position far from 0 round off their difference
    size = smooth_size(n + most)
    products = np.fft.irfft(np.fft.rfft(first, size).conj() * np.fft.rfft(then, size), size)[: most + 1]
    head = np.cumsum(first**2)[n - most - 1 :][::-1]
    tail = np.cumsum(then[::-1] ** 2)[n - most - 1 :][::-1]
    return int(np.argmin((head + tail - 2.0 * products) / np.arange(n, n - most - 1, -1)))
