"""ASAM MDF 3 and 4 (asammdf): channels with their conversions applied, stamped by the master of their group."""

from __future__ import annotations

import logging
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from typing import Any

import numpy as np

from dsd_cli.errors import DataError
from dsd_cli.files.formats.base import CLOCK, RECORDED, Group, numbers
from dsd_cli.files.formats.formulas import check_formulas
from dsd_cli.signals.log import Array

#: Types of channels of version 4 that have no bits: they count the rows.
VIRTUAL = (3, 6)


class MdfFile:
    """Groups by their acquisition name (else `group0`, ...); stamps are s since the start of the recording."""

    def __init__(self, path: str) -> None:
        from asammdf import MDF
        from asammdf.blocks import mdf_v3, mdf_v4

        # what could not be opened cannot be closed either, and says so with a traceback when it is collected
        for kind in (mdf_v3.MDF3, mdf_v4.MDF4):
            kind.__del__ = _close_quietly  # type: ignore[method-assign]
        # what the file says of buses and their databases is not followed: that would run its conversions unseen
        with _unheard(logging.getLogger("asammdf")):  # it logs what it then raises
            self._path, self._mdf = path, MDF(path, process_bus_logging=False)  # type: ignore[call-arg]
        self.metadata = {RECORDED: self._mdf.header.start_time.isoformat()}
        self.notes: list[str] = []
        self.groups: Sequence[Group] = self._groups()

    def _groups(self) -> list[Group]:
        found, taken = [], set()
        groups: list[Any] = list(self._mdf.groups)
        for at, group in enumerate(groups):
            rows = group.channel_group.cycles_nr
            master = self._mdf.masters_db.get(at)
            # a name that is twice in a group is read by its place
            places: dict[str, int] = {}
            for k, channel in enumerate(group.channels):
                places.setdefault(channel.name if channel.name not in places else f"{channel.name}#{k}", k)
            units = {name: group.channels[k].unit or "" for name, k in places.items()}
            name = getattr(group.channel_group, "acq_name", None) or f"group{at}"
            name = name if name not in taken else f"{name}#{at}"
            taken.add(name)
            if rows:
                found.append(Group(name, rows, units, clock=master is not None, handle=(at, places)))
        return found

    def read(self, group: Group, channels: Sequence[str], start: int, rows: int) -> dict[str, Array]:
        at, places = group.handle
        count = min(rows, group.rows - start)
        for name in channels:
            self._check(at, places.get(name), name)
        out: dict[str, Array] = {}
        for name in channels:
            if name == CLOCK and name not in places:
                stamps: Array = self._mdf.get_master(at, record_offset=start, record_count=count).astype(np.float64)
                out[name] = stamps
                continue
            signal = self._mdf.get(group=at, index=places[name], record_offset=start, record_count=count)
            out[name] = _valid(signal, count)
        return out

    def _check(self, at: int, place: int | None, name: str) -> None:
        """Look at every formula that reading the channel, or the stamps (None), would run: also those of its parts.

        Where a channel lies outside of its record the library would read, and write, what is not its own.
        """
        own: list[Any] = self._mdf.groups[at].channels
        asked = [] if place is None else [own[place]]
        master = self._mdf.masters_db.get(at)
        asked += [] if master is None else [own[master]]
        if any(getattr(channel, "component_addr", 0) for channel in asked):
            asked = own
        for channel in asked:
            check_formulas(f"{self._path}: {name}", channel.conversion)
            if not _lies_in(self._mdf.groups[at].channel_group, channel):
                raise DataError(
                    f"{self._path}: is damaged ({channel.name} lies outside of its record)", "write it again"
                )


def _lies_in(record: Any, channel: Any) -> bool:
    """Whether the bits of a channel, of either version, are some of its record; those of a virtual one are nowhere."""
    if getattr(channel, "channel_type", 0) in VIRTUAL:
        return True
    of_bytes, of_bits = ("byte_offset", "additional_byte_offset"), ("bit_offset", "start_offset")
    first = sum(8 * getattr(channel, name, 0) for name in of_bytes) + sum(getattr(channel, name, 0) for name in of_bits)
    return bool(first + channel.bit_count <= 8 * record.samples_byte_nr)


@contextmanager
def _unheard(logger: logging.Logger) -> Iterator[None]:
    level = logger.level
    logger.setLevel(logging.CRITICAL + 1)
    try:
        yield
    finally:
        logger.setLevel(level)


def _close_quietly(file: Any) -> None:
    with suppress(Exception):
        file.close()


def _valid(signal: Any, count: int) -> Array:
    """Samples that the file marks as invalid, and texts, are no values."""
    found = numbers(signal.samples)
    if found is None or found.shape != (count,):
        return np.full(count, np.nan)
    if signal.invalidation_bits is not None:
        found = np.where(np.asarray(signal.invalidation_bits, dtype=bool), np.nan, found)
    return found
