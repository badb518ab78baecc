"""The motion of the plant that an exported model is held against: the plant of `dsd simulate` under a given u."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from dsd_cli.effects import Channels, Role, get_effect
from dsd_cli.errors import DataError
from dsd_cli.export.base import Motion
from dsd_cli.plant.filtering import delay_taps
from dsd_cli.plant.forces import interval_forces
from dsd_cli.plant.model import PlantModel
from dsd_cli.plant.motion import Actuator, Plant
from dsd_cli.signals.log import Array, Log

#: Built-in motion: s, and rad or m of its slower and faster part.
DURATION, SWEEP, WOBBLE = 3.0, 1.0, 0.1
#: Hz of both, both at rest at TURN s, from when on u is this share of the friction for so many s, which must hold.
SLOW, FAST, TURN, REST, HELD = 0.5, 3.0, 2.0, 0.2, 0.4


#: What a motion at rest is good for.
STILL = "nothing can be compared; a log with moves is needed"


class Path(NamedTuple):
    """velocity and position at t_0 ... t_n-1, SI, shape (n,)."""

    velocity: Array
    position: Array


def simulated(model: PlantModel, motion: Motion, horizon: float = math.inf, path: Path | None = None) -> Path:
    """The plant of `dsd simulate` under u(t - L); u and all memory have settled on 0 before t_0.

    Parameters
    ----------
    horizon, path : every `horizon` s the run takes up position and velocity of `path` again.
    """
    step, count = motion.sample_time, len(motion.u)
    plant, actuator = Plant(model, motion.position, motion.velocity), Actuator(model)
    whole, fraction = delay_taps(model.delay, step)
    drive = [actuator.at_rest] * (whole + 1)
    every = max(round(horizon / step), 1) if math.isfinite(horizon) else count
    velocity, position = np.empty(count), np.empty(count)
    for k, u in enumerate(motion.u.tolist()):
        if path is not None and k % every == 0:
            plant.velocity, plant.position = float(path.velocity[k]), float(path.position[k])
        velocity[k], position[k] = plant.velocity, plant.position
        t = k * step
        drive.append(actuator.drive(t, u, step))
        split = fraction * step
        if fraction > 0.0:
            plant.advance(t, drive[-2 - whole], split)
        plant.advance(t + split, drive[-1 - whole], step - split)
    return Path(velocity, position)


def built_in(model: PlantModel, sample_time: float) -> Motion:
    """u for reversals, slow and fast parts and a rest: J a less the forces on a planned path."""
    t = np.arange(round(DURATION / sample_time)) * sample_time
    resting = (t >= TURN) & (t < TURN + REST)
    position = np.zeros(len(t))
    velocity, acceleration = np.zeros(len(t)), np.zeros(len(t))
    for size, hertz in ((SWEEP, SLOW), (WOBBLE, FAST)):
        w = 2.0 * math.pi * hertz
        position += size * (1.0 - np.cos(w * t))
        velocity += size * w * np.sin(w * t)
        acceleration += size * w * w * np.cos(w * t)
    # the pull of a load is in J already
    forces = {n: v for n, v in model.effects.items() if get_effect(n).role in (Role.APPLIED, Role.FRICTION)}
    needed = model.inertia * acceleration
    channels = Channels(t, needed, velocity, position, np.full(len(t), sample_time))
    force, budget = interval_forces(forces, channels, model.inertia)
    u = np.where(resting, HELD * budget - force, needed - force + np.sign(velocity) * budget)
    return Motion(u, sample_time)


def _rests(log: Log, end: int) -> bool:
    """Whether nothing is logged of a motion but noise of the sensor.

    White noise of n < 1e6 samples is within 10 times its deviation, 7 times the rms of its steps; a speed that is
    white is less than its own steps. One step of an encoder is two values.
    """
    if "position" in log:
        position = log["position"][:end]
        size = float(np.sqrt(np.mean(np.diff(position) ** 2))) if end > 1 else 0.0
        return len(np.unique(position)) <= 2 or float(np.ptp(position)) < 8.0 * size
    if "velocity" in log:
        velocity = log["velocity"][:end]
        return not np.any(velocity) or bool(np.mean(velocity**2) < np.mean(np.diff(velocity) ** 2))
    return False


def logged(log: Log, source: str, restarts: tuple[int, ...] = ()) -> Motion:
    """u of a log up to its first gap, from where and as fast as the axis was when it began.

    Raises
    ------
    DataError : the axis does not move in it.
    """
    end = restarts[0] if restarts else len(log)
    if _rests(log, end):
        raise DataError(f"{source}: the axis does not move" + (" before the first gap" if restarts else ""), STILL)
    position = float(log["position"][0]) if "position" in log else 0.0
    if "velocity" in log:
        velocity = float(log["velocity"][0])
    else:
        velocity = float(np.diff(log["position"][:2])[0] / log.sample_time) if "position" in log and end > 1 else 0.0
    return Motion(np.array(log["u"][:end]), log.sample_time, position, velocity, source)
