"""HDF5, and MATLAB's .mat of version 7.3, which is HDF5 (h5py)."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

import numpy as np

from dsd_cli.files.csv_cells import is_number
from dsd_cli.files.formats.base import MOST_COLUMNS, Group, lies_in_rows, numbers
from dsd_cli.files.formats.matlab_objects import NO_NUMBERS, not_seen, object_channels
from dsd_cli.signals.log import Array

#: Attributes that name the unit of a dataset.
UNITS = ("units", "unit", "Units", "Unit")
#: Attributes that name the columns of a matrix.
NAMES = ("columns", "column_names", "names", "channels", "labels")
#: Ends of the names of a matrix and of the list of its columns that lies beside it (pandas).
BESIDE = ("_values", "_items")
#: What PyTables writes beside a table so that it finds rows faster.
INDEX = "_i_"
#: A text in what pandas says of the columns in a block of its table.
_TEXT = re.compile(rb"V([^\n]*)\n")
#: More bytes per byte in the file than any compression gives: the rest was never written.
MOST_PACKED = 2000


class Hdf5File:
    """Datasets by their path, columns of a matrix as `path/1`, ..., fields of a compound one as `path/field`."""

    def __init__(self, path: str) -> None:
        import h5py

        self._file = h5py.File(path, "r")
        self.metadata: dict[str, str] = {}
        self.notes: list[str] = []
        # MATLAB writes its matrices the other way round, and marks every variable
        self._matlab = any("MATLAB_class" in item.attrs for item in self._file.values())
        parts: dict[tuple[str, int], dict[str, _Place]] = {}
        self._objects: list[str] = []
        self._file.visititems(lambda name, item: self._note(parts, name, item))
        if self._objects:
            self._note_objects(parts, path)
        self.groups: Sequence[Group] = [
            Group(group, rows, {name: place.unit for name, place in places.items()}, handle=places)
            for (group, rows), places in parts.items()
            if rows
        ]
        if self._objects and not self.groups and not self.notes:
            self.notes.append(NO_NUMBERS)

    def _is_index(self, path: str) -> bool:
        """Whether it lies in what PyTables writes beside a table; a group of such a name alone is the user's."""
        parts = path.split("/")
        of = {k: part.removeprefix(INDEX) for k, part in enumerate(parts) if part.startswith(INDEX)}
        return any("/".join([*parts[:k], table]) in self._file for k, table in of.items() if table)

    def _note(self, parts: dict[tuple[str, int], dict[str, _Place]], path: str, item: Any) -> None:
        import h5py

        if not isinstance(item, h5py.Dataset) or path.startswith("#") or self._is_index(path):
            return
        if item.external or item.is_virtual:  # it may name any file of the reader's
            self.notes.append(f"{path} lies in another file, which is not followed")
            return
        if item.nbytes > MOST_PACKED * max(item.id.get_storage_size(), 1024):
            self.notes.append(f"{path} claims {item.nbytes / 1e9:,.1f} GB, of which next to nothing is in the file")
            return
        if item.attrs.get("MATLAB_class") in (b"char", b"cell", b"function_handle"):
            return
        if "MATLAB_object_decode" in item.attrs:  # a number that stands for an object
            self._objects.append(path)
            return
        if path.endswith("/value") and item.parent.keys() == {"type", "value"}:  # a variable of Octave
            path = path.removesuffix("/value")
        for full, place in _places(path, item, self._matlab).items():
            group, _, name = full.rpartition("/")
            parts.setdefault((group, place.rows), {})[name] = place

    def _note_objects(self, parts: dict[tuple[str, int], dict[str, _Place]], path: str) -> None:
        found = object_channels(path)
        if found is None:
            self.notes.append(not_seen())
            return
        for full, values in found.items():
            if any(full == one or full.startswith(f"{one}/") for one in self._objects):
                group, _, name = full.rpartition("/")
                parts.setdefault((group, values.size), {})[name] = _Place(values, 0)

    def read(self, group: Group, channels: Sequence[str], start: int, rows: int) -> dict[str, Array]:
        return {name: group.handle[name].read(start, min(start + rows, group.rows)) for name in channels}


class _Place:
    """One channel inside a dataset: `along` is the axis of the rows, `at` the column, `part` the field."""

    def __init__(self, item: Any, along: int, at: int | None = None, part: str | None = None) -> None:
        self._item, self._along, self._at, self._part = item, along, at, part
        self.rows = item.shape[along]
        self.unit = _said(item, UNITS, at, item.shape[1 - along] if item.ndim > 1 else 1)

    def read(self, start: int, stop: int) -> Array:
        rows = slice(start, stop)
        if self._part is not None:
            values = self._item.fields(self._part)[rows]
            values = values if self._at is None else values[:, self._at]
        elif self._at is None:
            values = self._item[rows]
        else:
            values = self._item[(rows, self._at) if self._along == 0 else (self._at, rows)]
        found = numbers(values)
        return np.full(stop - start, np.nan) if found is None else found


def _places(path: str, item: Any, matlab: bool) -> dict[str, _Place]:
    if item.ndim == 1 and item.dtype.names:
        return {f"{path}/{name}": place for part in item.dtype.names for name, place in _parts(item, part).items()}
    if item.dtype.kind not in "biuf" or item.ndim not in (1, 2):
        return {}
    if item.ndim == 1:
        return {path: _Place(item, 0)}
    if 1 in item.shape:
        along = 0 if item.shape[1] == 1 else 1
        return {path: _Place(item, along, 0)}
    along = 1 if matlab != lies_in_rows(item.shape[::-1] if matlab else item.shape) else 0
    columns = item.shape[1 - along]
    if columns > MOST_COLUMNS:
        return {}
    named = {k: _said(item, NAMES, k, columns) or str(k + 1) for k in range(columns)}
    if len(listed := _listed_beside(path, item)) == columns:
        named = dict(enumerate(listed))
    if len(set(named.values())) < len(named) or any("/" in name or is_number(name) for name in named.values()):
        named = {k: str(k + 1) for k in named}
    return {f"{path}/{name}": _Place(item, along, k) for k, name in named.items()}


def _listed_beside(path: str, item: Any) -> list[str]:
    """What a list of texts beside a matrix calls its columns; [] where there is none, or it is an array in memory."""
    values, items = BESIDE
    name = path.rpartition("/")[2]
    there = name.endswith(values) and hasattr(item, "parent")
    beside: Any = item.parent.get(name.removesuffix(values) + items) if there else None
    listed = isinstance(beside, type(item)) and beside.dtype.kind == "S" and beside.ndim == 1
    return [*map(_text, beside[:])] if listed else []


def _parts(item: Any, part: str) -> dict[str, _Place]:
    """The channels in a field of a compound dataset: one, or the columns of a block of pandas, called as it says."""
    base, shape = item.dtype[part].base, item.dtype[part].shape
    if base.kind not in "biuf" or len(shape) > 1:
        return {}
    if not shape:
        return {part: _Place(item, 0, part=part)}
    said = np.ravel(item.attrs.get(f"{part}_kind", b""))
    names = [_text(name) for name in _TEXT.findall(said[0])] if said.size and isinstance(said[0], bytes) else []
    names = names if len(set(names)) == shape[0] else [f"{part}/{k + 1}" for k in range(shape[0])]
    return {name: _Place(item, 0, at=k, part=part) for k, name in enumerate(names)}


def _said(item: Any, keys: Sequence[str], at: int | None, columns: int) -> str:
    """What the first of these attributes says of a dataset, or of its column `at` where it has a text for each."""
    attributes = getattr(item, "attrs", {})  # an array in memory has none
    value = next((attributes[key] for key in keys if key in attributes), "")
    if np.ndim(value) == 0 or (np.size(value) == columns == 1):
        return _text(np.ravel(value)[0])
    return _text(value[at]) if at is not None and np.shape(value) == (columns,) else ""


def _text(value: Any) -> str:
    return value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value)
