"""Labels of rows, and what goes into the engine: how they are put together and cut."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsd_cli.detect.engine import Forces, Labels
from dsd_cli.detect.profile.cells import Estimates, held
from dsd_cli.signals.log import Array


class Rows(NamedTuple):
    """Labels of consecutive rows of the log, each array of shape (n,).

    Dropped rows (and rows of warm-up) carry the last label, NaN likelihood and probability, confident = False, and 0
    samples; else `samples` is how many samples the window behind the label holds. `estimates` (method "profile", else
    ()) stand there as they were before, their flags False.
    """

    t: NDArray[Any]
    state: NDArray[Any]
    log_likelihood: NDArray[Any]
    probability: NDArray[Any]
    confident: NDArray[Any]
    samples: NDArray[Any]
    estimates: tuple[NDArray[Any], ...] = ()


def nats_left(log_likelihood: NDArray[Any], rho: float) -> NDArray[Any]:
    """Eq. 15 backwards: half of the sum of squares in the window, in rho^2."""
    return np.asarray(-0.5 * np.log(2.0 * np.pi) - np.log(rho) - log_likelihood)


def residual_of(rows: Rows, rho: float) -> NDArray[Any]:
    """rms of what each label leaves of d_hat in its window, unit of rho; NaN where nothing was judged; shape (n,)."""
    nats = np.where(rows.samples > 0, nats_left(rows.log_likelihood, rho), np.nan)
    return rho * np.sqrt(2.0 * np.maximum(nats, 0.0) / np.maximum(rows.samples, 1))


def unjudged(rows: Rows, count: int, label: int) -> Rows:
    """The first `count` rows as rows of the warm-up."""
    if count <= 0:
        return rows
    columns: list[Any] = [column.copy() for column in rows[1:6]]
    for column, nothing in zip(columns, (label, np.nan, np.nan, False, 0), strict=True):
        column[:count] = nothing
    return Rows(rows.t, *columns, *[_each(rows.estimates, lambda column: _blank(column, count))])


def _blank(column: NDArray[Any], count: int) -> NDArray[Any]:
    """The first `count` values as before there was any estimate."""
    column = column.copy()
    column[:count] = False if column.dtype == np.bool_ else np.nan
    return column


def _each(estimates: Any, change: Callable[[NDArray[Any]], NDArray[Any]]) -> Any:
    """Every column changed alike; () stays."""
    return Estimates(*map(change, estimates)) if estimates else ()


def part(rows: Rows, begin: int) -> Rows:
    """The rows from `begin` on."""
    columns: list[Any] = [column[begin:] for column in rows[:6]]
    return Rows(*columns, *[_each(rows.estimates, lambda column: column[begin:])])


def estimates_of(labels: Labels | None, keep: NDArray[Any] | None, n: int, last: tuple[float, ...]) -> Any:
    """Estimates of `n` rows from those of the samples; rows without a sample carry the ones before, their flags False.

    Parameters
    ----------
    keep : row of every sample, -1 for none; None: sample i is row i.
    last : values before the first row; () where the method has no estimates.
    """
    if not last or (labels is not None and keep is None):
        return labels.estimates if labels is not None else ()
    if labels is None or keep is None:
        at, rows = np.zeros(0, dtype=int), np.zeros(0, dtype=int)
        values: tuple[NDArray[Any], ...] = (np.zeros(0),) * 6
    else:
        at = np.flatnonzero(keep >= 0)
        rows, values = keep[at], labels.estimates
    filled = np.zeros(n, dtype=np.int64)
    filled[rows] = np.arange(1, rows.size + 1)
    latest = np.maximum.accumulate(filled)
    columns: list[Any] = [
        np.concatenate([[before], value[at]])[latest] for before, value in zip(last, values[:4], strict=True)
    ]
    flags = [np.zeros(n, dtype=np.bool_) for _ in range(2)]
    for flag, value in zip(flags, values[4:], strict=True):
        flag[rows] = value[at]
    return Estimates(*columns, *flags)


def without_confidence(labels: Labels, wrong: NDArray[np.bool_]) -> Labels:
    """The same labels, none of the `wrong` ones confident; see `held_again` for the estimates."""
    estimates: Any = labels.estimates
    if estimates:
        estimates = estimates._replace(
            delay_confident=estimates.delay_confident & ~wrong, inertia_confident=estimates.inertia_confident & ~wrong
        )
    return replace(labels, confident=labels.confident & ~wrong, estimates=estimates)


def held_again(labels: Labels, last: tuple[float, ...]) -> Labels:
    """The same labels, with estimates only of samples whose flag is still set.

    Parameters
    ----------
    last : delay, its std, inertia, its std before the first sample.
    """
    flags = labels.estimates[4:]
    columns = [held(column, flags[i // 2], last[i]) for i, column in enumerate(labels.estimates[:4])]
    return replace(labels, estimates=Estimates(*columns, *flags))


class Inputs(NamedTuple):
    """What the engine takes, each array of shape (n,).

    resting : where the axis rests without a reason that the model knows, yet has a vote; None: nowhere.
    motion : mean speed and its sign in the interval that ends at each sample, shape (n, 2), where the rows identify it.
    """

    u: Array
    d_hat: Array
    t: Array
    forces: Forces | None
    resting: NDArray[np.bool_] | None = None
    motion: Array | None = None


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
    rests = [part.resting for part in inputs if part.resting is not None]
    motions = [part.motion for part in inputs if part.motion is not None]
    resting = np.concatenate(rests) if rests else None
    return Inputs(u, d_hat, t, forces, resting, np.concatenate(motions) if motions else None)


def cut(labels: Labels, begin: int, end: int) -> Labels:
    """Labels `begin` to `end`."""
    columns: list[Any] = [column[begin:end] for column in labels_arrays(labels)]
    return Labels(labels.grid, *columns, *[_each(labels.estimates, lambda column: column[begin:end])])
