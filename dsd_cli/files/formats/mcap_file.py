"""MCAP (mcap and its decoders): messages of ROS 2, protobuf and JSON, topic by topic."""

from __future__ import annotations

import io
import json
from collections.abc import Iterator, Sequence
from contextlib import redirect_stderr
from importlib import import_module
from importlib.util import find_spec
from typing import Any

from dsd_cli.errors import UsageError
from dsd_cli.files.formats.topics import Message, Topics, counted

#: Encoding of messages -> (module with its DecoderFactory, what to install).
DECODERS = {
    "cdr": ("mcap_ros2.decoder", "mcap-ros2-support"),
    "ros1": ("mcap_ros1.decoder", "mcap-ros1-support"),
    "protobuf": ("mcap_protobuf.decoder", "mcap-protobuf-support"),
}


class McapFile(Topics):
    """Topics whose messages can be decoded; JSON needs no decoder."""

    def __init__(self, path: str) -> None:
        from mcap.reader import make_reader

        self._path = path
        self._factories = {
            encoding: import_module(module).DecoderFactory()
            for encoding, (module, _) in DECODERS.items()
            if find_spec(module.split(".")[0]) is not None
        }
        with open(path, "rb") as file:
            summary = make_reader(file).get_summary()
        if summary is None or summary.statistics is None:
            counts, start = self._counted()
        else:
            counts = [
                (summary.channels[key].topic, count)
                for key, count in summary.statistics.channel_message_counts.items()
                if key in summary.channels
            ]
            start = summary.statistics.message_start_time
        super().__init__(counted(counts), start)
        if not self.groups:
            self._refuse_undecoded()

    def _counted(self) -> tuple[list[tuple[str, int]], int]:
        """Of a file without a summary: a recorder that was cut off does not write it."""
        counts, start = [], 0
        with open(self._path, "rb") as file:
            for _, channel, message in _reader(file).iter_messages(log_time_order=False):
                counts.append((channel.topic, 1))
                start = message.log_time if start == 0 else min(start, message.log_time)
        return counts, start

    def _messages(self, topics: Sequence[str]) -> Iterator[Message]:
        with open(self._path, "rb") as file:
            for schema, channel, message in _reader(file).iter_messages(topics=topics):
                decode = self._decoder(channel.message_encoding, schema)
                if decode is None:
                    return
                yield channel.topic, decode(message.data), message.log_time

    def _decoder(self, encoding: str, schema: Any) -> Any:
        if encoding == "json":
            return json.loads
        factory = self._factories.get(encoding)
        with redirect_stderr(io.StringIO()):  # prints the definition that it then raises for
            return None if factory is None else factory.decoder_for(encoding, schema)

    def _refuse_undecoded(self) -> None:
        with open(self._path, "rb") as file:
            found = {channel.message_encoding for _, channel, _ in _reader(file).iter_messages(log_time_order=False)}
        for encoding in sorted(found & set(DECODERS) - set(self._factories)):
            raise UsageError(
                f"{self._path}: its messages are {encoding}, and {DECODERS[encoding][1]} is not installed",
                f"pip install {DECODERS[encoding][1]}",
            )


def _reader(file: Any) -> Any:
    from mcap.reader import make_reader

    return make_reader(file)
