"""`--shard I/N`: the share of the logs that one run of many works on."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterable
from pathlib import Path

from dsd_cli import __version__
from dsd_cli.cli.fleet_tasks import Task
from dsd_cli.errors import UsageError
from dsd_cli.files.fleet_parts import FleetShard, check_part


def shard_of(text: str, output: str) -> tuple[int, int]:
    """I and N.

    Raises
    ------
    UsageError : no such shard, or an output that cannot be a part.
    """
    match = re.fullmatch(r"([0-9]{1,6})/([0-9]{1,6})", text)
    shard, of = (int(match[1]), int(match[2])) if match else (0, 0)
    if not 1 <= shard <= of:
        raise UsageError(f"--shard {text}", "I/N with I from 1 to N, such as 1/8 to 8/8")
    check_part(output)
    return shard, of


def cut(tasks: list[Task], shard: tuple[int, int]) -> tuple[list[Task], FleetShard]:
    """The tasks of that shard, and what part of the whole they are; times and places of files do not count.

    Raises
    ------
    UsageError : more shards than logs, said by every shard.
    """
    number, of = shard
    if of > len(tasks):
        raise UsageError(f"--shard {number}/{of}: there are {len(tasks):,} logs", f"at most {len(tasks):,} shards")
    logs = _digest(part for task in tasks for part in (task.log, task.config.name, task.machine, task.date))
    return tasks[number - 1 :: of], FleetShard(
        number, of, len(tasks), tasks[0].command, __version__, logs, _digest(_settings(tasks))
    )


def _settings(tasks: list[Task]) -> Iterable[str]:
    for config, files in dict.fromkeys((task.config, task.effects_from) for task in tasks):
        yield from (config.name, config.text, *config.values, "--", *config.effects)
        yield from (hashlib.sha256(Path(file).read_bytes()).hexdigest() for file in files)


def _digest(parts: Iterable[str]) -> str:
    return hashlib.sha256("\0".join(parts).encode("utf-8", "surrogateescape")).hexdigest()[:20]
