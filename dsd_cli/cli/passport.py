"""`dsd passport`: sign the values of an axis, within limits, log by log."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from dsd_cli.cli.identification import LogsArgument
from dsd_cli.cli.options import (
    EffectsFromOption,
    FixOption,
    Format,
    FormatOption,
    FromOption,
    QuietOption,
    SetOption,
    ToOption,
)

if TYPE_CHECKING:
    from dsd_cli.cli.identification import Given
    from dsd_cli.cli.progress import Progress
    from dsd_cli.files.config import Config
    from dsd_cli.files.limits import Limits
    from dsd_cli.passport import Limit, Passport, Reading, Reference
    from dsd_cli.report.passport import Signed

ModelArgument = Annotated[Path, typer.Argument(metavar="CONFIG", help="Config with the model as it was delivered.")]
LimitsOption = Annotated[
    Path, typer.Option("--limits", metavar="FILE", help="What each value may be: docs/passport.md.")
]
PassportOutput = Annotated[
    str | None, typer.Option("-o", "--output", metavar="FILE", help="Passport to write (JSON); - is stdout.")
]


def passport(
    config: ModelArgument,
    logs: LogsArgument,
    limits: LimitsOption,
    output: PassportOutput = None,
    form: FormatOption = Format.TABLE,
    fix: FixOption = None,
    start: FromOption = None,
    end: ToOption = None,
    override: SetOption = None,
    effects_from: EffectsFromOption = None,
    quiet: QuietOption = False,
) -> None:
    """Fit the values of CONFIG to each LOG anew, and compare them with limits around the values as delivered.

    The newest log decides (by the date in its name or in the file, else the last one given). Exit code 3 if it is
    outside of a limit, or if that cannot be decided: one line says what changed, by how many sigma, and since which
    log.
    """
    import sys

    from dsd_cli.cli.identification import check_logs, load_given, say, warn
    from dsd_cli.cli.plan import widening
    from dsd_cli.cli.progress import Progress
    from dsd_cli.cli.user_effects import use_effects
    from dsd_cli.errors import CheckFailed
    from dsd_cli.files.config import load_config
    from dsd_cli.files.limits import load_limits
    from dsd_cli.report.passport import print_passport, verdict_line

    use_effects(effects_from)
    settings = load_config(config, override or ()).within(start, end).knowing(fix or ())
    wanted = load_limits(limits)
    check_logs(logs, [], settings.signals)
    reference, told = _delivered(wanted, limits, settings)
    _check_names(wanted.limits, reference, limits)
    _check_output(output, form, [config, limits, *logs, *settings.files, *(effects_from or ())])
    with Progress(not quiet) as progress, widening(settings.signals):
        given = load_given(settings, logs, (), progress)
        found = _found(given, logs, wanted.limits, reference, progress)
    units = settings.signals.units
    warn(quiet, found.warnings)
    if form is Format.JSON or output is not None:
        _put(found, _signed(config, limits, logs, told), output, form, settings)
    if form is not Format.JSON and output != "-":
        print_passport(found, units, sys.stdout)
    if output not in (None, "-"):
        say(quiet, f"wrote {output}")
    if found.failed:
        raise CheckFailed(verdict_line(found, units))


def _check_output(output: str | None, form: Format, inputs: Sequence[str | Path]) -> None:
    """Raises UsageError : two things on stdout, or over an input. DataError : it cannot be written there."""
    from dsd_cli.errors import UsageError
    from dsd_cli.files.whole import check_target

    if output == "-" and form is Format.JSON:
        raise UsageError("-o - and --format json", "are the same; one of them")
    if output not in (None, "-"):
        check_target(str(output), inputs)


def _delivered(limits: Limits, path: Path, settings: Config) -> tuple[dict[str, Reference], dict[str, str | None]]:
    """(value -> as it was delivered, what says so); the config itself where the limits name nothing else."""
    from dsd_cli.files.config import load_config
    from dsd_cli.files.limits import delivered, load_passport

    if limits.reference is None:
        return _of_config(settings), {"file": settings.name, "kind": "config", "date": _step_date(settings)}
    file = path.parent / limits.reference
    if file.suffix == ".json":
        found = load_passport(file)
        return delivered(found, str(file)), {"file": str(file), "kind": "passport", "date": found.get("date")}
    other = load_config(file)
    return _of_config(other), {"file": str(file), "kind": "config", "date": _step_date(other)}


def _of_config(config: Config) -> dict[str, Reference]:
    """The values of [model], their errors and the force error out of the last step of [[history]]."""
    import math

    from dsd_cli.cli.recordings import believed_model
    from dsd_cli.cli.versus import fitted_errors
    from dsd_cli.identify.fit.values import flat
    from dsd_cli.passport import RMSE, Reference

    errors = fitted_errors(config)
    values = flat(believed_model(config))
    found = {name: Reference(value, errors.get(name, math.nan)) for name, value in values.items()}
    left = config.history[-1].heldout_rmse_after if config.history else None
    return found if left is None else {**found, RMSE: Reference(left)}


def _step_date(config: Config) -> str | None:
    return config.history[-1].date if config.history else None


def _check_names(limits: Mapping[str, Limit], reference: Mapping[str, Reference], path: Path) -> None:
    """Raises UsageError : a limit on a value that was not delivered, or a share of 0."""
    from dsd_cli.errors import UsageError
    from dsd_cli.files.config.rules import suggestion
    from dsd_cli.passport import RMSE

    for name, limit in limits.items():
        if name == RMSE and name not in reference and not limit.relative and limit.within == float("inf"):
            continue
        if name not in reference:
            hint = "the config has no [[history]] with it" if name == RMSE else suggestion(name, reference)
            raise UsageError(f"{path}: limits.{name}: the delivered model has no such value", hint)
        if limit.relative and reference[name].value == 0.0:
            raise UsageError(f"{path}: limits.{name}: was delivered as 0", "write its change as a number, without %")


def _found(
    given: Given,
    logs: Sequence[str],
    limits: Mapping[str, Limit],
    reference: Mapping[str, Reference],
    progress: Progress,
) -> Passport:
    """Each log by itself, in the order of their dates where every one has one."""
    import math
    from dataclasses import replace

    from dsd_cli.cli.fleet_tasks import date_in, recorded_date
    from dsd_cli.passport import RMSE, Passport, Reference, judge, read_values
    from dsd_cli.report.in_units import in_units

    readings: list[Reading] = []
    for log, recording in zip(logs, given.recordings, strict=True):
        progress(f"fitting {log}")
        date = date_in(log) or ("" if log == "-" else recorded_date(log))
        readings.append(read_values(recording, given.model, given.engine_settings, log, date))
    if all(one.date for one in readings):
        readings.sort(key=lambda one: one.date)
    units = given.settings.signals.units
    readings = [replace(one, estimates=in_units(one.estimates, units)) for one in readings]
    known = {RMSE: Reference(math.nan), **reference}
    judged = judge(limits, known, readings)
    earlier = [
        f"{one.name} was outside of its limits in {', '.join(one.outside)}, and is not in {readings[-1].log}"
        for one in judged
        if one.outside and one.since is None
    ]
    return Passport(judged, tuple(readings), (*given.warnings, *earlier))


def _signed(config: Path, limits: Path, logs: Sequence[str], reference: Mapping[str, str | None]) -> Signed:
    import hashlib

    from dsd_cli import __version__
    from dsd_cli.cli.report_story import source_file
    from dsd_cli.files.config.edit import now
    from dsd_cli.report.passport import Signed

    files = {
        name: {"file": str(path), "sha256": hashlib.sha256(path.read_bytes()).hexdigest()}
        for name, path in (("config", config), ("limits_file", limits))
    }
    hashes = {log: (source_file(log).sha256 or None) if Path(log).is_file() else None for log in logs}
    return Signed(now(), __version__, files, hashes, reference)


def _put(found: Passport, signed: Signed, output: str | None, form: Format, settings: Config) -> None:
    """The document with its hash, on stdout or into a file, or both."""
    from dsd_cli.cli.identification import print_json
    from dsd_cli.files.limits import HASH, content_hash
    from dsd_cli.files.whole import write_whole
    from dsd_cli.report.passport import passport_json
    from dsd_cli.report.terminal import json_text

    document: dict[str, Any] = passport_json(found, signed, settings.signals.units)
    document[HASH] = content_hash(document)
    if output not in (None, "-"):
        write_whole(str(output), (json_text(document, indent=2) + "\n").encode())
    if form is Format.JSON or output == "-":
        print_json(document)
