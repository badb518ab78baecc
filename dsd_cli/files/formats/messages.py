"""Messages of a topic, one after the other, as channels: every number in them, under the way to it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from dsd_cli.files.formats.base import CLOCK
from dsd_cli.signals.log import Array

#: Numbers of an array in a message that are taken; longer ones are pictures and clouds.
LONGEST_ARRAY = 64
#: No reading of a sensor is larger: JSON has whole numbers that no float64 holds.
LARGEST = 1e300


def fields(message: Any, prefix: str = "") -> Iterator[tuple[str, float]]:
    """(name, value) of every number in a message; members of an array by the message's own `name` list, else from 1."""
    if isinstance(message, bool | int | float | np.number | np.bool_):
        if not isinstance(message, int | float) or abs(message) < LARGEST:
            yield prefix, float(message)
        return
    if isinstance(message, str | bytes) or message is None:
        return
    if isinstance(message, list | tuple | np.ndarray):
        if len(message) <= LONGEST_ARRAY:
            for at, part in enumerate(message):
                yield from fields(part, f"{prefix}/{at + 1}")
        return
    members = _members(message)
    if prefix and (ticks := _ticks(members)) is not None:
        yield prefix, ticks / 1e9
        return
    names: Any = members.get("name")
    for key, value in members.items():
        way = f"{prefix}/{key}" if prefix else key
        if _named_by(names, value):
            for name, part in zip(names, value, strict=True):  # sensor_msgs/JointState
                yield from fields(part, f"{way}/{name}")
        else:
            yield from fields(value, way)


def _named_by(names: Any, value: Any) -> bool:
    listed = isinstance(names, list | tuple) and len(names) > 0 and all(isinstance(name, str) for name in names)
    return listed and isinstance(value, list | tuple | np.ndarray) and len(value) == len(names)


def _members(message: Any) -> Mapping[str, Any]:
    if isinstance(message, Mapping):
        return {str(key): value for key, value in message.items()}
    descriptor = getattr(message, "DESCRIPTOR", None)  # protobuf
    if descriptor is not None:
        return {field.name: _plain(getattr(message, field.name)) for field in descriptor.fields}
    slots = getattr(type(message), "__slots__", None) or getattr(message, "__dict__", {})
    return {name: getattr(message, name) for name in slots if not name.startswith("_") and hasattr(message, name)}


def _plain(value: Any) -> Any:
    """A repeated field of protobuf as a list."""
    return list(value) if hasattr(value, "append") and hasattr(value, "extend") else value


def stamp(message: Any) -> int | None:
    """The stamp of its header in ns since 1970; None without one."""
    header = _members(message).get("header")
    at = None if header is None else _members(header).get("stamp")
    if at is None:
        return None
    return _ticks(_members(at))


def _ticks(parts: Mapping[str, Any]) -> int | None:
    """A time in whole seconds and the rest, as ROS, protobuf and their JSON write it, in ns; None: it is none."""
    whole = next((parts[key] for key in ("sec", "secs", "seconds") if key in parts), None)
    rest = next((parts[key] for key in ("nanosec", "nanos", "nsec", "nsecs") if key in parts), None)
    if len(parts) != len(("whole", "rest")) or not isinstance(whole, int) or not isinstance(rest, int):
        return None
    return whole * 1_000_000_000 + rest


class Topic:
    """Collects the messages of one topic."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.rows = 0
        self._columns: dict[str, list[float]] = {}
        self._stamps: list[tuple[int, int]] = []

    def add(self, message: Any, log_time: int) -> None:
        """One message and when it was logged, ns."""
        for name, value in fields(message):
            column = self._columns.setdefault(name, [])
            if len(column) < self.rows:  # it was not in the messages before
                column.extend([np.nan] * (self.rows - len(column)))
            column.append(value)
        own = stamp(message)
        self._stamps.append((log_time, 0 if own is None else own))
        self.rows += 1

    @property
    def stamped(self) -> bool:
        """Every message has a stamp in its header; else the time of logging counts."""
        return self.rows > 0 and all(own > 0 for _, own in self._stamps)

    def columns(self, start: int) -> dict[str, Array]:
        """Name -> values, and the stamps as `CLOCK`, in s since `start` (ns)."""
        which = 1 if self.stamped else 0
        out: dict[str, Array] = {}
        for name, column in self._columns.items():
            column.extend([np.nan] * (self.rows - len(column)))
            if not name.startswith("header/"):
                out[name] = np.array(column)
        out.setdefault(CLOCK, np.array([pair[which] - start for pair in self._stamps], dtype=np.float64) / 1e9)
        return out
