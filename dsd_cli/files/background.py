"""Reading ahead in a thread of its own: Arrow decodes while the detector computes."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from queue import Queue
from threading import Event, Thread
from typing import Any, TypeVar

T = TypeVar("T")


def read_ahead(items: Iterable[T], depth: int = 2) -> Iterator[T]:
    """The same items, at most `depth` of them read ahead; what the source raises is raised here."""
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

    Thread(target=fill, name="reader", daemon=True).start()
    try:
        while True:
            kind, value = queue.get()
            if kind == "end":
                return
            if kind == "error":
                raise value
            yield value
    finally:
        stop.set()
        while not queue.empty():
            queue.get()
