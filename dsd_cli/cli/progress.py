"""Progress on stderr, on a terminal only."""

from __future__ import annotations

import sys
import time


class Progress:
    """A counter that says nothing for the first second."""

    def __init__(self, what: str, enabled: bool = True) -> None:
        self._what = what
        self._enabled = enabled and sys.stderr.isatty()
        self._count = 0
        self._next = time.monotonic() + 1.0
        self._shown = False

    def add(self, count: int) -> None:
        """So many more are done."""
        self._count += count
        if self._enabled and time.monotonic() >= self._next:
            print(f"\r{self._count:,} {self._what}", end="", file=sys.stderr, flush=True)
            self._next = time.monotonic() + 0.2
            self._shown = True

    def close(self) -> None:
        """Take the line back."""
        if self._shown:
            print("\r\033[K", end="", file=sys.stderr, flush=True)
