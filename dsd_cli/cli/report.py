"""`dsd report`: one page of all that a log says, from its quality to the config that results."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from dsd_cli.cli.identification import HoldoutOption
from dsd_cli.cli.options import (
    CONFIG_FILE,
    BoundsOption,
    ConfigOption,
    EffectsFromOption,
    FixOption,
    FromOption,
    PriorOption,
    QuietOption,
    SetOption,
    ToOption,
)

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

LogsArgument = Annotated[list[str], typer.Argument(metavar="LOG...", help="Log files (CSV, Parquet, MF4, ...).")]
PageOption = Annotated[
    str | None, typer.Option("-o", "--output", metavar="FILE", help="Page to write (.html); - is stdout. Needed.")
]
HoldOption = Annotated[
    bool, typer.Option("--hold", help="Fit nothing that [model] has: a known machine. Also: fit.hold.")
]
LearnOption = Annotated[
    bool,
    typer.Option("--learn", help="Where the ladder ends in unknown: learn the law, show it, put it into the config."),
]


def report(
    log: LogsArgument,
    config: ConfigOption = CONFIG_FILE,
    output: PageOption = None,
    holdout: HoldoutOption = None,
    hold: HoldOption = False,
    learn: LearnOption = False,
    fix: FixOption = None,
    bounds: BoundsOption = None,
    prior: PriorOption = None,
    start: FromOption = None,
    end: ToOption = None,
    override: SetOption = None,
    effects_from: EffectsFromOption = None,
    quiet: QuietOption = False,
) -> None:
    """Write one HTML page of what LOG says: check, detect, compare, diagnose and improve in one.

    The page needs no network and holds everything: the quality of the log, the labels, where the model fails, what is
    missing, each step of `improve --auto`, the values and what they are worth, the experiment that would identify
    more, the config that results. What cannot be done with this log is said on the page.
    """
    from dsd_cli.cli.identification import check_logs
    from dsd_cli.cli.report_story import Teller, tell
    from dsd_cli.cli.user_effects import use_effects
    from dsd_cli.files.config import load_config
    from dsd_cli.files.config.edit import read_origin
    from dsd_cli.report.page.page import render

    apart = holdout or []
    page = _checked_output(output, [config, *log, *apart, *(effects_from or ())])
    use_effects(effects_from)
    origin = read_origin(config)
    settings = load_config(config, override or ()).within(start, end)
    settings = settings.knowing(fix or (), bounds or (), prior or (), hold)
    check_logs(log, apart, settings.signals)
    _checked_output(output, settings.files)
    _refuse_streams([*log, *apart])
    teller = Teller(settings, tuple(log), tuple(apart), quiet, learn)
    story = tell(teller, origin, [*settings.files, *(effects_from or ())])
    _put(page, render(story), quiet)


def _checked_output(output: str | None, inputs: Sequence[str | Path]) -> str:
    """Whether the page can be written, before anything is computed.

    Raises
    ------
    UsageError : there is none, another suffix, or one of the inputs.
    DataError : it is a directory, or its folder is not there or cannot be written to.
    """
    from dsd_cli.errors import UsageError
    from dsd_cli.files.config.edit import check_config_output

    if output is None:
        raise UsageError("-o is missing", "name the page to write: -o report.html")
    if output != "-":
        if not output.lower().endswith((".html", ".htm")):
            raise UsageError(f"-o {output}: a page is written as HTML", "end the name in .html")
        check_config_output(output, inputs)
    return output


def _refuse_streams(logs: Sequence[str]) -> None:
    """Raises UsageError : a log that can be read only once."""
    from dsd_cli.errors import UsageError, source_name
    from dsd_cli.files.tables_in import is_stream

    for log in logs:
        if is_stream(log):
            name = source_name(log)
            raise UsageError(f"{name}: a page needs a log several times", "save it as a file first")


def _put(output: str, content: bytes, quiet: bool) -> None:
    import sys

    from dsd_cli.cli.identification import say
    from dsd_cli.files.whole import write_whole

    if output == "-":
        sys.stdout.flush()
        sys.stdout.buffer.write(content)
        sys.stdout.flush()
        return
    write_whole(output, content)
    say(quiet, f"wrote {output} ({len(content) / 1e6:.2g} MB)")
