"""The command that moves a plant along a given path, and that motion as a recording to be looked at like a log's."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from dsd_cli.effects import Channels, Role, get_effect
from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.recordings.recording import Recording
from dsd_cli.plant.forces import interval_forces
from dsd_cli.plant.model import PlantModel
from dsd_cli.signals.log import Array, Log

#: Rounds in which u is found where forces or the actuator depend on it.
_ROUNDS = 8


@dataclass(frozen=True)
class Path:
    """position, velocity, acceleration, shape (n,), every `step` s; the acceleration is a mean over the interval that
    ends at each sample."""

    step: float
    position: Array
    velocity: Array
    acceleration: Array

    @classmethod
    def of(cls, position: Array, step: float) -> Path:
        """From the position alone: of a sine its speed to 1.2 %, down to eight samples a period."""
        velocity = np.gradient(position, step)
        velocity[1:-1] -= np.diff(velocity, 2) / 6.0
        return cls.moving(position, velocity, step)

    @classmethod
    def moving(cls, position: Array, velocity: Array, step: float) -> Path:
        """From the position and the velocity of each sample."""
        return cls(step, position, velocity, np.diff(velocity, prepend=velocity[:1]) / step)

    def resampled(self, step: float) -> Path:
        """The same every so many s, its speed a cubic between two samples: where it rests it stays at rest."""
        from scipy.interpolate import CubicHermiteSpline

        spline = CubicHermiteSpline(self.times, self.velocity, np.gradient(self.velocity, self.step))
        at = step * np.arange(int(self.times[-1] / step + 1e-9) + 1)
        return Path.moving(self.position[0] + spline.antiderivative()(at), spline(at), step)

    @property
    def times(self) -> Array:
        """s, from 0."""
        return np.asarray(self.step * np.arange(len(self.position)), dtype=np.float64)


def command_for(model: PlantModel, path: Path, most: float = np.inf) -> Array:
    """u of each sample, held to the next, under which that plant follows the path; no larger than `most`.

    From the forces of the plant's own law, mean over each interval; the command comes a delay earlier. What an input
    effect swallows is added until nothing is missing, or u is at its limit. At rest friction carries nothing.
    """
    mean, place, sign = _means(path)
    needed = model.motor_inertia * path.acceleration
    for _ in range(_ROUNDS if any("u" in get_effect(name).needs for name in model.effects) else 1):
        channels = Channels(path.times - 0.5 * path.step, needed, mean, place, np.full(len(mean), path.step))
        force, budget = interval_forces(model.effects, channels, model.inertia)
        needed = model.motor_inertia * path.acceleration - force + budget * sign
    return _commanded(model, np.asarray(needed), path.step, most)


def _means(path: Path) -> tuple[Array, Array, Array]:
    """Speed, place and direction of each interval, shape (n,)."""
    before = np.concatenate([path.velocity[:1], path.velocity[:-1]])
    place = 0.5 * (path.position + np.concatenate([path.position[:1], path.position[:-1]]))
    size = np.abs(path.velocity) + np.abs(before)
    sign = np.where(size > 1e-9 * max(float(size.max()), 1e-300), (path.velocity + before) / (size + 1e-300), 0.0)
    return 0.5 * (path.velocity + before), place, sign


def _commanded(model: PlantModel, needed: Array, step: float, most: float) -> Array:
    """u before the actuator and the delay, out of what must act in the interval that ends at each sample."""
    at = np.arange(len(needed), dtype=np.float64)
    wanted = np.interp(at + 1.0 + model.delay / step, at, needed)  # u_k acts until t_(k+1), a delay later
    inputs = [name for name in model.effects if get_effect(name).role is Role.INPUT]
    u = np.clip(wanted, -most, most)
    for _ in range(_ROUNDS if inputs else 0):
        u = np.clip(u + wanted - actuated(model, u, step), -most, most)
    return u


def actuated(model: PlantModel, u: Array, step: float) -> Array:
    """What the actuator makes of a command, mean over the interval that begins at each sample."""
    nothing, times = np.full(len(u), np.nan), step * (np.arange(len(u)) + 0.5)
    for name, values in model.effects.items():
        effect = get_effect(name)
        if effect.role is Role.INPUT:
            shape = effect.to_columns(values, model.inertia)[1]
            (u,), _ = effect.run(Channels(times, u, nothing, nothing, np.full(len(u), step)), shape)
    return np.asarray(u)


def as_recording(
    template: Recording, path: Path, u: Array, rest_speed: float = 0.0, seen: Recording | None = None
) -> Recording:
    """A motion as the sensor of the template would show it, but for its noise.

    Where friction may hold the axis is known no better than by that sensor: as `seen` (`seen.as_seen`), or by the noise
    that the speed of the template has.
    """
    step, q = path.step, path.position
    template = template if seen is None else seen
    if template.sensor.two_intervals:
        acceleration = np.pad(np.diff(q, 2) / step**2, 1, mode="edge")
    else:
        acceleration = path.acceleration
    rms = float(np.sqrt(np.mean(path.velocity**2)))
    rest = max(rest_speed, POLICY.rest_deviations * template.speed_noise, POLICY.creep_share * rms)
    channels = {
        "t": path.times,
        "u": u,
        "position": q,
        "velocity": path.velocity,
        "acceleration": acceleration,
        "rest_speed": np.full(len(q), rest),
        "speed_noise": np.full(len(q), template.speed_noise),
        "turning": np.full(len(q), np.nan),
    }
    if seen is not None:
        rest, (piece,) = seen.rest_speed, seen.pieces
        at = np.minimum(np.round(path.times / piece.sample_time).astype(int), len(piece) - 1)
        channels |= {name: piece[name][at] for name in ("rest_speed", "speed_noise")}
        channels["turning"] = np.where(np.isfinite(piece["turning"][at]), path.acceleration, np.nan)
    log = Log(channels, step, "plan", u_hold=template.pieces[0].u_hold)
    return replace(template, name="plan", pieces=(log,), rest_speed=rest, levels=(), pushed=None)
