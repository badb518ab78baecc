"""One run over a fleet: what is done already, what is left, and the table at the end."""

from __future__ import annotations

import contextlib
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from dsd_cli.cli.fleet_pools import DaskPool, Pool, ProcessPool, run_all
from dsd_cli.cli.fleet_tasks import COMMAND, COMMON, DONE, Row, Task
from dsd_cli.cli.progress import is_terminal, span, three
from dsd_cli.errors import DataError, UsageError
from dsd_cli.files.fleet_parts import FleetShard
from dsd_cli.files.fleet_table import KEY, Journal, load_writers, read_rows

_ELSEWHERE = "write to another file with -o, or say --anew to lose it"


@dataclass(frozen=True)
class Workers:
    """Where the logs are worked on: `count` processes here, or the cluster; `retries` of a log that kills them."""

    count: int
    cluster: str | None = None
    retries: int = 2

    def pool(self) -> Pool:
        return ProcessPool(self.count) if self.cluster is None else DaskPool(self.cluster)


@dataclass(frozen=True)
class Ran:
    """`logs` in the table, `kept` of an earlier run, `failed` without a result (each says why in its row)."""

    logs: int
    kept: int
    failed: int


def run_fleet(
    tasks: list[Task], output: Path, workers: Workers, anew: bool, quiet: bool, part: FleetShard | None = None
) -> Ran:
    """Work on every log that has no row yet, and write the table, or `part` of one.

    Raises
    ------
    DataError : no log gave a result, or the table cannot be written.
    UsageError : the table is another command's or another run's, or none of ours.
    """
    say = _quiet if quiet else _on_stderr
    journal = Journal(output)
    try:
        kept = _take_up(journal, output, tasks, anew, say)
        left = [task for task in tasks if task.key not in journal]
        if kept:
            say(f"{kept:,} of {len(tasks):,} logs are done already")
        with _counting(len(left), quiet) as count, _keeping(journal, say):
            for row in _rows(workers, left, say):
                journal.add(row)
                count(row["status"] == DONE)
        keys = [task.key for task in tasks]
        reasons = [str(row["reason"]) for row in journal.rows(keys) if row["status"] != DONE]
        journal.finish(keys, COMMON, None if part is None else part.metadata())
    finally:
        journal.close()
    if part is None:  # of a part, the others may have results
        refuse_without_result(reasons, len(tasks), output)
    return Ran(len(tasks), kept, len(reasons))


def refuse_without_result(reasons: list[str], logs: int, output: str | Path) -> None:
    """A table of nothing but failures is written, and an error.

    Raises
    ------
    DataError : no log gave a result.
    """
    if len(reasons) == logs:
        raise DataError(f"no log gave a result; the first: {reasons[0]}", f"{output} has the reason of each")


def _rows(workers: Workers, left: list[Task], say: Callable[[str], None]) -> Iterator[Row]:
    if not left:
        return
    pool = workers.pool()
    try:
        rows = run_all(pool, left, workers.retries, say)
        yield next(rows)
        load_writers()  # while the workers work, not when they are done
        yield from rows
    finally:
        pool.close()


def _take_up(journal: Journal, output: Path, tasks: list[Task], anew: bool, say: Callable[[str], None]) -> int:
    """Rows of an earlier run, finished or not, that are still of these logs with these configs; failures are not.

    Raises
    ------
    UsageError : the table is another command's, or none of ours.
    """
    wanted = {task.key for task in tasks}
    if anew:
        journal.forget(wanted)
        return 0
    _refuse_other(journal.first(), journal.path, tasks)
    earlier = _earlier(output) if output.is_file() else []
    if earlier:
        _refuse_other(earlier[0], output, tasks)
        logs = {task.log for task in tasks}
        if gone := sum(row["log"] not in logs for row in earlier):
            say(f"{gone:,} of the {len(earlier):,} rows of {output} are of logs that are not named now: they go")
    for row in earlier:
        if row[KEY] in wanted and row[KEY] not in journal and row["status"] == DONE:
            journal.add({name: value for name, value in row.items() if value is not None or "." not in name})
    known = [key for key in wanted if key in journal]
    journal.forget([row[KEY] for row in journal.rows(known) if row["status"] != DONE])
    return sum(key in journal for key in known)


def _earlier(output: Path) -> list[Row]:
    try:
        return read_rows(output)
    except DataError as error:
        raise UsageError(error.message, f"it is not written over: {_ELSEWHERE}") from None


def _refuse_other(row: Row, where: Path, tasks: list[Task]) -> None:
    command = row.get(COMMAND)
    if command not in (None, tasks[0].command):
        raise UsageError(f"{where}: has rows of dsd fleet {command}", _ELSEWHERE)


@contextlib.contextmanager
def _keeping(journal: Journal, say: Callable[[str], None]) -> Iterator[None]:
    try:
        yield
    except BaseException:
        if len(journal):
            say(f"stopped; the rows so far are in {journal.path}: the same command goes on from there")
        raise


def _on_stderr(line: str) -> None:
    from dsd_cli.errors import printable

    print(printable(line), file=sys.stderr)


def _quiet(_: str) -> None:
    return None


@contextlib.contextmanager
def _counting(total: int, quiet: bool) -> Iterator[Callable[[bool], None]]:
    """Progress with rate and time left, on a terminal: call it with whether the log gave a result."""
    shown = not quiet and is_terminal(sys.stderr)
    begin = time.monotonic()
    state = {"done": 0, "failed": 0, "next": begin + 1.0}

    def count(good: bool) -> None:
        state["done"] += 1
        state["failed"] += not good
        now = time.monotonic()
        if shown and now >= state["next"]:
            state["next"] = now + 0.2
            print(
                f"\r\033[K{progress_line(state['done'], total, state['failed'], now - begin)}", end="", file=sys.stderr
            )
            sys.stderr.flush()

    try:
        yield count
    finally:
        if shown:
            print("\r\033[K", end="", file=sys.stderr, flush=True)


def progress_line(done: float, total: int, failed: float, seconds: float) -> str:
    """`120 of 10,000 logs, 2 failed, 14.2 a second, 12 min left`."""
    rate = done / seconds if seconds > 0.0 else 0.0
    parts = [f"{int(done):,} of {total:,} logs"]
    if failed:
        parts.append(f"{int(failed):,} failed")
    if rate > 0.0:
        parts += [f"{three(rate)} a second", f"{span((total - done) / rate)} left"]
    return ", ".join(parts)
