"""Channels that go in the steps of an encoder."""

from __future__ import annotations

import numpy as np

from dsd_cli.signals.log import Array
from dsd_cli.signals.rounding import ROUNDING

#: Changes out of which the step of an encoder is read, at least.
_FEWEST = 10
#: One step is what a change has within this factor of the least; beyond so many steps the rounding of printed numbers
#: spoils the multiples; shares of the changes that must be below that, and of those whole within so much.
_ONE_STEP, _MOST_STEPS, _BELOW, _WHOLE, _APART = 1.5, 50.0, 0.3, 0.98, 0.02


def encoder_step(x: Array) -> float:
    """The step of a quantised channel; 0 if it is not quantised."""
    changes = np.abs(np.diff(x))
    changes = changes[changes > ROUNDING * max(float(np.abs(x).max(initial=0.0)), 1e-300)]
    if changes.size < _FEWEST:
        return 0.0
    step = float(np.percentile(changes, 1))
    step = float(np.median(changes[changes < _ONE_STEP * step]))
    multiples = changes / step
    small = multiples[multiples < _MOST_STEPS]
    whole = np.abs(small - np.round(small)) < _APART
    return step if small.size > _BELOW * changes.size and np.mean(whole) > _WHOLE else 0.0
