"""Raw rows of a log to the evenly spaced samples a detector wants, row by row accounted for.

Streaming: the result depends on the rows, never on how they were cut into batches.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from dsd_cli.errors import DataError
from dsd_cli.signals.clock import CLOCK_PATIENCE, JITTER, Clock, clock_window, settle_clock, stamp_rounding, suspicious
from dsd_cli.signals.log import Array
from dsd_cli.signals.outliers import Limits, Outliers
from dsd_cli.signals.pieces import Piece, bridge, rows_of, too_close

#: Holes of up to this many samples are bridged by a straight line; longer ones are gaps.
BRIDGE = 10
#: In a log with irregular stamps, a step of more than this many median steps is a gap.
IRREGULAR_GAP = 10.0

__all__ = ["Cleaner", "Piece"]

#: Channels that have a range.
MEASURED = ("u", "d_hat", "velocity", "position")
Masks = dict[str, NDArray[np.bool_]]
BEYOND = "beyond the range of the channel"
_LAST_REASONS = ("duplicate stamp", "bridged", "gap", "restart", "jittered stamp")


class Cleaner:
    """Feed rows in batches of any size, get pieces back; `finish` gives what was held.

    Parameters
    ----------
    sample_time : s, or None to find it from the time column; given, it is the clock and the log is regular.
    time_scale : s per unit of the time column.
    bridge : longest hole, in samples, that is bridged; 0 where the values are to be differentiated.
    limits : what is no value of u, d_hat, velocity or position; such rows are dropped. None: all values are.

    Raises
    ------
    DataError : (from `feed` or `finish`) no sample time given and the time column does not advance.
    """

    def __init__(
        self, sample_time: float | None, time_scale: float = 1.0, bridge: int = BRIDGE, limits: Limits | None = None
    ) -> None:
        self._bridge = bridge
        self._outliers = Outliers(Limits() if limits is None else limits)
        self._clock = None if sample_time is None else Clock(sample_time, sample_time, True)
        self._clock_is_given = sample_time is not None
        self._time_scale = time_scale
        self._held: list[tuple[Array, dict[str, Array]]] = []
        self._rows = 0
        self._samples = 0
        self._count: Counter[str] = Counter()
        self._last: tuple[float, dict[str, float]] | None = None
        self._restart_asked = False
        self._first_u: float | None = None
        self._u_varies = False

    @property
    def sample_time(self) -> float | None:
        """s; None until the clock is settled."""
        return None if self._clock is None else self._clock.sample_time

    @property
    def regular(self) -> bool | None:
        """None until the clock is settled."""
        return None if self._clock is None else self._clock.regular

    @property
    def held(self) -> int:
        """Rows waiting for the clock to be settled; they come out, in order, with a later `feed` or `finish`."""
        return sum(t.size for t, _ in self._held)

    @property
    def dropped(self) -> dict[str, int]:
        """Reason -> count, in a fixed order; "bridged" counts samples put in, "jittered stamp" is information only."""
        first = [name for name in self._count if name not in _LAST_REASONS]
        return {name: self._count[name] for name in (*first, *_LAST_REASONS) if self._count[name]}

    @property
    def warnings(self) -> list[str]:
        """One sentence each, about the rows so far."""
        found = []
        if self._clock is not None and (doubt := suspicious(self._clock.sample_time)):
            found.append(doubt)
        if self._clock_is_given and self._samples:
            steps, given = self._samples - 1, f"sample_time = {self.sample_time:g} s is set, but most stamps are"
            if self._count["gap"] * 2 > steps > 0:
                found.append(f"{given} much farther apart: is signals.time_unit right?")
            if self._count["duplicate stamp"] > self._samples:
                found.append(f"{given} much closer together: is signals.time_unit right?")
        if not self._clock_is_given and self._count["jittered stamp"] * 2 > self._samples > 0:
            found.append(
                f"most stamps are off the sample time {self.sample_time:g} s of the first rows by more than 1 %: "
                "the samples are taken as evenly spaced all the same"
            )
        if self._samples > 1 and self._first_u is not None and not self._u_varies:
            found.append(
                f"u is constant ({self._first_u:g}): nothing excites the plant, so states are indistinguishable"
            )
        return found

    def feed(self, t: Array | None, values: Mapping[str, Array]) -> list[Piece]:
        """Rows as they are in the log, shape (n,) each; t None: there is no time column."""
        columns = {name: np.ascontiguousarray(column, dtype=np.float64) for name, column in values.items()}
        if not self._count:
            self._count.update({f"not finite: {name}": 0 for name in ("t", *columns)})
        if t is None:
            if self._clock is None:
                raise ValueError("without a time column the sample time must be given")
            rows = next(iter(columns.values())).size
            stamps: Array = np.arange(self._rows, self._rows + rows, dtype=np.float64) * self._clock.sample_time
        else:
            stamps = np.ascontiguousarray(t, dtype=np.float64)
            if self._time_scale != 1.0:
                stamps = stamps * self._time_scale
        if self._clock is not None:
            return self._clean(stamps, columns)
        self._held.append((stamps, columns))
        window = clock_window(self._timed())
        return [] if window is None else self._release(window)

    def finish(self) -> list[Piece]:
        """The end of the log: what was held, on the clock that its rows give."""
        if not self.held:
            return []
        return self._release(self.held)

    def restart(self) -> list[Piece]:
        """The next row begins another recording, whatever its stamp says; gives what was held.

        Rows held that give no clock stay held, and the stamps alone decide about them.
        """
        try:
            pieces = self.finish()
        except DataError:
            return []
        self._restart_asked = self._last is not None
        return pieces

    def _timed(self) -> Array:
        """The stamps that are held, NaN where a channel has no value: such a row may be another channel's in between.

        The first of them, as many as the clock waits for; all of these where fewer than two rows are whole.
        """
        stamps = np.concatenate([held for held, _ in self._held])[:CLOCK_PATIENCE]
        columns = [np.concatenate([values[name] for _, values in self._held]) for name in self._held[0][1]]
        whole = np.all([np.isfinite(column[:CLOCK_PATIENCE]) for column in columns], axis=0)
        return np.where(whole, stamps, np.nan) if whole.sum() > 1 else stamps

    def _release(self, window: int) -> list[Piece]:
        self._clock = settle_clock(self._timed()[:window])
        stamps = np.concatenate([held for held, _ in self._held])
        columns = {name: np.concatenate([held[name] for _, held in self._held]) for name in self._held[0][1]}
        self._held = []
        return self._clean(stamps, columns)

    def _clean(self, t: Array, values: dict[str, Array]) -> list[Piece]:
        if t.size == 0:
            return []
        start, self._rows = self._rows, self._rows + t.size
        self._watch_u(values)
        beyond = self._beyond(values)
        if not beyond and self._is_clean(t, values):
            pieces = [self._piece(start, t, None, t, values, False)]
        else:
            pieces = self._mend(start, t, values, beyond)
        self._samples += sum(piece.t.size for piece in pieces)
        last = next((piece for piece in reversed(pieces) if piece.t.size), None)
        if last is not None:
            self._last = float(last.t[-1]), {name: float(column[-1]) for name, column in last.values.items()}
        return pieces

    def _is_clean(self, t: Array, values: dict[str, Array]) -> bool:
        """Every row is one sample that continues the one before; counts jitter when it is so."""
        if self._restart_asked or not np.isfinite(t).all():
            return False
        if not all(np.isfinite(column).all() for column in values.values()):
            return False
        with np.errstate(over="ignore"):
            steps = np.diff(t) if self._last is None else np.diff(t, prepend=self._last[0])
        if steps.size == 0:
            return True
        low, high = float(steps.min()), float(steps.max())
        T, median, regular = self._clock_now
        if not regular:
            return low > 0 and high <= IRREGULAR_GAP * median
        if not (low > 0.5 * T and high < 1.5 * T):
            return False
        if max(T - low, high - T) > JITTER * T:
            self._count_jitter(steps, t[t.size - steps.size :])
        return True

    @property
    def _clock_now(self) -> Clock:
        assert self._clock is not None
        return self._clock

    def _mend(self, start: int, t: Array, values: dict[str, Array], beyond: Masks) -> list[Piece]:
        T, median, regular = self._clock_now
        rows = self._usable_rows(t, values, beyond)
        rows = rows[~self._duplicates(t[rows])]
        stamps = t[rows]
        with np.errstate(over="ignore"):
            steps = np.diff(stamps, prepend=stamps[:1] - T if self._last is None else self._last[0])
        if self._restart_asked and rows.size:
            steps[0] = -np.inf
            self._restart_asked = False
        backwards = steps < 0
        if regular:
            missing = np.where(steps >= 1.5 * T, np.rint(steps / T) - 1, 0)
            gap = missing > self._bridge
            in_place = (steps > 0) & (missing == 0)
            self._count_jitter(steps[in_place], stamps[in_place])
        else:
            missing = np.zeros(steps.size)
            gap = steps > IRREGULAR_GAP * median
        inserted = np.where(gap | backwards, 0, missing).astype(np.int64)
        self._count.update({"gap": int(gap.sum()), "restart": int(backwards.sum()), "bridged": int(inserted.sum())})

        cuts = np.flatnonzero(gap | backwards)
        edges = sorted({0, *cuts.tolist(), rows.size})
        pieces, row = [], 0
        restarts = set(cuts.tolist())
        if 0 in restarts and rows[0] > 0:  # dropped rows before the restart belong to what was before
            pieces.append(self._piece(start, t[: rows[0]], rows[:0], t[:0], rows_of(values, rows[:0]), False))
            row = int(rows[0])
        for first, end in zip(edges, [*edges[1:], rows.size], strict=True):
            if first == end and not (rows.size == 0 and first == 0):
                continue
            stop = int(rows[end]) if end < rows.size else t.size
            kept = rows[first:end]
            previous = self._last if first == 0 else None
            keep, times, samples = bridge(t, values, kept, inserted[first:end], previous)
            keep = np.where(keep < 0, -1, keep - row)
            whole = keep.size == stop - row and not inserted[first:end].any()
            pieces.append(
                self._piece(start + row, t[row:stop], None if whole else keep, times, samples, first in restarts)
            )
            row = stop
        return pieces

    def _piece(
        self,
        start: int,
        row_t: Array,
        keep: NDArray[np.int64] | None,
        t: Array,
        values: dict[str, Array],
        restart: bool,
    ) -> Piece:
        return Piece(start, row_t.size, keep, t, row_t, values, restart, None if self._clock_now.regular else t)

    def _beyond(self, values: dict[str, Array]) -> Masks:
        """Measured channel -> rows beyond its range, for those that have such rows."""
        found = {name: self._outliers.beyond(name, values[name]) for name in MEASURED if name in values}
        return {name: rows for name, rows in found.items() if rows is not None}

    def _usable_rows(self, t: Array, values: dict[str, Array], beyond: Masks) -> NDArray[np.int64]:
        """Rows finite and in range in every column; a row that is not is counted under its first such column."""
        usable = np.ones(t.size, dtype=bool)
        bad_rows = {f"not finite: {name}": ~np.isfinite(column) for name, column in {"t": t, **values}.items()}
        bad_rows |= {f"{BEYOND}: {name}": rows for name, rows in beyond.items()}
        for reason, bad in bad_rows.items():
            self._count[reason] += int((usable & bad).sum())
            usable &= ~bad
        return np.flatnonzero(usable)

    def _duplicates(self, stamps: Array) -> NDArray[np.bool_]:
        """Stamps less than half a sample (irregular logs: not at all) after the last one that is kept."""
        T, _, regular = self._clock_now
        last = None if self._restart_asked or self._last is None else self._last[0]
        drop = too_close(stamps, last, 0.5 * T if regular else 0.0)
        self._count["duplicate stamp"] += int(drop.sum())
        return drop

    def _count_jitter(self, steps: Array, stamps: Array) -> None:
        T = self._clock_now.sample_time
        late = np.abs(steps - T) > JITTER * T + stamp_rounding(np.abs(stamps))
        self._count["jittered stamp"] += int(late.sum())

    def _watch_u(self, values: dict[str, Array]) -> None:
        if self._u_varies or "u" not in values:
            return
        u = values["u"][np.isfinite(values["u"])]
        if u.size:
            self._first_u = float(u[0]) if self._first_u is None else self._first_u
            self._u_varies = bool((u != self._first_u).any())
