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
        super().__init__(_channels("", plain) if objects is None else objects)
        if _WORKSPACE in loaded and (objects is None or not self.groups):
            self.notes.append(not_seen() if objects is None else NO_NUMBERS)


def _claimed(path: str) -> float:
    """Bytes that the variables say they need; 0 where an object, whose size is not in its header, is among them."""
    from scipy.io import whosmat

    try:
        return sum(8.0 * math.prod(shape) for _, shape, _ in whosmat(path))
    except TypeError:
        return 0.0


def _channels(prefix: str, value: Any) -> dict[str, Array]:
    if isinstance(value, Mapping):
        found: dict[str, Array] = {}
        for name, part in value.items():
            found |= _channels(f"{prefix}/{name}" if prefix else str(name), part)
        return found
    if isinstance(value, np.ndarray) and value.dtype == object:  # a cell array, or an array of structs
        found = {}
        for at, part in enumerate(value.reshape(-1)):
            found |= _channels(f"{prefix}/{at + 1}", part)
        return found
    return columns_of(prefix, value) if isinstance(value, np.ndarray) else {}
