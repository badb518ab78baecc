"""How the process ends: signals, and threads that outlive their work."""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from types import CodeType
from typing import NoReturn

#: s until a signal that came where no exception can be raised is raised again.
_SOON = 0.005
#: Signals that end a command in good order.
ENDING = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name))


class Ended(KeyboardInterrupt):
    """SIGINT, SIGTERM or SIGHUP: on the way out, half-written files go."""

    def __init__(self, number: int) -> None:
        super().__init__()
        self.number = number


def end_in_order() -> None:
    """The first of the signals raises `Ended`; another one ends the process at once, whatever it does.

    In a callback of the interpreter (of a weak reference, in `__del__`) Python swallows what is raised, and the
    signal would be lost: it comes once more, a little later.
    """
    swallowed = sys.unraisablehook

    def once_more(lost: sys.UnraisableHookArgs) -> None:
        if not isinstance(lost.exc_value, Ended):
            swallowed(lost)
            return
        signal.signal(lost.exc_value.number, _raise)
        threading.Thread(target=_send, args=(lost.exc_value.number, once_more.__code__), daemon=True).start()

    sys.unraisablehook = once_more
    for number in ENDING:
        if signal.getsignal(number) in (signal.SIG_DFL, signal.default_int_handler):  # ignored ones stay ignored
            signal.signal(number, _raise)


def _send(number: int, hook: CodeType) -> None:
    """The signal, to this process, once the main thread has left the hook: in there it would be swallowed again."""
    main = threading.main_thread().ident or 0
    inside = True
    while inside:
        time.sleep(_SOON)
        frame, inside = sys._current_frames().get(main), False
        while frame is not None:
            inside = inside or frame.f_code is hook
            frame = frame.f_back
    os.kill(os.getpid(), number)


def _raise(number: int, _: object) -> None:
    at_once()
    raise Ended(number)


def at_once() -> None:
    """From now on the signals end the process as they do by default."""
    for number in ENDING:
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, signal.SIG_DFL)


def leave(code: int) -> NoReturn:
    """Exit; where a thread still reads or writes at once, for the interpreter would be taken down under it."""
    if threading.active_count() > 1:
        flush_streams()
        os._exit(code)
    sys.exit(code)


def flush_streams() -> None:
    """What stdout and stderr still hold is written, where anybody takes it: the last thing before `os._exit`."""
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except (OSError, ValueError):
            continue


@contextmanager
def interrupt_ends_reading(wanted: bool) -> Iterator[list[bool]]:
    """The first Ctrl-C (SIGTERM, SIGHUP) fills the list and nothing else, so that what was read is labelled."""
    interrupted: list[bool] = []
    if not wanted:
        yield interrupted
        return
    before = {number: signal.getsignal(number) for number in ENDING}

    def back() -> None:
        for number, handler in before.items():
            signal.signal(number, handler)

    def note(*_: object) -> None:
        interrupted.append(True)
        back()

    for number in ENDING:
        signal.signal(number, note)
    try:
        yield interrupted
    finally:
        back()
