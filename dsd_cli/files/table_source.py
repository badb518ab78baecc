"""What every reader of tables shares: batches, the choice of columns, the first bytes, metadata beside a file."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from difflib import get_close_matches
from pathlib import Path
from typing import NamedTuple, Protocol

import numpy as np

from dsd_cli.errors import DataError
from dsd_cli.files.content import content_of
from dsd_cli.signals.log import Array

#: What the file with the metadata of a CSV file is called, after that one's name.
SIDECAR = ".meta.json"
#: Metadata that says: the columns have the tool's own names, and its units ([signals] has been applied to them).
OWN_CHANNELS = "channels"
#: Metadata that says what d_hat was computed from, see `Log.d_hat_source`.
D_HAT_SOURCE = "d_hat_source"
#: Bytes; ours hold a config.
LARGEST_SIDECAR = 1 << 24


class Batch(NamedTuple):
    """`rows` rows: canonical name -> float64, shape (rows,), NaN where a value is missing.

    `restart`: the file was begun anew, so these rows are another recording.
    """

    rows: int
    columns: dict[str, Array]
    restart: bool = False


class TableSource(Protocol):
    """A table that is being read.

    Attributes
    ----------
    name : for messages.
    column_names : every column of the file, needed or not.
    columns : canonical name -> column, for those that are read (optional ones only if they are there).
    metadata : provenance that came with the file.
    warnings : one sentence each.
    unreadable : rows given as NaN because their line could not be read (live streams only).
    """

    name: str
    metadata: dict[str, str]

    @property
    def column_names(self) -> list[str]: ...
    @property
    def columns(self) -> dict[str, str]: ...
    @property
    def warnings(self) -> list[str]: ...
    @property
    def unreadable(self) -> int: ...

    def batches(self) -> Iterator[Batch]: ...


def read_head(path: str | Path, size: int) -> bytes:
    """The first bytes of a file, or of the text in it; one line for whatever keeps it from being read."""
    try:
        with open(path, "rb") as file:
            head = file.read(size)
        return head if (content := content_of(path, size)) is None else content
    except FileNotFoundError:
        raise DataError(f"{path}: no such file") from None
    except IsADirectoryError:
        raise DataError(f"{path}: is a directory", "give a log file") from None
    except PermissionError:
        raise DataError(f"{path}: permission denied") from None
    except (OSError, ValueError) as error:
        raise DataError(f"{path}: cannot be read ({getattr(error, 'strerror', None) or error})") from None


def choose_columns(
    source: str, column_names: list[str], columns: Mapping[str, str], optional: Collection[str]
) -> dict[str, str]:
    """Canonical name -> column for those that are there.

    Raises
    ------
    DataError : there are no columns, a needed one is missing, or there are several of that name.
    """
    if not column_names:
        raise DataError(f"{source}: has no columns", "write it again with the channels in it")
    chosen = {}
    for canonical, name in columns.items():
        if name in column_names:
            if column_names.count(name) > 1:
                key, at = "time" if canonical == "t" else canonical, column_names.index(name) + 1
                told = f"give it by its number, --set signals.{key}={at}, or that of another"
                raise DataError(f'{source}: {column_names.count(name)} columns are called "{name}"', told)
            chosen[canonical] = name
        elif canonical not in optional:
            bare = column_names == [str(k + 1) for k in range(len(column_names))]
            listed = f"{'no header; its columns are ' if bare else ''}{_listed(column_names)}"
            raise DataError(f'{source}: no column "{name}"; it has {listed}', _hint(canonical, name, column_names))
    return chosen


def _listed(names: list[str], limit: int = 12) -> str:
    more = f" and {len(names) - limit} more" if len(names) > limit else ""
    return ", ".join(name or '""' for name in names[:limit]) + more


def _hint(canonical: str, name: str, column_names: list[str]) -> str:
    key = "time" if canonical == "t" else canonical
    if canonical in column_names:
        return f'set [signals] {key} = "{canonical}"'
    column_names = [column for column in column_names if not column.startswith("true_")]
    if "/" in name:  # group/channel: that they share the group says nothing
        name = name.rpartition("/")[2]
        folded = {column.rpartition("/")[2].casefold(): column for column in column_names}
    else:
        folded = {column.casefold(): column for column in column_names}
    close = get_close_matches(name.casefold(), list(folded), n=1, cutoff=0.5) or [
        column for column in folded if column.startswith((name.casefold() + "_", name.casefold() + " "))
    ]
    return f'set [signals] {key} = "{folded[close[0]] if close else "..."}"'


def sidecar(path: str | Path) -> Path:
    """Where the metadata of a CSV file is kept."""
    return Path(f"{path}{SIDECAR}")


def read_sidecar(path: str | Path) -> dict[str, str]:
    """Metadata of a CSV file; empty when there is none or it is not ours."""
    beside = sidecar(path)
    try:
        if not beside.is_file() or beside.stat().st_size > LARGEST_SIDECAR:
            return {}
        import json

        found = json.loads(beside.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return {}
    return {str(key): str(value) for key, value in found.items()} if isinstance(found, dict) else {}


def missing(rows: int) -> Array:
    """A column without any value."""
    return np.full(rows, np.nan)
