"""Whole logs in and out: what `simulate` and `observe` write, and reading it (or any small recording) into memory."""

from __future__ import annotations

import sys
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

import numpy as np

from dsd_cli.errors import DataError
from dsd_cli.files.as_read import as_read
from dsd_cli.files.command import Command
from dsd_cli.files.csv_layout import CsvLayout
from dsd_cli.files.remade import Made
from dsd_cli.files.scaled import FACTORS, applied, factors_text
from dsd_cli.files.table_source import D_HAT_SOURCE, TableSource
from dsd_cli.files.tables_in import dropped_with_unreadable, open_table
from dsd_cli.files.tables_out import open_writer
from dsd_cli.files.watched import Watch, watched
from dsd_cli.files.windowed import Window
from dsd_cli.signals.cleaning import Cleaner, Piece
from dsd_cli.signals.log import CHANNELS, D_HAT_MAKER, Array, DHatSource, Log
from dsd_cli.signals.outliers import Limits

_D_HAT_SOURCES = ("logged", "velocity", "position")
#: Metadata that `write_log` adds and `load_log` turns back into attributes.
SAMPLE_TIME = "sample_time"


@dataclass(frozen=True)
class LoadedLog:
    """A log in memory and what was done to it.

    Attributes
    ----------
    dropped : reason -> count, see `Cleaner.dropped`.
    restarts : the samples that do not continue the one before.
    regular : the samples are `log.sample_time` apart (but for jitter and restarts).
    """

    log: Log
    dropped: Mapping[str, int]
    warnings: tuple[str, ...]
    restarts: tuple[int, ...]
    regular: bool


def load_log(
    path: str | Path,
    signals: Mapping[str, str],
    optional: Collection[str] = (),
    *,
    sample_time: float | None = None,
    time_scale: float = 1.0,
    factors: Mapping[str, float] | None = None,
    offsets: Mapping[str, float] | None = None,
    command: Command | None = None,
    made: Made | None = None,
    unwrap: bool = False,
    limits: Limits | None = None,
    window: Window | None = None,
    most_rows: int | None = None,
    watch: Watch | None = None,
    layout: CsvLayout | None = None,
) -> LoadedLog:
    """Read a whole log, cleaned.

    Parameters
    ----------
    signals : canonical name (see `CHANNELS`) -> column; without "t" the `sample_time` (s) is needed.
    optional : canonical names whose columns may be missing.
    time_scale : s per unit of the time column.
    factors : channel -> what its column is multiplied by. offsets : channel -> what is taken off it before that.
    command : how u was logged; None is a held one, as it acted.
    made : how d_hat was; None is as here.
    unwrap : see `unwrapped`.
    limits : rows with values beyond them, with the factors in, are dropped.
    window : the rows that are read; None is all.
    most_rows : about so many rows are enough.
    watch : is called with the share that is read.
    layout : where the rows of a text file are; None: it is found.

    Raises
    ------
    DataError : it cannot be read, or no usable row is in it.
    """
    if "t" not in signals and sample_time is None:
        raise DataError(f"{path}: no time column", "set signals.time, or signals.sample_time")
    command = command or Command()
    table = watched(open_table(path, signals, optional, u_hold=command.hold, layout=layout), watch)
    clock: dict[str, Any] = {"time_scale": time_scale, "sample_time": sample_time}
    clock |= {"made": made, "offsets": offsets, "unwrap": unwrap}
    table = as_read(table, command, window or Window(), factors or {}, **clock)
    cleaner = Cleaner(sample_time, time_scale, limits=limits)
    channels, restarts = _joined(_cleaned(table, cleaner, most_rows))
    if not channels or cleaner.sample_time is None:
        raise DataError(
            f"{table.name}: no row has a value in every needed column ({', '.join(table.columns.values())})"
        )
    log = _log(table, channels, cleaner.sample_time, factors_text(*applied(table, factors or {}, offsets)), command)
    _give_back()
    dropped = dropped_with_unreadable(cleaner.dropped, table.unreadable)
    return LoadedLog(log, dropped, (*table.warnings, *cleaner.warnings), restarts, bool(cleaner.regular))


def _log(table: TableSource, channels: dict[str, Array], sample_time: float, factors: str, command: Command) -> Log:
    """The channels with where they are from."""
    metadata = {key: text for key, text in table.metadata.items() if key not in (D_HAT_SOURCE, SAMPLE_TIME)}
    metadata |= {FACTORS: factors} if factors else {}
    source = table.metadata.get(D_HAT_SOURCE, "logged")
    known = source in _D_HAT_SOURCES and "d_hat" in channels
    d_hat_source = cast(DHatSource, source) if known else "logged"
    return Log(channels, sample_time, table.name, d_hat_source=d_hat_source, metadata=metadata, u_hold=command.hold)


def _cleaned(table: TableSource, cleaner: Cleaner, most_rows: int | None) -> list[Piece]:
    pieces, rows = [], 0
    for batch in table.batches():
        if batch.restart:
            pieces += cleaner.restart()
        values = dict(batch.columns)
        pieces += cleaner.feed(values.pop("t", None), values)
        rows += batch.rows
        if most_rows is not None and rows >= most_rows:
            break
    return pieces + cleaner.finish()


def _joined(pieces: Sequence[Piece]) -> tuple[dict[str, Array], tuple[int, ...]]:
    """Channels of shape (n,), none where n = 0, and the samples that do not continue the one before."""
    restarts, samples = [], 0
    for piece in pieces:
        if piece.restart:
            restarts.append(samples)
        samples += piece.t.size
    if not samples:
        return {}, ()
    channels = {"t": _one([piece.t for piece in pieces])}
    for name in sorted(pieces[0].values, key=_order):
        channels[name] = _one([piece.values.pop(name) for piece in pieces])  # no channel is there twice
    return channels, tuple(restarts)


def _one(parts: Sequence[Array]) -> Array:
    """Parts joined, shape (n,), read-only, so that a `Log` need not copy it."""
    joined = np.concatenate(parts)
    joined.flags.writeable = False
    return joined


def write_log(path: str | Path, log: Log, inputs: Collection[str | Path] = ()) -> None:
    """Write a log with its metadata; `.csv`, `.parquet`, or "-" for CSV on stdout. See `open_writer` for errors."""
    names = sorted(log.channels, key=_order)
    kept = {key: text for key, text in log.metadata.items() if key != D_HAT_MAKER}
    metadata = {**kept, SAMPLE_TIME: repr(float(log.sample_time)), D_HAT_SOURCE: log.d_hat_source}
    with open_writer(path, dict.fromkeys(names, "float64"), metadata, tuple(inputs)) as writer:
        step = 1 << 17
        for start in range(0, len(log), step):
            writer.write({name: log[name][start : start + step] for name in names})


def _give_back() -> None:
    """Arrow keeps what the batches took for the next ones, as much as the log itself; there are none."""
    if (arrow := sys.modules.get("pyarrow")) is not None:
        arrow.default_memory_pool().release_unused()


def _order(name: str) -> tuple[int, str]:
    return (CHANNELS.index(name) if name in CHANNELS else len(CHANNELS), name)
