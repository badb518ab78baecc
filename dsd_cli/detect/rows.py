"""Labels of rows, and what goes into the engine: how they are put together and cut."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsd_cli.detect.engine import Forces, Labels
from dsd_cli.signals.log import Array


class Rows(NamedTuple):
    """Labels of consecutive rows of the log, each array of shape (n,).

    Dropped rows (and rows of warm-up) carry the last label, NaN likelihood and probability, confident = False, and 0
    samples; else `samples` is how many samples the window behind the label holds.
    """

    t: NDArray[Any]
    state: NDArray[Any]
    log_likelihood: NDArray[Any]
    probability: NDArray[Any]
    confident: NDArray[Any]
    samples: NDArray[Any]


def unjudged(rows: Rows, count: int, label: int) -> Rows:
    """The first `count` rows as rows of the warm-up."""
    if count <= 0:
        return rows
    columns = [column.copy() for column in rows[1:]]
    for column, nothing in zip(columns, (label, np.nan, np.nan, False, 0), strict=True):
        column[:count] = nothing
    return Rows(rows.t, *columns)


class Inputs(NamedTuple):
    """What the engine takes, each array of shape (n,)."""

    u: Array
    d_hat: Array
    t: Array
    forces: Forces | None


def labels_arrays(labels: Labels) -> tuple[NDArray[Any], ...]:
    """state, log_likelihood, probability, confident."""
    return labels.state, labels.log_likelihood, labels.probability, labels.confident


def joined(inputs: list[Inputs]) -> Inputs:
    """One after the other."""
    forces = None
    if inputs[0].forces is not None:
        parts = [part.forces for part in inputs if part.forces is not None]
        forces = Forces(*(np.concatenate(column) for column in zip(*parts, strict=True)))
    u, d_hat, t = (np.concatenate([part[i] for part in inputs]) for i in range(3))
    return Inputs(u, d_hat, t, forces)


def cut(labels: Labels, begin: int, end: int) -> Labels:
    """Labels `begin` to `end`."""
    return Labels(labels.grid, *(column[begin:end] for column in labels_arrays(labels)))
