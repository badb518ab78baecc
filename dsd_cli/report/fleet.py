"""What the table of a fleet says: shares of verdicts, logs that stand out, values that drift over the dates."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from typing import Any

import numpy as np

from dsd_cli.report.head import SCHEMA_VERSION
from dsd_cli.signals.log import Array
from dsd_cli.signals.spread import robust_deviation

Row = Mapping[str, Any]

#: Columns in which a log may stand out, or a machine drift, beside all `value.`s.
MEASURES = ("force_rmse", "heldout_rmse", "rmse", "residual_rms", "explained_share", "confident_share", "sample_time")
#: Robust standard deviations (1.4826 MAD) from the median at which a log stands out.
FAR = 6.0
#: Beyond it a value counts as this.
LARGEST = 1e100
#: A fleet that agrees better than this share of its median has no outliers worth a word.
AGREES = 0.02
#: Logs that it takes to say what is usual; dates that it takes to say that something drifts.
USUAL_LOGS, DRIFT_LOGS = 8, 8
#: A drift is named from this p value on, divided by the number of values looked at, and this share of the median.
DRIFT_P, DRIFT_SHARE = 0.01, 0.1


@dataclass(frozen=True)
class Share:
    """How many logs have this verdict; `share` of those with a result."""

    verdict: str
    logs: int
    share: float


@dataclass(frozen=True)
class Reason:
    """Why `logs` logs gave no result, `first` among them."""

    reason: str
    logs: int
    first: str


@dataclass(frozen=True)
class Odd:
    """A log whose value is `away` robust standard deviations from the fleet's median `usual`."""

    log: str
    column: str
    value: float
    usual: float
    away: float


@dataclass(frozen=True)
class Drift:
    """A value of a machine that goes one way over the dates: Theil and Sen's line, Mann and Kendall's test."""

    machine: str
    column: str
    begin: str
    end: str
    first: float
    last: float
    per_day: float
    logs: int
    p: float


@dataclass(frozen=True)
class FleetSummary:
    """`tested` : values looked at for drift; `undated` : logs that have no date."""

    results: str
    logs: int
    failed: int
    reasons: tuple[Reason, ...]
    verdicts: tuple[Share, ...]
    odd: tuple[Odd, ...]
    drifts: tuple[Drift, ...]
    tested: int
    undated: int


def summarize(results: str, rows: Sequence[Row]) -> FleetSummary:
    """The summary of a table of results."""
    good = [row for row in rows if row["status"] == "done"]
    bad = [row for row in rows if row["status"] != "done"]
    verdicts = Counter(str(row["verdict"]) for row in good)
    drifts, tested = _drifts(good)
    return FleetSummary(
        results,
        len(rows),
        len(bad),
        _reasons(bad),
        tuple(Share(name, count, count / len(good)) for name, count in verdicts.most_common()),
        tuple(_odd(good)),
        tuple(drifts),
        tested,
        sum(1 for row in good if days_of(row) is None),
    )


def to_json(found: FleetSummary) -> dict[str, Any]:
    """The object of `--format json`."""
    return {"schema_version": SCHEMA_VERSION, "command": "fleet summary", **asdict(found)}


def _reasons(bad: Sequence[Row]) -> tuple[Reason, ...]:
    first: dict[str, str] = {}
    for row in bad:
        first.setdefault(_bare(row), str(row["log"]))
    counted = Counter(_bare(row) for row in bad).most_common()
    return tuple(Reason(reason, logs, first[reason]) for reason, logs in counted)


def _bare(row: Row) -> str:
    """The reason without the name of the log, so that like ones are counted together."""
    return str(row["reason"]).replace(str(row["log"]), "").lstrip(":, ")


def measured_columns(rows: Sequence[Row]) -> list[str]:
    """Columns in which a log may stand out."""
    names = dict.fromkeys(name for row in rows for name in row)
    return [name for name in names if name in MEASURES or name.startswith("value.")]


def numbers_of(rows: Sequence[Row], column: str) -> Array:
    """The column, shape (rows,), NaN where a log has none; so large that squares still are numbers."""
    values = (row.get(column) for row in rows)
    found = np.array([float(value) if isinstance(value, int | float) else np.nan for value in values])
    return np.where(np.isfinite(found), np.clip(found, -LARGEST, LARGEST), found)


def _odd(rows: Sequence[Row]) -> list[Odd]:
    """Logs that stand out, farthest first; values count with their own standard errors."""
    found = []
    for column in measured_columns(rows):
        values = numbers_of(rows, column)
        known = np.isfinite(values)
        if known.sum() < USUAL_LOGS:
            continue
        usual = float(np.median(values[known]))
        spread = robust_deviation(values[known] - usual)
        fitted = column.startswith("value.")
        own = numbers_of(rows, column.replace("value.", "error.")) if fitted else np.zeros(known.size)
        scale = np.sqrt(max(spread, AGREES * abs(usual)) ** 2 + np.where(np.isfinite(own), own, 0.0) ** 2)
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            away = np.where(known & (scale > 0.0), np.clip((values - usual) / scale, -LARGEST, LARGEST), 0.0)
        for at in np.flatnonzero(np.abs(away) > FAR).tolist():
            found.append(Odd(str(rows[at]["log"]), column, float(values[at]), usual, float(away[at])))
    return sorted(found, key=lambda one: (-abs(one.away), one.log, one.column))


def days_of(row: Row) -> float | None:
    """Days since 1970 of the date of a log; None without one."""
    try:
        stamp = datetime.fromisoformat(str(row.get("date") or ""))
    except ValueError:
        return None
    return (stamp if stamp.tzinfo else stamp.replace(tzinfo=UTC)).timestamp() / 86400.0


def _drifts(rows: Sequence[Row]) -> tuple[list[Drift], int]:
    """Values that drift, surest first, and how many were looked at."""
    machines: dict[str, list[Row]] = {}
    for row in rows:
        if days_of(row) is not None:
            machines.setdefault(str(row.get("machine") or ""), []).append(row)
    columns = measured_columns(rows)
    tested = [
        drift
        for machine, mine in machines.items()
        for column in columns
        if (drift := _drift(machine, column, mine)) is not None
    ]
    found = [one for one in tested if one.p * len(tested) < DRIFT_P and _matters(one)]
    return sorted(found, key=lambda one: (one.p, one.machine, one.column)), len(tested)


def _matters(drift: Drift) -> bool:
    return abs(drift.last - drift.first) > DRIFT_SHARE * max(abs(drift.first), abs(drift.last))


def _drift(machine: str, column: str, rows: Sequence[Row]) -> Drift | None:
    days = np.array([days_of(row) for row in rows], dtype=float)
    values = numbers_of(rows, column)
    known = np.isfinite(values)
    days, values = days[known], values[known]
    if np.unique(days).size < DRIFT_LOGS or np.ptp(values) == 0.0:
        return None
    from scipy.stats import kendalltau, theilslopes

    slope, middle, *_ = theilslopes(values, days)
    begin, end = float(days.min()), float(days.max())
    return Drift(
        machine,
        column,
        _date(begin),
        _date(end),
        float(middle + slope * begin),
        float(middle + slope * end),
        float(slope),
        int(days.size),
        float(kendalltau(days, values).pvalue),
    )


def _date(days: float) -> str:
    return datetime.fromtimestamp(days * 86400.0, UTC).date().isoformat()
