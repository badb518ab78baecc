"""The result of `dsd add`, as JSON and as tables."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

from dsd_cli.identify.compare.balance import Force
from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.results import DELAY, INERTIA, Addition, Estimates, Step, without_errors
from dsd_cli.report import terminal
from dsd_cli.report.diagnosis import plain_table, score_json
from dsd_cli.report.head import head
from dsd_cli.report.ladder import fit_text, own, print_legend
from dsd_cli.report.names import balance_json, change_text, error, estimates_json, force_error, number_or_none
from dsd_cli.report.terminal import escaped
from dsd_cli.report.values_table import correlations_json, print_values
from dsd_cli.report.verdict import assumed_text, of_place


@dataclass(frozen=True)
class AdditionReport:
    """An addition and where it came from and went; `force` : the balance of forces of the model without it."""

    result: Addition
    logs: tuple[str, ...]
    holdout: tuple[str, ...]
    config: str
    force: Force | None = None

    @property
    def band_hz(self) -> float:
        """End of the band, Hz; NaN where it is not known."""
        return math.nan if self.force is None else self.force.band_hz

    @property
    def floor(self) -> float:
        """What the sensor alone would leave, unit of u; NaN where it is not known."""
        return math.nan if self.force is None else self.force.floor

    @property
    def lacking(self) -> bool:
        """Whether more is missing: more is left than the sensor leaves."""
        return self.result.after.heldout_rmse > POLICY.floor_factor * self.floor

    @property
    def values(self) -> Estimates:
        """All that were fitted; where more is missing without standard errors, which know nothing of its bias."""
        found = self.result.estimates
        free = {name: one for name, one in found.items() if not one.held}
        return {**found, **without_errors(free)} if self.lacking else found


def caveats(report: AdditionReport) -> tuple[str, ...]:
    """That a unit that nothing says decides what the effect is called, and that more is missing than it.

    The latter where more is left than the sensor leaves: it bends these values.
    """
    placed = of_place([report.result.effect], report.result.units)
    found = (assumed_text(placed),) if placed else ()
    if not report.lacking:
        return found
    left = error(report.result.after.heldout_rmse)
    over = f"{left} is left, and the sensor alone would leave {error(report.floor)}"
    return (*found, f"{over}: more is missing, and biases these values, so without +-; `dsd diagnose` says what")


def add_json(report: AdditionReport) -> dict[str, Any]:
    """The object of the contract of `dsd add`."""
    result = report.result
    return {
        **head("add", report.logs),
        "holdout": list(report.holdout),
        "effect": result.effect,
        "rmse_before": number_or_none(result.before.rmse),
        "rmse_after": number_or_none(result.after.rmse),
        "heldout_rmse_before": number_or_none(result.before.heldout_rmse),
        "heldout_rmse_after": number_or_none(result.after.heldout_rmse),
        **balance_json(report.band_hz, report.floor, result.units),
        "before": score_json(result.before),
        "after": score_json(result.after),
        "parameters": estimates_json(own(replace(added_step(result), estimates=report.values))),
        "estimates": estimates_json(report.values),
        "correlations": correlations_json(result.correlations),
        "refitted": None if result.refitted is None else score_json(result.refitted),
        "warnings": [*result.warnings, *caveats(report)],
        "config": report.config,
    }


def added_step(result: Addition) -> Step:
    """An addition as the one rung of a ladder."""
    return Step(1, result.effect, result.after, result.estimates, result.model)


def addition_line(report: AdditionReport) -> str:
    """What the effect brought."""
    result = report.result
    before, after = result.before.heldout_rmse, result.after.heldout_rmse
    held = f"held-out {force_error(report.band_hz)}: {error(before)} -> {error(after)} {result.units.force}"
    return f"{result.effect} added: {held} ({change_text(before, after)})"


def print_addition(report: AdditionReport, file: Any) -> None:
    """For a person."""
    console = terminal.console(file)
    result = report.result
    before, after = result.before, result.after
    console.print(f"[bold]{escaped(addition_line(report))}[/bold]")
    refitted = [] if result.refitted is None or result.effect in (INERTIA, DELAY) else [result.refitted]
    scores = [before, *refitted, after]
    table = plain_table("", "", "before", *(["own values refitted"] * len(refitted)), "after")
    for name, of in (
        ("force error, rms", lambda s: error(s.rmse)),
        ("held-out, rms", lambda s: error(s.heldout_rmse)),
        ("fit", lambda s: fit_text(s.fit_percent)),
        ("of u", lambda s: fit_text(s.relative_error_percent)),
    ):
        table.add_row(name, *map(of, scores))
    console.print(table)
    title = "values, biased by what else is missing, so without +-" if report.lacking else "values"
    print_values(console, title, report.values, result.correlations)
    print_legend(console, result.units)
