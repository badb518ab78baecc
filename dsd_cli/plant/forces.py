"""What acts on the plant in the interval that ends at each sample: mean motion, effect forces, friction."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsd_cli.effects import Channels, Role, get_effect
from dsd_cli.plant.model import EffectValues
from dsd_cli.signals.log import Array

Mask = NDArray[np.bool_]


class Sample(NamedTuple):
    """The last sample of the chunk before; a channel that is not logged is None."""

    velocity: float | None
    position: float | None


class IntervalChannels(NamedTuple):
    """Means over the interval that ends at each sample; each of shape (n,), NaN where not logged.

    velocity, position : mean speed and position.
    sign : mean of sgn v while the plant moves; NaN at rest (both end speeds within the rest speed).
    acceleration : (v_k - v_{k-1})/T where the plant starts, stops or turns, so that sgn v does not say what friction
        does in the interval; NaN elsewhere.
    """

    velocity: Array
    position: Array
    sign: Array
    acceleration: Array


def interval_channels(
    velocity: Array | None,
    position: Array | None,
    interval: float | Array,
    rest_speed: float = 0.0,
    previous: Sample | None = None,
) -> IntervalChannels:
    """Mean motion per interval; `interval` is T in s, a number or shape (n,) for irregular stamps.

    Without velocity the mean speed is diff(q)/T, and friction goes by that. The first sample of a log (no `previous`)
    has no interval: it stands for itself.
    """
    given = velocity if velocity is not None else position
    missing = np.full(0 if given is None else len(given), np.nan)
    before = previous or Sample(None, None)
    ends = None if position is None else _with_previous(position, before.position)
    mean_position = missing if ends is None else 0.5 * (ends[:-1] + ends[1:])
    if velocity is None:
        mean = missing if ends is None else np.diff(ends) / interval
        sign = np.where(np.abs(mean) <= rest_speed, np.nan, np.sign(mean))
        return IntervalChannels(mean, mean_position, sign, missing)
    speeds = _with_previous(velocity, before.velocity)
    a, b = speeds[:-1], speeds[1:]
    with np.errstate(invalid="ignore", divide="ignore"):
        sign = (a + b) / (np.abs(a) + np.abs(b))
    at_rest, unclear = _rest(a, b, rest_speed)
    sign = np.where(at_rest, np.nan, sign)
    acceleration = np.where(unclear, (b - a) / interval, np.nan)
    return IntervalChannels(0.5 * (a + b), mean_position, sign, acceleration)


def _with_previous(x: Array, previous: float | None) -> Array:
    return np.concatenate([x[:1] if previous is None else [previous], x])


def _rest(a: Array, b: Array, rest_speed: float) -> tuple[Mask, Mask]:
    """Intervals at rest, and those that start, stop or turn."""
    slow_a, slow_b = np.abs(a) <= rest_speed, np.abs(b) <= rest_speed
    return slow_a & slow_b, (slow_a ^ slow_b) | ((a * b < 0.0) & ~(slow_a & slow_b))


def interval_forces(effects: EffectValues, channels: Channels, inertia: float = 1.0) -> tuple[Array, Array]:
    """(force F of applied effects and loads, budget b >= 0 of the frictions), unit of u, shape of the channels.

    Parameters
    ----------
    channels : means of an interval; `channels.u` is the delayed u that reaches the plant.
        The state of effects with memory is that at the begin of a log.
    inertia : J of the whole plant, for effects that hang a part of it on the motor.
    """
    total = {True: np.zeros(np.shape(channels.u)), False: np.zeros(np.shape(channels.u))}
    for name, values in effects.items():
        effect = get_effect(name)
        if effect.role is Role.INPUT:
            continue
        force, _ = effect.force(channels, values, inertia, None)
        scale = -inertia if effect.role is Role.STRUCTURE else 1.0
        total[effect.role is Role.FRICTION] = total[effect.role is Role.FRICTION] + scale * force
    return total[False], np.maximum(total[True], 0.0)


def combine(drive: Array, force: Array, budget: Array, sign: Array, momentum: Array | None = None) -> Array:
    """z: the net force on the plant in each interval, unit of u; every argument broadcasts against the others.

    drive + F - b s while the plant moves; drive + F - clip(drive + F, -b, b) at rest (s is NaN).

    `momentum` = J (v_k - v_{k-1})/T, where finite, takes the place of s: where the plant starts, stops or turns
    friction is whatever within its budget explains the change of speed. At rest that rule is the one above.
    """
    other = drive + force
    friction = np.where(np.isnan(sign), np.clip(other, -budget, budget), budget * sign)
    if momentum is not None:
        friction = np.where(np.isnan(momentum), friction, np.clip(other - momentum, -budget, budget))
    return np.asarray(other - friction)
