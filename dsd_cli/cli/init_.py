"""`dsd init`: a commented config to start from."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from dsd_cli.cli.options import QuietOption


def init(
    template: Annotated[
        str,
        typer.Option(
            "--template",
            metavar="NAME",
            help="lab (your own recording), paper-step, paper-sine, paper-delay-change or servo.",
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
        typer.echo(f"wrote {output} (template {template}); next: {after}", err=True)


def _write(path: Path, text: str, force: bool) -> None:
    from dsd_cli.errors import DataError, UsageError

    if path.exists() and not force:
        raise UsageError(f"{path} exists", "name another file with -o, or overwrite it with --force")
    partial = path.with_name(f".{path.name}.part")
    try:
        partial.write_text(text, encoding="utf-8")
        partial.replace(path)
    except OSError as error:
        partial.unlink(missing_ok=True)
        raise DataError(f"{path}: cannot be written", error.strerror or str(error)) from error
