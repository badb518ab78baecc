"""The real command in a pseudo-terminal, and what its screen shows."""

import codecs
import fcntl
import os
import pty
import select
import signal
import struct
import subprocess
import termios
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pyte

from tests.cli.rig import DSD


class Terminal:
    """A command whose stdin, stdout and stderr are one terminal; `screen` is what a person sees.

    command : in place of `dsd` with the arguments.
    """

    def __init__(
        self,
        *arguments: object,
        cwd: Path,
        columns: int = 80,
        lines: int = 40,
        command: list[str] | None = None,
        **environment: str,
    ) -> None:
        self.screen = pyte.Screen(columns, lines)
        self.raw = b""
        self._stream, self._decode = pyte.Stream(self.screen), codecs.getincrementaldecoder("utf-8")("replace")
        self._master, slave = pty.openpty()
        fcntl.ioctl(slave, termios.TIOCSWINSZ, struct.pack("HHHH", lines, columns, 0, 0))
        plain = {name: value for name, value in os.environ.items() if name not in ("COLUMNS", "LINES", "NO_COLOR")}
        self.process = subprocess.Popen(
            command or [*DSD, *map(str, arguments)],
            stdin=slave,
            stdout=slave,
            stderr=slave,
            cwd=cwd,
            env={**plain, "TERM": "xterm-256color", "PYTHONIOENCODING": "utf-8", **environment},
            start_new_session=True,
            preexec_fn=_controlling,
        )
        os.close(slave)

    def read(self, wait: float = 0.1) -> bool:
        """Take what comes within that time, s; False where the command has closed the terminal."""
        if select.select([self._master], [], [], wait)[0]:
            try:
                more = os.read(self._master, 1 << 16)
            except OSError:  # what Linux says when nobody holds the other side any more
                more = b""
            if not more:
                return False
            self.raw += more
            self._stream.feed(self._decode.decode(more))
        return True

    def until(self, seen: Callable[[], bool], wait: float = 300.0) -> None:
        """Read until that is so."""
        end = time.monotonic() + wait
        while not seen():
            assert time.monotonic() < end, f"not seen; the screen:\n{self.text}"
            if not self.read():
                assert seen(), f"the command ended; the screen:\n{self.text}"

    def finish(self, wait: float = 300.0) -> int:
        """Read to the end; the exit code."""
        end = time.monotonic() + wait
        while self.read():
            assert time.monotonic() < end, f"still running; the screen:\n{self.text}"
        return self.process.wait(300)

    def type(self, text: str) -> None:
        """Keys; "\\x03" is Ctrl-C."""
        os.write(self._master, text.encode())

    @property
    def text(self) -> str:
        """The screen without blanks at the ends of lines."""
        return "\n".join(line.rstrip() for line in self.screen.display).rstrip()

    def close(self) -> None:
        self.process.kill()
        self.process.wait(300)
        os.close(self._master)


@contextmanager
def terminal(*arguments: object, cwd: Path, **how: object) -> Iterator[Terminal]:
    """The command, ended at the end of the block at the latest."""
    opened = Terminal(*arguments, cwd=cwd, **how)
    try:
        yield opened
    finally:
        opened.close()


def _controlling() -> None:
    """In the child: the terminal is its own, so that Ctrl-C typed there reaches it."""
    fcntl.ioctl(0, termios.TIOCSCTTY, 0)
    signal.signal(signal.SIGINT, signal.SIG_DFL)
