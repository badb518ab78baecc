"""Which logs a fleet has, and which config each of them: from names, globs, a list or a table."""

from __future__ import annotations

import glob
import hashlib
import os
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from dsd_cli import __version__
from dsd_cli.cli.fleet_tasks import ConfigText, Task, is_url
from dsd_cli.errors import DataError, UsageError
from dsd_cli.files.fleet_table import PART, read_rows
from dsd_cli.files.formats.known import is_bag
from dsd_cli.files.table_source import SIDECAR
from dsd_cli.files.tables_in import is_stream
from dsd_cli.files.whole import is_same

_TABLES = (".csv", ".parquet", ".pq")


@dataclass(frozen=True)
class Entry:
    """A log as the user names it; empty: he does not say."""

    log: str
    config: str = ""
    machine: str = ""
    date: str = ""


def entries(logs: Sequence[str], listing: Path | None) -> list[Entry]:
    """Every log that is named, globs expanded.

    Raises
    ------
    UsageError : no log, a pattern that matches nothing, or a list that cannot be read.
    """
    found = [Entry(name) for pattern in logs for name in _expanded(pattern)]
    if listing is not None:
        found += _listed(listing)
    if not found:
        raise UsageError("no log is given", "name logs, or a list of them with --list FILE")
    return found


def once(found: Iterable[Entry]) -> list[Entry]:
    """Every log with every config of its own once, as it was named first; in the order of their names."""
    kept: dict[tuple[str, str], Entry] = {}
    for entry in found:
        kept.setdefault((_place(entry.log), _place(entry.config)), entry)
    return sorted(kept.values(), key=lambda one: (one.log, one.config))


def _place(name: str) -> str:
    """The same for all spellings of a path."""
    return name if is_url(name) or not name else os.path.abspath(name)


def _expanded(pattern: str) -> list[str]:
    if os.path.isdir(pattern) and not is_bag(pattern):
        raise UsageError(f"{pattern}: is a folder", f"name its logs: '{os.path.join(pattern, '**', '*')}'")
    if not any(sign in pattern for sign in "*?[") or os.path.exists(pattern):  # a name may have such a sign
        return [pattern]
    if is_url(pattern):
        import fsspec

        system, place = fsspec.url_to_fs(pattern)
        found = [system.unstrip_protocol(name) for name in system.glob(place)]
    else:
        found = _logs_among(glob.glob(pattern, recursive=True))
    if not found:
        raise UsageError(f"{pattern}: no such log")
    return sorted(found)


def _logs_among(names: Sequence[str]) -> list[str]:
    """What a pattern has found, without folders, files of a bag that is there itself, and our metadata beside a CSV."""
    bags = {name.rstrip(os.sep) for name in names if is_bag(name)}
    return [
        name
        for name in names
        if name.rstrip(os.sep) in bags
        or not (
            os.path.isdir(name)
            or os.path.dirname(name) in bags
            or (name.endswith(SIDECAR) and os.path.exists(name.removesuffix(SIDECAR)))
        )
    ]


def _listed(listing: Path) -> Iterator[Entry]:
    """A table with a column `log` (and config, machine, date), or plain lines; paths are as seen from the list."""
    rows = _table(listing) if listing.suffix.lower() in _TABLES else _lines(listing)
    for row in rows:
        log = str(row.get("log") or "").strip()
        if not log:
            raise UsageError(f"{listing}: a row without a log")
        config = str(row.get("config") or "").strip()
        yield Entry(
            _beside(listing, log),
            _beside(listing, config) if config else "",
            str(row.get("machine") or "").strip(),
            str(row.get("date") or "").strip(),
        )


def _beside(listing: Path, name: str) -> str:
    return name if is_url(name) or os.path.isabs(name) else os.path.normpath(listing.parent / name)


def _lines(listing: Path) -> list[dict[str, Any]]:
    try:
        text = listing.read_text(encoding="utf-8-sig")
    except FileNotFoundError:
        raise UsageError(f"{listing}: no such file") from None
    except (OSError, UnicodeDecodeError) as error:
        raise UsageError(f"{listing}: cannot be read ({getattr(error, 'strerror', None) or error})") from None
    return [{"log": line.strip()} for line in text.splitlines() if line.strip() and not line.startswith("#")]


def _table(listing: Path) -> list[dict[str, Any]]:
    import pyarrow as pa

    if is_stream(listing):  # Arrow would wait for its writer, and not even a signal would end that
        raise UsageError(f"{listing}: is a FIFO or a device", "a table of logs is a file; lines may come out of a pipe")
    try:
        if listing.suffix.lower() == ".csv":
            import pyarrow.csv as pc

            table = pc.read_csv(listing)
        else:
            import pyarrow.parquet as pq

            table = pq.read_table(listing)
    except FileNotFoundError:
        raise UsageError(f"{listing}: no such file") from None
    except (pa.ArrowException, OSError) as error:
        raise UsageError(f"{listing}: cannot be read as a table ({str(error).splitlines()[0]})") from None
    if "log" not in table.column_names:
        raise UsageError(f"{listing}: has no column log; it has {', '.join(table.column_names)}")
    wanted = [name for name in ("log", "config", "machine", "date") if name in table.column_names]
    rows: list[dict[str, Any]] = table.select(wanted).to_pylist()
    return rows


@dataclass(frozen=True)
class Asked:
    """What is asked of every log: the command, the config where a log has none of its own, and the options."""

    command: str
    config: Path
    values: tuple[str, ...] = ()
    effects: tuple[str, ...] = ()
    effects_from: tuple[Path, ...] = ()


def tasks(found: Iterable[Entry], asked: Asked) -> list[Task]:
    """A task for every log; configs are read once, here, so that what is wrong with one is said before anything runs.

    Raises
    ------
    UsageError, DataError : a config that cannot be used.
    """
    from dsd_cli.cli.user_effects import use_effects
    from dsd_cli.files.config import load_config
    from dsd_cli.files.config.text import read_again

    use_effects(asked.effects_from)
    texts: dict[str, ConfigText] = {}
    beside: dict[str, list[str]] = {}
    own: dict[str, tuple[str, ...]] = {}
    out = []
    for entry in found:
        name = entry.config or str(asked.config)
        if name not in texts:
            settings = load_config(name, asked.values, asked.effects)
            own[name] = tuple(str(file.absolute()) for file in (*asked.effects_from, *settings.effect_files))
            beside[name] = [part for file in settings.files for part in _state(str(file))]
            folder, text = str(Path(name).parent.absolute()), read_again(name)
            texts[name] = ConfigText(name, folder, text, asked.values, asked.effects)
        path = entry.log if is_url(entry.log) else os.path.abspath(entry.log)
        task = Task(
            asked.command,
            entry.log,
            path,
            texts[name],
            tuple(dict.fromkeys(own[name])),
            "",
            entry.machine or Path(path).parent.name,
            entry.date,
        )
        out.append(replace(task, key=_key(task, beside[name])))
    return out


def _key(task: Task, beside: Sequence[str]) -> str:
    """Changes with anything that could change the row; `beside` is the state of files that the config names."""
    parts = [*beside, __version__, task.command, task.path, task.machine, task.date, *_state(task.path)]
    parts += [task.config.name, task.config.text, *task.config.values, "--", *task.config.effects]
    for file in task.effects_from:
        parts.append(hashlib.sha256(Path(file).read_bytes()).hexdigest())
    return hashlib.sha256("\0".join(parts).encode("utf-8", "surrogateescape")).hexdigest()[:20]


def _state(path: str) -> list[str]:
    try:
        found = os.stat(path)
    except (OSError, ValueError):
        return []
    return [str(found.st_size), str(found.st_mtime_ns)]


def refuse_output_among(found: Iterable[Entry], output: str) -> list[Entry]:
    """The logs without the table of results and its journal, which a pattern may have found.

    Raises
    ------
    UsageError : the output is one of the logs, and no table of results.
    DataError : nothing else is there.
    """
    kept = []
    for entry in found:
        if is_same(entry.log, output):
            _refuse_log(output)
        elif not is_same(entry.log, output + PART):
            kept.append(entry)
    if not kept:
        raise DataError(f"{output}: is the only log", "write the results to another file")
    return kept


def _refuse_log(output: str) -> None:
    try:
        read_rows(output)
    except DataError:
        raise UsageError(f"{output}: is one of the logs", "write the results to another file") from None
