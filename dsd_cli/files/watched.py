"""A table that says how many of its rows have been read, and how many there are."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from pathlib import Path

from dsd_cli.files.table_source import Batch, TableSource
from dsd_cli.files.tables_in import PARQUET_MAGIC, is_stream
from dsd_cli.files.wrapped import WrappedTable

#: (what is being done, rows in all if that is known) -> to be called with the number of rows just read.
Watch = Callable[[str, int | None], Callable[[int], None]]
#: Bytes at the beginning of a file that tell the size of a line; lines that are its header, at most.
SAMPLE, HEADER = 1 << 16, 3


def watched(table: TableSource, watch: Watch | None, what: str = "reading") -> TableSource:
    """The table, reporting its rows to `watch`; the table itself without one."""
    return table if watch is None else _WatchedTable(table, watch, f"{what} {Path(table.name).name}")


class _WatchedTable(WrappedTable):
    """Reports its rows."""

    def __init__(self, table: TableSource, watch: Watch, what: str) -> None:
        super().__init__(table)
        self._watch, self._what = watch, what

    def batches(self) -> Iterator[Batch]:
        add = self._watch(self._what, about_rows(self.name))
        for batch in self._table.batches():
            yield batch
            add(batch.rows)


def about_rows(path: str) -> int | None:
    """How many rows a log has: a Parquet file says it, the size of the first lines of a text allows a guess; else
    None."""
    if is_stream(path) or not os.path.isfile(path):
        return None
    try:
        with open(path, "rb") as file:
            head = file.read(SAMPLE)
        if head.startswith(PARQUET_MAGIC):
            import pyarrow.parquet as pq

            return int(pq.read_metadata(path).num_rows)
        size = os.path.getsize(path)
    except Exception:  # whoever reads it says what is wrong
        return None
    lines = head.count(b"\n")
    if b"\0" in head or lines <= HEADER:
        return None
    begin, end = len(b"\n".join(head.split(b"\n")[:HEADER])), head.rindex(b"\n")
    return round((size - begin) / (end - begin) * (lines - HEADER))
