"""Columns of one table that were written each at times of its own, with blank cells in between, as merged topics are.

What holds of channels of different clocks (`formats.join`) holds of these: a row with all of them need not exist.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from dsd_cli.errors import DataError
from dsd_cli.files.formats.changes import changes_of, logged_on_change, without_repeats
from dsd_cli.files.formats.join import DECIDING, Joined, Sampled, join
from dsd_cli.files.parquet_in import BATCH_ROWS
from dsd_cli.files.table_source import Batch, TableSource
from dsd_cli.files.wrapped import WrappedTable
from dsd_cli.signals.log import Array, Hold

#: A column has a clock of its own where it is blank in this share or more of the rows in which any has a value.
BLANK = 0.5
#: Rows from which on that is a clock.
FEWEST = 20


def on_one_clock(table: TableSource, u_hold: Hold) -> TableSource:
    """The table with its columns at the stamps of the slowest of them; itself where it has no stamps."""
    return _OwnClocks(table, u_hold) if "t" in table.columns and len(table.columns) > 2 else table


def is_blank(values: Mapping[str, Array]) -> bool:
    """Whether one of these columns, shape (n,) each, has a clock of its own; an empty one has none at all."""
    there = np.array([np.isfinite(column) for column in values.values()])
    rows, counts = int(there.any(axis=0).sum()), there.sum(axis=1)
    return bool(rows >= FEWEST and (counts > 0).all() and (counts <= (1.0 - BLANK) * rows).any())


def _is_whole(columns: Mapping[str, Array]) -> bool:
    """Whether no column is blank, as far as these rows say it: one that is all empty may begin later."""
    begun = all(np.isfinite(column).any() for column in _measured(columns).values())
    return begun and not is_blank(_measured(columns)) and not is_on_change(columns) and not _blanked(columns)


def _blanked(columns: Mapping[str, Array]) -> dict[str, Array]:
    """A table of changes whose blank cells were filled with what was before, blank again; {}: it is none."""
    deciding = {name: x for name, x in columns.items() if name in DECIDING}
    return without_repeats(columns["t"], deciding, [name for name in deciding if name != "u"])


def is_on_change(columns: Mapping[str, Array]) -> bool:
    """Whether u is blank where it did not change, however few rows that are; stamps and channels, shape (n,) each."""
    u = columns.get("u")
    if u is None or np.isfinite(u).all():
        return False
    seen = {name: changes_of(columns["t"], columns[name]) for name in DECIDING if name in columns}
    return "u" in logged_on_change(seen, [name for name in seen if name in DECIDING[1:]])


def _measured(columns: Mapping[str, Array]) -> dict[str, Array]:
    return {name: column for name, column in columns.items() if name != "t"}


class _OwnClocks(WrappedTable):
    """A table with blank cells is read into memory and joined; any other one passes in its batches."""

    def __init__(self, table: TableSource, u_hold: Hold) -> None:
        super().__init__(table)
        self._u_hold, self._notes = u_hold, list[str]()

    @property
    def warnings(self) -> list[str]:
        return [*self._table.warnings, *self._notes]

    def batches(self) -> Iterator[Batch]:
        batches = iter(self._table.batches())
        first = next(batches, None)
        if first is None:
            return
        if _is_whole(first.columns):
            yield first
            yield from batches
            return
        parts = [first, *batches]
        columns = {name: np.concatenate([part.columns[name] for part in parts]) for name in first.columns}
        columns |= _blanked(columns)
        if not is_blank(_measured(columns)) and not is_on_change(columns):
            yield from parts
            return
        for joined in self._joined(columns.pop("t"), columns):
            for start in range(0, joined.t.size, BATCH_ROWS):
                cut = slice(start, start + BATCH_ROWS)
                values = {name: column[cut] for name, column in joined.values.items()}
                yield Batch(joined.t[cut].size, {"t": joined.t[cut], **values})

    def _joined(self, t: Array, columns: Mapping[str, Array]) -> Iterator[Joined]:
        """The recordings in it, one after the other: each begins where the stamps of a column go back.

        Raises
        ------
        DataError : in none of them have all columns values at the same time.
        """
        stamped = np.flatnonzero(np.isfinite(t))
        begins = np.flatnonzero(np.diff(t[stamped]) < 0.0) + 1
        if all(np.all(np.diff(t[np.isfinite(t) & np.isfinite(x)]) >= 0.0) for x in columns.values()):
            begins = begins[:0]  # columns below one another are one recording
        failed: list[DataError] = []
        recordings = np.split(stamped, begins)
        for rows in recordings:
            try:
                joined = join(self.name, self._parts(t[rows], {n: x[rows] for n, x in columns.items()}), self._u_hold)
            except DataError as error:
                failed.append(error)
                continue
            self._notes = self._notes or joined.notes
            yield joined
        if len(failed) == len(recordings):
            raise failed[-1]
        if failed:
            lost = f"{len(failed)} of {len(recordings)} recordings in it lack a channel and are left out"
            self._notes = [*self._notes, lost]

    def _parts(self, t: Array, columns: Mapping[str, Array]) -> list[Sampled]:
        """Columns with values in the same rows are of one clock."""
        clocks: dict[bytes, list[str]] = {}
        for name, column in columns.items():
            clocks.setdefault(np.isfinite(column).tobytes(), []).append(name)
        parts = []
        for names in clocks.values():
            rows = np.isfinite(columns[names[0]])
            label = ", ".join(self.columns[name] for name in names)
            parts.append(Sampled(label, t[rows], {name: columns[name][rows] for name in names}))
        return parts
