"""The result of `dsd check` as a table and as JSON."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from dsd_cli.identify.checks import CheckResult, Excitation, Finding, Parameter
from dsd_cli.identify.results import DELAY, INERTIA, Estimate
from dsd_cli.report.head import head
from dsd_cli.report.names import estimate_text, in_words, listed, number_or_none
from dsd_cli.report.terminal import console as terminal
from dsd_cli.report.terminal import escaped
from dsd_cli.report.values_table import GRADES
from dsd_cli.signals.units import Units

#: rad
TURN = 2.0 * math.pi
#: Best first: several logs together tell what one of them tells.
_GRADES = ("identified", "weak", "not")
_STYLES = {"error": "bold red", "warning": "yellow", "note": "dim"}


def verdict(result: CheckResult) -> str:
    """The whole in one line."""
    if result.errors:
        return f"cannot answer: {'; '.join(one.what for one in result.errors)}"
    if answers_little(result):
        return (
            "can answer little: no value is more than weakly identifiable, and moves are too few to judge an effect by"
        )
    warnings = sum(one.severity == "warning" for one in result.findings)
    if not warnings:
        return "can answer"
    return f"can answer, with {'a warning' if warnings == 1 else f'{warnings} warnings'}"


def answers_little(result: CheckResult) -> bool:
    """Whether nothing forbids an answer, but no value is identified and no effect can be asked for."""
    weak = result.parameters and all(one.identified != "identified" for one in result.parameters)
    return bool(weak) and not result.errors and result.excitation.effects == 0


def to_json(results: Sequence[CheckResult]) -> dict[str, Any]:
    """The object of the contract; of several logs together what stands at the top, each by itself in `by_log`."""
    bands = [one.band_hz for one in results if one.band_hz is not None]
    floors = [one.floor for one in results if one.floor is not None]
    return {
        **head("check", (one.log for one in results)),
        "can_answer": not any(one.errors for one in results),
        "findings": [{"log": one.log, **_finding_json(f)} for one in results for f in one.findings],
        "parameters": _together(results),
        "band_hz": min(bands, default=None),
        "floor": max(floors, default=None),
        "unit": results[0].units.u or "u" if results else "u",
        "by_log": [_log_json(one) for one in results],
    }


def _log_json(result: CheckResult) -> dict[str, Any]:
    return {
        "log": result.log,
        "can_answer": not result.errors,
        "verdict_text": verdict(result),
        "samples": result.samples,
        "seconds": result.seconds,
        "band_hz": result.band_hz,
        "floor": result.floor,
        "effects": result.excitation.effects,
        "excitation": asdict(result.excitation),
        "findings": [_finding_json(one) for one in result.findings],
        "parameters": [_parameter_json(one) for one in result.parameters],
    }


def _finding_json(one: Finding) -> dict[str, Any]:
    return {key: getattr(one, key) for key in ("what", "channel", "severity", "sure", "remedy")}


def _parameter_json(one: Parameter) -> dict[str, Any]:
    return {
        "name": one.name,
        "identified": one.identified,
        "value": number_or_none(one.value),
        "std_error": number_or_none(one.std_error),
        "unit": in_words(one.unit),
        "tied_to": list(one.tied_to),
    }


def _together(results: Sequence[CheckResult]) -> list[dict[str, Any]]:
    """Each parameter as the log that identifies it best has it."""
    best: dict[str, Parameter] = {}
    for one in (p for result in results for p in result.parameters):
        if one.name not in best or _rank(one) < _rank(best[one.name]):
            best[one.name] = one
    return [_parameter_json(one) for one in best.values()]


def _rank(one: Parameter) -> tuple[int, float]:
    return _GRADES.index(one.identified), one.std_error


def print_table(results: Sequence[CheckResult], file: Any) -> None:
    """For a person: the verdict of each log first."""
    console = terminal(file)
    for i, result in enumerate(results):
        if i:
            console.print()
        console.print(f"[bold]{escaped(f'{result.log}: {verdict(result)}')}[/bold]")
        for line in facts(result):
            console.print(escaped(f"  {line}"))
        _print_findings(console, result.findings)
        if result.parameters and not result.errors:
            _print_parameters(console, result.parameters, result.units)


def facts(result: CheckResult) -> list[str]:
    """What kind of log it is, in lines."""
    apart = 1e3 * result.seconds / max(result.samples, 1)
    lines = [
        f"{result.samples:,} samples, {apart:.4g} ms apart: {result.seconds:.3g} s",
        *_moves(result.excitation, result.units),
    ]
    if result.band_hz is not None:
        floor = (
            "" if result.floor is None else f"; noise of the sensor there: {result.floor:.2g} {result.units.u or 'u'}"
        )
        lines.append(f"acceleration seen up to {result.band_hz:.3g} Hz{floor}")
    return lines


def _moves(did: Excitation, units: Units) -> list[str]:
    enough = f"enough to cross-validate {did.effects} effect{'' if did.effects == 1 else 's'}"
    if did.moving is None or did.top_speed is None or did.travel is None:
        return [f"no motion is logged; u turns {did.stretches} times: {enough}"]
    share = f"{100.0 * did.moving:.0f} % of the time"
    velocity, position = (f" {units.of_velocity}", f" {units.position}") if units.position else ("", "")
    guessed = "" if units.position else ", if it turns"
    turns = "" if units.position == "m" else f" ({did.travel / TURN:.2g} turns{guessed})"
    return [
        f"{did.stretches} move{'' if did.stretches == 1 else 's'} ({did.forward} forward), {share}: {enough}",
        f"speed up to {did.top_speed:.3g}{velocity}, travel {did.travel:.3g}{position}{turns}",
    ]


def _print_findings(console: Any, findings: Sequence[Finding]) -> None:
    from rich.table import Table

    if not findings:
        return
    table = Table(box=None, show_header=False, padding=(0, 1, 0, 0))
    table.add_column(no_wrap=True)
    table.add_column(overflow="fold")
    for one in findings:
        sure = "" if one.sure >= 0.9 else f" ({100.0 * one.sure:.0f} % sure)"
        remedy = f"\n-> {escaped(one.remedy)}" if one.remedy else ""
        table.add_row(f"[{_STYLES[one.severity]}]{one.severity}[/]", escaped(f"{one.what}{sure}") + remedy)
    console.print(table)


def _print_parameters(console: Any, parameters: Sequence[Parameter], units: Units) -> None:
    from rich.table import Table

    table = Table(box=None, padding=(0, 2, 0, 0))
    for name in ("value", "on this log", "value by the fit in the band"):
        table.add_column(name, no_wrap=True)
    for one in parameters:
        fitted = estimate_text(Estimate(one.value, one.std_error, one.unit)) if one.identified != "not" else "no value"
        table.add_row(escaped(one.name), "below 0" if _impossible(one) else GRADES[one.identified], escaped(fitted))
        for other in one.tied_to:
            table.add_row(escaped(f"  indistinguishable from {other}"))
    console.print(table)
    if below := [one.name for one in parameters if _impossible(one)]:
        late = ", or for a u that is late" if "delay" in below else ""
        console.print(
            f"{listed(below)} below 0 compensates for forces that the model lacks{late}: `dsd diagnose` says which"
        )
    if units.legend:
        console.print(units.legend)


def _impossible(one: Parameter) -> bool:
    """Whether it is a value that no axis has, clearly."""
    return one.name in (INERTIA, DELAY) and one.identified != "not" and one.value + 2.0 * one.std_error < 0.0
