"""What a run of the detector found: shares, segments, the truth where the log knows it, and the user's expectations."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsd_cli.detect.grid import Grid
from dsd_cli.detect.profile.summary import Estimate, EstimateCount
from dsd_cli.detect.rows import Rows, nats_left
from dsd_cli.detect.spec import nats_of_fit
from dsd_cli.signals.log import Array

#: Segments kept for the report: a label that changes more often than this is chattering.
MOST_SEGMENTS = 10_000


@dataclass(frozen=True)
class StateShare:
    """How often a state was chosen: of all samples, and of the confident ones."""

    index: int
    values: dict[str, float]
    share: float
    confident_share: float


class Segment(NamedTuple):
    """Consecutive samples with the same label; start and end are stamps, s."""

    start: float
    end: float
    state: int
    values: dict[str, float]
    confident_share: float


class Truth(NamedTuple):
    """Share of the judged samples whose label is the candidate nearest to the log's own truth.

    Nearest in L for the delay and in 1/J for the inertia (that is how J enters eq. 13). None: the log does not say.
    """

    share_correct: float
    share_correct_confident: float | None
    share_correct_delay: float | None
    share_correct_inertia: float | None
    samples: int


class Check(NamedTuple):
    """One `--expect`: the share of judged samples with that value, and whether it is enough."""

    axis: str
    value: float
    share: float
    min_share: float
    samples: int
    holds: bool


@dataclass(frozen=True)
class Summary:
    """The result of `dsd detect`.

    `judged` samples are those past the warm-up that were not dropped; `residual_rms` (unit of u) is what the chosen
    states leave unexplained of d_hat, `explained_share` the share of the judged samples whose state explains its window
    to within about 2 rho, as `confident` asks. None without judged samples.
    """

    samples: int
    judged: int
    residual_rms: float | None
    explained_share: float | None
    confident_share: float
    states: list[StateShare]
    segments: list[Segment]
    segments_total: int
    final: dict[str, float]
    final_confident: bool
    truth: Truth | None
    checks: list[Check]
    estimates: dict[str, Estimate] = field(default_factory=dict)


class Expectation(NamedTuple):
    """`--expect axis=value`."""

    axis: str
    value: float


class Summarizer:
    """Adds up labels batch by batch in constant memory."""

    def __init__(
        self,
        grid: Grid,
        expectations: list[Expectation] | None = None,
        after: float = -np.inf,
        min_share: float = 0.95,
        confident_only: bool = False,
        rho: float = 0.3,
    ) -> None:
        self._rho = rho
        self._squares, self._explained = 0.0, 0
        self._grid = grid
        self._after, self._min_share, self._confident_only = after, min_share, confident_only
        self._expected = [
            (e, np.isclose(grid.axes[e.axis], e.value, rtol=1e-9, atol=1e-12)) for e in expectations or []
        ]
        self._met = np.zeros(len(self._expected))
        self._expected_of = 0
        self._count = np.zeros(len(grid), dtype=np.int64)
        self._confident = np.zeros(len(grid), dtype=np.int64)
        self._judged = 0
        self._truth = _TruthCount(grid)
        self._segments = _Segments()
        self._last_confident = False
        self._estimates = EstimateCount()

    def add(self, rows: Rows, truth: Mapping[str, Array]) -> None:
        """Labels of the next rows, and the truth columns (true_delay, true_inertia) of the same rows."""
        if rows.state.size == 0:
            return
        judged = rows.samples > 0
        self._judged += int(judged.sum())
        samples, log_likelihood = rows.samples, rows.log_likelihood
        if not judged.all():
            samples, log_likelihood = samples[judged], log_likelihood[judged]
        nats = nats_left(log_likelihood, self._rho)
        self._squares += float((nats / samples).sum()) * 2.0 * self._rho * self._rho
        self._explained += int((nats <= nats_of_fit(samples)).sum())
        self._count += np.bincount(rows.state, minlength=len(self._grid))
        self._confident += np.bincount(rows.state[rows.confident], minlength=len(self._grid))
        if self._expected:
            use = judged & (rows.t >= self._after) & (rows.confident | (not self._confident_only))
            self._expected_of += int(use.sum())
            self._met += [float(match[rows.state[use]].sum()) for _, match in self._expected]
        self._truth.add(rows, judged, truth)
        self._segments.add(rows)
        self._last_confident = bool(rows.confident[-1])
        self._estimates.add(rows)

    @property
    def judged(self) -> int:
        """Samples judged so far."""
        return self._judged

    @property
    def samples(self) -> int:
        """Rows so far."""
        return int(self._count.sum())

    def values(self, state: int) -> dict[str, float]:
        """Axis -> value of a state."""
        return {name: float(values[state]) for name, values in self._grid.axes.items()}

    def result(self, label: int) -> Summary:
        """The summary so far; `label` is the state chosen last."""
        total, confident = max(int(self._count.sum()), 1), max(int(self._confident.sum()), 1)
        values = [self.values(state) for state in range(len(self._grid))]
        states = [
            StateShare(i, values[i], float(n / total), float(c / confident))
            for i, (n, c) in enumerate(zip(self._count, self._confident, strict=True))
        ]
        segments = [
            Segment(start, end, state, values[state], sure / count)
            for start, end, state, count, sure in self._segments.closed()
        ]
        checks = [
            self._check(expectation, met / max(self._expected_of, 1))
            for (expectation, _), met in zip(self._expected, self._met.tolist(), strict=True)
        ]
        return Summary(
            samples=self.samples,
            judged=self._judged,
            residual_rms=float(np.sqrt(self._squares / self._judged)) if self._judged else None,
            explained_share=self._explained / self._judged if self._judged else None,
            confident_share=float(self._confident.sum() / total),
            states=states,
            segments=segments,
            segments_total=self._segments.total,
            final=self.values(label),
            final_confident=self._last_confident,
            truth=self._truth.result(),
            checks=checks,
            estimates=self._estimates.result(),
        )

    def _check(self, expectation: Expectation, share: float) -> Check:
        holds = self._expected_of > 0 and share >= self._min_share
        return Check(expectation.axis, expectation.value, share, self._min_share, self._expected_of, holds)


class _TruthCount:
    def __init__(self, grid: Grid) -> None:
        self._grid = grid
        self._right = dict.fromkeys(("both", "confident", "true_delay", "true_inertia"), 0)
        self._seen = dict.fromkeys(("both", "confident", "true_delay", "true_inertia"), 0)

    def add(self, rows: Rows, judged: NDArray[np.bool_], truth: Mapping[str, Array]) -> None:
        if not truth:
            return
        both, use = np.ones(rows.state.size, dtype=bool), judged.copy()
        for name, values in truth.items():
            use &= np.isfinite(values)
            right = self._nearest(name, values, rows.state)
            known = judged & np.isfinite(values)
            self._right[name] += int((right & known).sum())
            self._seen[name] += int(known.sum())
            both &= right
        for name, part in (("both", use), ("confident", use & rows.confident)):
            self._right[name] += int((both & part).sum())
            self._seen[name] += int(part.sum())

    def _nearest(self, name: str, values: Array, state: NDArray[np.int32]) -> NDArray[np.bool_]:
        """Whether the label is the candidate nearest to the truth."""
        axis = self._grid.axes[name.removeprefix("true_")]
        scale = (lambda x: 1.0 / x) if name == "true_inertia" else (lambda x: x)
        with np.errstate(divide="ignore", invalid="ignore"):
            found, inverse = np.unique(values, return_inverse=True)
            distance = np.abs(scale(axis)[None, :] - scale(found)[:, None])
            allowed = distance <= distance.min(axis=1, keepdims=True) * (1 + 1e-9) + 1e-12
        return np.asarray(allowed[inverse, state])

    def result(self) -> Truth | None:
        if not self._seen["both"]:
            return None
        share = {name: self._right[name] / seen if seen else None for name, seen in self._seen.items()}
        return Truth(
            self._right["both"] / self._seen["both"],
            share["confident"],
            share["true_delay"],
            share["true_inertia"],
            self._seen["both"],
        )


class _Segments:
    """Runs of the same label, in constant memory: past MOST_SEGMENTS only their number is kept."""

    def __init__(self) -> None:
        self.total = 0
        self._closed: list[tuple[float, float, int, int, int]] = []
        self._open: tuple[float, float, int, int, int] | None = None

    def add(self, rows: Rows) -> None:
        cuts = np.flatnonzero(np.diff(rows.state)) + 1
        begins = np.concatenate([[0], cuts])
        if len(self._closed) >= MOST_SEGMENTS and self._open is not None:  # chatter: only count
            self.total += begins.size - (self._open[2] == int(rows.state[0]))
            self._open = (self._open[0], float(rows.t[-1]), int(rows.state[-1]), 1, 0)
            return
        ends = np.concatenate([cuts, [rows.state.size]])
        sure = np.concatenate([[0], np.cumsum(rows.confident)])
        for begin, end in zip(begins.tolist(), ends.tolist(), strict=True):
            piece = (
                float(rows.t[begin]),
                float(rows.t[end - 1]),
                int(rows.state[begin]),
                end - begin,
                int(sure[end] - sure[begin]),
            )
            if self._open is not None and self._open[2] == piece[2]:
                start, _, state, count, confident = self._open
                self._open = (start, piece[1], state, count + piece[3], confident + piece[4])
                continue
            self._close()
            self._open = piece
            self.total += 1

    def _close(self) -> None:
        if self._open is not None and len(self._closed) < MOST_SEGMENTS:
            self._closed.append(self._open)

    def closed(self) -> list[tuple[float, float, int, int, int]]:
        """(start, end, state, samples, confident samples) of every segment, the running one included."""
        running = [] if self._open is None or len(self._closed) >= MOST_SEGMENTS else [self._open]
        return self._closed + running
