"""A model through a target: what is carried, what is left out and costs, and how far the exported model is off."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from dsd_cli.effects import Channels
from dsd_cli.errors import UsageError
from dsd_cli.export.base import INERTIA, Joint, Motion, NotRun, Target, Verdict
from dsd_cli.export.motion import Path, simulated
from dsd_cli.plant.forces import combine, interval_channels, interval_forces
from dsd_cli.plant.model import PlantModel
from dsd_cli.signals.log import Array

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
    """content of the file; what of the model is in it, and what is not."""

    content: bytes
    joint: Joint
    carried: tuple[Verdict, ...]
    dropped: tuple[Left, ...]


def make(target: Target, joint: Joint, motion: Motion, drop: bool) -> Made:
    """The joint through the target; the cost of what is left out is told on the motion.

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
    dropped = tuple(Left(one.part, one.how, cost(joint, one.part, motion, path)) for one in refused)
    return Made(target.write(kept), kept, tuple(one for one in verdicts if one.carried), dropped)


def verify(target: Target, made: Made, motion: Motion) -> Verified:
    """Runs the exported model beside `dsd simulate` of the parts that it carries."""
    if target.run is None:
        return Verified(False, f"not run: {target.not_run}")
    try:
        velocity = target.run(made.content, made.joint, motion)
    except NotRun as why:
        return Verified(False, f"not run: {why}")
    wanted = simulated(made.joint.model, motion).velocity
    off = percent(velocity, wanted)
    return Verified(True, motion.source, off, motion.sample_time, motion.u, np.asarray(velocity), wanted)


def percent(found: Array, wanted: Array) -> float:
    """rms of the difference in percent of the rms of what is wanted; infinite where it is not finite."""
    off, size = np.asarray(found) - wanted, math.sqrt(float(np.mean(wanted * wanted)))
    with np.errstate(over="ignore", invalid="ignore"):
        error = math.sqrt(float(np.mean(off * off))) if np.isfinite(off).all() else math.inf
    if size == 0.0:
        return 0.0 if error == 0.0 else math.inf
    return 100.0 * error / size


def cost(joint: Joint, part: str, motion: Motion, path: Path | None = None) -> Cost:
    """What leaving out that part costs along the motion of the whole model (`path`: that motion, where it is known)."""
    path = path or simulated(joint.model, motion)
    less = joint.without(frozenset([part])).model
    missing = _net(joint.model, motion, path) - _net(less, motion, path)
    force, size = _rms(missing), _rms(motion.u)
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


def _rms(x: Array) -> float:
    return math.sqrt(float(np.mean(x * x)))
