"""National Instruments TDMS (npTDMS): groups and channels, stamped by the waveform properties where they have them."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from typing import Any

import numpy as np

from dsd_cli.files.formats.base import CLOCK, RECORDED, Group, numbers
from dsd_cli.signals.log import Array


class TdmsFile:
    """Channels of a group with the same length and waveform timing are one group; data are read as asked for."""

    def __init__(self, path: str) -> None:
        import nptdms
        from nptdms.log import log_manager

        log_manager.set_level(logging.ERROR)  # what it says of a segment is said below
        self._file = nptdms.TdmsFile.open(path)
        status = getattr(self._file, "file_status", None)
        cut_off = status is not None and status.incomplete_final_segment
        self.notes: list[str] = ["its end is missing: what is whole of it is read"] if cut_off else []
        parts: dict[tuple[str, int, float, float, Any], dict[str, Any]] = {}
        for group in self._file.groups():
            for channel in group.channels():
                if len(channel) and (channel.dtype is not None and channel.dtype.kind in "biufM"):
                    parts.setdefault((group.name, len(channel), *_timing(channel)), {})[channel.name] = channel
        began = [begin for *_, begin in parts if begin is not None]
        first = min(began) if began else None
        self.metadata = {} if first is None else {RECORDED: str(np.datetime64(first, "s"))}
        self.groups: Sequence[Group] = [
            Group(
                name,
                rows,
                {one: str(channel.properties.get("unit_string", "")) for one, channel in channels.items()},
                clock=step > 0.0,
                handle=(channels, step, offset + _after(begin, first)),
            )
            for (name, rows, step, offset, begin), channels in parts.items()
        ]

    def read(self, group: Group, channels: Sequence[str], start: int, rows: int) -> dict[str, Array]:
        found, step, offset = group.handle
        stop = min(start + rows, group.rows)
        out: dict[str, Array] = {}
        for name in channels:
            if name == CLOCK and name not in found:
                out[name] = offset + step * np.arange(start, stop, dtype=np.float64)
            else:
                values = numbers(found[name].read_data(start, stop - start))
                out[name] = np.full(stop - start, np.nan) if values is None else values
        return out


def _timing(channel: Any) -> tuple[float, float, Any]:
    """(step s, offset s, start) of the waveform; step 0: it has none."""
    has = channel.properties
    begin = has.get("wf_start_time")
    return float(has.get("wf_increment", 0.0)), float(has.get("wf_start_offset", 0.0)), begin


def _after(begin: Any, first: Any) -> float:
    """s from the first waveform's start to this one."""
    if begin is None:
        return 0.0
    after: Any = np.datetime64(begin) - np.datetime64(first)
    return float(after.astype("timedelta64[ns]").astype(np.int64)) / 1e9
