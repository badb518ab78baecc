"""The loop of `dsd improve`: who decides on the next effect, and how its steps get into the config."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from dsd_cli.cli.options import Format
from dsd_cli.errors import UsageError, printable
from dsd_cli.identify.results import NONE, UNKNOWN, Diagnosis, Estimates, Score, Step
from dsd_cli.report.in_units import in_units

if TYPE_CHECKING:
    from dsd_cli.cli.progress import Progress
    from dsd_cli.files.config import History
    from dsd_cli.files.config.edit import Origin
    from dsd_cli.signals.units import Units


#: Digits of a correlation: two values that only their sum tells are at 0.9999.
CORRELATION_DIGITS = 6


def check_outputs(output: str | None, form: Format, inputs: Sequence[str | Path]) -> None:
    """Whether the config can be written, before anything is computed.

    Raises
    ------
    UsageError : config and JSON on stdout, or over a log.
    DataError : the folder is not there or cannot be written to.
    """
    from dsd_cli.files.config.edit import check_config_output

    if output == "-" and form is Format.JSON:
        raise UsageError("-o - and --format json", "stdout can take one of them; name a file with -o")
    if output is not None:
        check_config_output(output, inputs)


def put_config(output: str, text: str, origin: Origin | None = None) -> None:
    """Write the config, whole or not at all, if it is one that `dsd` reads; - is stdout.

    Raises
    ------
    DataError : it cannot be written, or it is the `origin` and another process has changed it meanwhile.
    """
    from dsd_cli.files.config import parse_config
    from dsd_cli.files.config.edit import write_text

    parse_config(text, output)
    if output == "-":
        sys.stdout.write(text)
        sys.stdout.flush()
    else:
        write_text(output, text, origin)


def with_steps(text: str, start: Score, steps: Sequence[Step], logs: Sequence[str], units: Units) -> str:
    """The config after these steps, each in its history; `units` are those that their estimates are in."""
    from dsd_cli.files.config.edit import with_model, with_step

    score = start
    for step in steps:
        changed = with_model(text, step.model, step.estimates)
        text = with_step(changed, _record(step, score, logs, units), before=text)
        score = step.score
    return text


def _record(step: Step, before: Score, logs: Sequence[str], units: Units) -> History:
    from dsd_cli.files.config import History
    from dsd_cli.files.config.edit import now, rounded
    from dsd_cli.report.ladder import own
    from dsd_cli.report.names import number_or_none

    estimates, gone = own(step), step.kind == "taken back"
    errors = {name: number_or_none(e.std_error) for name, e in estimates.items()}
    listed = {k: v for k, v in step.model.effects.get(step.effect, {}).items() if isinstance(v, list | tuple)}
    values = {
        name: rounded(e.value, e.std_error) for name, e in estimates.items() if number_or_none(e.value) is not None
    }
    return History(
        effect=step.effect,
        taken_back=gone,
        date=now(),
        logs=tuple(log.encode(errors="backslashreplace").decode() for log in logs),  # a file name may be no text
        rmse_before=number_or_none(before.rmse),
        rmse_after=number_or_none(step.score.rmse),
        heldout_rmse_before=number_or_none(before.heldout_rmse),
        heldout_rmse_after=number_or_none(step.score.heldout_rmse),
        values={**values, **listed},
        std_errors={name: rounded(e, e) for name, e in errors.items() if e},
        fitted={name: rounded(e.value, e.std_error) for name, e in step.estimates.items()},
        fitted_errors={
            name: rounded(e.std_error, e.std_error) for name, e in step.estimates.items() if number_or_none(e.std_error)
        },
        fitted_correlations={
            name: {
                other: round(r, CORRELATION_DIGITS) for other, r in e.correlations.items() if other in step.estimates
            }
            for name, e in step.estimates.items()
            if e.correlations
        },
        units=_units(step.estimates, units),
        levels={x.deviations.name: [rounded(e.value, e.std_error) for e in x.values] for x in step.levels},
        level_errors={x.deviations.name: [rounded(e.std_error, e.std_error) for e in x.values] for x in step.levels},
    )


def _units(estimates: Estimates, units: Units) -> dict[str, str]:
    """Of the errors and of the values that have one; none where the user did not name his."""
    if units.legend:
        return {}
    return {"rmse": units.force} | {name: e.unit for name, e in estimates.items() if e.unit not in ("", "1")}


def follow(diagnosis: Diagnosis) -> str | None:
    """--auto: take what the diagnosis finds, until it finds nothing that it can name, or nothing but
    what may compensate for a value that was given wrongly.
    """
    if diagnosis.verdict in (NONE, UNKNOWN):
        return None
    if diagnosis.verdict not in diagnosis.stand_ins:
        return diagnosis.verdict
    ranked = [c.effect for c in diagnosis.ranking if c.model is not None]
    return next((e for e in ranked if e in diagnosis.found and e not in diagnosis.stand_ins), None)


class Asker:
    """Shows each diagnosis on the terminal and asks what to do."""

    def __init__(self, progress: Progress, units: Units) -> None:
        self._progress, self._units = progress, units

    def __call__(self, diagnosis: Diagnosis) -> str | None:
        from dsd_cli.report.diagnosis import DiagnosisReport, print_table

        self._progress.clear()
        print_table(DiagnosisReport(in_units(diagnosis, self._units)), sys.stderr, brief=True)
        found = follow(diagnosis)
        while True:
            question = f"add {found}? [y]es / [n]o stop / name of another effect: "
            if found is None:
                question = "[n]o stop / name of an effect to add all the same: "
            print(question, end="", file=sys.stderr, flush=True)
            line = sys.stdin.readline()
            if not line:
                print(file=sys.stderr)
                return None
            answer = line.strip()
            if answer.lower() in ("n", "no"):
                return None
            if answer.lower() in ("y", "yes") and found is not None:
                return found
            if answer and self._can_add(diagnosis, answer):
                return answer

    @staticmethod
    def _can_add(diagnosis: Diagnosis, answer: str) -> bool:
        from dsd_cli.effects import find_effect
        from dsd_cli.files.config.rules import suggestion

        ranked = {c.effect: c.untestable for c in diagnosis.ranking}
        if answer in ranked:
            why = ranked[answer]
        elif find_effect(answer) is not None:
            why = "it is in the model, or cannot be tried on this log"
        else:
            why = f"no such effect; {suggestion(answer, ranked)}"
        if why:
            print(printable(f"{answer}: {why}"), file=sys.stderr)
        return not why
