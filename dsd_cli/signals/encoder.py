"""Channels that go in the steps of an encoder."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from dsd_cli.signals.log import Array
from dsd_cli.signals.rounding import ROUNDING

#: Changes out of which the step of an encoder is read, at least.
_FEWEST = 10
#: One step is what a change has within this factor of the least; beyond so many steps the rounding of printed numbers
#: spoils the multiples; shares of the changes that must be below that, and of those whole within so much.
_ONE_STEP, _MOST_STEPS, _BELOW, _WHOLE, _APART = 1.5, 50.0, 0.3, 0.98, 0.02
#: Steps of which the least changes may be: of a motion that is hardly ever slow.
_MOST_PARTS = 8


def encoder_step(x: Array) -> float:
    """The step of a quantised channel; 0 if it is not quantised."""
    changes = np.abs(np.diff(x))
    changes = changes[changes > ROUNDING * max(float(np.abs(x).max(initial=0.0)), 1e-300)]
    if changes.size < _FEWEST:
        return 0.0
    least = float(np.percentile(changes, 1))
    least = float(np.median(changes[changes < _ONE_STEP * least]))
    for parts in range(1, _MOST_PARTS + 1):
        multiples = changes * (parts / least)
        small = multiples[multiples < _MOST_STEPS]
        whole = np.abs(small - np.round(small)) < _APART
        if small.size > _BELOW * changes.size and np.mean(whole) > _WHOLE:
            return least / parts
    return 0.0


def exact_step(parts: Sequence[Array]) -> float:
    """The step to the digits that the whole way shows, of stretches of one channel; 0 where they are not all counts."""
    step = max(encoder_step(x) for x in parts)
    if not step > 0.0:
        return 0.0
    changes = np.concatenate([np.diff(x) for x in parts])
    few = changes[np.abs(changes) < _MOST_STEPS * step]
    times = np.round(few / step)
    step = float(times @ few) / max(float(times @ times), 1.0)
    ways = [np.concatenate([[0.0], np.cumsum(np.round(np.diff(x) / step))]) for x in parts]
    counts, way = (np.concatenate([x - x.mean() for x in xs]) for xs in (ways, parts))
    step = float(counts @ way) / max(float(counts @ counts), 1e-300)
    return step if np.std(way - step * counts) < _APART * step else 0.0
