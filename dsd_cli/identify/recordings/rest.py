"""When the axis rests, as far as a noisy speed can tell."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dsd_cli.identify.policy import POLICY
from dsd_cli.signals.log import Array


def resting(velocity: Array, rest_speed: float) -> NDArray[np.bool_]:
    """Intervals (the one that ends at each sample) at rest, shape (n,).

    A run of slow samples is a rest if the speed neither passes through zero nor only comes near it: its mean, and its
    change along a fitted line, are small parts of the band of slow speeds. Where the axis only turns friction's
    direction is known, but for the instant.
    """
    slow = np.abs(velocity) <= rest_speed
    both = slow & np.concatenate([slow[:1], slow[:-1]])
    edges = np.flatnonzero(np.diff(np.concatenate([[False], both, [False]]).astype(np.int8)))
    found = np.zeros(len(velocity), dtype=bool)
    for start, end in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        if end - start < POLICY.least_rest_samples:
            continue
        place = np.arange(end - start) - 0.5 * (end - start - 1)
        change = float(place @ velocity[start:end]) / float(place @ place) * (end - start)
        mean = float(velocity[start:end].mean())
        found[start:end] = max(abs(change), abs(mean)) <= POLICY.resting_share * rest_speed
    return found
