"""The result of `dsd improve`, as JSON and as tables."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from dsd_cli.identify.compare.versus import Moved, Validation
from dsd_cli.identify.results import (
    DELAY,
    NONE,
    UNKNOWN,
    Diagnosis,
    Estimates,
    Ladder,
    Step,
    own_values,
    without_errors,
)
from dsd_cli.identify.verdict.contradictions import kept_values
from dsd_cli.learn.results import LEARNT
from dsd_cli.report import terminal
from dsd_cli.report.diagnosis import named, plain_table, score_json
from dsd_cli.report.head import head
from dsd_cli.report.levels import levels_json
from dsd_cli.report.names import (
    balance_json,
    change_text,
    error,
    estimates_json,
    fall_text,
    force_error,
    number_or_none,
    values_text,
)
from dsd_cli.report.prior_conflicts import against_json, once
from dsd_cli.report.terminal import escaped
from dsd_cli.report.two_numbers import missing_json, two_answers, unexplained_json
from dsd_cli.report.validation import validation_json, validation_lines
from dsd_cli.report.values_table import correlations_json, print_values
from dsd_cli.report.verdict import late_text, verdict_line
from dsd_cli.report.versus import moved_json, print_moved
from dsd_cli.signals.units import Units

#: Characters of the longest bar.
BAR = 14
_SIGMAS = "sigma: by the errors of both fits alone; `from its prior` above: with the spread between machines as well"
_EIGHTHS = " ▏▎▍▌▋▊▉█"


@dataclass(frozen=True)
class LadderReport:
    """A ladder and where it came from and went; `config` None: nothing was written."""

    result: Ladder
    logs: tuple[str, ...]
    config: str | None = None
    dropped: Mapping[str, int] = field(default_factory=dict)
    reading: tuple[str, ...] = ()
    validation: tuple[Validation, ...] = ()
    moved: tuple[Moved, ...] = ()

    @property
    def warnings(self) -> tuple[str, ...]:
        """Of reading the logs, and of the last diagnosis."""
        return once((*self.reading, *self.result.last.warnings, *self.result.warnings))


def improve_json(report: LadderReport) -> dict[str, Any]:
    """The object of the contract."""
    result = report.result
    return {
        **head("improve", report.logs),
        "holdout": list(result.holdout),
        **balance_json(result.last.band_hz, result.last.floor, result.last.units),
        "ladder": [_step_json(step, result) for step in result.steps],
        "validation": [validation_json(one) for one in report.validation],
        **({"moved": [moved_json(one) for one in report.moved]} if report.moved else {}),
        "values": estimates_json(result.values),
        "correlations": correlations_json(result.correlations),
        **levels_json(result.levels),
        "missing": missing_json(result.missing),
        "unexplained": unexplained_json(result.last.unexplained),
        "verdict": result.verdict,
        "probability": number_or_none(result.last.probability),
        "against_told": against_json(result.last),
        "verdict_text": final_line(result),
        "stopped": result.stopped,
        "config": report.config,
        "warnings": list(report.warnings),
        "dropped": [{"reason": reason, "count": count} for reason, count in report.dropped.items()],
    }


def _step_json(step: Step, result: Ladder) -> dict[str, Any]:
    done = {"step": step.step, "effect": step.effect, "kind": step.kind.replace(" ", "_")}
    return {**done, **score_json(step.score), "values": estimates_json(brought(step, result))}


def own(step: Step) -> Estimates:
    """The values that a step brought: those of its effect by parameter; after a refit all."""
    mine = own_values(step.estimates, step.effect)
    return mine or ({} if step.step == 0 else dict(step.estimates))


def brought(step: Step, result: Ladder) -> Estimates:
    """The values of a step's effect as the model at the end has them: fitted before what came later they are biased,
    and what the end has no more stands without a standard error."""
    mine = {} if step.kind == "taken back" else own(step)
    if step is result.steps[-1]:
        return mine
    at_end = own_values(result.values, step.effect) or result.values
    return {name: at_end.get(name, one) for name, one in without_errors(mine).items()}


def final_line(result: Ladder) -> str:
    """What was reached, what is left, and why it stopped."""
    first, last = result.steps[0].score, result.steps[-1].score
    fell = change_text(first.heldout_rmse, last.heldout_rmse)
    line = (
        f"held-out {force_error(result.last.band_hz)}: {error(first.heldout_rmse)} -> {error(last.heldout_rmse)}"
        f" {result.last.units.force} ({fell}) in {_count(len(result.steps) - 1)}"
    )
    refitted = error(result.last.refitted.heldout_rmse)
    if len(result.steps) == 1 and refitted not in ("-", error(last.heldout_rmse)):
        line += f" ({refitted} with the values of [model] fitted again)"
    judged = result.verdict in (NONE, UNKNOWN) or result.verdict == result.last.verdict
    if judged:
        line += f"; {verdict_line(_judged(result))}"
    there = [step.effect for step in result.steps if step.effect in (DELAY, *result.steps[-1].model.effects)]
    line += late_text((name for name in there if name != result.verdict), result.last.provenance)
    return f"{line}; stopped: {result.stopped}" if result.stopped else line


def learnt(result: Ladder) -> bool:
    """Whether the model at the end has a law that was learnt."""
    return any(step.kind == LEARNT for step in result.steps)


def _judged(result: Ladder) -> Diagnosis:
    """The last diagnosis, of the model at the end: where an effect was taken back, that is another one."""
    if len(result.steps) == 1:
        return result.last
    return replace(result.last, refitted=result.steps[-1].score)


def _count(steps: int) -> str:
    return "1 step" if steps == 1 else f"{steps} steps"


def step_line(step: Step, before: Step | None) -> str:
    """One rung, as it is taken."""
    fell = f" ({change_text(before.score.heldout_rmse, step.score.heldout_rmse)})" if before else ""
    values = values_text(without_errors(own(step))) if before and step.kind != "taken back" else ""
    return f"step {step.step}: {done(step)}: held-out force error {error(step.score.heldout_rmse)}{fell}" + (
        f"; {values}" if values else ""
    )


def print_ladder(report: LadderReport, file: Any) -> None:
    """For a person: a bar per rung."""
    console = terminal.console(file)
    result = report.result
    errors = [step.score.heldout_rmse for step in result.steps]
    top = max((e for e in errors if math.isfinite(e)), default=math.nan)
    held = f"held-out {force_error(result.last.band_hz)} ({result.last.units.force})"
    table = plain_table(f"{', '.join(report.logs)}: {held}", "step", "error", "", "fell by", "fit")
    table.columns[2].justify = "left"
    for i, step in enumerate(result.steps):
        table.add_row(
            named(f"{step.step} {done(step)}", brought(step, result)),
            error(errors[i]),
            bar(errors[i], top, _encoding(file)),
            fall_text(errors[i - 1], errors[i]) if i else "",
            fit_text(step.score.fit_percent),
        )
    console.print(table)
    if report.dropped:
        counts = ", ".join(f"{reason} {count:,}" for reason, count in report.dropped.items())
        console.print(escaped(f"rows not taken as they are: {counts}"))
    print_values(console, _title(result), result.values, result.correlations, kept_values(result.last.warnings))
    if report.moved:
        print_moved(console, "prior", "this machine", report.moved)
        if any(math.isfinite(one.sigma) for one in report.moved):
            console.print(_SIGMAS)
    for one in report.validation:
        for line in validation_lines(one, result.last.units):
            console.print(escaped(line))
    back = {step.effect for step in result.steps if step.kind == "taken back"}
    added = [step.effect for step in result.steps if step.effect not in back]
    for line in [] if result.last.blocked else two_answers(result.missing, result.last, added):
        console.print(escaped(line))
    print_legend(console, result.last.units)
    console.print(f"[bold]{escaped(final_line(result))}[/bold]")


def _title(result: Ladder) -> str:
    if len(result.steps) > 1:
        return "values at the end"
    held = all(one.held for one in result.values.values())
    return (
        "values of [model]" if held else "values of [model] fitted again (nothing was taken: the config keeps its own)"
    )


def print_legend(console: Any, units: Units) -> None:
    """What the letters in the units are."""
    if units.legend:
        console.print(units.legend)


def done(step: Step) -> str:
    """What a step did, in words."""
    return f"{step.effect} {step.kind}" if step.kind in ("taken back", "learnt") else step.effect


def fit_text(percent: float) -> str:
    """Fit percent with one digit."""
    return f"{percent:.1f} %" if math.isfinite(percent) else "-"


def _encoding(file: Any) -> str:
    return getattr(file, "encoding", None) or "ascii"


def bar(value: float, top: float, encoding: str) -> str:
    """A bar of length value / top, in eighths of a character where the encoding has them."""
    if not (math.isfinite(value) and math.isfinite(top)) or top <= 0.0:
        return ""
    length = BAR * min(max(value / top, 0.0), 1.0)
    try:
        _EIGHTHS.encode(encoding)
    except (UnicodeEncodeError, LookupError):
        return "#" * max(round(length), 1)
    eighths = max(round(8 * length), 1)
    return _EIGHTHS[-1] * (eighths // 8) + _EIGHTHS[eighths % 8].strip()
