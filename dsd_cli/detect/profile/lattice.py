"""The delays that the profile looks at: every sample from below the smallest candidate to above the largest."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dsd_cli.detect.grid import Grid
from dsd_cli.errors import UsageError
from dsd_cli.signals.log import Array

#: Delays that one sample may be compared with.
MOST_DELAYS = 5000


@dataclass(frozen=True)
class Lattice:
    """Evenly spaced delays, and what of the grid they stand for.

    Attributes
    ----------
    delays : s, shape (G,); one value where the grid has one: the delay then is known.
    step : s between them.
    spacing : s, smallest distance of two candidates: what an estimate must be sure of.
    open_below, open_above : whether the truth may lie beyond the first (last) delay: not below a delay of 0.
    """

    delays: Array
    step: float
    spacing: float
    open_below: bool
    open_above: bool

    @property
    def known(self) -> bool:
        """Whether there is no delay to find."""
        return self.delays.size == 1


def make_lattice(grid: Grid, sample_time: float) -> Lattice:
    """From half a spacing below the smallest candidate (not below 0) to half a spacing above the largest.

    Raises
    ------
    UsageError : more delays than can be looked at.
    """
    candidates = np.sort(np.array(grid.delays))
    if candidates.size == 1:
        return Lattice(candidates, sample_time, np.inf, False, False)
    gaps = np.diff(candidates)
    first = int(np.floor(max(candidates[0] - 0.5 * gaps[0], 0.0) / sample_time + 1e-6))
    last = int(np.ceil((candidates[-1] + 0.5 * gaps[-1]) / sample_time - 1e-6))
    count = last - first + 1
    if count > MOST_DELAYS:
        raise UsageError(
            f'method "profile" looks at every sample between the candidate delays: {count:,} of them',
            f"narrow states.delays to less than {MOST_DELAYS:,} samples",
        )
    return Lattice(np.arange(float(first), last + 1.0) * sample_time, sample_time, float(gaps.min()), first > 0, True)
