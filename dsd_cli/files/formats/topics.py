"""What MCAP and ROS bags share: topics are groups, and are read, once, when something of them is asked for."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from datetime import UTC, datetime
from typing import Any

from dsd_cli.files.formats.base import CLOCK, RECORDED, Group
from dsd_cli.files.formats.messages import Topic
from dsd_cli.signals.log import Array

#: (topic, message, time of logging in ns)
Message = tuple[str, Any, int]


class Topics:
    """A `Container` of topics; `_messages` gives those of the topics named."""

    notes: list[str]

    def __init__(self, topics: Sequence[tuple[str, int]], start: int) -> None:
        """`topics` : (name, messages), `start` : of the recording, ns since 1970."""
        self.notes = []
        self._start = start
        self.metadata = {RECORDED: datetime.fromtimestamp(start / 1e9, UTC).isoformat(timespec="seconds")}
        self._columns: dict[str, dict[str, Array]] = {}
        shown = self._first([name for name, _ in topics])
        self.groups: Sequence[Group] = [
            Group(name.strip("/"), rows, dict.fromkeys(shown[name], ""), clock=True, handle=name)
            for name, rows in topics
            if shown.get(name)
        ]

    def _messages(self, topics: Sequence[str]) -> Iterable[Message]:
        raise NotImplementedError

    def _first(self, topics: Sequence[str]) -> dict[str, list[str]]:
        """Channels of each topic, as its first message has them."""
        found: dict[str, list[str]] = {}
        for topic in topics:
            for _, message, logged in self._messages([topic]):
                one = Topic(topic)
                one.add(message, logged)
                found[topic] = [name for name in one.columns(0) if name != CLOCK]
                break
        return found

    def read(self, group: Group, channels: Sequence[str], start: int, rows: int) -> dict[str, Array]:
        if group.handle not in self._columns:
            self._load(group)
        found = self._columns[group.handle]
        return {name: found[name][start : start + rows] for name in channels}

    def _load(self, group: Group) -> None:
        topic = Topic(group.handle)
        for _, message, logged in self._messages([group.handle]):
            topic.add(message, logged)
        if not topic.stamped:
            self.notes.append(f"{group.name}: its messages have no stamp, the time of logging is taken")
        self._columns[group.handle] = topic.columns(self._start)


def counted(pairs: Iterable[tuple[str, int]]) -> list[tuple[str, int]]:
    """(topic, messages), one per topic, in the order of their names."""
    total: dict[str, int] = {}
    for topic, count in pairs:
        total[topic] = total.get(topic, 0) + count
    return sorted(total.items())
