"""Reading ahead in a thread of its own: Arrow decodes while the detector computes."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from queue import SimpleQueue
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
    # a signal may interrupt anything that is written in Python with its lock held: these two queues are not
    queue: SimpleQueue[tuple[str, Any]] = SimpleQueue()
    room: SimpleQueue[None] = SimpleQueue()
    stop = Event()
    for _ in range(depth):
        room.put(None)

    def fill() -> None:
        try:
            for item in items:
                room.get()
                queue.put(("item", item))
                if stop.is_set():
                    return
            queue.put(("end", None))
        except BaseException as error:
            queue.put(("error", error))

    thread = Thread(target=fill, name="reader", daemon=True)
    thread.start()
    try:
        yield _taken(queue, room)
    finally:
        stop.set()
        room.put(None)  # a reader that waits for room sees `stop`
        thread.join(PATIENCE)


def _taken(queue: SimpleQueue[tuple[str, Any]], room: SimpleQueue[None]) -> Iterator[Any]:
    while True:
        kind, value = queue.get()
        room.put(None)
        if kind == "end":
            return
        if kind == "error":
            raise value
        yield value
