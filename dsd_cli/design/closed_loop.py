"""Each explanation as the plant under the loop: does the motion keep its limits there, and what does it identify?"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from dsd_cli.design.inverse import Path, command_for
from dsd_cli.design.limits import Limits
from dsd_cli.effects import Role, get_effect
from dsd_cli.errors import DataError
from dsd_cli.plant.controllers import ControllerSettings, Gains
from dsd_cli.plant.model import ObserverSettings, PlantModel
from dsd_cli.plant.motion import Plant
from dsd_cli.plant.references import Planned
from dsd_cli.plant.simulation import SimulationSettings, simulate
from dsd_cli.signals.log import Array

#: Of loops that nobody described: crossover times its lag, rad, of a stiff one (45 degrees of phase margin are left),
#: of a soft one; least and most rad/s; share of the crossover at which the gains of position and integral take over.
_STIFF, _SOFT, _SLOWEST, _FASTEST, _POSITION, _INTEGRAL = 0.45, 0.3, 3.0, 40.0, 0.25, 0.05
#: s that the axis is held at the start before the motion begins; s over which an acceleration counts.
SETTLE, _ACCELERATION_OVER = 1.5, 0.02
#: Times the rate of a loop, from where on a load that swings on its motor moves with it.
_AS_ONE = 10.0


@dataclass(frozen=True)
class Loop:
    """The loop that the motion is run in; step : s of its samples. described : by the user; else his may be stiffer."""

    controller: ControllerSettings
    observer: ObserverSettings
    step: float
    described: bool = False


class UnstableLoopError(DataError):
    """The simulated loop is not stable with a plant; says under which gains."""


class StandsOffError(UnstableLoopError):
    """It holds the axis beyond the limits before the motion begins, so that no user has brought it to the start."""


@dataclass(frozen=True)
class Run:
    """What a plant did: path and u, shape (n,), from the first sample of the motion on."""

    path: Path
    u: Array

    def exceeded(self, limits: Limits, part: slice = slice(None)) -> dict[str, float]:
        """Limits that it broke in a part, and by which share; an acceleration counts as its mean over 20 ms."""
        width = max(round(_ACCELERATION_OVER / self.path.step), 1)
        smooth = np.convolve(self.path.acceleration, np.ones(width) / width, "same")
        return limits.exceeded(*(x[part] for x in (self.path.position, self.path.velocity, smooth, self.u)))


def usual_loops(model: PlantModel, observer: ObserverSettings, step: float) -> tuple[Loop, Loop]:
    """PID and PD with feedforward for this plant, as stiff as its delay lets it be and softer: a user's are between. In
    the first an axis swings whose friction falls with the speed; in the other it stands off by what the feedforward
    lacks, over the gain of the position."""

    def loop(phase: float, integral: float) -> Loop:
        pace = float(np.clip(phase / (model.delay + step + 0.004), _SLOWEST, _FASTEST))
        kd = model.inertia * pace
        kp = _POSITION * kd * pace
        law = ControllerSettings("pd", Gains(kp, kd), "error", integral=integral * kp * pace)
        return Loop(law, replace(observer, sign=1), step)

    return loop(_STIFF, _INTEGRAL), loop(_SOFT, 0.0)


def run_loop(plant: PlantModel, loop: Loop, planned: tuple[Path, Array], limits: Limits) -> Run:
    """The plant under that loop, held at the start until it rests.

    planned : the path that is wanted, the rest before it (`SETTLE`) included, and the feedforward of u, shape (n,).

    Raises
    ------
    UnstableLoopError : the loop is not stable with this plant. StandsOffError : nobody described a loop that cannot
    hold it at the start.
    """
    before, (path, added) = round(SETTLE / loop.step), planned
    if loop.controller.integral > 0.0:  # what holds the axis at the start stands in it before the motion begins
        rest = Path.of(path.position[:before], loop.step)
        added = added + (command_for(plant, rest)[0] - added[0])
    settings = SimulationSettings(
        model=_simulated(plant, loop),
        duration=len(added) * loop.step,
        sample_time=loop.step,
        observer=loop.observer,
        controller=loop.controller,
        reference=Planned(path.position, path.velocity),
        start=limits.start,
        feedforward=added,
        before=float(added[0]),
    )
    gains, log = loop.controller.gains, None
    with suppress(DataError):
        log = simulate(settings)
    if log is None or not float(np.abs(log["velocity"]).max()) < 1e3 * limits.velocity:
        raise UnstableLoopError(
            f"the simulated loop is unstable (kp {gains.kp:.3g}, kd {gains.kd:.3g})", "lower its gains"
        )
    velocity, u = log["velocity"], log["u"]
    if not loop.described:  # one so stiff that the axis follows, whose friction or inertia holds it up in this one
        followed = command_for(plant, path, 3.0 * limits.u)
        u = np.where(np.abs(followed) > np.abs(u), followed, u)
        stands = float(log["position"][before])
        if not (loop.controller.integral > 0.0 or limits.low <= stands <= limits.high):
            raise StandsOffError(f"a loop without an integral rests at {stands:.3g}, not at {limits.start:.3g},")
    slope = np.diff(velocity, prepend=velocity[:1]) / loop.step
    return Run(Path(loop.step, *(x[before:] for x in (log["position"], velocity, slope))), u[before:])


def _simulated(plant: PlantModel, loop: Loop) -> PlantModel:
    """What moves in that loop as the plant does, in a few stretches of constant forces a sample: late by whole samples,
    a load without play that swings far faster than the loop answers one with its motor."""
    fast = Plant(plant).resonance > _AS_ONE * loop.controller.gains.kd / plant.inertia
    one = {n: v for n, v in plant.effects.items() if v.get("gap") or get_effect(n).role is not Role.STRUCTURE}
    return replace(plant, delay=round(plant.delay / loop.step) * loop.step, effects=one if fast else plant.effects)
