"""The first rows of every channel of an unknown log, table by table: what `dsd init` and `dsd columns` look at."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass

from dsd_cli.errors import DataError, source_name
from dsd_cli.files.csv_cells import is_stamp, stamps_in
from dsd_cli.files.csv_in import CsvTable
from dsd_cli.files.csv_layout import CsvLayout
from dsd_cli.files.formats.base import Container, Group
from dsd_cli.files.formats.known import HEAD_BYTES, LONG, format_of, is_bag, open_container
from dsd_cli.files.formats.long_form import ROWS, long_form, peeked
from dsd_cli.files.label_runs import split_note
from dsd_cli.files.parquet_in import ParquetTable
from dsd_cli.files.table_source import read_head
from dsd_cli.files.tables_in import is_stream, open_table
from dsd_cli.signals.facts import Channel
from dsd_cli.signals.log import Array

#: Channels of a table that are looked at.
CHANNELS = 400
#: Share of its cells that may be no numbers in a column of numbers: whoever reads it says in which line.
SPOILED = 0.1


@dataclass(frozen=True, eq=False)
class Table:
    """Channels with the same rows; `clock`: the file stamps them by itself. `rows`: None where it does not say.

    `beside`: columns that it has as well, and that are not looked at.
    """

    name: str
    channels: tuple[Channel, ...]
    rows: int | None
    clock: bool = False
    beside: frozenset[str] = frozenset()


@dataclass(frozen=True, eq=False)
class Sample:
    """The tables of a log, those with most first, and what was said while it was read."""

    tables: tuple[Table, ...]
    notes: tuple[str, ...] = ()
    sample_time: float | None = None


def sample(path: str, layout: CsvLayout | None = None, told: Collection[str] = ()) -> Sample:
    """The first rows of every channel; `told`: columns that the user names, by their number where others have the name.

    Raises
    ------
    DataError : it cannot be read, or can be read only once.
    """
    if is_stream(path):
        raise DataError(f"{source_name(path)}: can be read only once", "write it to a file first")
    kind = format_of(path, b"" if is_bag(path) else read_head(path, HEAD_BYTES))
    if kind is not None:
        return _of_container(open_container(path, kind, layout.scaled if layout else None))
    table = open_table(path, {}, (), layout=layout)
    assert isinstance(table, CsvTable | ParquetTable)
    if again := [text for text in told if _is_one_of_several(text, table.column_names)]:
        table = open_table(path, dict(zip(again, again, strict=True)), (), layout=layout)
        assert isinstance(table, CsvTable | ParquetTable)
    first = peeked(table)
    if long_form(table, first) is not None:
        return _of_container(open_container(path, LONG))
    if isinstance(table, ParquetTable):
        notes = filter(None, [split_note(path, first)])
        return Sample((Table("", tuple(_of_arrow(first, {})), table.rows),), tuple(notes))
    channels = tuple(_of_arrow(first, table.units))
    notes = filter(None, [*table.warnings, split_note(path, first, table.delimiter)])
    return Sample((Table("", channels, None),), tuple(notes), table.sample_time)


def _is_one_of_several(text: str, names: Sequence[str]) -> bool:
    """Whether it is the number of a column whose name others have, so that nothing else says which is meant."""
    at = int(text) - 1 if text.isascii() and text.isdigit() and text not in names else -1
    return 0 <= at < len(names) and names.count(names[at]) > 1


def _of_container(file: Container) -> Sample:
    tables = [
        Table(group.name, tuple(_of_group(file, group)), group.rows, group.clock)
        for group in file.groups
        if group.rows > 1
    ]
    return Sample(tuple(_merged(tables)), tuple(file.notes), getattr(file, "sample_time", None))


def _of_group(file: Container, group: Group) -> Iterator[Channel]:
    names = list(group.units)[:CHANNELS]
    found = file.read(group, names, 0, ROWS)
    for name in names:
        values: Array = found[name]
        yield Channel(group.full(name), values, group.units[name])


def _merged(tables: list[Table]) -> Iterator[Table]:
    """Groups inside of the same group that have as many rows are one table; those of the file's own clocks stay."""
    parts: dict[tuple[str, int | None], list[Table]] = {}
    above = {table.rows for table in tables if not table.name and not table.clock}
    for table in tables:
        top = "" if table.rows in above else table.name.partition("/")[0]
        key = (table.name if table.clock else top, table.rows)
        parts.setdefault(key, []).append(table)
    for (name, rows), mine in parts.items():
        channels = tuple(channel for table in mine for channel in table.channels)
        yield Table(name, channels, rows, mine[0].clock)


def _of_arrow(columns: dict[str, object], units: dict[str, str]) -> Iterator[Channel]:
    import pyarrow as pa

    from dsd_cli.files.arrow_arrays import as_float64, is_number_type, texts_of

    for name, column in list(columns.items())[:CHANNELS]:
        kind = column.type  # type: ignore[attr-defined]
        unit = units.get(name, "")
        if is_number_type(kind):
            yield Channel(name, as_float64(column), unit, pa.types.is_boolean(kind))
        else:
            texts = texts_of(column) or ()
            spoken = any(is_stamp(text) for text in texts[:1] if text is not None)
            yield Channel(name, stamps_in(texts, SPOILED), "s" if spoken else unit)
