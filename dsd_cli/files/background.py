"""Reading ahead in a thread of its own: Arrow decodes while the detector computes."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from queue import Empty, Queue
from threading import Event, Thread
from typing import Any, TypeVar

T = TypeVar("T")

#: Seconds to wait for the reader at the end: a pipe whose writer says nothing must not hold us up.
PATIENCE = 2.0


@contextmanager
def read_ahead(items: Iterable[T], depth: int = 2) -> Iterator[Iterator[T]]:
    """Gives the same items, at most `depth` of them read ahead; what the source raises is raised here.

    The thread has ended when the block is left, however it is left: a process that exits while Arrow still
    decodes is aborted by Arrow's own threads.
    """
    queue: Queue[tuple[str, Any]] = Queue(depth)
    stop = Event()

    def fill() -> None:
        try:
            for item in items:
                queue.put(("item", item))
                if stop.is_set():
                    return
            queue.put(("end", None))
        except BaseException as error:
            queue.put(("error", error))

    thread = Thread(target=fill, name="reader", daemon=True)
    thread.start()
    try:
        yield _taken(queue)
    finally:
        stop.set()
        _emptied(queue)  # a reader that waits for room sees `stop`
        thread.join(PATIENCE)


def _taken(queue: Queue[tuple[str, Any]]) -> Iterator[Any]:
    while True:
        kind, value = queue.get()
        if kind == "end":
            return
        if kind == "error":
            raise value
        yield value


def _emptied(queue: Queue[tuple[str, Any]]) -> None:
    try:
        while True:
            queue.get_nowait()
    except Empty:
        return
