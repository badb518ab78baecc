"""SQLite (of Python itself): the tables of a database that a logger filled, a row for each sample."""

from __future__ import annotations

import sqlite3
from contextlib import closing
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np

from dsd_cli.files.csv_cells import ISO_TIME, seconds
from dsd_cli.files.formats.base import FEWEST, InMemory, check_size
from dsd_cli.signals.log import Array

#: More bytes than this, of 8 for each value, no byte of a database holds.
_PER_BYTE = 8.0


class SqliteFile(InMemory):
    """Columns of numbers, or of stamps in words, as `table/column`, in the order in which the database has its rows.

    It is opened for reading alone, with what a logger that still runs, or was killed, has only in its write-ahead log.
    Tables of other modules are not asked: they would run these. A table of fewer rows than make a channel says what
    the rig was.
    """

    def __init__(self, path: str) -> None:
        check_size(path, _PER_BYTE * Path(path).stat().st_size)
        channels: dict[str, Array] = {}
        ahead = Path(f"{path}-wal")
        as_it_is = "" if ahead.is_file() and ahead.stat().st_size else "&immutable=1"  # leaves no file beside it
        with closing(sqlite3.connect(f"file:{quote(str(Path(path).absolute()))}?mode=ro{as_it_is}", uri=True)) as base:
            base.text_factory = lambda words: words.decode("utf-8", "replace")
            tables = base.execute(
                "SELECT name, sql FROM sqlite_master WHERE type = 'table' AND name NOT LIKE 'sqlite_%'"
            )
            for table, made in tables.fetchall():
                if str(made).upper().split()[1:2] == ["VIRTUAL"]:
                    continue
                found = base.execute(f'SELECT * FROM "{table.replace(chr(34), chr(34) * 2)}"')
                names = [one[0] for one in found.description]
                rows = found.fetchall()
                columns = zip(*rows, strict=True) if len(rows) >= FEWEST else []
                read = {f"{table}/{name}": _numbers(cells) for name, cells in zip(names, columns, strict=False)}
                channels |= {full: values for full, values in read.items() if values is not None}
        super().__init__(channels)


def _numbers(cells: tuple[Any, ...]) -> Array | None:
    """A column as float64, NaN where nothing is, stamps in words in s; None: it is of other words, or of none."""
    there = [cell for cell in cells if cell is not None]
    if there and all(isinstance(cell, str) and ISO_TIME.match(cell) for cell in there):
        return np.array([np.nan if cell is None else seconds(cell) for cell in cells])
    try:  # of a column of TEXT that has numbers in it, too
        return np.array([np.nan if cell is None else float(cell) for cell in cells]) if there else None
    except (TypeError, ValueError):
        return None
