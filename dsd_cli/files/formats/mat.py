"""MATLAB's .mat up to version 7 (scipy); 7.3 is HDF5, see hdf5.py."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from dsd_cli.files.formats.base import InMemory, columns_of
from dsd_cli.signals.log import Array


class MatFile(InMemory):
    """Variables by their names, fields of structs as `struct/field`, to any depth."""

    def __init__(self, path: str) -> None:
        from scipy.io import loadmat

        loaded = loadmat(path, simplify_cells=True)
        channels = _channels("", {name: value for name, value in loaded.items() if not name.startswith("__")})
        super().__init__(channels)


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
