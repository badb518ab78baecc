"""The channels of a log as a table and as JSON."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from dsd_cli.identify.roles import Channel, Facts
from dsd_cli.report.head import head
from dsd_cli.report.live import BLOCKS, PLAIN, sparkline
from dsd_cli.report.terminal import console as terminal
from dsd_cli.report.terminal import escaped

#: First values that are shown, and characters of the line that shows how a channel runs.
FIRST, WIDTH = 3, 24


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
    for at, one in enumerate(columns, start=1):
        line = sparkline([np.nan if x is None else x for x in one.shape], 0.0, 1.0, WIDTH, ramp)
        first = ", ".join(_number(x) for x in one.first)
        rows = "-" if one.rows is None else f"{one.rows:,}"
        cells = (one.name, one.unit or "-", rows, _number(one.low), _number(one.high), first, line)
        table.add_row(str(at), *map(escaped, cells), escaped(one.role or f"({one.kind})"))
    console.print(table)
    for one in columns:
        if one.role:
            console.print(escaped(f"{one.role}: {one.name}, {one.reason}"))


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.5g}"
