"""The picture of `dsd fleet summary --plot`: the verdicts, and values of every log by date, with what stands out."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from dsd_cli.report.figure import (
    LIMIT,
    MEASURED,
    OTHER,
    PREDICTED,
    RESIDUAL,
    SHARE,
    headline,
    in_picture,
    legend_above,
    nothing,
    sheet,
    shortened,
)
from dsd_cli.report.fleet import Drift, FleetSummary, Row, days_of, measured_columns, numbers_of
from dsd_cli.report.fleet_table import drift_line
from dsd_cli.signals.log import Array

#: Panels of values; bars of verdicts; machines with a mark of their own; logs that are named in a panel.
MOST_PANELS, MOST_VERDICTS, MOST_MACHINES, MOST_NAMES = 6, 10, 5, 4
_MARKS = tuple(zip((MEASURED, PREDICTED, OTHER, "#008060", RESIDUAL), "o^sDv", strict=True))


@dataclass(frozen=True)
class Values:
    """A value of every log that has it, shape (n,): where it lies (days since 1970, or the number of the log), which
    machine, and whether it stands out."""

    column: str
    at: Array
    value: Array
    machine: tuple[str, ...]
    log: tuple[str, ...]
    odd: Array


def columns_shown(found: FleetSummary, rows: Sequence[Row]) -> list[str]:
    """Those that drift first, then those with logs that stand out, then what else was measured and varies."""
    good = [row for row in rows if row["status"] == "done"]
    named = [one.column for one in found.drifts] + [one.column for one in found.odd]
    others = [name for name in measured_columns(good) if _varies(numbers_of(good, name))]
    return list(dict.fromkeys([*named, *others]))[:MOST_PANELS]


def _varies(values: Array) -> bool:
    known = values[np.isfinite(values)]
    return known.size > 1 and bool(np.ptp(known) > 0.0)


def values_of(column: str, found: FleetSummary, rows: Sequence[Row]) -> Values:
    """The points of one panel; by date where every log with a result has one."""
    good = [row for row in rows if row["status"] == "done"]
    days = [days_of(row) for row in good]
    dated = found.undated == 0
    x = np.array([day if dated and day is not None else k + 1 for k, day in enumerate(days)], dtype=np.float64)
    y = numbers_of(good, column)
    kept = np.flatnonzero(np.isfinite(y)).tolist()
    odd = {one.log for one in found.odd if one.column == column}
    logs = tuple(str(good[k]["log"]) for k in kept)
    machines = tuple(str(good[k].get("machine") or "") for k in kept)
    return Values(column, x[kept], y[kept], machines, logs, np.array([log in odd for log in logs], dtype=bool))


def draw(found: FleetSummary, rows: Sequence[Row]) -> Any:
    """The figure."""
    columns = columns_shown(found, rows)
    lines = -(-len(columns) // 2)
    bars = min(len(found.verdicts), MOST_VERDICTS) + bool(found.failed)
    above = 1.3 + 0.3 * max(bars, 1)
    figure = sheet(12.0, above + 2.9 * lines + 0.6)
    parts = figure.subfigures(2, 1, height_ratios=[above, 2.9 * lines]) if lines else [figure]
    failed = f", {found.failed:,} without a result" if found.failed else ""
    said = "\n".join(drift_line(one) for one in found.drifts[:3])
    headline(figure, f"{shortened(Path(found.results).name)}: {found.logs:,} logs{failed}\n{said}".rstrip(), 130)
    _draw_verdicts(parts[0].subplots(1, 1), found)
    machines = _machines(rows)
    if lines:
        panels = parts[1].subplots(lines, 2, squeeze=False).ravel()
        for panel in panels[len(columns) :]:
            panel.set_axis_off()
        for k, (panel, column) in enumerate(zip(panels, columns, strict=False)):
            _draw_values(panel, values_of(column, found, rows), found, machines, named=k == 0)
    return figure


def _machines(rows: Sequence[Row]) -> list[str]:
    return sorted({str(row.get("machine") or "") for row in rows if row["status"] == "done"})


def _draw_verdicts(axis: Any, found: FleetSummary) -> None:
    bars = [(one.verdict, one.logs, MEASURED) for one in found.verdicts[:MOST_VERDICTS]]
    bars += [("no result", found.failed, LIMIT)] if found.failed else []
    if not bars:
        nothing(axis, "no log has a result")
        return
    axis.barh(range(len(bars)), [logs for _, logs, _ in bars], color=[color for *_, color in bars], height=0.6)
    for place, (_, logs, _) in enumerate(bars):
        share = 100.0 * logs / found.logs
        axis.annotate(f"{logs:,} ({share:.3g} %)", (logs, place), (3, 0), textcoords="offset points", va="center")
    axis.set_yticks(range(len(bars)), [in_picture(shortened(name)) for name, *_ in bars])
    axis.invert_yaxis()
    axis.set_xlim(0.0, 1.12 * max(logs for _, logs, _ in bars))
    more = len(found.verdicts) - MOST_VERDICTS
    axis.set_xlabel(f"logs{f'; {more} more verdicts in the table' if more > 0 else ''}")


def _draw_values(axis: Any, values: Values, found: FleetSummary, machines: list[str], named: bool) -> None:
    """Every log; those of the machine that drifts are strong, those that stand out ringed and named."""
    drifts = [one for one in found.drifts if one.column == values.column]
    shown = [one.machine for one in drifts] or (machines if 1 < len(machines) <= MOST_MACHINES else [])
    shown = shown[:MOST_MACHINES]
    at: Any = values.at if found.undated else [_moment(day) for day in values.at]
    of = np.array([shown.index(name) if name in shown else -1 for name in values.machine], dtype=int)
    for k in sorted(set(of.tolist())):
        color, mark = _MARKS[k] if k >= 0 else (SHARE if shown else MEASURED, "o")
        label = "other machines" if k < 0 else in_picture(shortened(shown[k], 20))
        axis.plot([x for x, one in zip(at, of, strict=True) if one == k], values.value[of == k], mark, color=color,
                  ms=4, mew=0, alpha=0.8, label=label if shown else None)  # fmt: skip
    for one in drifts if not found.undated else ():
        _draw_drift(axis, one)
    _draw_odd(axis, at, values, {one.machine for one in drifts})
    axis.set_ylabel(in_picture(shortened(values.column.removeprefix("value."), 34)))
    if found.undated:
        axis.set_xlabel("number of the log in the table")
    else:
        axis.tick_params(axis="x", labelrotation=20)
    if (named and shown) or drifts or values.odd.any():
        legend_above(axis, 3)
    else:
        axis.set_title(" ", fontsize=9.5)


def _moment(day: float) -> datetime:
    return datetime.fromtimestamp(day * 86400.0, UTC).replace(tzinfo=None)


def _draw_drift(axis: Any, drift: Drift) -> None:
    ends = [datetime.fromisoformat(day) for day in (drift.begin, drift.end)]
    axis.plot(ends, [drift.first, drift.last], color=LIMIT, lw=1.8, ls="--", label="drift")


def _draw_odd(axis: Any, at: Any, values: Values, drifting: Collection[str]) -> None:
    """Ringed, and named where they do not lie on a drift."""
    where = np.flatnonzero(values.odd).tolist()
    if where:
        x = [at[k] for k in where]
        axis.plot(x, values.value[where], "o", mfc="none", mec=LIMIT, ms=10, mew=1.4, label="stands out")
    for k in [k for k in where if values.machine[k] not in drifting][:MOST_NAMES]:
        name = in_picture(shortened("/".join(Path(values.log[k]).parts[-2:]), 28))
        axis.annotate(name, (at[k], values.value[k]), (7, 3), textcoords="offset points", fontsize=8)
