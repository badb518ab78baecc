"""The result of `dsd compare` as a table."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import PurePath
from typing import Any

from dsd_cli.identify.compare.balance import Force
from dsd_cli.identify.compare.comparison import Comparison, LogAccuracy
from dsd_cli.identify.compare.evaluation import Accuracy
from dsd_cli.identify.compare.forward import Forward, Tracking
from dsd_cli.identify.compare.regimes import Where
from dsd_cli.identify.compare.residuals import ResidualTests
from dsd_cli.report import terminal
from dsd_cli.report.comparison import Report
from dsd_cli.report.conclusions import conclusion, no_dependence, simulation_conclusion
from dsd_cli.report.names import force_error
from dsd_cli.report.terminal import escaped

#: Rows of a table on the screen; the JSON has all.
MOST_DEPENDENCES, MOST_LOGS = 8, 12
#: Shares below this are not shown on the screen.
_LEAST_SHOWN = 0.01


def print_table(report: Report, file: Any) -> None:
    """The result for a person."""
    console = terminal.console(file)
    result = report.result
    if isinstance(result, Comparison):
        _print_comparison(console, result)
        last = conclusion(result)
    else:
        _print_forward(console, result, report.holdout)
        last = simulation_conclusion(result)
    if report.dropped:
        counts = ", ".join(f"{reason} {count:,}" for reason, count in report.dropped.items())
        console.print(f"rows not taken as they are: {escaped(counts)}")
    if report.max_rmse is not None:
        verdict = "holds" if report.holds else "does not hold"
        console.print(f"rmse of {escaped(report.judged_log)} at most {report.max_rmse:g}: {verdict}")
    console.print(f"[bold]{escaped(last)}[/bold]")


def _print_comparison(console: Any, result: Comparison) -> None:
    clock = f"{result.accuracy.samples:,} samples judged, {result.sample_time * 1e3:.6g} ms apart"
    name = result.logs[0] if len(result.logs) == 1 else f"{len(result.logs)} logs"
    console.print(f"[bold]{escaped(name)}[/bold]: {clock}")
    sources = _sources(result.provenance)
    sources += [f"no {name}: {why}" for name, why in result.missing.items()]
    if sources:
        console.print(escaped("; ".join(sources)))
    console.print(f"left out: {result.skipped:,} samples, the first {result.lead:g} s (they rest on u before the log)")
    _print_force(console, result)
    _print_accuracy(console, result)
    _print_residual(console, result.residual)
    _print_where(console, result.where, "force error" if result.where_of == "force" else "error of d_hat")
    table = _table("what a function of it explains of the force residual (held-out)", "of", "explains")
    shown = [d for d in result.dependence if d.explains >= _LEAST_SHOWN][:MOST_DEPENDENCES]
    for one in shown:
        table.add_row(one.on, _percent(one.explains))
    if shown:
        console.print(table)
    else:
        console.print(escaped(f"dependence of the force residual: {no_dependence(result)}\n"))


def _print_force(console: Any, result: Comparison) -> None:
    view = result.force
    if view.log is not None:
        columns: list[tuple[str, Force]] = [("all" if len(result.logs) > 1 else "log", view.log)]
        if result.holdout is not None and view.holdout is not None:
            columns.append((f"holdout {_short(result.holdout.log)}", view.holdout))
        title = f"{force_error(view.log.band_hz)}, r = J a - u - forces"
        table = _table(title, "", *(name for name, _ in columns), "unit")
        rows = (
            ("rmse", "rmse", result.units.force),
            ("fit (0 is a constant)", "fit_percent", "%"),
            ("of u", "relative_error_percent", "%"),
            ("floor: the sensor's noise", "floor", result.units.force),
        )
        for heading, key, unit in rows:
            table.add_row(heading, *(_figure(getattr(force, key)) for _, force in columns), unit)
        table.columns[-1].justify = "left"
        console.print(table)
    if view.missing:
        console.print(f"no force error: {escaped(view.missing)}")


def _print_accuracy(console: Any, result: Comparison) -> None:
    columns: list[tuple[str, Accuracy]] = [("all" if len(result.logs) > 1 else "log", result.accuracy)]
    if result.holdout is not None:
        columns.append((f"holdout {_short(result.holdout.log)}", result.holdout.accuracy))
    table = _table("error of the predicted d_hat, e = measured - predicted", "", *(name for name, _ in columns), "unit")
    rows = (
        ("rmse", "rmse", result.units.force),
        ("fit (0 is a constant)", "fit_percent", "%"),
        ("variance accounted for", "vaf_percent", "%"),
        ("bias", "bias", result.units.force),
        ("largest error", "max_error", result.units.force),
        ("of the net force Jn a", "relative_error_percent", "%"),
        ("of u: relative force error", "relative_force_error_percent", "%"),
    )
    for heading, key, unit in rows:
        table.add_row(heading, *(_figure(getattr(accuracy, key)) for _, accuracy in columns), unit)
    table.columns[-1].justify = "left"
    console.print(table)
    if len(result.by_log) > 1:
        _print_logs(console, result.by_log, result.force.by_log)


def _print_logs(console: Any, logs: Sequence[LogAccuracy], forces: Mapping[str, float]) -> None:
    table = _table("log by log", "log", "samples", "force error", "of d_hat: rmse", "fit %", "bias", "largest")
    for one in logs[:MOST_LOGS]:
        a = one.accuracy
        figures = (forces.get(one.log), a.rmse, a.fit_percent, a.bias, a.max_error)
        table.add_row(escaped(_short(one.log)), f"{a.samples:,}", *map(_figure, figures))
    console.print(table)
    if len(logs) > MOST_LOGS:
        console.print(f"  and {len(logs) - MOST_LOGS} more logs (--format json lists them)")


def _print_residual(console: Any, tests: ResidualTests) -> None:
    table = _table(
        "is the residual of d_hat noise?",
        "correlation",
        "largest",
        "lag ms",
        "by chance",
        "share of variance",
        "verdict",
    )
    table.add_row(
        "own past",
        f"{tests.largest:.2f}",
        f"{tests.largest_lag * 1e3:.4g}",
        f"±{tests.widest:.3f}",
        "-" if tests.white else _percent(tests.predictable_share),
        _weight(not tests.white, tests.remembers),
    )
    table.add_row(
        "u before",
        f"{tests.largest_with_u:.2f}",
        f"{tests.largest_lag_with_u * 1e3:.4g}",
        f"±{tests.widest_with_u:.3f}",
        "-" if tests.independent_of_u else _percent(tests.largest_with_u**2),
        _weight(not tests.independent_of_u, tests.follows_u),
    )
    table.columns[-1].justify = "left"
    console.print(table)
    console.print("  by chance: in 99 of 100 logs the largest correlation of noise is within")
    console.print(f"  with u, {tests.effective_samples:,.0f} of {tests.samples:,} samples count as independent\n")


def _weight(significant: bool, large: bool) -> str:
    if large:
        return "significant, large"
    return "significant, small" if significant else "chance"


def _print_where(console: Any, where: Where, of: str) -> None:
    if where.regimes:
        table = _table(f"where the {of} is", "regime", "of the samples", "of the error", "rmse")
        for regime in where.regimes:
            name = f"({regime.regime})" if regime.overlaps else regime.regime
            shares = (_percent(regime.share_of_samples), _percent(regime.share_of_error))
            table.add_row(name, *shares, f"{regime.rmse:.3g}")
        console.print(table)
        if any(regime.overlaps for regime in where.regimes):
            console.print("  (in brackets): samples that the other regimes have, too\n")
    table = _table("the worst part by", "", "from", "to", "of the samples", "of the error", "rmse")
    parts = (("time, s", where.time), ("velocity", where.velocity), ("position", where.position))
    for name, bins in parts:
        if bins:
            worst = max(bins, key=lambda one: one.share_of_error)
            shares = (_percent(worst.share_of_samples), _percent(worst.share_of_error))
            table.add_row(name, f"{worst.start:.4g}", f"{worst.end:.4g}", *shares, f"{worst.rmse:.3g}")
    band = max(where.frequency, key=lambda one: one.share_of_error)
    table.add_row(
        "frequency, Hz", f"{band.start:.4g}", f"{band.end:.4g}", "", _percent(band.share_of_error), f"{band.rmse:.3g}"
    )
    console.print(table)
    if len({one.log for one in where.time}) > 1:
        worst = max(where.time, key=lambda one: one.share_of_error)
        console.print(f"  this time is of {escaped(_short(worst.log))}\n")


def _print_forward(console: Any, result: Forward, holdout: Forward | None) -> None:
    for what, forward in (("", result), ("holdout ", holdout)):
        if forward is None:
            continue
        name = escaped(what + ", ".join(forward.logs))
        console.print(f"[bold]{name}[/bold]: {forward.samples:,} samples simulated{_anew(forward)}")
        sources = [one for one in _sources(forward.provenance) if not one.startswith("d_hat")]
        if sources:
            console.print(escaped("; ".join(sources)))
        table = _table("logged less simulated", "", "channel", "rmse", "fit %", "largest", "unit")
        for loop, rows in (("open loop", forward.open_loop), ("closed loop", forward.closed_loop)):
            for row in rows:
                table.add_row(loop, *_tracking(row))
        table.columns[-1].justify = "left"
        console.print(table)
        if forward.not_closed:
            console.print(escaped(f"no closed loop: {forward.not_closed}"))


def _anew(forward: Forward) -> str:
    if not math.isfinite(forward.horizon):
        return ""
    if not forward.restarts:
        return f", never begun anew: the log has no stretch longer than {forward.horizon:g} s"
    return f", begun anew from the measured motion every {forward.horizon:g} s"


def _sources(provenance: Mapping[str, str]) -> list[str]:
    """What was not logged as it is."""
    return [f"{name} {how}" for name, how in provenance.items() if how != "logged"]


def _tracking(row: Tracking) -> tuple[str, ...]:
    figures = (row.rmse, row.fit_percent, row.max_error)
    return (row.channel, *("-" if x is None else f"{x:.3g}" for x in figures), row.unit)


def _table(title: str, *names: str) -> Any:
    from rich import box
    from rich.table import Table

    table = Table(box=box.SIMPLE_HEAD, title=escaped(title), title_justify="left", title_style="")
    for i, name in enumerate(names):
        table.add_column(escaped(name), justify="left" if i == 0 else "right", no_wrap=True)
    return table


def _figure(x: float | None) -> str:
    return "-" if x is None else f"{x:.4g}"


def _percent(share: float) -> str:
    return f"{100 * share:.1f} %"


def _short(log: str) -> str:
    """The name of the file without its folder."""
    return PurePath(log).name
