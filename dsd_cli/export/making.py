"""A model through a target: what is carried, what is left out and costs, and how far the exported model is off."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from dsd_cli.effects import Channels
from dsd_cli.errors import DataError, UsageError
from dsd_cli.export.base import INERTIA, Joint, Motion, NotRun, Target, Verdict
from dsd_cli.export.motion import STILL, Path, simulated
from dsd_cli.plant.forces import combine, interval_channels, interval_forces
from dsd_cli.plant.model import PlantModel
from dsd_cli.signals.log import Array
from dsd_cli.signals.spread import rms

#: An exported model that is further off than so many percent of the rms speed is refused.
MOST_PERCENT = 1.0
#: s of free simulation in which leaving out an effect is told.
FREE = 0.5


@dataclass(frozen=True)
class Cost:
    """What leaving a part out costs on a motion.

    force : rms of the force that is then missing, unit of u. force_percent : of the rms of u.
    velocity_percent : rms error of the speed within free simulations of 0.5 s, of the rms speed; infinite where
    the model without it runs away.
    """

    force: float
    force_percent: float
    velocity_percent: float


@dataclass(frozen=True)
class Left:
    """A part that a target does not carry: why, and what that costs."""

    part: str
    why: str
    cost: Cost


@dataclass(frozen=True)
class Verified:
    """Whether the exported model ran, what it ran under, and the rms of its speed error in percent of the rms speed.

    `how` says why not where it did not run; `rms_percent` is then None. `found`, `wanted` : speed of the exported model
    and of `dsd simulate` under `u`, SI, shape (n,), `sample_time` s apart; empty where it did not run.
    """

    ran: bool
    how: str
    rms_percent: float | None = None
    sample_time: float = 0.0
    u: Array = field(default_factory=lambda: np.zeros(0), repr=False, compare=False)
    found: Array = field(default_factory=lambda: np.zeros(0), repr=False, compare=False)
    wanted: Array = field(default_factory=lambda: np.zeros(0), repr=False, compare=False)

    @property
    def holds(self) -> bool:
        return self.rms_percent is None or self.rms_percent <= MOST_PERCENT


@dataclass(frozen=True)
class Made:
    """content of the file; what of the model is in it, and what is not; lost: what leaving all that out costs."""

    content: bytes
    joint: Joint
    carried: tuple[Verdict, ...]
    dropped: tuple[Left, ...]
    lost: Cost | None = None


def make(target: Target, joint: Joint, motion: Motion, drop: bool) -> Made:
    """The joint through the target; the cost of what is left out is measured on the motion.

    Raises
    ------
    UsageError : a part that it does not carry, unless `drop`; the inertia can never be left out.
    """
    verdicts = [target.judge(joint, part) for part in joint.parts]
    refused = [one for one in verdicts if not one.carried]
    if refused and (not drop or any(one.part == INERTIA for one in refused)):
        reasons = "; ".join(f"{one.part} ({one.how})" for one in refused)
        raise UsageError(f"{target.id} does not carry {reasons}", "--drop leaves it out and says what that costs")
    kept = joint.without(frozenset(one.part for one in refused))
    path = simulated(joint.model, motion) if refused else None
    dropped = tuple(Left(one.part, one.how, cost(joint, [one.part], motion, path)) for one in refused)
    lost = cost(joint, [one.part for one in refused], motion, path) if refused else None
    return Made(target.write(kept), kept, tuple(one for one in verdicts if one.carried), dropped, lost)


def verify(target: Target, made: Made, motion: Motion) -> Verified:
    """Runs the exported model beside `dsd simulate` of the parts that it carries.

    Raises
    ------
    DataError : the axis does not move under that u, so that both speeds are 0 whatever the exported model is.
    """
    if target.run is None:
        return Verified(False, f"not run: {target.not_run}")
    path = simulated(made.joint.model, motion)
    moving = np.abs(path.velocity) > made.joint.model.rest_speed
    if not moving.any():
        raise DataError(f"{motion.source}: the model does not move under its u", STILL)
    if 0 < target.most < len(motion.u):
        motion = _part(motion, path, max(int(np.argmax(moving)) - 1, 0), target.most)
        path = simulated(made.joint.model, motion)
    try:
        velocity = target.run(made.content, made.joint, motion)
    except NotRun as why:
        return Verified(False, f"not run: {why}")
    wanted = path.velocity
    off = percent(velocity, wanted)
    return Verified(True, motion.source, off, motion.sample_time, motion.u, np.asarray(velocity), wanted)


def _part(motion: Motion, path: Path, start: int, most: int) -> Motion:
    """At most so many samples from that one on, from where and as fast as the model is then."""
    end, step = min(start + most, len(motion.u)), motion.sample_time
    which = f"{motion.source}, {start * step:.4g} to {end * step:.4g} s of {len(motion.u) * step:.4g} s"
    return Motion(motion.u[start:end], step, float(path.position[start]), float(path.velocity[start]), which)


def percent(found: Array, wanted: Array) -> float:
    """rms of the difference in percent of the rms of what is wanted; infinite where it is not finite."""
    off, size = np.asarray(found) - wanted, math.sqrt(float(np.mean(wanted * wanted)))
    with np.errstate(over="ignore", invalid="ignore"):
        error = math.sqrt(float(np.mean(off * off))) if np.isfinite(off).all() else math.inf
    if size == 0.0:
        return 0.0 if error == 0.0 else math.inf
    return 100.0 * error / size


def cost(joint: Joint, parts: Sequence[str], motion: Motion, path: Path | None = None) -> Cost:
    """What leaving out these parts costs along the motion of the whole model (`path`: it, where it is known)."""
    path = path or simulated(joint.model, motion)
    less = joint.without(frozenset(parts)).model
    missing = _net(joint.model, motion, path) - _net(less, motion, path)
    force, size = rms(missing), rms(motion.u)
    free = simulated(less, motion, FREE, path)
    return Cost(force, 100.0 * force / size if size > 0.0 else math.inf, percent(free.velocity, path.velocity))


def _net(model: PlantModel, motion: Motion, path: Path) -> Array:
    """Net force on the plant in the interval that ends at each sample, unit of u, along a given path, shape (n,)."""
    from dsd_cli.effects import Role, get_effect
    from dsd_cli.plant.filtering import delayed_mean

    step = motion.sample_time
    t = np.arange(len(motion.u)) * step
    u = motion.u
    for name, values in model.effects.items():
        if (effect := get_effect(name)).role is Role.INPUT:
            columns, _ = effect.run(
                Channels(t, u, path.velocity, path.position, np.full(len(t), step)),
                effect.to_columns(values, model.inertia)[1],
            )
            u = np.asarray(columns[0], dtype=np.float64)
    u = delayed_mean(u, model.delay, step)
    means = interval_channels(path.velocity, path.position, step, model.rest_speed)
    channels = Channels(t - 0.5 * step, u, means.velocity, means.position, np.full(len(t), step))
    force, budget = interval_forces(model.effects, channels, model.inertia)
    return combine(u, force, budget, means.sign, model.inertia * means.acceleration)
