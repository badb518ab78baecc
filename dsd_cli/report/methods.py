"""The result of `dsd detect --method a,b,c` as JSON and as a table."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from dsd_cli.detect.side_by_side import MethodScore
from dsd_cli.report import terminal
from dsd_cli.report.head import head
from dsd_cli.report.terminal import escaped


def to_json(log: str, scores: Sequence[MethodScore]) -> dict[str, Any]:
    """One object per method."""
    return {**head("detect", [log]), "log": log, "methods": [asdict(one) for one in scores]}


def print_table(log: str, scores: Sequence[MethodScore], file: Any) -> None:
    """Side by side; columns that need a truth are left out where the log has none."""
    from rich import box
    from rich.table import Table

    console = terminal.console(file)
    known = any(one.share_correct is not None for one in scores)
    console.print(f"[bold]{escaped(log)}[/bold]: {scores[0].judged:,} judged samples")
    table = Table(box=box.SIMPLE_HEAD, padding=(0, 1), collapse_padding=True, pad_edge=False)
    columns = ["method", "right", "confident", "of them", "followed", "after s", "false", "us"]
    if not known:
        columns = ["method", "confident", "switches", "us"]
    for name in columns:
        table.add_column(name, justify="left" if name == "method" else "right", no_wrap=True)
    for one in scores:
        table.add_row(*(_cells(one) if known else _cells_without_truth(one)))
    console.print(table)
    console.print("confident: share of the labels; us: microseconds per sample")
    if known:
        console.print("followed: changes of the true state, and the median time until the label is right and stands")
        console.print("of them: share of the confident that is right; false: changes of the label to a wrong state")


def _cells(one: MethodScore) -> list[str]:
    followed = "-" if not one.changes else f"{one.followed} of {one.changes}"
    delay = "-" if one.detection_delay is None else f"{one.detection_delay:.3g}"
    return [
        one.method,
        _percent(one.share_correct),
        _percent(one.confident_share),
        _percent(one.share_correct_confident),
        followed,
        delay,
        str(one.false_switches),
        _microseconds(one.nanoseconds),
    ]


def _cells_without_truth(one: MethodScore) -> list[str]:
    return [one.method, _percent(one.confident_share), str(one.switches), _microseconds(one.nanoseconds)]


def _percent(share: float | None) -> str:
    return "-" if share is None else f"{100 * share:.1f} %"


def _microseconds(nanoseconds: float) -> str:
    """Three digits, never an exponent."""
    value = nanoseconds / 1e3
    return f"{value:.3g}" if value < 100.0 else f"{value:,.0f}"
