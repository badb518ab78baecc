"""MATLAB's .mat up to version 7 (scipy; objects by mat-io); 7.3 is HDF5, see hdf5.py."""

from __future__ import annotations

import math
import struct
import warnings
from collections.abc import Mapping
from typing import Any

import numpy as np

from dsd_cli.files.formats.base import (
    FEWEST,
    InMemory,
    check_size,
    columns_of,
    lists_in,
    named_by,
    only_one,
    sample_times_said,
)
from dsd_cli.files.formats.matlab_objects import NO_NUMBERS, not_seen, object_channels
from dsd_cli.signals.log import Array

#: Where a file keeps what is in its objects.
_WORKSPACE = "__function_workspace__"


class MatFile(InMemory):
    """Variables by their names, fields of structs as `struct/field`, to any depth; columns by a list of names."""

    def __init__(self, path: str) -> None:
        from scipy.io import loadmat

        _check_elements(path)
        check_size(path, _claimed(path))
        with warnings.catch_warnings():  # of objects, of which it takes one for another
            warnings.simplefilter("ignore")
            loaded = loadmat(path, simplify_cells=True)
        objects = object_channels(path) if _WORKSPACE in loaded else None
        plain = {name: value for name, value in loaded.items() if not name.startswith("__") and name != "None"}
        plain, units = _of_modelica(plain)
        channels = named_by(_channels("", plain, units), lists_in(plain), units) if objects is None else objects
        super().__init__(channels, units=units)
        self.sample_time = _sample_time(plain)
        if _WORKSPACE in loaded and (objects is None or not self.groups):
            self.notes.append(not_seen() if objects is None else NO_NUMBERS)


#: MAT 5: bytes before the first element; types of elements, of numbers and others; classes of a matrix, of numbers.
_HEADER, _FLAGS, _MATRIX, _PACKED = 128, 6, 14, 15
_NUMBERS, _ELEMENTS = {1, 2, 3, 4, 5, 6, 7, 9, 12, 13, 16, 17, 18}, {14, 15}
_CLASSES, _OF_NUMBERS = range(1, 18), range(4, 16)


def _check_elements(path: str) -> None:
    """SciPy ends the process at an element that there cannot be; what is packed has a sum that fails before.

    Raises
    ------
    ValueError : there is one.
    """
    content = np.memmap(path, np.uint8, "r").data
    mark = bytes(content[124:128])
    if mark in (b"\x00\x01IM", b"\x01\x00MI"):
        _walk(content[_HEADER:], "<" if mark.endswith(b"IM") else ">")


def _walk(content: memoryview, order: str) -> None:
    """The elements of a file, or of a matrix, which begins with its class."""
    at, numeric = 0, False
    while at + 8 <= len(content):
        kind, size = struct.unpack_from(f"{order}II", content, at)
        if kind >> 16:  # a small one, within its tag
            kind, size, body = kind & 0xFFFF, 8, at
        else:
            body = at + 8
        if kind not in (_NUMBERS if numeric else _NUMBERS | _ELEMENTS):
            raise ValueError(f"an element of type {kind}, which there cannot be")
        if at == 0 and kind == _FLAGS and body + 4 <= len(content):
            of_class = struct.unpack_from(f"{order}I", content, body)[0] & 0xFF
            if of_class not in _CLASSES:
                raise ValueError(f"a matrix of class {of_class}, which there is not")
            numeric = of_class in _OF_NUMBERS
        if kind == _MATRIX:
            _walk(content[body : body + size], order)
        at = body + (size if kind == _PACKED else -(-size // 8) * 8)


def _claimed(path: str) -> float:
    """Bytes that the variables say they need; 0 where an object, whose size is not in its header, is among them."""
    from scipy.io import whosmat

    try:
        return sum(8.0 * math.prod(shape) for _, shape, _ in whosmat(path))
    except TypeError:
        return 0.0


#: What a result of Modelica keeps beside the parameters, which do not change.
_RESULT = {"Aclass", "name", "description", "dataInfo", "data_2"}


def _of_modelica(variables: dict[str, Any]) -> tuple[dict[str, Any], dict[str, str]]:
    """(variables, units) of a result of Dymola or OpenModelica by the names that it keeps beside its matrices; of any
    other file the variables as they are.

    `dataInfo` says of each in which matrix and column it is, below 0 where that is its negative; all may be turned.
    """
    parts: list[Any] = [variables.get(key) for key in ("name", "description", "dataInfo", "data_2")]
    if not variables.keys() >= _RESULT or [np.ndim(part) for part in parts] != [1, 1, 2, 2]:
        return variables, {}
    names, said, info, data = parts
    if "binTrans" in "".join(variables["Aclass"]):  # letters beside letters; NUL at the end of a row is not read
        rows = ([str(row).ljust(info.shape[1], "\0") for row in texts] for texts in (names, said))
        names, said = (["".join(letters) for letters in zip(*texts, strict=False)] for texts in rows)
    else:
        info, data = info.T, data.T
    changing = [(k, int(at)) for k, (matrix, at) in enumerate(info[:2].T) if matrix in (0, 2)]  # the time, too
    if not len(names) == len(said) == info.shape[1] or not all(0 < abs(at) <= len(data) for _, at in changing):
        return variables, {}
    found: dict[str, Any] = {}
    units: dict[str, str] = {}
    for k, at in changing:
        name, text = (str(words[k]).strip(" \0") for words in (names, said))
        found[name] = math.copysign(1.0, at) * data[abs(at) - 1]
        units[name] = text.rpartition("[")[2].rstrip().rstrip("]").partition("|")[0] if "[" in text else ""
    return found, units


def _sample_time(variables: Mapping[str, Any]) -> float | None:
    """The one that the variables say, or fields of structs with channels: that of a controller is another matter."""
    said = sample_times_said(variables)
    for value in variables.values():
        if isinstance(value, Mapping) and _records(value) and (inside := _sample_time(value)) is not None:
            said.add(inside)
    return only_one(said)


def _records(value: Any) -> bool:
    """Whether channels are in it, at any depth."""
    return any(map(_records, value.values())) if isinstance(value, Mapping) else np.size(value) >= FEWEST


#: Fields of a struct that is one channel: of dSPACE's recorders, and of what Simulink writes to the workspace.
_VALUES, _NAMES = ("Data", "values"), ("Name", "label")


def _channels(prefix: str, value: Any, units: dict[str, str]) -> dict[str, Array]:
    """Path -> channel; units are put in by the path of their channel."""
    found: dict[str, Array] = {}
    if isinstance(value, Mapping):
        if (one := _record(prefix, value)) is not None:
            full, values = one
            found = columns_of(full, values)
            unit = value.get("Unit")  # of an empty text the library makes an array of none
            units |= dict.fromkeys(found, unit if isinstance(unit, str) else "")
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
    if values is None or name is None or isinstance(value.get("Time"), np.ndarray):  # with stamps of its own: a group
        return None
    above, _, last = path.rpartition("/")
    if last.isdigit():
        above, _, _ = above.rpartition("/")
    if last == "X" or path.endswith("/X/1"):  # the stamps of dSPACE's Y
        name = "time"
    return f"{above}/{name or last}".lstrip("/"), values
