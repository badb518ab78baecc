"""MATLAB's .mat up to version 7 (scipy; objects by mat-io); 7.3 is HDF5, see hdf5.py."""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping
from typing import Any

import numpy as np

from dsd_cli.files.formats.base import InMemory, check_size, columns_of
from dsd_cli.files.formats.matlab_objects import NO_NUMBERS, not_seen, object_channels
from dsd_cli.signals.log import Array

#: Where a file keeps what is in its objects.
_WORKSPACE = "__function_workspace__"


class MatFile(InMemory):
    """Variables by their names, fields of structs as `struct/field`, to any depth."""

    def __init__(self, path: str) -> None:
        from scipy.io import loadmat

        check_size(path, _claimed(path))
        with warnings.catch_warnings():  # of objects, of which it takes one for another
            warnings.simplefilter("ignore")
            loaded = loadmat(path, simplify_cells=True)
        objects = object_channels(path) if _WORKSPACE in loaded else None
        plain = {name: value for name, value in loaded.items() if not name.startswith("__") and name != "None"}
        units: dict[str, str] = {}
        super().__init__(_channels("", plain, units) if objects is None else objects, units=units)
        if _WORKSPACE in loaded and (objects is None or not self.groups):
            self.notes.append(not_seen() if objects is None else NO_NUMBERS)


def _claimed(path: str) -> float:
    """Bytes that the variables say they need; 0 where an object, whose size is not in its header, is among them."""
    from scipy.io import whosmat

    try:
        return sum(8.0 * math.prod(shape) for _, shape, _ in whosmat(path))
    except TypeError:
        return 0.0


#: Fields of a struct that is one channel: of dSPACE's recorders, and of what Simulink writes to the workspace.
_VALUES, _NAMES = ("Data", "values"), ("Name", "label")


def _channels(prefix: str, value: Any, units: dict[str, str]) -> dict[str, Array]:
    """Path -> channel; units are put in by the path of their channel."""
    found: dict[str, Array] = {}
    if isinstance(value, Mapping):
        if (one := _record(prefix, value)) is not None:
            full, values = one
            found = columns_of(full, values)
            units |= dict.fromkeys(found, str(value.get("Unit") or ""))
            return found
        for name, part in value.items():
            found |= _channels(f"{prefix}/{name}" if prefix else str(name), part, units)
        return found
    if isinstance(value, list) or (isinstance(value, np.ndarray) and value.dtype == object):  # cells, arrays of structs
        for at, part in enumerate(value if isinstance(value, list) else value.reshape(-1)):
            found |= _channels(f"{prefix}/{at + 1}", part, units)
        return found
    return columns_of(prefix, value) if isinstance(value, np.ndarray) else {}


def _record(path: str, value: Mapping[str, Any]) -> tuple[str, Any] | None:
    """Name and values of a struct that is one channel; it is called as it calls itself, in the place of its array."""
    values = next((value[key] for key in _VALUES if isinstance(value.get(key), np.ndarray)), None)
    name = next((value[key] for key in _NAMES if isinstance(value.get(key), str)), None)
    if values is None or name is None:
        return None
    above, _, last = path.rpartition("/")
    if last.isdigit():
        above, _, _ = above.rpartition("/")
    if last == "X" or path.endswith("/X/1"):  # the stamps of dSPACE's Y
        name = "time"
    return f"{above}/{name or last}".lstrip("/"), values
