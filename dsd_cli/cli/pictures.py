"""--plot FILE: what all commands that draw share."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Annotated, Any

import typer

from dsd_cli.errors import printable

PlotOption = Annotated[
    Path | None, typer.Option("--plot", metavar="FILE", help="Picture to draw (.png, .svg or .pdf).")
]


def check_plot(plot: Path | None, inputs: Iterable[str | Path]) -> None:
    """Whether the picture can be drawn, before anything is computed.

    Raises
    ------
    UsageError : another suffix, one of the inputs, or no matplotlib.
    DataError : it is a directory, or its folder is not there.
    """
    if plot is None:
        return
    import importlib.util

    from dsd_cli.errors import UsageError
    from dsd_cli.files.whole import check_target
    from dsd_cli.report.figure import FORMATS

    if plot.suffix.lower() not in FORMATS:
        raise UsageError(f"--plot {plot}: not known what to draw", f"end the name in {', '.join(FORMATS)}")
    check_target(plot, inputs)
    if importlib.util.find_spec("matplotlib") is None:
        raise UsageError("--plot needs matplotlib", "pip install matplotlib")


def put_picture(plot: Path, draw: Callable[[], Any], quiet: bool) -> None:
    """Draw the figure that `draw` makes, after everything else: it appears whole or not at all.

    A picture that fails costs no result and no exit code: it is a warning, said also where messages are not wanted,
    for somebody waits for the file.
    """
    from dsd_cli.errors import DsdError
    from dsd_cli.files.whole import write_whole
    from dsd_cli.report.figure import rendered

    try:
        write_whole(plot, rendered(draw, plot.suffix))
    except DsdError as error:
        _failed(error.message)
    except Exception as error:  # whatever a drawing library does, the result stands
        _failed(f"{plot}: cannot be drawn ({type(error).__name__}: {error})")
    else:
        if not quiet:
            typer.echo(printable(f"{plot}: drawn"), err=True)


def _failed(why: str) -> None:
    typer.echo(printable(f"dsd: warning: {why}; the rest is done"), err=True)
