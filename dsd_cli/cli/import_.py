"""`dsd import`: a joint of a simulator, or a table of values, as [model] of a config."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from dsd_cli.cli.add import OutputNeeded
from dsd_cli.cli.options import Format, FormatOption, QuietOption

if TYPE_CHECKING:
    from dsd_cli.export.reading.found import Found

FileArgument = Annotated[Path, typer.Argument(metavar="FILE", help="MJCF, URDF, or values by name (CSV, text).")]
JointOption = Annotated[
    str | None, typer.Option("--joint", metavar="NAME", help="Which joint, where there are several.")
]


def import_(
    file: FileArgument,
    output: OutputNeeded,
    joint: JointOption = None,
    form: FormatOption = Format.TABLE,
    quiet: QuietOption = False,
) -> None:
    """Write a config with the model that FILE has of a joint, so that `dsd compare LOG -c` says what it lacks.

    What was not understood, or is nothing of a single joint, is said on stderr and in the config.
    """
    from dsd_cli.cli.identification import print_json, say, warn
    from dsd_cli.cli.improve_loop import check_outputs, put_config
    from dsd_cli.export.reading.joints import read_joint
    from dsd_cli.report.imported import imported_json, imported_text, print_imported

    check_outputs(output, form, [file])
    found = read_joint(file, joint)
    text = _config(found, imported_text(found, str(file)))
    _check(file, text)
    put_config(output, text)
    warn(quiet, (f"{file}: not taken: {one}" for one in found.missed))
    if form is Format.JSON:
        print_json(imported_json(found, str(file), output))
    elif output != "-" and not quiet:
        import sys

        print_imported(found, str(file), sys.stdout)
    if output != "-":
        say(quiet, f"wrote {output}")


def _check(file: Path, text: str) -> None:
    """Raises DataError : values that no config can have."""
    from dsd_cli.errors import DataError, UsageError
    from dsd_cli.files.config import parse_config

    try:
        parse_config(text, str(file))
    except UsageError as error:
        raise DataError(error.message, error.hint) from None


def _config(found: Found, head: str) -> str:
    """The config; the observer is one that suits any log, for `compare` judges forces."""
    from dsd_cli.files.config.edit import literal, with_model

    model: Any = found.model
    inertia = f"{model.inertia:.15g}"
    observer = f"[observer]\nnominal_inertia = {inertia}\ntime_constant = 0.005\n"
    position = found.units.position or ("m" if found.linear else "")
    told = {"u_unit": found.units.u, "position_unit": position}
    lines = [f"{name} = {literal(unit)}\n" for name, unit in told.items() if unit]
    signals = "".join(["[signals]\n", *lines, "\n"]) if lines else ""
    return with_model(f"{head}\n{signals}{observer}\n[model]\ninertia = {inertia}\n", model, {})
