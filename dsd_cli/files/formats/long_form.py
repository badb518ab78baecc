"""Tables with a row for each value (time, name, value), as databases of time series and `melt` write them: turned.

Each name is a channel; several columns of values give `name/column`. Values that have the same stamp are one row.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsd_cli.files.arrow_arrays import as_float64, is_number_type, texts_of
from dsd_cli.files.csv_cells import MISSING, is_number, number, stamps_in
from dsd_cli.files.csv_in import CsvTable
from dsd_cli.files.formats.base import InMemory, check_size
from dsd_cli.files.names_in import is_unit, words_in
from dsd_cli.files.parquet_in import ParquetTable
from dsd_cli.files.recognise import is_time, recognise
from dsd_cli.files.words import TIME_UNITS
from dsd_cli.signals.log import Array

#: Rows that are looked at.
ROWS = 100_000
#: Different texts of which it is asked whether they are numbers.
SAID = 100
#: A text, or a whole number, names a channel where it comes so many times, in the mean, ...
AGAIN = 10
#: ... and stamps rise, or all fall, in this share of the steps from each of its rows to its next.
RISES = 0.97
#: Where there are several columns of values, names change in this share of the steps from row to row at least: else
#: they may be trials, or states of one axis. Where names are numbers, stamps stand still in that share, too, or values
#: change within a name by less than that share of their change from row to row: else they may be counters.
ALTERNATE = 0.5


#: What a channel beside the time may be.
SIGNALS = ("u", "d_hat", "velocity", "position")


class Long(NamedTuple):
    """Which columns hold the stamps, the names (joined by `/`) and the values."""

    time: str
    names: tuple[str, ...]
    values: tuple[str, ...]

    @property
    def note(self) -> str:
        """What to say of it."""
        return f"it has a row for each value, named by {', '.join(self.names)}"


class LongFile(InMemory):
    """A CSV or Parquet file of this form; see `Container`."""

    def __init__(self, path: str) -> None:
        table = opened(path, {})
        first = peeked(table)
        long = long_form(table, first)
        assert long is not None, "who opens it has asked"
        words = {one for one in long.values if (cells := texts_of(first[one])) and stamps_in(cells) is None}
        places = {"t": long.time} | {str(k): one for k, one in enumerate(long.values) if one not in words}
        table = opened(path, places)
        parts = [batch.columns for batch in table.batches()]
        numbers = {column: np.concatenate([part[name] for part in parts]) for name, column in places.items()}
        numbers |= {column: _with_words(table.texts(column)) for column in words}
        channels, units = turned(path, long, numbers, {name: table.texts(name) for name in long.names})
        super().__init__(channels, dict(table.metadata), units)
        self.notes.append(long.note)


def turned(
    path: str, long: Long, numbers: Mapping[str, Array], texts: Mapping[str, list[str]]
) -> tuple[dict[str, Array], dict[str, str]]:
    """The stamps in their order and the values of each name, NaN where it has none, of shape (stamps,); their units."""
    kept = _needed({name: texts[name] for name in long.names})
    names, first, codes = np.unique(_joined([texts[name] for name in kept]), return_index=True, return_inverse=True)
    of_units = [name for name in long.names if name not in kept and all(map(is_unit, texts[name]))]
    t, rows = np.unique(numbers[long.time], return_inverse=True)
    check_size(path, 8.0 * t.size * len(names) * len(long.values))
    channels, units = {long.time: t}, {}
    for at, name in enumerate(names.tolist()):
        mine = codes == at
        for column in long.values:
            full = f"{name}/{column}" if len(long.values) > 1 else name
            channels[full] = np.full(t.size, np.nan)
            channels[full][rows[mine]] = numbers[column][mine]
            units[full] = texts[of_units[0]][first[at]] if of_units and len(long.values) == 1 else ""
    return channels, units


def _joined(texts: list[list[str]]) -> list[str]:
    return ["/".join(row) for row in zip(*texts, strict=True)]


def _needed(texts: Mapping[str, list[str]]) -> list[str]:
    """The columns that distinguish the names, without those that follow from others, as units do."""
    kept = sorted(texts, key=lambda name: all(map(is_unit, set(texts[name]))))
    different = len(set(_joined([texts[name] for name in kept])))
    for name in reversed(kept.copy()):
        rest = [texts[other] for other in kept if other != name]
        if rest and len(set(_joined(rest))) == different:
            kept.remove(name)
    return [name for name in texts if name in kept]


def long_form(table: CsvTable | ParquetTable, first: Mapping[str, Any] | None = None) -> Long | None:
    """The form of a table, by its first rows; None where each row has a value of every channel.

    Raises
    ------
    DataError : it cannot be read.
    """
    first = peeked(table) if first is None else first
    found = form_of({name: column.slice(0, ROWS) for name, column in first.items()})
    if found is None or any(len(set(texts_of(first[name]) or first[name].to_pylist())) > 1 for name in found.names):
        return found
    return found if any(len(set(table.texts(name))) > 1 for name in found.names) else None  # names one after the other


def peeked(table: CsvTable | ParquetTable) -> dict[str, Any]:
    """Column -> Arrow array of its first rows."""
    return table.peek(ROWS) if isinstance(table, ParquetTable) else table.peek()


def form_of(columns: Mapping[str, Any]) -> Long | None:
    """The same of Arrow arrays: within each name stamps rise, and it has one value, or names alternate."""
    numbers = {name: as_float64(column) for name, column in columns.items() if is_number_type(column.type)}
    said = {name: texts_of(column) for name, column in columns.items()}
    texts = {name: [cell or "" for cell in cells] for name, cells in said.items() if cells and not _measured(cells)}
    if any(map(are_names, texts.values())):
        spelt = {name: stamps_in(cells) for name, cells in said.items() if cells and name not in texts}  # 0,5 and dates
        worded = {name: _with_words(said[name] or []) for name, x in spelt.items() if x is None}
        return form_by_texts({n: x for n, x in {**spelt, **worded, **numbers}.items() if x is not None}, texts)
    named = {name: x for name, x in numbers.items() if TIME_UNITS.keys().isdisjoint(words_in(name))}  # nsec comes again
    whole = (name for name, x in named.items() if np.all(x == np.round(x)) and are_names(x.tolist()))
    for name in whole:
        codes = np.unique(numbers[name], return_inverse=True)[1]
        form = _form((name,), codes, numbers)
        if form is not None and (_stand(numbers[form.time]) or _go_on(codes, [numbers[one] for one in form.values])):
            return form
    return None


def form_by_texts(numbers: Mapping[str, Array], texts: Mapping[str, list[str]]) -> Long | None:
    """The same, of channels whose names are texts, of columns with as many rows each."""
    names = tuple(name for name, cells in texts.items() if are_names(cells))
    if not names:
        return None
    told = {one.column for role, one in recognise(list(numbers)).items() if role in SIGNALS}
    form = _form(names, _codes(texts, names), numbers, told)
    if form is None or not (kept := _without_stretches(texts, names, numbers[form.time])):
        return form
    return _form(kept, _codes(texts, kept), numbers, told)


def _codes(texts: Mapping[str, list[str]], names: Sequence[str]) -> NDArray[np.int64]:
    return np.unique(_joined([texts[name] for name in names]), return_inverse=True)[1]


def _without_stretches(texts: Mapping[str, list[str]], names: Sequence[str], t: Array) -> tuple[str, ...]:
    """Those that name channels beside others that say when: all rows of a stamp have the same, and few stamps a new."""
    order = np.argsort(t, kind="stable")
    again, new = np.diff(t[order]) == 0.0, {}
    for name in names:
        new[name] = np.diff(np.unique(texts[name], return_inverse=True)[1][order]) != 0
    when = {name for name, step in new.items() if not step[again].any() and AGAIN * step.sum() < np.sum(~again)}
    at_once = any(step[again].any() for step in new.values())
    return tuple(name for name in names if name not in when) if at_once else ()


def are_names(cells: list[Any]) -> bool:
    """Whether they come again, and are not blank by and large: a text that stands in some rows only is a remark."""
    return 0 < AGAIN * len(set(cells)) <= len(cells) and 2 * cells.count("") < len(cells)


def _measured(cells: list[str | None]) -> bool:
    """Whether most that they say are numbers, written in more than one way, and so no names."""
    told = [cell for cell in dict.fromkeys(cells) if cell and cell.strip() not in MISSING][:SAID]
    return 2 * sum(map(is_number, told)) > len(told)


def _with_words(cells: Sequence[str | None]) -> Array:
    """Values of which some are yes or no, or words: 1 or 0, and NaN."""
    return np.array([_value((cell or "").strip()) for cell in cells])


def _value(cell: str) -> float:
    if (said := cell.casefold()) in ("true", "false"):
        return float(said == "true")
    return number(cell) if is_number(cell) else np.nan


def _stand(t: Array) -> bool:
    return bool(np.mean(np.diff(t) == 0.0) >= ALTERNATE)


def _go_on(codes: NDArray[np.int64], values: list[Array]) -> bool:
    """Whether values go on from a row of a name to its next rather than from row to row."""
    order = np.argsort(codes, kind="stable")
    inside = np.diff(codes[order]) == 0
    within = np.array([_change(np.diff(x[order])[inside]) for x in values])
    across = np.array([_change(np.diff(x)) for x in values])
    return bool(np.median(within - ALTERNATE * across) < 0.0)


def _change(steps: Array) -> float:
    there = np.abs(steps[np.isfinite(steps)])
    return float(there.mean()) if there.size else 0.0


def _form(
    names: tuple[str, ...], codes: NDArray[np.int64], numbers: Mapping[str, Array], told: Collection[str] = ()
) -> Long | None:
    """`told` : columns that are a value though they stay within a name, as the pwm of a run of a motor."""
    order = np.argsort(codes, kind="stable")
    inside = np.diff(codes[order]) == 0
    steps = {name: np.diff(x[order])[inside] for name, x in numbers.items()}
    ways = {name: max(np.mean(step > 0.0), np.mean(step < 0.0)) for name, step in steps.items() if step.size}
    clocks = [name for name, share in ways.items() if share >= RISES]
    if not clocks:
        return None
    time = max(clocks, key=is_time)
    stamps = {time, *filter(is_time, steps)}
    values = tuple(n for n, step in steps.items() if n not in stamps and (n in told or np.any(np.abs(step) > 0.0)))
    alternate = np.mean(np.diff(codes) != 0) >= ALTERNATE
    return Long(time, names, values) if len(values) == 1 or (values and alternate) else None


def opened(path: str, columns: Mapping[str, str]) -> CsvTable | ParquetTable:
    """A CSV or Parquet file."""
    with open(path, "rb") as file:
        parquet = file.read(4) == b"PAR1"
    return ParquetTable(path, columns) if parquet else CsvTable(path, columns)
