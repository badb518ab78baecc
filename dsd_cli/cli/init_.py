"""`dsd init`: a commented config to start from."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from dsd_cli.cli.options import QuietOption
from dsd_cli.errors import printable


def init(
    template: Annotated[
        str,
        typer.Option(
            "--template",
            metavar="NAME",
            help="lab (your own recording), paper-step, paper-sine, paper-delay-change, damping or servo.",
        ),
    ] = "lab",
    output: Annotated[
        str, typer.Option("-o", "--output", metavar="FILE", help="File to write; - is stdout.")
    ] = "dsd.toml",
    force: Annotated[bool, typer.Option("--force", help="Overwrite an existing file.")] = False,
    quiet: QuietOption = False,
) -> None:
    """Write a commented dsd.toml: for your own recording, or a simulation that runs as it is."""
    from dsd_cli.files.template import template_text

    text = template_text(template)
    if output == "-":
        typer.echo(text, nl=False)
        return
    _write(Path(output), text, force)
    if not quiet:
        after = f"dsd detect LOG -c {output}" if template == "lab" else f"dsd simulate -c {output} -o log.csv"
        typer.echo(printable(f"wrote {output} (template {template}); next: {after}"), err=True)


def _write(path: Path, text: str, force: bool) -> None:
    from dsd_cli.errors import UsageError
    from dsd_cli.files.whole import check_target, write_whole

    if path.is_file() and not force:
        raise UsageError(f"{path} exists", "name another file with -o, or overwrite it with --force")
    check_target(path, ())
    write_whole(path, text.encode())
