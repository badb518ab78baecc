"""ROS bags (rosbags): the folder that `ros2 bag record` writes (SQLite or MCAP), and .bag files of ROS 1."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from dsd_cli.files.formats.topics import Message, Topics, counted

#: Types of messages where the bag does not hold them: of the current long-term release.
TYPES = "ros2_humble"


class RosBag(Topics):
    """Topics whose type is known, from the bag itself or as a standard one."""

    def __init__(self, path: str) -> None:
        from rosbags.highlevel import AnyReader
        from rosbags.typesys import get_typestore
        from rosbags.typesys.store import Typestore

        found = Path(path)
        if found.suffix == ".db3":  # the database inside of the folder
            found = found.parent
        store: Typestore = get_typestore(next(one for one in _stores() if one.value == TYPES))
        self._reader: Any = AnyReader([found], default_typestore=store)
        self._reader.open()
        known = [one for one in self._reader.connections if one.msgtype in self._reader.typestore.fielddefs]
        super().__init__(counted((one.topic, one.msgcount) for one in known), self._reader.start_time)
        unknown = sorted({one.msgtype for one in self._reader.connections} - {one.msgtype for one in known})
        if unknown:
            self.notes.append(f"types of messages that are not known: {', '.join(unknown)}")

    def _messages(self, topics: Sequence[str]) -> Iterator[Message]:
        wanted = [one for one in self._reader.connections if one.topic in topics]
        for connection, logged, data in self._reader.messages(wanted):
            yield connection.topic, self._reader.deserialize(data, connection.msgtype), logged


def _stores() -> Any:
    from rosbags.typesys import Stores

    return Stores
