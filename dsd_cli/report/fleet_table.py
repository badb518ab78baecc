"""The summary of a fleet for a person."""

from __future__ import annotations

from typing import Any

from dsd_cli.report import terminal
from dsd_cli.report.fleet import DRIFT_LOGS, USUAL_LOGS, Drift, FleetSummary, Odd
from dsd_cli.report.terminal import escaped

#: Rows of a table on the screen; the JSON has all.
MOST = 12


def print_table(found: FleetSummary, file: Any) -> None:
    """Shares, logs that stand out, drifts, and why logs gave no result."""
    from rich import box
    from rich.table import Table

    console = terminal.console(file)
    failed = f", {found.failed:,} without a result" if found.failed else ""
    console.print(f"[bold]{escaped(found.results)}[/bold]: {found.logs:,} logs{failed}")
    table = Table(box=box.SIMPLE_HEAD, title="verdicts", title_justify="left", title_style="")
    table.add_column("verdict")
    for name in ("logs", "share"):
        table.add_column(name, justify="right")
    for one in found.verdicts[:MOST]:
        table.add_row(escaped(one.verdict), f"{one.logs:,}", f"{100.0 * one.share:.1f} %")
    console.print(table)
    _more(console, len(found.verdicts), "verdicts")
    if found.odd:
        console.print(_odd_table(found.odd))
        _more(console, len(found.odd), "values")
    elif found.logs - found.failed >= USUAL_LOGS:
        console.print("no log stands out")
    for drift in found.drifts[:MOST]:
        console.print(escaped(drift_line(drift)))
    _more(console, len(found.drifts), "drifts")
    if not found.drifts:
        console.print(_no_drift(found))
    for why in found.reasons[:MOST]:
        others = f" and {why.logs - 1:,} more" if why.logs > 1 else ""
        console.print(escaped(f"no result: {why.first}{others}: {why.reason}"))
    _more(console, len(found.reasons), "reasons")


def _odd_table(odd: tuple[Odd, ...]) -> Any:
    from rich import box
    from rich.table import Table

    table = Table(box=box.SIMPLE_HEAD, title="logs that stand out", title_justify="left", title_style="")
    for name in ("log", "column"):
        table.add_column(name, overflow="fold")
    for name in ("value", "usual", "robust sd away"):
        table.add_column(name, justify="right")
    for one in odd[:MOST]:
        table.add_row(escaped(one.log), escaped(one.column), f"{one.value:.4g}", f"{one.usual:.4g}", f"{one.away:+.0f}")
    return table


def drift_line(drift: Drift) -> str:
    """One sentence."""
    way = "rises" if drift.per_day > 0.0 else "falls"
    machine = f"machine {drift.machine}" if drift.machine else "the machine"
    change = 100.0 * (drift.last / drift.first - 1.0) if drift.first else float("inf")
    share = f" ({change:+.0f} %)" if abs(change) < 1e4 else ""
    return (
        f"{machine}: {drift.column} {way} from {drift.first:.3g} to {drift.last:.3g}{share}, {drift.begin} to "
        f"{drift.end} ({drift.logs} logs, p = {drift.p:.1g})"
    )


def _no_drift(found: FleetSummary) -> str:
    if not found.tested:
        why = f"; {found.undated:,} logs have no date" if found.undated else ""
        return f"no machine has logs of {DRIFT_LOGS} dates or more, which it takes to look for drift{why}"
    return f"no value drifts over the dates ({found.tested:,} tested)"


def _more(console: Any, total: int, what: str) -> None:
    if total > MOST:
        console.print(f"  and {total - MOST:,} more {what} (--format json lists them)")
