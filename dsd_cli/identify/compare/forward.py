"""The model run forward from where the log begins: open loop under the logged u, and closed through the controller.

A prediction of d_hat sees each force at once; a position is its double integral. In open loop every error of the model,
and every u that was not quite what reached the axis, therefore adds up without limit; the closed loop holds it down.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from dsd_cli.errors import DataError, UsageError
from dsd_cli.identify.compare.evaluation import percent_left
from dsd_cli.identify.recordings.recording import Recording
from dsd_cli.plant.controllers import Controller, ControllerSettings, Measured
from dsd_cli.plant.filtering import delay_taps
from dsd_cli.plant.model import ObserverSettings, PlantModel
from dsd_cli.plant.motion import Actuator, Plant
from dsd_cli.plant.observer import DisturbanceObserver
from dsd_cli.plant.prediction import Frame
from dsd_cli.plant.references import Logged
from dsd_cli.signals.log import Array, Log
from dsd_cli.signals.rounding import ROUNDING
from dsd_cli.signals.spread import rms
from dsd_cli.signals.units import Units

#: Channels of a simulation.
CHANNELS = ("position", "velocity")
#: A simulated channel this many times beyond the range of the logged one has diverged.
_DIVERGED = 1e6
OPEN_LOOP, CLOSED_LOOP = "open_loop", "closed_loop"
#: Samples out of which the speed at the start is had.
_FIRST = 20
#: Share by which a sample time is off: stamps that count from long ago have few digits for it.
_OF_STAMPS = 1e-6
#: Times the error of the open loop, from which on that of the closed one is not the model's; and least fit.
_OF_CONTROLLER, _CLOSE_ENOUGH = 2.0, 99.95


@dataclass(frozen=True)
class Tracking:
    """One channel of a simulation against the log; fit_percent as in `Accuracy`."""

    channel: str
    unit: str
    rmse: float
    fit_percent: float | None
    vaf_percent: float | None
    bias: float
    max_error: float


@dataclass(frozen=True)
class Trace:
    """One piece of a log and what was simulated beside it; channel -> shape (n,), `closed_loop` {} without one."""

    name: str
    t: Array
    measured: Mapping[str, Array]
    open_loop: Mapping[str, Array]
    closed_loop: Mapping[str, Array]


@dataclass(frozen=True)
class Forward:
    """Simulations over the logs; `not_closed` says why there is none in closed loop.

    `provenance` : channel -> where it is from, of the first log. `horizon` : s after which the open loop was begun
    anew from the measured motion; inf: never. `restarts` : how often it was. `traces` : of each piece, for a picture.
    """

    logs: tuple[str, ...]
    samples: int
    open_loop: tuple[Tracking, ...]
    closed_loop: tuple[Tracking, ...]
    not_closed: str = ""
    provenance: Mapping[str, str] = field(default_factory=dict)
    horizon: float = math.inf
    restarts: int = 0
    traces: tuple[Trace, ...] = field(default=(), repr=False, compare=False)

    @property
    def of_controller(self) -> bool:
        """Whether the closed loop is clearly further off than the open one: then it is the controller that differs from
        the one of the log (what it measures, how it differentiates the reference), and not the model."""
        if not self.closed_loop or (self.closed_loop[0].fit_percent or 0.0) > _CLOSE_ENOUGH:
            return False
        return self.closed_loop[0].rmse > _OF_CONTROLLER * self.open_loop[0].rmse

    @property
    def main(self) -> tuple[str, Tracking]:
        """The loop and channel that stand for the whole: closed if there is one, position if there is one."""
        loop = CLOSED_LOOP if self.closed_loop else OPEN_LOOP
        return loop, (self.closed_loop or self.open_loop)[0]


def run_forward(
    recordings: Sequence[Recording],
    model: PlantModel,
    observer: ObserverSettings,
    controller: ControllerSettings | None = None,
    *,
    horizon: float = math.inf,
    units: Units = Units(),  # noqa: B008
) -> Forward:
    """Simulate every piece from its first position and speed, and compare.

    horizon : s; the open loop begins anew from the measured position and speed each time it has run so long.

    Raises DataError : the simulation diverges, or the logs have neither position nor velocity.
    UsageError : a horizon shorter than a sample.
    """
    pieces = [piece for recording in recordings for piece in recording.pieces]
    longest = max(piece.sample_time for piece in pieces)
    if horizon < (1.0 - _OF_STAMPS) * longest:
        raise UsageError(f"--horizon {horizon:g}s", f"the samples are {longest:g} s apart; a horizon is longer")
    names = [name for name in CHANNELS if all(name in piece for piece in pieces)]
    if "velocity" not in names:
        raise DataError(f"{recordings[0].name}: no motion to simulate against", "set signals.velocity or .position")
    not_closed = (
        _not_closed(pieces, controller) if math.isinf(horizon) else "a horizon in seconds looks at the open loop alone"
    )
    starts = [_start(piece, recording) for recording in recordings for piece in recording.pieces]
    rest = [recording.rest_speed for recording in recordings for _ in recording.pieces]
    runs = [open_loop(p, model, horizon, *how) for p, *how in zip(pieces, starts, rest, strict=True)]
    looped: list[dict[str, Array]] = []
    if controller is not None and not not_closed:
        looped = [closed_loop(piece, model, replace(observer, sign=1), controller) for piece in pieces]
    return Forward(
        logs=tuple(r.name for r in recordings),
        samples=sum(map(len, pieces)),
        open_loop=_tracking(pieces, runs, names, units),
        closed_loop=_tracking(pieces, looped, names, units) if looped else (),
        not_closed=not_closed,
        provenance=dict(recordings[0].provenance),
        horizon=horizon,
        restarts=sum(len(restart_rows(piece["t"].tolist(), horizon)) for piece in pieces),
        traces=_traces(recordings, names, runs, looped),
    )


def _traces(
    recordings: Sequence[Recording],
    names: Sequence[str],
    runs: Sequence[dict[str, Array]],
    looped: Sequence[dict[str, Array]],
) -> tuple[Trace, ...]:
    pieces = [(recording.name, piece) for recording in recordings for piece in recording.pieces]
    found = zip(pieces, runs, looped or [{} for _ in pieces], strict=True)
    return tuple(
        Trace(name, piece["t"], *({n: of[n] for n in names if n in of} for of in (piece.channels, run, loop)))
        for (name, piece), run, loop in found
    )


def _not_closed(pieces: Sequence[Log], controller: ControllerSettings | None) -> str:
    if controller is None:
        return "the config has no [simulate.controller]"
    if any("reference" not in piece for piece in pieces):
        return "the log has no reference"
    if not all(Frame(piece).regular for piece in pieces):
        return "the stamps are irregular, and the controller has a clock"
    return ""


def open_loop(
    piece: Log, model: PlantModel, horizon: float = math.inf, start: float | None = None, rest_speed: float = 0.0
) -> dict[str, Array]:
    """Position and velocity under the logged u, shape (n,) each; u before the log is held at u_0.

    horizon : each time it has run for so many s it begins anew from the measured motion; what effects remember stays.
    start : speed at the first sample; None is the logged one. rest_speed : an axis no faster than that rests.
    """
    frame, first = Frame(piece), float(piece["velocity"][0]) if start is None else start
    drive = frame.mean_u(frame.command(model.effects), model.delay).tolist()
    times, intervals = piece["t"].tolist(), frame.intervals.tolist()
    anew = frozenset(restart_rows(times, horizon))
    watch = Watch(piece)
    plant = Plant(model, watch.rows[0][0], _at_rest(first, rest_speed))
    for k in range(1, len(times)):
        if k - 1 in anew:
            plant.position = float(piece["position"][k - 1]) if "position" in piece else plant.position
            plant.velocity = _at_rest(float(piece["velocity"][k - 1]), rest_speed)
        watch.guarded(plant, times[k - 1], drive[k], intervals[k])
        watch.note(plant, times[k])
    return watch.channels()


def restart_rows(times: Sequence[float], horizon: float) -> list[int]:
    """Rows whose measured motion the simulation takes up again: no part of it is longer than the horizon."""
    rows, since = [], times[0]
    for k, t in enumerate(times[1:]):
        if t - since > horizon * (1.0 + ROUNDING):
            since = times[k]
            rows.append(k)
    return rows


def closed_loop(
    piece: Log, model: PlantModel, observer: ObserverSettings, controller: ControllerSettings
) -> dict[str, Array]:
    """Position and velocity under the controller's own u, which follows the logged reference."""
    step = piece.sample_time
    reference = Logged(tuple(piece["reference"].tolist())).sample(len(piece), step)
    targets = list(zip(reference.position.tolist(), reference.rate.tolist(), strict=True))
    times = piece["t"].tolist()
    start = _at_rest(float(piece["velocity"][0]), model.rest_speed)
    watch, actuator = Watch(piece), Actuator(model)
    plant = Plant(model, watch.rows[0][0], start)
    watcher = DisturbanceObserver(observer, step, "velocity", float(piece["d_hat"][0]))
    law = Controller(controller, observer.nominal_inertia, step)
    whole, fraction = delay_taps(model.delay, step)
    before = actuator.drive(times[0] - step, float(piece["u"][0]), step)
    drive = [before] * (whole + 2)
    for t, target in zip(times[:-1], targets[:-1], strict=True):
        d_hat = watcher.observe(plant.velocity)
        u = law.step(Measured(*target, plant.position, plant.velocity, d_hat))
        watcher.apply(u)
        drive.append(actuator.drive(t, u, step))
        if fraction > 0.0:
            watch.guarded(plant, t, drive[-2 - whole], fraction * step)
        watch.guarded(plant, t + fraction * step, drive[-1 - whole], (1.0 - fraction) * step)
        watch.note(plant, t + step)
    return watch.channels()


def _at_rest(speed: float, rest_speed: float) -> float:
    return 0.0 if abs(speed) <= rest_speed else speed


def _start(piece: Log, recording: Recording) -> float:
    """Speed at the first sample; one out of the position is worst there, and a parabola through a few is better."""
    if recording.provenance.get("velocity") != "from position" or piece["position"].size < _FIRST:
        return float(piece["velocity"][0])
    t = piece["t"][:_FIRST] - piece["t"][0]
    return float(np.polyfit(t / t[-1], piece["position"][:_FIRST], 2)[1] / t[-1])


def _tracking(
    pieces: Sequence[Log], runs: Sequence[dict[str, Array]], names: Sequence[str], units: Units
) -> tuple[Tracking, ...]:
    found = []
    for name in names:
        logged = np.concatenate([piece[name] for piece in pieces])
        error = logged - np.concatenate([run[name] for run in runs])
        spread = rms(logged - logged.mean())
        size = rms(error)
        found.append(
            Tracking(
                channel=name,
                unit=units.of_position if name == "position" else units.of_velocity,
                rmse=size,
                fit_percent=percent_left(size, spread),
                vaf_percent=percent_left(float(np.var(error)), spread**2),
                bias=float(error.mean()),
                max_error=float(np.abs(error).max()),
            )
        )
    return tuple(found)


class Watch:
    """What a simulated plant did, and whether it ran away."""

    def __init__(self, piece: Log) -> None:
        self.name = piece.source
        first = (float(piece["position"][0]) if "position" in piece else 0.0, float(piece["velocity"][0]))
        self.rows = [first]
        spans = [float(np.abs(piece[name]).max()) for name in CHANNELS if name in piece]
        self.limit = _DIVERGED * max(max(spans), 1e-9)

    def guarded(self, plant: Plant, t: float, u: float, duration: float) -> None:
        """Advance; a force that overflows has diverged."""
        try:
            plant.advance(t, u, duration)
        except (OverflowError, ZeroDivisionError, ValueError):
            raise self.diverged(t) from None

    def note(self, plant: Plant, t: float) -> None:
        """One more row."""
        if not (abs(plant.position) <= self.limit and abs(plant.velocity) <= self.limit):
            raise self.diverged(t)
        self.rows.append((plant.position, plant.velocity))

    def diverged(self, t: float) -> DataError:
        """The error."""
        return DataError(
            f"{self.name}: the simulated axis runs away: at t = {t:g} s it is {_DIVERGED:g} times beyond the log",
            "the model is unstable: check the signs of its effects, the gains, and the sample time",
        )

    def channels(self) -> dict[str, Array]:
        """By name, shape (n,)."""
        position, velocity = np.array(self.rows).T
        return {"position": position, "velocity": velocity}
