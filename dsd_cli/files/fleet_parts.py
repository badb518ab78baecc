"""Parts of a fleet's table, each made by a run of its own, and the table that they are parts of."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from dsd_cli.errors import DataError, UsageError
from dsd_cli.files.fleet_table import read_rows

#: Suffixes of a part: CSV does not tell an empty text from no value.
PARQUET = (".parquet", ".pq")
#: Where a Parquet file keeps what part it is.
_PLACE = "dsd.fleet.part"
#: What all parts of a fleet share, and what it is called.
_SHARED = {
    "of": "number of shards",
    "command": "command",
    "version": "version of dsd",
    "logs": "list of logs",
    "configs": "config or options",
}


@dataclass(frozen=True)
class FleetShard:
    """Shard `shard` (1 to `of`) of `count` logs; `logs` and `configs` are digests of what the whole fleet was given."""

    shard: int
    of: int
    count: int
    command: str
    version: str
    logs: str
    configs: str

    def __post_init__(self) -> None:
        if not 1 <= self.shard <= self.of <= self.count:
            raise ValueError("no such part")

    def metadata(self) -> dict[str, str]:
        """What goes into the Parquet file."""
        return {_PLACE: json.dumps(asdict(self))}


def joined(paths: Sequence[Path]) -> list[dict[str, Any]]:
    """The rows of the whole table, in the order of its logs: part i of n has rows i, i + n, i + 2 n, ...

    Raises
    ------
    DataError : a part that cannot be read, is none, or has lost rows.
    UsageError : parts of different fleets, a part that is given twice or not at all.
    """
    parts = [_part(path) for path in paths]
    first, places = parts[0], dict[int, Path]()
    for path, part in zip(paths, parts, strict=True):
        for name, called in _SHARED.items():
            one, other = getattr(first, name), getattr(part, name)
            if one != other:
                shown = f" ({other}, not {one})" if name in ("of", "command", "version") else ""
                raise UsageError(f"{path}: has another {called} than {paths[0]}{shown}", "make all parts anew alike")
        if part.shard in places:
            raise UsageError(f"{path}: is shard {part.shard}/{part.of}, as {places[part.shard]} is", "give each once")
        places[part.shard] = path
    if missing := [str(shard) for shard in range(1, first.of + 1) if shard not in places]:
        raise UsageError(f"shard {', '.join(missing)} of {first.of} is missing", "give the parts of all shards")
    found = {shard: read_rows(path) for shard, path in places.items()}
    for shard, path in places.items():
        wanted = len(range(shard - 1, first.count, first.of))
        if len(found[shard]) != wanted:
            raise DataError(f"{path}: has {len(found[shard]):,} rows, not {wanted:,}", "make it anew")
    return [found[k % first.of + 1][k // first.of] for k in range(first.count)]


def _part(path: Path) -> FleetShard:
    """What the file says of itself."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    if not path.is_file():
        why = "no such file" if not path.exists() else "is no file"
        raise DataError(f"{path}: {why}", "dsd fleet detect, compare or diagnose with --shard writes it")
    none = DataError(f"{path}: is no part of a fleet", "dsd fleet detect, compare or diagnose with --shard writes it")
    try:
        return FleetShard(**json.loads((pq.read_schema(path).metadata or {})[_PLACE.encode()]))
    except OSError as error:
        raise DataError(f"{path}: cannot be read ({error.strerror or error})") from None
    except (pa.ArrowException, ValueError, KeyError, TypeError):
        raise none from None


def check_part(output: str) -> None:
    """Raise a UsageError where no part can be written."""
    if Path(output).suffix.lower() not in PARQUET:
        raise UsageError(f"{output}: a part is a Parquet file", "end its name in .parquet; merge may write .csv")


def refuse_other_table(output: Path, command: str) -> None:
    """Raise a UsageError if the output is there, and no table of that command."""
    if not output.is_file():
        return
    try:
        made = {row.get("command") for row in read_rows(output)} - {None, command}
    except DataError as error:
        raise UsageError(error.message, "it is not written over: write to another file with -o") from None
    if made:
        raise UsageError(f"{output}: has rows of dsd fleet {made.pop()}", "write to another file with -o")
