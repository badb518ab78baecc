"""`dsd detect`: label every sample of a log."""

from __future__ import annotations

from enum import StrEnum
from typing import TYPE_CHECKING, Annotated

import typer

from dsd_cli.cli.options import (
    CONFIG_FILE,
    ConfigOption,
    EffectOption,
    EffectsFromOption,
    FromOption,
    LogArgument,
    OutputOption,
    QuietOption,
    SetOption,
    ToOption,
)
from dsd_cli.cli.pictures import PlotOption

if TYPE_CHECKING:
    from dsd_cli.detect.summary import Check


class DetectFormat(StrEnum):
    """table and json are the summary; csv and jsonl are the labels, one line per sample."""

    TABLE = "table"
    JSON = "json"
    CSV = "csv"
    JSONL = "jsonl"


ExpectOption = Annotated[
    list[str] | None,
    typer.Option(
        "--expect", metavar="AXIS=VALUE", help="Check: labels have this delay (inertia, ...); else exit 3. Repeatable."
    ),
]
AfterOption = Annotated[
    float | None, typer.Option("--after", metavar="T", help="Check only samples with this stamp or later, s.")
]
ShareOption = Annotated[
    float, typer.Option("--min-share", metavar="SHARE", help="Share of samples that a check requires, 0 to 1.")
]
ConfidentOption = Annotated[bool, typer.Option("--confident-only", help="Check only confident samples.")]
MethodOption = Annotated[
    str | None,
    typer.Option("--method", metavar="NAME[,NAME...]", help="Method for this run; several are compared side by side."),
]
FollowOption = Annotated[bool, typer.Option("--follow", help="Keep labelling what is appended to LOG, until Ctrl-C.")]
LiveOption = Annotated[
    bool, typer.Option("--live", help="With --follow: show state, confidence, changes, d_hat and residual.")
]
DetectFormatOption = Annotated[
    DetectFormat | None,
    typer.Option("--format", help="On stdout: summary (table, json) or labels (csv, jsonl). Default: table; csv live."),
]


def detect(
    log: LogArgument,
    config: ConfigOption = CONFIG_FILE,
    output: OutputOption = None,
    expect: ExpectOption = None,
    after: AfterOption = None,
    min_share: ShareOption = 0.95,
    confident_only: ConfidentOption = False,
    method: MethodOption = None,
    follow: FollowOption = False,
    live: LiveOption = False,
    plot: PlotOption = None,
    form: DetectFormatOption = None,
    start: FromOption = None,
    end: ToOption = None,
    override: SetOption = None,
    effect: EffectOption = None,
    effects_from: EffectsFromOption = None,
    quiet: QuietOption = False,
) -> None:
    """Label every sample of LOG with the most likely delay and inertia.

    Each row of the log gets one label: state, delay, inertia, log likelihood, probability, and whether it is
    confident. stdin (-) and --follow are live: one line out per line in.
    """
    from dsd_cli.cli.detect_checks import Judgement
    from dsd_cli.cli.detect_job import Destination, Job
    from dsd_cli.cli.pictures import check_plot, put_picture
    from dsd_cli.cli.user_effects import use_effects
    from dsd_cli.errors import UsageError
    from dsd_cli.files.config import load_config

    use_effects(effects_from)
    judgement = Judgement(tuple(expect or ()), after, min_share, confident_only)
    lines = output is None and not live and (follow or log == "-")
    form = form or (DetectFormat.CSV if lines else DetectFormat.TABLE)
    settings = load_config(config, override or (), effect or ()).within(start, end)
    if method is not None:
        from dsd_cli.cli.detect_methods import parse_methods, side_by_side

        methods = parse_methods(method)
        if len(methods) > 1:
            if output is not None or follow or live or expect or plot is not None:
                hint = "leave out -o, --plot, --follow, --live and --expect"
                raise UsageError("several methods are only compared", hint)
            side_by_side(log, settings, methods, form.value, quiet)
            return
        settings = settings.override([f'detector.method="{methods[0]}"'])
    to = Destination(form.value, output, quiet, inputs=(log, config, *settings.files, *(effects_from or ())))
    to.check()
    check_plot(plot, (*to.inputs, *(() if output in (None, "-") else (output,))))
    job = Job(log, settings, follow, to, panel=live, watched=plot is not None)
    result = job.run(judgement)
    to.show(result)
    if plot is not None and (watched := job.watched) is not None:
        from dsd_cli.report.plots_detection import draw

        put_picture(plot, lambda: draw(result, watched.seen(), watched.plan, settings.signals.units), quiet)
    if failed := [check for check in result.summary.checks if not check.holds]:
        raise _check_failed(failed)


def _check_failed(failed: list[Check]) -> Exception:
    from dsd_cli.errors import CheckFailed

    texts = [
        f"{check.axis} {check.value:g}: there is no such sample to check"
        if check.samples == 0
        else f"{check.axis} {check.value:g} in {100 * check.share:.1f} % of {check.samples} samples "
        f"(required: {100 * check.min_share:g} %)"
        for check in failed
    ]
    return CheckFailed("expectation not met: " + "; ".join(texts))
