"""The result of `dsd diagnose` as a sentence, as JSON and as a table."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from dsd_cli.identify.results import Candidate, Diagnosis, Estimates, Score
from dsd_cli.plant.model import PlantModel
from dsd_cli.report import terminal
from dsd_cli.report.head import head
from dsd_cli.report.levels import levels_json
from dsd_cli.report.names import (
    balance_json,
    error,
    estimate_text,
    estimates_json,
    fall_text,
    force_error,
    listed,
    number_or_none,
    percent,
    values_text,
)
from dsd_cli.report.prior_conflicts import against_json
from dsd_cli.report.terminal import Hanging, escaped
from dsd_cli.report.two_numbers import believed, missing_json, two_answers, unexplained_json
from dsd_cli.report.values_table import correlation_lines, correlations_json
from dsd_cli.report.verdict import advice_of, verdict_line

#: Rows of a table on the screen; the JSON has all.
MOST_CANDIDATES = 12


@dataclass(frozen=True)
class DiagnosisReport:
    """A diagnosis and where it came from; `given` is the model as the config has it."""

    result: Diagnosis
    given: PlantModel | None = None
    holdout: tuple[str, ...] = ()
    dropped: Mapping[str, int] = field(default_factory=dict)


def to_json(report: DiagnosisReport) -> dict[str, Any]:
    """The object of the contract."""
    result = report.result
    return {
        **head("diagnose", result.logs),
        "holdout": list(report.holdout),
        "samples": result.samples,
        "verdict": result.verdict,
        "probability": number_or_none(result.probability),
        "against_told": against_json(result),
        "verdict_text": verdict_line(result, report.given),
        "found": list(result.found),
        **_set_json(result),
        **levels_json(result.levels),
        "stability": [],  # no longer asked: the key goes with the next version
        **score_json(result.score),
        **balance_json(result.band_hz, result.floor, result.units),
        "refitted": score_json(result.refitted),
        "missing": missing_json(result.missing),
        "unexplained": unexplained_json(result.unexplained),
        "ranking": [_candidate_json(c, result) for c in result.ranking],
        "ceiling": {"heldout_rmse": number_or_none(result.ceiling.heldout_rmse), "on": list(result.ceiling.on)},
        "noise": number_or_none(result.noise),
        "depends_on": list(result.depends_on),
        "estimates": estimates_json(result.estimates),
        "correlations": correlations_json(result.correlations),
        "provenance": dict(result.provenance),
        "advice": list(advice_of(result)),
        "warnings": list(result.warnings),
        "dropped": [{"reason": reason, "count": count} for reason, count in report.dropped.items()],
    }


def score_json(score: Score) -> dict[str, float | None]:
    """The errors of one model."""
    return {
        "rmse": number_or_none(score.rmse),
        "heldout_rmse": number_or_none(score.heldout_rmse),
        "fit_percent": number_or_none(score.fit_percent),
        "relative_error_percent": number_or_none(score.relative_error_percent),
    }


def _set_json(result: Diagnosis) -> dict[str, Any]:
    """The values and the error of several effects that were found, all fitted together."""
    if not result.whole_values:
        return {}
    held_out = number_or_none(result.whole_heldout_rmse)
    return {"found_values": estimates_json(result.whole_values), "found_heldout_rmse": held_out}


def _candidate_json(one: Candidate, result: Diagnosis) -> dict[str, Any]:
    out: dict[str, Any] = {
        "effect": one.effect,
        "rmse_after": number_or_none(one.rmse_after),
        "heldout_rmse_before": number_or_none(one.heldout_rmse_before),
        "heldout_rmse_after": number_or_none(one.heldout_rmse_after),
        "probability": number_or_none(one.probability),
        "in_final_set": one.effect in result.found,
        "parameters": estimates_json(result.alone(one)),
        "indistinguishable_from": list(one.indistinguishable_from),
    }
    if one.untestable:
        out["not_testable"] = one.untestable
    if one.note:
        out["note"] = one.note
    return out


def print_table(report: DiagnosisReport, file: Any, brief: bool = False) -> None:
    """For a person; `brief`: the verdict and the best candidates only."""
    console = terminal.console(file)
    result = report.result
    console.print(f"[bold]{escaped(verdict_line(result, report.given))}[/bold]")
    if not brief:
        console.print(escaped(_first_line(result, report.holdout)))
    _print_ranking(console, result, 4 if brief else MOST_CANDIDATES)
    if brief:
        return
    for line in _closing_lines(report):
        console.print(escaped(line))


def _first_line(result: Diagnosis, holdout: Sequence[str]) -> str:
    line = f"{', '.join(result.logs)}: {result.samples:,} samples"
    if holdout:
        line += f", held out {', '.join(holdout)}"
    left = f"a {force_error(result.band_hz)} of {error(result.score.rmse)} ({result.units.force}, rms)"
    line += f"; the model as given leaves {left}"
    refitted = result.refitted.rmse
    return line + (f", with its own values fitted {error(refitted)}" if math.isfinite(refitted) else "")


def _print_ranking(console: Any, result: Diagnosis, most: int) -> None:
    tested = [c for c in result.ranking if not c.untestable]
    if not tested:
        return
    before = result.refitted.heldout_rmse
    title = f"held-out {force_error(result.band_hz)} with one effect more (without: {error(before)})"
    table = plain_table(title, "effect", "error", "falls by", "in the final set")
    for one in tested[:most]:
        notes = [one.note] if one.note else []
        if error(one.heldout_rmse_before) != error(before):
            how = "alone" if one.score is None else "all values fitted again"
            there = " with each log's level" if result.levels else ""
            notes.append(f"{how}, from {error(one.heldout_rmse_before)} as given{there}")
        notes += [f"indistinguishable from {other}" for other in one.indistinguishable_from]
        table.add_row(
            named(one.effect, result.alone(one), notes),
            error(one.heldout_rmse_after),
            fall_text(one.heldout_rmse_before, one.heldout_rmse_after),
            in_final_set(one, result),
        )
    console.print(table)
    console.print("  in the final set: probability that the effect belongs to what is missing, all found ones together")
    if result.whole_values:
        console.print(
            "  values: of each effect alone, biased by the others that are missing, so without +-; below, all together"
        )
    elif result.found:
        console.print("  values: of each effect alone; where what is missing biases them without +-")
    if len(tested) > most:
        console.print(f"  and {len(tested) - most} more candidates (--format json lists them)")


def in_final_set(one: Candidate, result: Diagnosis) -> str:
    """`yes, 99 %`: a member that is rather not there is no `yes`."""
    return f"{'yes, ' * (one.effect in result.found and believed(one.probability))}{percent(one.probability)}"


def _closing_lines(report: DiagnosisReport) -> list[str]:
    result = report.result
    lines = []
    if len(result.found) > 1:
        lines.append(f"found together: {found_text(result)}")
    if not result.blocked:
        lines += two_answers(result.missing, result)
    shown_above = tuple(f"{effect}." for effect in result.found) if result.whole_values else ()
    along = {k: e for k, e in result.estimates.items() if not k.startswith(shown_above)} if result.estimates else {}
    if along:
        fitted = (f"{name} {estimate_text(e)}" for name, e in along.items())
        lines.append("also fitted: " + ", ".join(fitted))
    lines += correlation_lines(result.correlations, result.estimates)
    on = f" of {listed(result.ceiling.on)}" if result.ceiling.on else ""
    if math.isfinite(result.ceiling.heldout_rmse):
        lines.append(f"ceiling: the best free-form function{on} reaches {error(result.ceiling.heldout_rmse)}")
    if math.isfinite(result.noise):
        lines.append(f"noise: {error(result.noise)} (force that no smooth function of anything explains, rms)")
    if math.isfinite(result.floor):
        lines.append(f"floor: {error(result.floor)} (what the noise of the sensor alone would leave in the band)")
    sources = [f"{name} {how}" for name, how in result.provenance.items() if how != "logged"]
    lines += [f"channels: {'; '.join(sources)}"] if sources else []
    why = dict.fromkeys(c.untestable for c in result.ranking if c.untestable)
    by_reason = ((", ".join(c.effect for c in result.ranking if c.untestable == reason), reason) for reason in why)
    lines += [f"not testable: {effects}: {reason}" for effects, reason in by_reason]
    if report.dropped:
        counts = ", ".join(f"{reason} {count:,}" for reason, count in report.dropped.items())
        lines.append(f"rows not taken as they are: {counts}")
    return [*lines, *filter(None, [result.units.legend]), *(f"-> {advice}" for advice in advice_of(result))]


def found_text(result: Diagnosis) -> str:
    """`cogging (amplitude 0.11 +- 0.01 u, ...) and ...`: the set that was found, with its values fitted together."""
    names = []
    for effect in result.found:
        own = result.joint_values(effect)
        names.append(f"{effect} ({values_text(own)})" if own else effect)
    return listed(names)


def plain_table(title: str, *names: str) -> Any:
    """A table without frame, the first column to the left and wrapped where the terminal is narrow."""
    from rich import box
    from rich.table import Table

    table = Table(box=box.SIMPLE_HEAD, title=escaped(title), title_justify="left", title_style="")
    for i, name in enumerate(names):
        table.add_column(name, justify="right" if i else "left", no_wrap=i > 0, overflow="fold")
    return table


def named(effect: str, values: Estimates, notes: Sequence[str] = ()) -> Hanging:
    """An effect, below it its values and what to know about them: one cell, so that tables stay narrow."""
    several = len(values) > 1  # then each needs its name
    lines = [f"{name} {estimate_text(e)}" if several else values_text({name: e}) for name, e in values.items()]
    return Hanging(effect, *(f"  {line}" for line in (*lines, *notes)))
