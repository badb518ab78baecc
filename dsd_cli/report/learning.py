"""The result of `dsd learn`, as JSON and as text."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from dsd_cli.effects import Role, get_effect
from dsd_cli.learn.results import LEARNT, Curve, Formula, Learnt, Tie, View
from dsd_cli.report import terminal
from dsd_cli.report.diagnosis import plain_table, score_json
from dsd_cli.report.head import head
from dsd_cli.report.names import (
    balance_json,
    change_text,
    error,
    estimate_text,
    estimates_json,
    force_error,
    number_or_none,
)
from dsd_cli.report.terminal import escaped
from dsd_cli.report.values_table import print_values
from dsd_cli.signals.units import Units

#: Knots of a curve that a terminal shows.
_SHOWN = 9


@dataclass(frozen=True)
class LearnReport:
    """What was learnt, and where it came from and went; None: not written."""

    result: Learnt
    logs: tuple[str, ...]
    config: str | None = None
    law_file: str | None = None
    curve_file: str | None = None
    warnings: tuple[str, ...] = ()
    dropped: Mapping[str, int] = field(default_factory=dict)


def learn_json(report: LearnReport) -> dict[str, Any]:
    """The object of the contract."""
    result = report.result
    curves = [curve_json(one, result.units) for one in result.curves]
    return {
        **head("learn", report.logs),
        "holdout": list(result.held_out),
        **balance_json(result.band_hz, result.floor, result.units),
        "verdict": result.verdict,
        "verdict_text": learn_line(result),
        "why": result.why,
        "family": result.family,
        "channels": list(result.channels),
        "curve": curves[0] if curves else None,
        "curves": curves,
        "formula": None if result.formula is None else _formula_json(result.formula, result.units),
        "rmse_before": number_or_none(result.score.rmse),
        "heldout_rmse_given": number_or_none(result.score.heldout_rmse),
        "heldout_rmse_before": number_or_none(result.refitted.heldout_rmse),
        "heldout_rmse_after": number_or_none(result.after.heldout_rmse),
        "heldout_rmse_ceiling": number_or_none(result.ceiling),
        "after": score_json(result.after),
        "estimates": estimates_json(result.estimates),
        "ties": [
            {
                "family": one.family,
                "channels": list(one.channels),
                "heldout_rmse": number_or_none(one.heldout_rmse),
                "separate": one.separate,
            }
            for one in result.ties
        ],
        "notes": list(result.notes),
        "config": report.config,
        "law_file": report.law_file,
        "curve_file": report.curve_file,
        "warnings": list(report.warnings),
        "dropped": [{"reason": reason, "count": count} for reason, count in report.dropped.items()],
    }


def curve_json(curve: Curve, units: Units) -> dict[str, Any]:
    """Knots, values and band; null where the log never was."""
    return {
        "effect": curve.effect,
        "channels": list(curve.channels),
        "factor": curve.factor,
        "unit": units.words(curve.unit),
        "knots": [list(one) for one in curve.knots],
        "values": list(curve.values),
        "low": [number_or_none(x) for x in curve.low],
        "high": [number_or_none(x) for x in curve.high],
    }


def _formula_json(formula: Formula, units: Units) -> dict[str, Any]:
    return {
        "text": formula.text,
        "words": formula.words,
        "parameters": {
            name: {
                "value": number_or_none(one.value),
                "std_error": number_or_none(one.std_error),
                "unit": units.words(one.unit),
            }
            for name, one in formula.parameters.items()
        },
        "effects": list(formula.effects),
        "in_catalogue": formula.known,
        "heldout_rmse": number_or_none(formula.heldout_rmse),
        "as_good_as_the_curve": formula.replaces,
    }


def learn_line(result: Learnt) -> str:
    """What was learnt and by how much the error fell, or why nothing was."""
    if result.verdict != LEARNT:
        return f"{result.verdict}: {result.why}" if result.why else result.verdict
    before, after = result.refitted.heldout_rmse, result.after.heldout_rmse
    held = f"held-out {force_error(result.band_hz)}: {error(before)} -> {error(after)} {result.units.force}"
    return f"learnt: {result.family}; {held} ({change_text(before, after)})"


def tie_line(one: Tie) -> str:
    """Another law that explains the log as well."""
    return f"as good: {one.family} ({error(one.heldout_rmse)}); to distinguish them: {one.separate}"


def print_learnt(report: LearnReport, file: Any) -> None:
    """For a person: what, the curve, the formula, the values, what else could be."""
    console, result = terminal.console(file), report.result
    console.print(f"[bold]{escaped(learn_line(result))}[/bold]")
    for curve in result.curves:
        _print_curve(console, curve, result.units)
    if result.formula is not None:
        _print_formula(console, result.formula)
    for one in result.ties:
        console.print(escaped(tie_line(one)))
    for note in result.notes:
        console.print(escaped(note))
    if result.verdict == LEARNT:
        beside = "the formula" if result.formula is not None and result.formula.replaces else "it"
        print_values(console, f"values beside {beside}", result.estimates, ())
    if result.units.legend:
        console.print(result.units.legend)


def against_motion(curve: Curve) -> bool:
    """Whether its values are levels of friction over the velocity: the force is against the motion."""
    return curve.channels == ("velocity",) and get_effect(curve.effect).role is Role.FRICTION


def as_forces(curve: Curve, view: View) -> tuple[Curve, View]:
    """Both as forces on the axis, as all other pictures have them: friction is negative over a positive velocity."""
    if not against_motion(curve):
        return curve, view
    sign = -np.sign(curve.knots[0])
    values, *ends = (sign * np.array(x) for x in (curve.values, curve.low, curve.high))
    low, high = (tuple(x.tolist()) for x in (np.minimum(*ends), np.maximum(*ends)))
    force = replace(curve, values=tuple(values.tolist()), low=low, high=high)
    return force, replace(view, points=-np.sign(view.at) * view.points)


def _print_curve(console: Any, curve: Curve, units: Units) -> None:
    if len(curve.channels) > 1:
        size = " x ".join(str(len(one)) for one in curve.knots)
        console.print(escaped(f"{curve.effect}: a table over {' and '.join(curve.channels)}, {size} knots"))
        return
    over = curve.channels[0]
    times = "" if curve.factor == "one" else f", times {curve.factor}"
    times += ", a level against the motion" if against_motion(curve) else ""
    table = plain_table(f"{curve.effect} over {over}{times}", over, units.words(curve.unit) or "factor", "95 % band")
    knots = curve.knots[0]
    every = max(-(-len(knots) // _SHOWN), 1)
    for i in sorted({*range(0, len(knots), every), len(knots) - 1}):
        band = f"{curve.low[i]:.3g} to {curve.high[i]:.3g}" if math.isfinite(curve.low[i]) else "not visited"
        table.add_row(f"{knots[i]:.4g}", f"{curve.values[i]:.4g}", band)
    console.print(table)


def _print_formula(console: Any, formula: Formula) -> None:
    console.print(escaped(f"formula: {formula.text}"))
    console.print(escaped(f"  that is {formula.words}"))
    for name, one in formula.parameters.items():
        console.print(escaped(f"  {name} = {estimate_text(one)}"))
    if not formula.replaces:
        console.print(escaped(f"  it explains less than the curve (held-out {error(formula.heldout_rmse)})"))


def curve_csv(result: Learnt) -> str:
    """All curves as one table: effect, channels, knots, value, band; a row for each knot."""
    lines = ["effect,channel_1,knot_1,channel_2,knot_2,value,low,high,unit,factor"]
    for curve in result.curves:
        names = [*curve.channels, ""][:2]
        second = curve.knots[1] if len(curve.knots) > 1 else (math.nan,)
        places = [(a, b) for a in curve.knots[0] for b in second]
        unit = result.units.words(curve.unit)
        for (a, b), value, low, high in zip(places, curve.values, curve.low, curve.high, strict=True):
            numbers = [_cell(x) for x in (a, b, value, low, high)]
            row = [curve.effect, names[0], numbers[0], names[1], *numbers[1:], unit, curve.factor]
            lines.append(",".join(row))
    return "\n".join(lines) + "\n"


def _cell(x: float) -> str:
    return f"{x:.9g}" if math.isfinite(x) else ""
