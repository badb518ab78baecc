"""The channels of a log as a table and as JSON."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from dsd_cli.report.head import head
from dsd_cli.report.live import BLOCKS, PLAIN, sparkline
from dsd_cli.report.terminal import console as terminal
from dsd_cli.report.terminal import escaped
from dsd_cli.signals.facts import Channel, Facts

#: First values that are shown, and characters of the line that shows how a channel runs.
FIRST, WIDTH = 3, 24
#: Constants that are shown, and rows from which a channel without a clock is no constant beside others that have one.
SHOWN, FEW = 5, 50


@dataclass(frozen=True)
class Column:
    """A channel: `kind` is what it does by itself, `role` what it may be ("" for nothing) and `reason` why.

    `low`, `high`, `first` in the unit of the file; `step` between rows, in that of its time, None where there is none;
    `rows` where the file says how many; `shape` : heights from 0 to 1 at even places of the log, null where nothing is.
    """

    name: str
    unit: str
    kind: str
    rows: int | None
    step: float | None
    low: float | None
    high: float | None
    first: tuple[float | None, ...]
    shape: tuple[float | None, ...]
    role: str
    reason: str

    @classmethod
    def of(cls, channel: Channel, facts: Facts, unit: str, rows: int | None, step: float, *guess: str) -> Column:
        """A channel with what was found of it; `guess`: role and reason."""
        values = np.empty(0) if channel.values is None else channel.values
        low, high = _finite(facts.low), _finite(facts.high)
        return cls(
            name=channel.name,
            unit=unit,
            kind=facts.kind,
            rows=rows,
            step=step or None,
            low=low,
            high=high,
            first=tuple(_finite(float(x)) for x in values[:FIRST]),
            shape=_shape(values, low, high),
            role=guess[0],
            reason=guess[1],
        )


def _finite(value: float) -> float | None:
    return value if np.isfinite(value) else None


def _shape(values: np.ndarray, low: float | None, high: float | None) -> tuple[float | None, ...]:
    """The channel at even places, from 0 at its least to 1 at its greatest."""
    if low is None or high is None or not values.size:
        return ()
    places = np.linspace(0, values.size - 1, min(WIDTH, values.size)).astype(int)
    reach = high - low
    return tuple(_finite(round(float((x - low) / reach), 3) if reach > 0.0 else 0.5) for x in values[places])


#: A channel and its number in the file, from 1.
Numbered = tuple[int, Column]


def to_json(log: str, columns: Sequence[Column], notes: Sequence[str]) -> dict[str, Any]:
    """The object of the contract."""
    return {**head("columns", [log]), "columns": [asdict(one) for one in columns], "notes": list(notes)}


def print_table(log: str, columns: Sequence[Column], notes: Sequence[str], file: Any) -> None:
    """For a person: a line a channel, the guesses with their reasons below."""
    from rich.table import Table

    console = terminal(file)
    console.print(f"[bold]{escaped(log)}: {len(columns)} channel{'' if len(columns) == 1 else 's'}[/bold]")
    for note in notes:
        console.print(escaped(f"  {note}"))
    table = Table(box=None, padding=(0, 2, 0, 0))
    for name in ("#", "channel", "unit", "rows", "least", "most", "first", "", "may be"):
        table.add_column(name, no_wrap=True, justify="right" if name in ("#", "rows", "least", "most") else "left")
    ramp = BLOCKS if (getattr(file, "encoding", None) or "").lower().startswith("utf") else PLAIN
    main, others, rest = _apart(columns)
    for at, one in [*main, *others, *rest[:SHOWN]]:
        line = sparkline([np.nan if x is None else x for x in one.shape], 0.0, 1.0, WIDTH, ramp)
        first = ", ".join(_number(x) for x in one.first)
        rows = "-" if one.rows is None else f"{one.rows:,}"
        cells = (one.name, one.unit or "-", rows, _number(one.low), _number(one.high), first, line)
        table.add_row(str(at), *map(escaped, cells), escaped(one.role or f"({one.kind})"))
    console.print(table)
    if len(rest) > SHOWN:
        left = len(rest) - SHOWN
        console.print(f"and {left} more constant{'' if left == 1 else 's'}: --format json lists all of them")
    for _, one in main:
        if one.role:
            console.print(escaped(f"{one.role}: {one.name}, {one.reason}"))


def _apart(columns: Sequence[Column]) -> tuple[list[Numbered], ...]:
    """What varies beside a clock, what varies without one, the constants, each with its number in the file.

    Beside channels with a clock, a few values without one are constants of a machine, such as the rows of a matrix. The
    largest group with a clock comes first. Where nothing has a clock, all that varies is in the first part.
    """
    clocked = any(one.step for one in columns)
    parts: tuple[list[Numbered], ...] = ([], [], [])
    for numbered in enumerate(columns, start=1):
        one = numbered[1]
        alone = clocked and not one.step
        constant = one.kind in ("constant", "empty", "text") or (alone and one.rows is not None and one.rows < FEW)
        parts[2 if constant else int(alone)].append(numbered)
    sizes = Counter(_group(one) for _, one in parts[0])
    parts[0].sort(key=lambda item: -sizes[_group(item[1])])
    return parts


def _group(one: Column) -> str:
    return one.name.partition("/")[0] if "/" in one.name else ""


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.5g}"
