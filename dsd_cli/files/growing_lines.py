"""Lines of bytes as they are written: of stdin, or of a file that grows, is cut or is replaced."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import BinaryIO

CHUNK = 1 << 16
POLL = 0.05  # s
#: Bytes before the place of reading that tell a file that was begun anew.
TAIL = 256
#: Bytes of a line that are looked at; there is no such log, but there are files without a line end.
LONGEST_LINE = 1 << 20


class GrowingLines:
    """The lines of a stream, or of a file that is followed; see `LineStream`."""

    def __init__(
        self, source: BinaryIO | Path, head: bytes, stop: Callable[[], bool] | None, idle_timeout: float | None
    ) -> None:
        self._path = source if isinstance(source, Path) else None
        self._stream = source  # kept, for a stream that nobody holds closes its descriptor
        self._stop = stop
        self._idle_timeout = idle_timeout
        self._half = head
        self._tail = b""  # what was read last
        self._fd = os.open(self._path, os.O_RDONLY) if self._path is not None else source.fileno()  # type: ignore[union-attr]

    def close(self) -> None:
        """Give the file back; stdin stays open."""
        if self._path is not None and self._fd >= 0:
            os.close(self._fd)
            self._fd = -1

    def read(self) -> Iterator[list[bytes] | None]:
        """Complete lines as they come; None where the file begins anew."""
        quiet_since = time.monotonic()
        head, self._half = self._half, b""
        if lines := self._lines(head):
            yield lines
        while True:
            anew = self._path is not None and self._was_cut()
            chunk = b"" if anew else os.read(self._fd, CHUNK)
            if chunk:
                quiet_since = time.monotonic()
                self._tail = (self._tail + chunk)[-TAIL:]
                if lines := self._lines(chunk):
                    yield lines
            elif self._path is None:
                if self._half:
                    last, self._half = self._half, b""
                    yield last.split(b"\n")
                return
            elif anew or self._was_replaced():
                self._half = self._tail = b""
                yield None
            else:
                quiet = time.monotonic() - quiet_since
                if (self._stop and self._stop()) or (self._idle_timeout is not None and quiet > self._idle_timeout):
                    return
                time.sleep(POLL)

    def _lines(self, chunk: bytes) -> list[bytes]:
        """The lines that are complete with this chunk; the rest waits.

        Of a line without end only the beginning is kept, which is then one that cannot be read.
        """
        *lines, rest = chunk.split(b"\n")
        if lines:
            lines[0] = self._half + lines[0]
            self._half = b""
            if b"\r" in chunk or b"\r" in lines[0]:  # ends a line too, as it does in a file
                lines = [part for line in lines for part in line.removesuffix(b"\r").split(b"\r")]
        if len(self._half) < LONGEST_LINE:
            self._half += rest
        return lines

    def _was_cut(self) -> bool:
        """Whether the file is shorter than what was read of it, or holds something else there; then to its begin.

        A file that was cut and has grown past its old size since is recognised by the bytes before the place of
        reading.
        """
        at = os.lseek(self._fd, 0, os.SEEK_CUR)
        if os.pread(self._fd, len(self._tail), at - len(self._tail)) == self._tail:
            return False
        os.lseek(self._fd, 0, os.SEEK_SET)
        return True

    def _was_replaced(self) -> bool:
        """Whether another file has taken the name; then that one is read."""
        assert self._path is not None
        try:
            named, held = os.stat(self._path), os.fstat(self._fd)
            if (named.st_ino, named.st_dev) == (held.st_ino, held.st_dev):
                return False
            fd = os.open(self._path, os.O_RDONLY)
        except FileNotFoundError:
            return False
        os.close(self._fd)
        self._fd = fd
        return True
