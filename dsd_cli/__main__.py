"""`dsd`, and `python -m dsd_cli`: what must be in order before anything slow is imported."""

from __future__ import annotations

import atexit
import gc
import io
import os
import signal
import sys
from typing import Any, NoReturn

#: Objects that a start makes and keeps, about: garbage is first looked for when there are more.
KEPT = 100_000


def main() -> NoReturn:
    """Run `dsd` with the arguments of the process and exit."""
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, signal.SIG_DFL)  # Ctrl-C while starting ends it without a traceback
    _spare_the_start()
    _open_standard_streams()
    from dsd_cli.cli.main import main as run_and_exit

    try:
        run_and_exit()
    except SystemExit as leaving:
        if not isinstance(leaving.code, int):
            raise
        _leave(leaving.code)


def _spare_the_start() -> None:
    """What a start makes is not looked through for garbage a hundred times; after that everything is as usual."""
    usual = gc.get_threshold()

    def as_usual(phase: str, _: object) -> None:
        gc.callbacks.remove(as_usual)
        gc.set_threshold(*usual)

    gc.set_threshold(KEPT, *usual[1:])
    gc.callbacks.append(as_usual)


def _leave(code: int) -> NoReturn:
    """Exit without taking all modules to pieces, which takes as long as loading some of them; the system frees them."""
    from dsd_cli.cli.ending import flush_streams  # loaded by now

    atexit._run_exitfuncs()
    flush_streams()
    os._exit(code)


def _open_standard_streams() -> None:
    """A closed stdin, stdout or stderr is the null device, or the next file that is opened would take its place."""
    for number, name, mode in ((0, "stdin", "r"), (1, "stdout", "w"), (2, "stderr", "w")):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # takes the lowest number that is free
        if getattr(sys, name) is None:
            setattr(sys, name, os.fdopen(number, mode, encoding="utf-8", closefd=False))
    for name in ("stdout", "stderr"):
        setattr(sys, name, _written_whole(getattr(sys, name)))


def _written_whole(stream: Any) -> Any:
    """The stream; under PYTHONUNBUFFERED, where Python drops what one write does not take, with a buffer in between."""
    if not isinstance(stream, io.TextIOWrapper) or not isinstance(stream.buffer, io.RawIOBase):
        return stream
    whole = io.BufferedWriter(stream.buffer)
    return io.TextIOWrapper(whole, stream.encoding, stream.errors, line_buffering=True)


if __name__ == "__main__":
    main()
