"""`dsd`, and `python -m dsd_cli`: what must be in order before anything slow is imported."""

from __future__ import annotations

import os
import signal
import sys


def main() -> None:
    """Run `dsd` with the arguments of the process and exit."""
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, signal.SIG_DFL)  # Ctrl-C while starting ends it without a traceback
    _open_standard_streams()
    from dsd_cli.cli.main import main as run_and_exit

    run_and_exit()


def _open_standard_streams() -> None:
    """A closed stdin, stdout or stderr is the null device, or the next file that is opened would take its place."""
    for number, name, mode in ((0, "stdin", "r"), (1, "stdout", "w"), (2, "stderr", "w")):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # takes the lowest number that is free
        if getattr(sys, name) is None:
            setattr(sys, name, os.fdopen(number, mode, encoding="utf-8", closefd=False))


if __name__ == "__main__":
    main()
