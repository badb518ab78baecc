"""What a detector that runs shows at a moment: a panel for a terminal, or a plain line."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from dsd_cli.report.terminal import escaped

#: Heights of a sparkline, lowest first; without Unicode the second.
BLOCKS, PLAIN = "▁▂▃▄▅▆▇█", "_.-=+*#@"
#: Axis -> its unit, where it has one of its own.
_UNITS = {"delay": " s"}
#: Columns beside a sparkline in the panel: frame, heading, figures.
BESIDE = 42


@dataclass(frozen=True)
class Moved:
    """The label that was well founded changed, at `t` s, from some values of the axes to others (None: the first)."""

    t: float
    before: Mapping[str, float] | None
    after: Mapping[str, float]


@dataclass(frozen=True)
class Trace:
    """The last seconds of a signal, oldest first, `step` s apart, NaN where it is not known; shape (n,)."""

    values: Sequence[float]
    step: float

    def known(self, columns: int) -> list[float]:
        """The last so many without the NaN."""
        return [value for value in self.values[-columns:] if math.isfinite(value)]


@dataclass(frozen=True)
class Moment:
    """A detector that runs, now.

    Attributes
    ----------
    t : stamp of the last row, s; NaN before there is one.
    state, values : the label: number, and axis -> value.
    probability : of the label, NaN where it was not judged. confident : share of the confident rows of the last second.
    rows, rate, dropped : rows so far, rows per second (NaN at first), reason -> rows not taken as they are.
    residual, rho : what the label leaves of d_hat in its window (rms), and what it may; `unit` of both.
    """

    log: str
    t: float
    state: int
    values: Mapping[str, float]
    probability: float
    confident: float
    rows: int
    rate: float
    dropped: Mapping[str, int]
    residual: float
    rho: float
    unit: str
    d_hat: Trace
    left: Trace
    moved: Sequence[Moved]


def panel(now: Moment, width: int, ascii_only: bool = False) -> Any:
    """The moment as a rich renderable of that width."""
    from rich import box
    from rich.panel import Panel
    from rich.table import Table

    ramp, columns = PLAIN if ascii_only else BLOCKS, max(width - BESIDE, 8)
    grid = Table.grid(padding=(0, 1))
    grid.add_column(no_wrap=True, min_width=8)
    grid.add_column(no_wrap=True, overflow="ellipsis")
    style = "bold green" if now.confident >= 0.5 else "yellow"
    grid.add_row("state", f"[{style}]{now.state}: {escaped(in_words(now.values))}[/], {_sureness(now)}")
    counts = f"{_stamp(now.t)}, {now.rows:,} rows, {_rate(now.rate)}, {escaped(_dropped(now.dropped))}"
    grid.add_row("at", counts)
    known = now.d_hat.known(columns)
    low, high = (min(known), max(known)) if known else (math.nan, math.nan)
    ends = f"{_number(low)} to {_number(high)} {escaped(now.unit)}"
    grid.add_row("d_hat", f"[cyan]{sparkline(now.d_hat.values, low, high, columns, ramp)}[/] {ends}")
    top = max([2.0 * now.rho, *now.left.known(columns)])
    figures = f"{_number(now.residual)}, rho {now.rho:g}"
    colour = "cyan" if not now.residual > 2.0 * now.rho else "red"
    grid.add_row("residual", f"[{colour}]{sparkline(now.left.values, 0.0, top, columns, ramp)}[/] {figures}")
    for i, one in enumerate(reversed(now.moved)):
        grid.add_row("changes" if i == 0 else "", escaped(change_line(one)))
    if not now.moved:
        grid.add_row("changes", "none yet")
    title = f"dsd detect: {escaped(now.log)}, the last {columns * now.d_hat.step:.3g} s"
    frame = box.ASCII if ascii_only else box.ROUNDED
    return Panel(grid, title=title, subtitle="Ctrl-C ends and sums up", box=frame, width=width, title_align="left")


def plain_line(now: Moment) -> str:
    """The moment in one line, for whatever is no terminal."""
    parts = [_stamp(now.t), f"state {now.state}: {in_words(now.values)}", _sureness(now)]
    parts += [f"residual {_number(now.residual)} (rho {now.rho:g})", f"{now.rows:,} rows", _rate(now.rate)]
    return ", ".join([*parts, _dropped(now.dropped)])


def change_line(moved: Moved) -> str:
    """`12.304 s: inertia 0.01 -> 0.015`; the first label in full."""
    before = moved.before
    if before is None:
        return f"{_stamp(moved.t)}: {in_words(moved.after)}"
    changed = [name for name, value in moved.after.items() if value != before[name]]
    steps = [f"{name} {before[name]:g} -> {moved.after[name]:g}{_UNITS.get(name, '')}" for name in changed]
    return f"{_stamp(moved.t)}: {', '.join(steps)}"


def sparkline(values: Sequence[float], low: float, high: float, columns: int, ramp: str = BLOCKS) -> str:
    """The last `columns` values as heights between low and high; a blank where there is none."""
    reach = high - low
    out = [" "] * max(columns - len(values), 0)
    for value in values[-columns:]:
        if not math.isfinite(value):
            out.append(" ")
        else:
            share = (value - low) / reach if reach > 0.0 else 0.0
            out.append(ramp[min(max(int(share * len(ramp)), 0), len(ramp) - 1)])
    return "".join(out)


def in_words(values: Mapping[str, float]) -> str:
    """`delay 0.002 s, inertia 0.015`."""
    return ", ".join(f"{name} {value:g}{_UNITS.get(name, '')}" for name, value in values.items())


def _sureness(now: Moment) -> str:
    if not math.isfinite(now.probability):
        return "not judged yet"
    return f"{100.0 * now.confident:.0f} % confident, p = {now.probability:.2f}"


def _dropped(dropped: Mapping[str, int]) -> str:
    if not dropped:
        return "none dropped"
    return ", ".join(f"{reason} {count:,}" for reason, count in dropped.items())


def _rate(rate: float) -> str:
    return f"{float(f'{rate:.3g}'):,.0f} rows/s" if math.isfinite(rate) else "- rows/s"


def _number(value: float) -> str:
    return f"{value:.3g}" if math.isfinite(value) else "-"


def _stamp(t: float) -> str:
    """To the millisecond."""
    return f"{t:.3f} s" if math.isfinite(t) else "no stamp"
