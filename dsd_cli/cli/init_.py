"""`dsd init`: a commented config to start from."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING, Annotated, Any

import typer

from dsd_cli.cli.options import QuietOption, template_names
from dsd_cli.errors import DsdError, printable, source_name
from dsd_cli.signals.units import SHORTEST

if TYPE_CHECKING:
    from dsd_cli.cli.init_log import Asked, Proposed


def _column(of: str) -> Any:
    return typer.Option(metavar="NAME", help=f"Column of the {of}, by its name or its number.")


UColumn = Annotated[str | None, _column("control input (torque, force, current or voltage)")]
PositionColumn = Annotated[str | None, _column("measured position")]
VelocityColumn = Annotated[str | None, _column("measured velocity")]
TimeColumn = Annotated[str | None, _column("time")]


def init(
    log: Annotated[
        str | None,
        typer.Argument(metavar="[LOG]", help="A log of your rig: the config is proposed from it; - is stdin."),
    ] = None,
    template: Annotated[
        str | None,
        typer.Option(
            "--template",
            metavar="NAME",
            autocompletion=template_names,
            help="lab (your own recording), paper-step, paper-sine, paper-delay-change, damping or servo.",
        ),
    ] = None,
    u: UColumn = None,
    position: PositionColumn = None,
    velocity: VelocityColumn = None,
    time: TimeColumn = None,
    override: Annotated[
        list[str] | None,
        typer.Option(
            "--set", metavar="KEY=VALUE", help="Value written into the config, e.g. signals.u_sign=-1 or csv.header=4."
        ),
    ] = None,
    output: Annotated[
        str, typer.Option("-o", "--output", metavar="FILE", help="File to write; - is stdout.")
    ] = "dsd.toml",
    force: Annotated[bool, typer.Option("--force", help="Overwrite an existing file.")] = False,
    quiet: QuietOption = False,
) -> None:
    """Write a commented dsd.toml: from a log of yours, for a recording to come, or for a simulation that runs as it is.

    With LOG, what each column is comes from its name and unit, else from what it does: what rises evenly is the time,
    what is the slope of another is its velocity, what acceleration and friction explain is the control input. Every
    guess is said. Where one is missing it is asked for, or the command that names it is printed and the rest written.
    """
    from dsd_cli.errors import DataError, UsageError
    from dsd_cli.files.template import template_text

    named = {role: column for role, column in zip(_NAMED, (u, position, velocity, time), strict=True) if column}
    if log is not None and template is not None:
        raise UsageError("a template is no config for a log", "give a log or --template")
    if log is None:
        if named or override:
            raise UsageError("--u, --position, --velocity, --time and --set say what is in a log", "give the log, too")
        template = template or "lab"
        _put(template_text(template), [], f"template {template}", log, template, (output, force, quiet))
        return
    proposed = _proposed(log, _asked(named, override or [], output, quiet), quiet)
    left = proposed.question or str(proposed.unread or "")
    _put(proposed.text, proposed.said, f"from {source_name(log)}", log, left, (output, force, quiet))
    if proposed.unread is not None:
        name, why = source_name(log), proposed.unread
        what = why.message.removeprefix(name).lstrip(":, ")
        where = "" if output == "-" else f"; the numbers in {output} are the template's"
        raise DataError(f"{name}: its rows could not be read: {what}{where}", why.hint)
    if proposed.question:
        where = "" if output == "-" else f"; {output} has the rest, with that line marked"
        raise DataError(f"{source_name(log)}: {proposed.question}{where}", _say(proposed.command, output, override))


def _say(command: str, output: str, override: list[str] | None) -> str:
    """The command that answers a question with what else was on the command line; columns that are set are in it.

    Without a command no column is left that could be named.
    """
    if not command:
        return "record a motion together with its torque, force, current or voltage"
    texts = [text for text in override or [] if text.partition("=")[0] not in [f"signals.{role}" for role in _NAMED]]
    named = f" -o {quote(output)}" * (output != "dsd.toml")
    return "".join([f"say it: {command}{named}", *(f" --set {quote(text)}" for text in texts)])


#: Columns that the command line names.
_NAMED = ("u", "position", "velocity", "time")


def _asked(named: dict[str, str], override: list[str], output: str, quiet: bool) -> Asked:
    """What the command line says; on a terminal the rest can be asked for."""
    import sys

    from dsd_cli.cli.init_log import Asked
    from dsd_cli.errors import UsageError
    from dsd_cli.files.config.config import parse_tables, read_config
    from dsd_cli.files.config.overrides import with_values
    from dsd_cli.files.config.signals import COLUMNS
    from dsd_cli.files.template import template_text

    written = with_values({}, override)
    if flat := next((name for name, keys in written.items() if not isinstance(keys, dict)), ""):
        raise UsageError(f"--set {flat}", "--set of init takes SECTION.KEY=VALUE")
    template = parse_tables(template_text("lab"), "template lab")
    template["signals"] = {}  # which are those of the log
    csv = read_config(with_values(template, override), f"{output} with --set" if output != "-" else "--set").csv
    said = {(section, key): value for section, keys in written.items() for key, value in keys.items()}
    tables = {key: value for key, value in said.items() if isinstance(value, dict)}
    values = {key: value for key, value in said.items() if key not in tables}
    person = not quiet and sys.stdin.isatty() and sys.stderr.isatty()
    columns = {role: str(values[("signals", role)]) for role in COLUMNS if values.get(("signals", role))}
    named = columns | named
    return Asked(named, values, csv.layout, _question if person else None, tables)


def _question(missing: str, candidates: Sequence[str]) -> str:
    """Ask for a column: its name, or its place in the list that is shown."""
    if missing == "position_unit":
        return _unit(candidates)
    if missing == "sample_time":
        return _seconds()
    what = "the control input (torque, force, current, voltage)" if missing == "u" else "the position"
    for at, name in enumerate(candidates, start=1):
        typer.echo(printable(f"  {at}: {name}"), err=True)
    answer = str(typer.prompt(f"Which column is {what}? number or name", err=True)).strip()
    return candidates[int(answer) - 1] if answer.isdigit() and 0 < int(answer) <= len(candidates) else answer


def _seconds() -> str:
    """Ask for the time between rows, s; "" for one that is not known."""
    asked = "The log has no time. How many s are its rows apart? Enter: not known"
    while answer := str(typer.prompt(asked, default="", show_default=False, err=True)).strip():
        with suppress(ValueError):
            if SHORTEST <= float(answer) < math.inf:
                return answer
        typer.echo(printable(f'  "{answer}" is no time in s, such as 0.001'), err=True)
    return ""


def _unit(units: Sequence[str]) -> str:
    """Ask for the unit of the position; "" for one that is not known."""
    asked = f"In what unit is the position? {', '.join(units)}; Enter: not known"
    while (answer := str(typer.prompt(asked, default="", show_default=False, err=True)).strip()) not in ("", *units):
        typer.echo(printable(f'  "{answer}" is none of them'), err=True)
    return answer


def _proposed(log: str, asked: Asked, quiet: bool) -> Proposed:
    from dsd_cli.cli.init_log import propose
    from dsd_cli.cli.progress import Progress

    with as_file(log) as path, Progress(not quiet and asked.ask is None) as progress:
        progress(f"looking at {Path(source_name(log)).name}")
        return propose(path, asked, log)


@contextmanager
def as_file(log: str) -> Iterator[str]:
    """A log that can be looked at more than once: what can be read only once is copied first."""
    from dsd_cli.files.tables_in import is_stream

    if not is_stream(log):
        yield log
        return
    import shutil
    import sys
    from tempfile import TemporaryDirectory

    with TemporaryDirectory() as folder:
        copy = Path(folder) / "stdin"
        with copy.open("wb") as file, sys.stdin.buffer if log == "-" else open(log, "rb") as stream:
            shutil.copyfileobj(stream, file)
        try:
            yield str(copy)
        except DsdError as error:  # which names the file that was read
            name = source_name(log)
            raise type(error)(error.message.replace(str(copy), name), error.hint.replace(str(copy), name)) from None


def _put(text: str, said: list[str], origin: str, log: str | None, left: str, how: tuple[str, bool, bool]) -> None:
    """Write the config, say what was guessed and what comes next; `left`: the template, or what is still asked."""
    output, force, quiet = how
    if output == "-":
        typer.echo(text, nl=False)
    else:
        _write(Path(output), text, force, () if log is None else (log,))
    if quiet:
        return
    for line in said:
        typer.echo(printable(f"  {line}"), err=True)
    if output == "-" or (log is not None and left):
        return
    named = "" if output == "dsd.toml" else f" -c {output}"
    after = f"simulate{named} -o log.csv" if log is None and left != "lab" else f"check {log or 'LOG'}{named}"
    typer.echo(printable(f"wrote {output} ({origin}); next: dsd {after}"), err=True)
    typer.echo("then: dsd compare, diagnose, improve (what is missing?) or dsd detect (which state now?)", err=True)


def _write(path: Path, text: str, force: bool, inputs: tuple[str, ...]) -> None:
    from dsd_cli.errors import UsageError
    from dsd_cli.files.whole import check_target, write_whole

    if path.is_file() and not force:
        raise UsageError(f"{path} exists", "name another file with -o, or overwrite it with --force")
    check_target(path, inputs)
    write_whole(path, text.encode())
