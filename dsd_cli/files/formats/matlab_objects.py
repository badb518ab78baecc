"""Objects in MATLAB's .mat files (mat-io): tables, timetables, timeseries, and the properties of any other.

Properties are taken as they are stored: mat-io's own tables round the times of rows to whole milliseconds.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from importlib.util import find_spec
from typing import Any

import numpy as np

from dsd_cli.errors import how_to_install
from dsd_cli.files.formats.base import columns_of
from dsd_cli.signals.log import Array

#: s per unit of a timeseries' times.
_UNITS = {
    "nanoseconds": 1e-9,
    "microseconds": 1e-6,
    "milliseconds": 1e-3,
    "seconds": 1.0,
    "minutes": 60.0,
    "hours": 3600.0,
    "days": 86400.0,
    "weeks": 604800.0,
}
_EXPORT = "in MATLAB: s.t = ts.Time; s.u = ts.Data; save('log.mat', '-struct', 's')"
#: What is said where the library finds nothing that could be a channel, too.
_NOT_SEEN = "MATLAB objects in it (tables, timetables, timeseries) are not seen"
NO_NUMBERS = f"the MATLAB objects in it have no numbers that can be read; {_EXPORT}"


def not_seen() -> str:
    """What is said where the library is not there."""
    return f"{_NOT_SEEN}: {how_to_install('mat')}, or {_EXPORT}"


def object_channels(path: str) -> dict[str, Array] | None:
    """Channels of all variables, those inside of objects as `variable/property`; None without mat-io."""
    if find_spec("matio") is None:
        return None
    from matio import load_from_mat

    with warnings.catch_warnings():  # of classes that it does not convert, which nobody asks it to
        warnings.simplefilter("ignore")
        loaded = load_from_mat(path, raw_data=True)
    found: dict[str, Array] = {}
    for name, value in loaded.items():
        if not name.startswith("__"):
            found |= dict(_channels(name, value))
    return found


def _channels(name: str, value: Any) -> Iterator[tuple[str, Array]]:
    properties = getattr(value, "properties", None)
    if isinstance(properties, dict):
        yield from _of_object(name, str(value.classname), properties)
    elif not isinstance(value, np.ndarray):
        return
    elif value.dtype.names:  # structs
        for at, record in enumerate(value.reshape(-1)):
            prefix = name if value.size == 1 else f"{name}/{at + 1}"
            for part in value.dtype.names:
                yield from _channels(f"{prefix}/{part}", record[part])
    elif value.dtype == object:  # cells
        for at, part in enumerate(value.reshape(-1)):
            yield from _channels(f"{name}/{at + 1}", part)
    else:
        yield from columns_of(name, value).items()


def _of_object(name: str, kind: str, properties: dict[str, Any]) -> Iterator[tuple[str, Array]]:
    if kind == "table":
        yield from _columns(name, properties["data"], properties["varnames"])
    elif kind == "timetable":
        held = properties["any"].reshape(-1)[0]
        yield from _columns(name, held["data"], held["varNames"])
        times = _row_times(held["rowTimes"], int(np.asarray(held["numRows"]).item()))
        if times is not None:
            yield f"{name}/{_text(held['dimNames'].reshape(-1)[0])}", times
    elif kind == "duration":
        yield name, np.asarray(properties["millis"], dtype=np.float64).reshape(-1) / 1e3
    elif kind == "datetime":  # ms since 1970, UTC; the imaginary part is what the real one has no digits for
        stamps = np.asarray(properties["data"]).reshape(-1)
        yield name, stamps.real / 1e3 + stamps.imag / 1e3
    elif kind == "timeseries":
        yield from _of_series(name, properties)
    else:
        for key, value in properties.items():
            yield from _channels(f"{name}/{key}", value)


def _of_series(name: str, properties: dict[str, Any]) -> Iterator[tuple[str, Array]]:
    """`name/Data` and `name/Time`, s; samples may lie along the first or (Simulink's) along the last dimension."""
    data = np.asarray(properties["Data_"] if "Data_" in properties else properties.get("Data"))
    times = _series_times(properties, getattr(properties.get("TimeInfo"), "properties", {}))
    if times is not None:
        yield f"{name}/Time", times
        if data.ndim > 1 and data.shape[0] != times.size == data.shape[-1]:
            data = data.reshape(-1, times.size, order="F").T
    yield from _channels(f"{name}/Data", data)


def _series_times(properties: dict[str, Any], info: dict[str, Any]) -> Array | None:
    """As MATLAB's own class has them: stored, or where they are even, as start, increment and length."""
    unit = _UNITS.get(_text(info.get("Units", "")) or "seconds")
    if unit is None:
        return None
    for stored in (properties.get("Time_"), properties.get("Time"), info.get("Time_")):
        if stored is not None and np.size(stored):
            return np.asarray(np.asarray(stored, dtype=np.float64).reshape(-1) * unit)
    start, step, count = (np.asarray(info.get(key, ())).reshape(-1) for key in ("Start_", "Increment_", "Length"))
    if not (start.size == step.size == count.size == 1):
        return None
    return np.asarray((float(start[0]) + float(step[0]) * np.arange(int(count[0]))) * unit)


def _columns(name: str, data: Any, names: Any) -> Iterator[tuple[str, Array]]:
    for column, values in zip(names.reshape(-1), data.reshape(-1), strict=True):
        yield from _channels(f"{name}/{_text(column)}", values)


def _row_times(times: Any, rows: int) -> Array | None:
    """s (of dates: since 1970, UTC); None where they are a step of a calendar."""
    if getattr(times, "classname", "") in ("duration", "datetime"):
        return dict(_channels("t", times))["t"]
    if not (isinstance(times, np.ndarray) and times.dtype.names and "sampleRate" in times.dtype.names):
        return None
    held = times.reshape(-1)[0]
    begin = dict(_channels("t", held["origin"])).get("t")
    if begin is None or begin.size != 1:
        return None
    if np.asarray(held["specifiedAsRate"]).item():
        return np.asarray(begin + np.arange(rows) / float(np.asarray(held["sampleRate"]).item()))
    step = dict(_channels("t", held["stepSize"])).get("t")
    return None if step is None or step.size != 1 else np.asarray(begin + step * np.arange(rows))


def _text(value: Any) -> str:
    return str(np.asarray(value).reshape(-1)[0]) if np.size(value) else ""
