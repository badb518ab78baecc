"""`dsd detect --follow --live`: what the detector finds, as it finds it."""

from __future__ import annotations

import math
import sys
import threading
import time
from collections import deque
from typing import Any

import numpy as np

from dsd_cli.cli.progress import PATIENCE, is_terminal
from dsd_cli.detect.rows import Rows, residual_of
from dsd_cli.detect.session import Session
from dsd_cli.errors import printable
from dsd_cli.files.table_source import TableSource
from dsd_cli.files.tables_in import dropped_with_unreadable
from dsd_cli.report.live import Moment, Moved, Trace, change_line, panel, plain_line
from dsd_cli.signals.log import Array

#: Between two drawings, s: of the panel, and of plain lines.
EVERY, EVERY_LINE = 0.125, 1.0
#: Changes in the panel; parts of labels that wait to be drawn: a terminal that stands still costs no memory.
MOST_CHANGES, MOST_WAITING = 4, 4096
#: Columns of a sparkline, s per column at least, and s that the rate is taken over.
COLUMNS, COLUMN, RATE_OVER = 200, 0.1, 2.0
#: Columns left free beside the panel: a terminal writes ^C there, and without room it would begin a line.
SPARE = 4


class Monitor:
    """What the detector leaves behind for whoever draws; it never waits for them.

    Whatever is handed over is replaced as a whole, or waits in a deque: there is no lock.
    """

    def __init__(self, session: Session, table: TableSource) -> None:
        self._session, self._table = session, table
        self._values = _values(session)
        self.rows, self.t, self.state, self.probability = 0, math.nan, session.label, math.nan
        self.moved: tuple[Moved, ...] = ()
        self.dropped: dict[str, int] = {}
        self.labelled: deque[tuple[Array, Array, Array]] = deque(maxlen=MOST_WAITING)
        self.observed: deque[tuple[Array, Array]] = deque(maxlen=MOST_WAITING)
        self._seen: object = None
        self._founded: int | None = None

    def add(self, rows: Rows) -> None:
        """The labels of the next rows."""
        if not rows.state.size:
            return
        self.rows += rows.state.size
        self.t, self.state = float(rows.t[-1]), int(rows.state[-1])
        self.probability = float(rows.probability[-1])
        self.labelled.append((rows.t, residual_of(rows, self._session.plan.settings.rho), rows.confident))
        if self._session.observed is not self._seen:
            self._seen = self._session.observed
            self.observed.append(self._session.observed)
        self.dropped = dropped_with_unreadable(self._session.cleaner.dropped, self._table.unreadable)
        self._note_changes(rows)

    def _note_changes(self, rows: Rows) -> None:
        """A label that is well founded, and another one than the last that was."""
        state = rows.state[rows.confident]
        if not state.size or (state[0] == self._founded and (state == state[0]).all()):
            return
        t = rows.t[rows.confident]
        for at in np.flatnonzero(np.diff(state, prepend=-1 if self._founded is None else self._founded)):
            before = None if self._founded is None else self._values[self._founded]
            self._founded = int(state[at])
            self.moved = (*self.moved, Moved(float(t[at]), before, self._values[self._founded]))[-MOST_CHANGES:]

    def values(self, state: int) -> dict[str, float]:
        """Axis -> value."""
        return self._values[state]


def _values(session: Session) -> list[dict[str, float]]:
    axes = session.plan.grid.axes
    columns = zip(*(values.tolist() for values in axes.values()), strict=True)
    return [dict(zip(axes, values, strict=True)) for values in columns]


class Columns:
    """A signal over the last seconds, one figure per column of log time: its mean, or its largest value."""

    def __init__(self, width: float, largest: bool) -> None:
        self.width, self._largest = width, largest
        self._sums: dict[int, tuple[float, int]] = {}

    def add(self, t: Array, x: Array) -> None:
        """More of it; stamps that go back begin anew."""
        good = np.isfinite(t) & np.isfinite(x)
        if not good.any():
            return
        column, x = np.floor(t[good] / self.width).astype(np.int64), x[good]
        if self._sums and column[-1] < max(self._sums) - 1:
            self._sums = {}
        for at in np.unique(column).tolist():
            inside = x[column == at]
            before, count = self._sums.get(at, (-math.inf if self._largest else 0.0, 0))
            value = max(before, float(inside.max())) if self._largest else before + float(inside.sum())
            self._sums[at] = value, count + inside.size
        last = max(self._sums)
        self._sums = {at: one for at, one in self._sums.items() if at > last - COLUMNS}

    def trace(self) -> Trace:
        """Oldest first."""
        if not self._sums:
            return Trace((), self.width)
        last = max(self._sums)
        sums = [self._sums.get(at, (math.nan, 1)) for at in range(last - COLUMNS + 1, last + 1)]
        return Trace([s if self._largest else s / n for s, n in sums], self.width)


class LiveView:
    """Gives a function that takes labels; a thread of its own draws what they say until the block is left.

    The panel is on stderr; where that is no terminal, a plain line per second with news.
    """

    def __init__(self, log: str, session: Session, table: TableSource, unit: str) -> None:
        self._log, self._session, self._unit = log, session, unit
        self._monitor, self._residual = Monitor(session, table), math.nan
        self._rates: deque[tuple[float, int]] = deque()
        self._d_hat, self._left = self._columns()
        self._sure: deque[tuple[float, Array]] = deque()
        self._ended = threading.Event()
        self._draws = is_terminal(sys.stderr)
        target = self._draw_panel if self._draws else self._print_lines
        self._thread = threading.Thread(target=target, name="live", daemon=True)

    def _columns(self) -> tuple[Columns, Columns]:
        width = max(COLUMN, self._session.cleaner.sample_time or 0.0)
        return Columns(width, largest=False), Columns(width, largest=True)

    def __enter__(self) -> Any:
        self._thread.start()
        return self._monitor.add

    def __exit__(self, *_: object) -> None:
        self._ended.set()
        self._thread.join(PATIENCE)

    def _draw_panel(self) -> None:
        from rich.console import Console
        from rich.live import Live

        console = Console(file=sys.stderr, highlight=False, emoji=False)
        try:
            with Live(console=console, auto_refresh=False, transient=True, redirect_stdout=False) as live:
                console.show_cursor(True)  # so that no way to end leaves the terminal without one
                while not self._ended.wait(EVERY):
                    width, ascii_only = console.width - SPARE, console.options.ascii_only
                    live.update(panel(self._moment(), width, ascii_only), refresh=True)
        except OSError:  # the terminal is gone
            return

    def _print_lines(self) -> None:
        rows, said = 0, -math.inf
        while not self._ended.wait(EVERY_LINE):
            if self._monitor.rows == rows:
                continue
            rows, now = self._monitor.rows, self._moment()
            news = [one for one in now.moved if one.t > said]
            said = max([said, *(one.t for one in now.moved)])
            lines = [*(f"change at {change_line(one)}" for one in news), plain_line(now)]
            try:
                print("\n".join(map(printable, lines)), file=sys.stderr, flush=True)
            except OSError:
                return

    def _moment(self) -> Moment:
        """What there is now; called by the thread that draws alone."""
        monitor, clock = self._monitor, time.monotonic()
        self._rates.append((clock, monitor.rows))
        while len(self._rates) > 2 and self._rates[0][0] < clock - RATE_OVER:
            self._rates.popleft()
        since, before = self._rates[0]
        for labelled in _taken(monitor.labelled):
            t, left, confident = labelled
            self._left.add(t, left)
            self._sure.append((clock, confident))
            self._residual = float(left[-1])
        for observed in _taken(monitor.observed):
            self._d_hat.add(*observed)
        while len(self._sure) > 1 and self._sure[0][0] < clock - 1.0:
            self._sure.popleft()
        sure = np.concatenate([one for _, one in self._sure]) if self._sure else np.zeros(0)
        return Moment(
            log=self._log,
            t=monitor.t,
            state=monitor.state,
            values=monitor.values(monitor.state),
            probability=monitor.probability,
            confident=float(sure.mean()) if sure.size else 0.0,
            rows=monitor.rows,
            rate=(monitor.rows - before) / (clock - since) if clock > since else math.nan,
            dropped=monitor.dropped,
            residual=self._residual,
            rho=self._session.plan.settings.rho,
            unit=self._unit,
            d_hat=self._d_hat.trace(),
            left=self._left.trace(),
            moved=monitor.moved,
        )


def _taken(waiting: deque[Any]) -> list[Any]:
    """All that waits; more may come meanwhile."""
    return [waiting.popleft() for _ in range(len(waiting))]
