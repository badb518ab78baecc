"""The result of `dsd detect` as JSON and as a table."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from dsd_cli.detect.profile.summary import Estimate
from dsd_cli.detect.summary import Segment, StateShare, Summary
from dsd_cli.report import terminal
from dsd_cli.report.head import head
from dsd_cli.report.terminal import escaped
from dsd_cli.report.value_units import units_of
from dsd_cli.signals.units import Units

if TYPE_CHECKING:
    from dsd_cli.report.changes import Changes

#: Rows of a table on the screen; the JSON has all.
MOST_STATES, MOST_SEGMENTS = 12, 15
#: Share of the judged labels that are confident, below which the reason is said.
LEAST_CONFIDENT = 0.01


@dataclass(frozen=True)
class Detection:
    """A summary and where it came from."""

    log: str
    summary: Summary
    method: str
    kernel: str
    sample_time: float | None
    regular: bool | None
    d_hat_source: str
    rho: float
    dropped: Mapping[str, int]
    changes: Changes | None
    warnings: tuple[str, ...]
    output: str = "d_hat"
    units: Units = field(default_factory=Units)

    @property
    def explains(self) -> bool:
        """Whether at least half of the judged samples are explained to within about 2 rho by their state.

        A share and not the rms: one large transient outside the model is no verdict on the whole log.
        """
        share = self.summary.explained_share
        return share is None or share >= 0.5


def to_json(result: Detection) -> dict[str, Any]:
    """The object of the contract; keys of further axes stand beside delay and inertia."""
    summary = result.summary
    out: dict[str, Any] = {
        **head("detect", [result.log]),
        "log": result.log,
        "method": result.method,
        "kernel": result.kernel,
        "sample_time": result.sample_time,
        "clock": {True: "regular", False: "irregular", None: None}[result.regular],
        "d_hat": result.d_hat_source,
        "samples": summary.samples,
        "judged": summary.judged,
        "confident_share": summary.confident_share,
        "residual_rms": summary.residual_rms,
        "explained_share": summary.explained_share,
        "rho": result.rho,
        "unit": result.units.force,
        "units": units_of(summary.final, result.units),
        "states": [_state(state) for state in summary.states],
        "segments": [_segment(segment) for segment in summary.segments],
        "segments_total": summary.segments_total,
        "final": {**summary.final, "confident": summary.final_confident},
        **({} if result.changes is None else result.changes.to_json()),
        "dropped": [{"reason": reason, "count": count} for reason, count in result.dropped.items()],
        "warnings": list(result.warnings),
    }
    if summary.estimates:
        out["estimates"] = {name: estimate._asdict() for name, estimate in summary.estimates.items()}
    if summary.truth is not None:
        out["truth"] = summary.truth._asdict()
    if summary.checks:
        out["checks"] = [check._asdict() for check in summary.checks]
    return out


def _state(state: StateShare) -> dict[str, Any]:
    return {"index": state.index, **state.values, "share": state.share, "confident_share": state.confident_share}


def _segment(segment: Segment) -> dict[str, Any]:
    from dsd_cli.report.names import number_or_none  # late: a table does without

    return {
        "start": number_or_none(segment.start),
        "end": number_or_none(segment.end),
        "state": segment.state,
        **segment.values,
        "confident_share": segment.confident_share,
    }


def print_table(result: Detection, file: Any) -> None:
    """The summary for a person."""
    from rich import box
    from rich.table import Table

    console = terminal.console(file)
    summary = result.summary
    console.print(f"[bold]{escaped(result.log)}[/bold]: {_first_line(result)}")
    headings = _headings(result)
    table = Table(box=box.SIMPLE_HEAD, title="states chosen", title_justify="left", title_style="")
    for name in ("state", *headings, "of all samples", "of confident ones"):
        table.add_column(name, justify="right")
    chosen = sorted((s for s in summary.states if s.share > 0), key=lambda s: -s.share)
    for state in chosen[:MOST_STATES]:
        values = [f"{value:g}" for value in state.values.values()]
        table.add_row(str(state.index), *values, _percent(state.share), _percent(state.confident_share))
    console.print(table)
    _more(console, len(chosen), MOST_STATES, "states")
    table = Table(box=box.SIMPLE_HEAD, title="segments of one label", title_justify="left", title_style="")
    for name in ("from s", "to s", *headings, "confident"):
        table.add_column(name, justify="right")
    for segment in summary.segments[:MOST_SEGMENTS]:
        values = [f"{value:g}" for value in segment.values.values()]
        table.add_row(
            *(_stamp(t, result.sample_time) for t in (segment.start, segment.end)),
            *values,
            _percent(segment.confident_share),
        )
    console.print(table)
    _more(console, summary.segments_total, MOST_SEGMENTS, "segments")
    for line in result.changes.lines() if result.changes is not None else ():
        console.print(line)
    for line in _closing_lines(result):
        console.print(line)


def _first_line(result: Detection) -> str:
    summary = result.summary
    clock = "" if result.sample_time is None else f", {result.sample_time * 1e3:.6g} ms apart"
    clock += "" if result.regular in (True, None) else " (irregular stamps)"
    source = "" if result.d_hat_source == "logged" else f"; d_hat computed from {result.d_hat_source}"
    sure = _percent(summary.confident_share)
    return f"{summary.samples:,} samples{clock}{source}; {summary.judged:,} judged, {sure} confident"


def _closing_lines(result: Detection) -> list[str]:
    summary = result.summary
    lines = [f"final: {escaped(_final(result))} ({'confident' if summary.final_confident else 'not confident'})"]
    if summary.estimates:
        lines.append("estimated between the candidates: " + "; ".join(map(_estimate, summary.estimates.items())))
    if summary.residual_rms is not None:
        unit = f"{escaped(result.units.u)} " if result.units.u else ""
        line = f"left unexplained by the labels: {summary.residual_rms:.3g} {unit}"
        line += f"(rms of {result.output}, rho is {result.rho:g})"
        if summary.explained_share is not None:
            line += f"; {_percent(summary.explained_share)} of the judged samples are within 2 rho"
        if not result.explains:
            line += "\n[bold]no candidate explains this log[/bold]: widen the grid, or the model lacks an effect"
        elif summary.judged and summary.confident_share < LEAST_CONFIDENT:
            line += (
                "\n[bold]no label is confident[/bold]: within so wide a rho the candidates are alike. If the model"
                " lacks a force (dsd diagnose): dsd improve LOG --states first; else a smaller rho or a larger window"
            )
        lines.append(line)
    truth = summary.truth
    if truth is not None:
        parts = [f"truth in the log: {_percent(truth.share_correct)} of {truth.samples:,} judged labels are right"]
        if truth.share_correct_confident is not None:
            parts.append(f"{_percent(truth.share_correct_confident)} of the confident ones")
        lines.append(", ".join(parts))
    for check in summary.checks:
        verdict = "holds" if check.holds else "does not hold"
        if check.samples == 0:
            lines.append(f"expected {check.axis} {check.value:g}: no such sample to check")
            continue
        of = f"{_percent(check.share)} of {check.samples:,} samples, {_percent(check.min_share)} required"
        lines.append(f"expected {check.axis} {check.value:g}: {verdict} ({of})")
    if _named(result) and result.units.legend:
        lines.append(result.units.legend)
    if result.dropped:
        counts = ", ".join(f"{reason} {count:,}" for reason, count in result.dropped.items())
        lines.append(f"rows not taken as they are: {escaped(counts)}")
    return lines


def _estimate(named: tuple[str, Estimate]) -> str:
    """The last well-founded value of an axis."""
    name, found = named
    if found.value is None:
        return f"{name} not identifiable"
    spread = "" if found.std is None else f" +- {found.std:.2g}"
    return f"{name} {found.value:.5g}{spread} (identifiable in {_percent(found.confident_share)} of the samples)"


def _named(result: Detection) -> dict[str, str]:
    """Unit of each axis of the grid; {} where the user named none."""
    return units_of(result.summary.final, result.units) if result.units.u or result.units.position else {}


def _headings(result: Detection) -> list[str]:
    units = _named(result)
    if not units:
        return ["delay s" if name == "delay" else name for name in result.summary.final]
    return ["\n".join((name.replace(".", ".\n"), escaped(unit))) for name, unit in units.items()]


def _final(result: Detection) -> str:
    """The last label in words."""
    units = _named(result)
    return ", ".join(f"{name} {value:g} {units.get(name, '')}".strip() for name, value in result.summary.final.items())


def _stamp(t: float, apart: float | None) -> str:
    """Seconds, with the digits that distinguish one sample from the next: the time of day and an epoch have many."""
    behind = 3 if not apart else max(math.ceil(-math.log10(apart)), 0)
    before = math.floor(math.log10(abs(t))) + 1 if abs(t) >= 1.0 else 1
    return f"{t:.{max(before + behind, 6)}g}"


def _percent(share: float) -> str:
    return f"{100 * share:.1f} %"


def _more(console: Any, total: int, shown: int, what: str) -> None:
    if total > shown:
        console.print(f"  and {total - shown:,} more {what} (--format json lists them)")
