"""From a fit to a label: which candidate is nearest, what is well founded, and what is held where nothing is."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsd_cli.signals.log import Array


class Estimates(NamedTuple):
    """Delay and inertia per sample, each of shape (n,), with what they are worth.

    Estimate and standard deviation belong together: of the last sample whose flag is set, NaN before the first.

    Attributes
    ----------
    delay, delay_std : s.
    inertia, inertia_std : unit of the nominal inertia.
    delay_confident, inertia_confident : whether this window identifies the value, to better than the candidates'
        spacing.
    """

    delay: Array
    delay_std: Array
    inertia: Array
    inertia_std: Array
    delay_confident: NDArray[np.bool_]
    inertia_confident: NDArray[np.bool_]


class Axis:
    """The candidates of one axis, and which of them a value is nearest to.

    `values` : in the unit in which nearest is meant: L for the delay, Jn / J for the inertia (as eq. 13 has it).
    """

    def __init__(self, values: Array) -> None:
        self.order = np.argsort(values, kind="stable")
        self._sorted = values[self.order]
        self._borders = 0.5 * (self._sorted[1:] + self._sorted[:-1])

    def cell(self, values: Array) -> NDArray[np.intp]:
        """Rank of the nearest candidate."""
        return np.searchsorted(self._borders, values)

    def borders(self, ranks: NDArray[np.intp]) -> tuple[Array, Array]:
        """Where the cells of these ranks begin and end."""
        edges = np.concatenate([[-np.inf], self._borders, [np.inf]])
        return edges[ranks], edges[ranks + 1]

    def spacing_at(self, values: Array) -> Array:
        """Distance of the two candidates that a value lies between, or of the two nearest to it."""
        if self._sorted.size == 1:
            return np.full(values.shape, np.inf)
        gaps = np.diff(self._sorted)
        between = np.clip(np.searchsorted(self._sorted, values) - 1, 0, gaps.size - 1)
        return np.asarray(gaps[between])


def settled(
    low: NDArray[np.intp], high: NDArray[np.intp], nearest: NDArray[np.intp], founded: NDArray[np.bool_], last: int
) -> NDArray[np.intp]:
    """The rank that stands at every sample.

    It changes where the data are well founded and exclude its cell, to the nearest; between two cells that both are
    possible the last one stays.

    Parameters
    ----------
    low, high : lowest and highest rank that is possible, shape (n,).
    last : the rank before.
    """
    out = np.empty(low.size, dtype=np.intp)
    begin = 0
    while begin < low.size:  # one pass per change
        moves = np.flatnonzero(founded[begin:] & ((last < low[begin:]) | (last > high[begin:])))
        end = begin + int(moves[0]) if moves.size else low.size
        out[begin:end] = last
        if moves.size:
            last = int(nearest[end])
            out[end] = last
            end += 1
        begin = end
    return out


def held(values: NDArray[Any], founded: NDArray[np.bool_], last: float) -> NDArray[Any]:
    """Values where they are founded, else the last one that was; shape (n,)."""
    at = np.maximum.accumulate(np.where(founded, np.arange(1, values.size + 1), 0))
    return np.concatenate([[last], values])[at]
