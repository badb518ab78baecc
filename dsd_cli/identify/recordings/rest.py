"""When the axis rests, as far as a noisy speed can show."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dsd_cli.identify.policy import POLICY
from dsd_cli.signals.log import Array
from dsd_cli.signals.runs import runs


def resting(velocity: Array, rest_speed: ArrayLike) -> NDArray[np.bool_]:
    """Intervals (the one that ends at each sample) at rest, shape (n,).

    rest_speed : up to which the axis may rest, one for all samples or shape (n,).

    A run of slow samples is a rest if the speed neither passes through zero nor only comes near it: its mean is a
    small part of the band of slow speeds, and so is its change along a fitted line; or the acceleration of that line
    is a small part of the usual one, for noise alone may tilt a rest. A mere reversal is no rest: friction's direction
    is known on either side of it. Noise may exceed the band for a moment, so that runs in wider bands count, too.
    An axis that creeps, by a fine sensor, far below its usual speed, sticks: friction holds it up to its level, and its
    direction says nothing.
    """
    usual_speed = float(np.sqrt(np.mean(velocity**2)))
    most = POLICY.resting_most * usual_speed
    limit = np.broadcast_to(np.minimum(rest_speed, most), velocity.shape)
    usual = float(np.mean(np.abs(np.diff(velocity)))) if len(velocity) > 1 else 0.0
    found = np.zeros(len(velocity), dtype=bool)
    for start, end in _runs(np.abs(velocity) <= POLICY.creep_share * usual_speed):
        found[start:end] = True
    for width in POLICY.resting_bands:
        for start, end in _runs(np.abs(velocity) <= width * limit):
            found[start:end] |= _stays(velocity[start:end], float(np.median(limit[start:end])), usual)
    return found


def _runs(slow: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """(first, behind the last) interval of every run whose samples are slow, long enough to be a rest."""
    both = slow & np.concatenate([slow[:1], slow[:-1]])
    return [(start, end) for start, end in runs(both) if end - start >= POLICY.least_rest_samples]


def _stays(velocity: Array, limit: float, usual: float) -> bool:
    """Whether a run of speeds, their mean, and their change along a fitted line, are small; `usual` change a sample."""
    size = float(np.sqrt(np.mean(velocity**2)))
    if abs(float(velocity.mean())) > POLICY.resting_share * limit or size > POLICY.resting_size * limit:
        return False
    place = np.arange(len(velocity)) - 0.5 * (len(velocity) - 1)
    slope = abs(float(place @ velocity) / float(place @ place))
    return slope * len(velocity) <= POLICY.resting_share * limit or slope <= POLICY.resting_slope * usual
