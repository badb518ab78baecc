"""`dsd init`: a commented config to start from."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from dsd_cli.cli.options import QuietOption, template_names
from dsd_cli.errors import printable


def init(
    log: Annotated[
        str | None, typer.Argument(metavar="[LOG]", help="A log of your rig: the config is proposed from it.")
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
    output: Annotated[
        str, typer.Option("-o", "--output", metavar="FILE", help="File to write; - is stdout.")
    ] = "dsd.toml",
    force: Annotated[bool, typer.Option("--force", help="Overwrite an existing file.")] = False,
    quiet: QuietOption = False,
) -> None:
    """Write a commented dsd.toml: from a log of yours, for a recording to come, or for a simulation that runs as it is.

    With LOG, its columns, units, sample time, and proposals for delay, inertia, rho and window come from its header and
    its first rows; every guess is said.
    """
    from dsd_cli.errors import UsageError
    from dsd_cli.files.template import template_text

    said: list[str] = []
    if log is None:
        template = template or "lab"
        text, origin = template_text(template), f"template {template}"
    elif template is not None:
        raise UsageError("a template is no config for a log", "give a log or --template")
    else:
        from dsd_cli.cli.init_log import propose
        from dsd_cli.cli.progress import Progress

        with Progress(not quiet) as progress:
            progress(f"looking at {Path(log).name}")
            text, said = propose(log)
        origin = f"from {log}"
    if output == "-":
        typer.echo(text, nl=False)
    else:
        _write(Path(output), text, force, () if log is None else (log,))
    if quiet:
        return
    for line in said:
        typer.echo(printable(f"  {line}"), err=True)
    if output != "-":
        simulated = log is None and template != "lab"
        named = "" if output == "dsd.toml" else f" -c {output}"
        after = f"simulate{named} -o log.csv" if simulated else f"check {log or 'LOG'}{named}"
        typer.echo(printable(f"wrote {output} ({origin}); next: dsd {after}"), err=True)
        typer.echo("then: dsd compare, diagnose, improve (what is missing?) or dsd detect (which state now?)", err=True)


def _write(path: Path, text: str, force: bool, inputs: tuple[str, ...]) -> None:
    from dsd_cli.errors import UsageError
    from dsd_cli.files.whole import check_target, write_whole

    if path.is_file() and not force:
        raise UsageError(f"{path} exists", "name another file with -o, or overwrite it with --force")
    check_target(path, inputs)
    write_whole(path, text.encode())
