"""How a method did on a log: share right, detection delay after a change, false switches, time per sample."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsd_cli.detect.engine import Labels
from dsd_cli.detect.grid import Grid
from dsd_cli.detect.plan import Plan
from dsd_cli.detect.rows import Inputs, Rows
from dsd_cli.detect.session import Session
from dsd_cli.signals.cleaning import Cleaner
from dsd_cli.signals.log import Array

#: A label has followed a change once it has been right for so many samples on end.
STANDS = 20


class TimedSession(Session):
    """A session that knows how long its engine took."""

    def __init__(self, plan: Plan, cleaner: Cleaner) -> None:
        super().__init__(plan, cleaner)
        self.seconds, self.samples = 0.0, 0

    def _run_inputs(self, inputs: Inputs) -> Labels:
        begin = time.perf_counter()
        labels = super()._run_inputs(inputs)
        self.seconds += time.perf_counter() - begin
        self.samples += inputs.u.size
        return labels


@dataclass(frozen=True)
class MethodScore:
    """One line of `dsd detect --method a,b`; what needs the truth is None in a log without it.

    Attributes
    ----------
    share_correct : of the judged samples, as `dsd detect` counts: the candidate nearest to the truth.
    share_correct_confident : of the confident ones; None where there are none.
    confident_share : of the judged samples.
    changes, followed : changes of the true state in the log, and how many of them the label followed.
    detection_delay : median over these, s from the change until the label is right for STANDS samples on end.
    false_switches : changes of the label to a state that is not the true one; without truth see `switches`.
    switches : all changes of the label.
    nanoseconds : per sample, likelihoods included.
    """

    method: str
    judged: int
    share_correct: float | None
    share_correct_confident: float | None
    confident_share: float
    changes: int | None
    followed: int | None
    detection_delay: float | None
    false_switches: int | None
    switches: int
    nanoseconds: float


def score(
    method: str, rows: Sequence[Rows], truth: Mapping[str, Array], grid: Grid, session: TimedSession
) -> MethodScore:
    """Score the labels of all rows of a log; `truth`: true_delay and true_inertia of these rows, or nothing."""
    t, state, confident, samples = (
        np.concatenate([getattr(part, name) for part in rows]) for name in ("t", "state", "confident", "samples")
    )
    judged = samples > 0
    switched = np.diff(state, prepend=state[:1]) != 0
    right, changes = _right(state, truth, grid), _changes(truth)
    count = max(int(judged.sum()), 1)
    sure = confident & judged
    lags = None if right is None else [_lag(t, right & judged, k, end) for k, end in changes]
    found = [lag for lag in lags or () if np.isfinite(lag)]
    return MethodScore(
        method=method,
        judged=int(judged.sum()),
        share_correct=None if right is None else float((right & judged).sum() / count),
        share_correct_confident=None if right is None or not sure.any() else float(right[sure].mean()),
        confident_share=float(sure.sum() / count),
        changes=None if lags is None else len(lags),
        followed=None if lags is None else len(found),
        detection_delay=float(np.median(found)) if found else None,
        false_switches=None if right is None else int((switched & judged & ~right).sum()),
        switches=int((switched & judged).sum()),
        nanoseconds=1e9 * session.seconds / max(session.samples, 1),
    )


def _right(state: NDArray[Any], truth: Mapping[str, Array], grid: Grid) -> NDArray[Any] | None:
    """Whether each label is nearest to the truth, in L and in 1/J; None without a truth."""
    if not truth:
        return None
    right = np.ones(state.size, dtype=bool)
    for name, values in truth.items():
        turn = (lambda x: 1.0 / x) if name == "true_inertia" else (lambda x: x)
        axis = turn(grid.axes[name.removeprefix("true_")])
        unique, inverse = np.unique(values, return_inverse=True)
        distance = np.abs(axis[None, :] - turn(unique)[:, None])
        right &= (distance <= distance.min(axis=1, keepdims=True) * (1 + 1e-9) + 1e-12)[inverse, state]
    return right


def _changes(truth: Mapping[str, Array]) -> list[tuple[int, int]]:
    """(row of each change of the truth, row of the next one or the number of rows)."""
    if not truth:
        return []
    n = len(next(iter(truth.values())))
    cuts = np.unique(np.concatenate([np.flatnonzero(np.diff(values) != 0) + 1 for values in truth.values()])).tolist()
    return list(zip(cuts, [*cuts[1:], n][: len(cuts)], strict=True))


def _lag(t: Array, right: NDArray[Any], begin: int, end: int) -> float:
    """s until the label is right for STANDS samples on end, before the next change; inf if it never is."""
    part = right[begin:end]
    if part.size < STANDS:
        return np.inf
    total = np.concatenate([[0], np.cumsum(part)])
    at = np.flatnonzero(total[STANDS:] - total[:-STANDS] == STANDS)
    return float(t[begin + at[0]] - t[begin]) if at.size else np.inf
