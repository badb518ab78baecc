"""Progress on stderr, on a terminal only: what is being done, how much of it, how fast, and how long it still takes."""

from __future__ import annotations

import os
import sys
import threading
import time
from collections.abc import Callable
from typing import Any, NamedTuple

#: Silence at the beginning, s: what is done by then needs no progress.
SILENT = 1.0
#: Between two drawings, s.
EVERY = 0.2
#: Waited for a terminal that takes no more (Ctrl-S), s.
PATIENCE = 2.0
#: Width where the terminal does not say it.
WIDTH = 80


class Activity(NamedTuple):
    """`done` of `total` (None: nobody knows) in that unit ("": a share of 1), from `begin` to `at` (monotonic, s)."""

    what: str
    begin: float
    at: float
    done: float = 0.0
    total: float | None = None
    unit: str = ""


class Progress:
    """A line that a thread of its own draws; the work sets what it shows and never waits for it.

    Use it as a context: at the end the line is gone. Nothing is drawn unless stderr is a terminal.
    """

    def __init__(self, enabled: bool = True) -> None:
        self._enabled = enabled and is_terminal(sys.stderr)
        self._activity: Activity | None = None
        self._shown = False
        self._drawing = threading.Lock()
        self._ended = threading.Event()
        self._thread: threading.Thread | None = None

    def __call__(self, what: str, share: float | None = None) -> None:
        """That is being done, and so much of it, 0 to 1; None: nobody knows."""
        before, now = self._activity, time.monotonic()
        goes_on = before is not None and not before.unit and share is not None and share >= before.done
        begin = before.begin if before is not None and goes_on else now
        self._activity = Activity(what, begin, now, share or 0.0, None if share is None else 1.0)

    @property
    def watch(self) -> Callable[[str, int | None], Callable[[int], None]] | None:
        """`rows`, for those who read; None where nobody looks."""
        return self.rows if self._enabled else None

    def rows(self, what: str, total: int | None = None) -> Callable[[int], None]:
        """That is being done row by row: call the result with the number of rows just done."""
        begin, done = time.monotonic(), 0
        self._activity = Activity(what, begin, begin, 0, total, "rows")

        def add(count: int) -> None:
            nonlocal done
            done += count
            self._activity = Activity(what, begin, time.monotonic(), done, total, "rows")

        return add

    def clear(self) -> None:
        """Take the line back; nothing is shown until something else is being done."""
        with self._drawing:
            self._activity = None
            self._take_back()

    def __enter__(self) -> Progress:
        if self._enabled:
            self._thread = threading.Thread(target=self._draw_on, name="progress", daemon=True)
            self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ended.set()
        if self._thread is not None:
            self._thread.join(PATIENCE)
            if not self._thread.is_alive():
                self.clear()

    def _draw_on(self) -> None:
        wait = SILENT
        while not self._ended.wait(wait):
            wait = EVERY
            with self._drawing:
                activity = self._activity
                if activity is not None:
                    text = progress_line(activity, time.monotonic())[: _width() - 1]
                    print(f"\r\033[K{text}", end="", file=sys.stderr, flush=True)
                    self._shown = True

    def _take_back(self) -> None:
        if self._shown:
            print("\r\033[K", end="", file=sys.stderr, flush=True)
            self._shown = False


def progress_line(activity: Activity, now: float) -> str:
    """`labelling: 1,200,000 of 10,000,000 rows, 350,000 a second, 25 s left`."""
    what, begin, at, done, total, unit = activity
    if not done or at <= begin:
        return f"{what}, {span(now - begin)}"
    rate = done / (at - begin)
    if unit:
        parts = [f"{done:,.0f} of {total:,.0f} {unit}" if total else f"{done:,.0f} {unit}", f"{three(rate)} a second"]
    else:
        parts = [f"{100.0 * done:.0f} %"]
    if total is not None and done < total:  # counted down between two steps that take long
        parts.append(f"{span(max((total - done) / rate - (now - at), 0.0))} left")
    return f"{what}: {', '.join(parts)}"


def span(seconds: float) -> str:
    """`12 s`, `3 min`, `2 h`."""
    unit, size = ("s", 1.0) if seconds < 90.0 else ("min", 60.0) if seconds < 5400.0 else ("h", 3600.0)
    return f"{seconds / size:.0f} {unit}"


def three(rate: float) -> str:
    """Three digits, never an exponent."""
    return f"{float(f'{rate:.3g}'):,.0f}" if rate >= 100.0 else f"{rate:.3g}" if rate >= 0.001 else "0"


def is_terminal(stream: Any) -> bool:
    """Whether lines can be drawn over there."""
    return bool(stream.isatty()) and os.environ.get("TERM") != "dumb"


def _width() -> int:
    try:
        return os.get_terminal_size(sys.stderr.fileno()).columns or WIDTH
    except (OSError, ValueError):
        return WIDTH
