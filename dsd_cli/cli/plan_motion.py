"""`dsd plan`: which motion settles what the logs leave open?"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from dsd_cli.cli.fit_options import ReadOptions
from dsd_cli.cli.identification import LogsArgument
from dsd_cli.cli.options import Format
from dsd_cli.cli.sharing import spread

if TYPE_CHECKING:
    from dsd_cli.cli.plan_request import Answer, Request
    from dsd_cli.files.config import Config

MotionOption = Annotated[
    str,
    typer.Option(
        "-o",
        "--output",
        metavar="FILE",
        help="Motion to write: .csv, .yaml (ROS 2 JointTrajectory), .c, .h or .st (IEC 61131-3); - is stdout.",
    ),
]
ForOption = Annotated[
    list[str] | None,
    typer.Option(
        "--for",
        metavar="NAMES",
        help="What to settle: effects from one another (gravity,constant_load), or values (inertia); default: what "
        "diagnose leaves open. Repeatable.",
    ),
]
DiagnosisOption = Annotated[
    Path | None,
    typer.Option("--diagnosis", metavar="FILE", help="JSON of dsd diagnose: distinguish what it left open."),
]
SecondsOption = Annotated[
    str | None,
    typer.Option(
        "--seconds",
        metavar="S|A:B",
        help="Length, s; of A:B the shortest that is enough, with a curve. Default 10, or 20 where 10 are not enough.",
    ),
]
LimitOption = Annotated[
    list[str] | None,
    typer.Option(
        "--limit",
        metavar="NAME=SIZE",
        help="position=LOW:HIGH (or one size for both), velocity, acceleration, jerk, u; default: what the logs "
        "reached. Repeatable.",
    ),
]
RestOption = Annotated[
    float | None, typer.Option("--start", metavar="Q", help="Position of rest at begin and end; default the middle.")
]
RateOption = Annotated[
    float | None, typer.Option("--sample-time", metavar="T", help="s between rows of the motion; default the logs'.")
]
JointOption = Annotated[str, typer.Option("--joint", metavar="NAME", help="Name of the joint in a JointTrajectory.")]
RunOption = Annotated[
    str | None,
    typer.Option(
        "--run-with",
        metavar="COMMAND",
        help="Command with {reference} and {log} in it that moves the axis and leaves a log; plan, run, diagnose and "
        "plan again until nothing is left open.",
    ),
]
ExperimentsOption = Annotated[
    int, typer.Option("--experiments", metavar="N", min=1, help="Experiments of --run-with at most.")
]


@spread
def plan(
    log: LogsArgument,
    output: MotionOption,
    options: ReadOptions,
    wanted: ForOption = None,
    diagnosis: DiagnosisOption = None,
    seconds: SecondsOption = None,
    limit: LimitOption = None,
    rest_at: RestOption = None,
    rate: RateOption = None,
    joint: JointOption = "joint",
    run_with: RunOption = None,
    experiments: ExperimentsOption = 3,
) -> None:
    """Plan the motion whose log distinguishes what LOG leaves open, within the limits of the axis.

    Says how many nats it will distinguish explanations by, and to which standard errors values will be known, and what
    no motion identifies. Every likely plant has followed the motion in simulation, under [simulate.controller] if
    there is one, and kept the limits.
    """
    from dsd_cli.cli.identification import check_logs, say
    from dsd_cli.cli.pictures import check_plot
    from dsd_cli.cli.plan_request import names_of, request, told_by

    plot, form, quiet = options.plot, options.form, options.quiet
    settings = options.settings(logs=log)
    check_logs(log, (), settings.signals)
    read = [options.config, *log, *options.files(settings), *([diagnosis] if diagnosis else [])]
    _check_output(output, form, read)
    check_plot(plot, [*read, output])
    numbers = (seconds, limit or (), rest_at, rate)
    asked: Request = request(settings, names_of(wanted, diagnosis), numbers, told_by(diagnosis))
    if run_with is None:
        answer = _once(settings, log, asked, quiet)
    else:
        answer = _looped((settings, log, asked, quiet), run_with, output, experiments)
    _written(answer, output, joint)
    _shown(answer, output, form, quiet)
    planned = answer.plan
    if plot is not None and planned.motion is None and not (planned.pairs or planned.values):
        say(quiet, f"{plot}: not drawn, nothing is left open")
    elif plot is not None:
        from dsd_cli.cli.pictures import put_picture
        from dsd_cli.report.plots_plan import draw

        put_picture(plot, lambda: draw(answer.plan), quiet)


def _check_output(output: str, form: Format, read: Sequence[str | Path]) -> None:
    """One kind of text on stdout, and no file that is read."""
    from dsd_cli.errors import UsageError
    from dsd_cli.files.motion_out import motion_format
    from dsd_cli.files.whole import check_target

    motion_format(output)
    if output == "-" and form is Format.JSON:
        raise UsageError("-o - and --format json both need stdout", "give -o next.csv")
    if output != "-":
        check_target(output, read)


def _once(settings: Config, logs: list[str], asked: Request, quiet: bool) -> Answer:
    from dsd_cli.cli.identification import warn
    from dsd_cli.cli.plan_request import planned

    answer = planned(settings, logs, asked, quiet)
    warn(quiet, answer.warnings)
    return answer


def _looped(job: tuple[Config, list[str], Request, bool], command: str, output: str, most: int) -> Answer:
    from dsd_cli.cli.plan_loop import closed

    return closed(job, command, output, most)


def _written(answer: Answer, output: str, joint: str) -> None:
    """Nothing where no motion is needed or would help."""
    from dsd_cli.files.motion_out import motion_format, motion_text
    from dsd_cli.files.whole import write_whole

    if answer.plan.motion is None:
        if output != "-" and Path(output).exists():
            typer.echo(f"{output} is of an earlier plan: no motion is needed or would help now", err=True)
        return
    text = motion_text(answer.plan.motion, motion_format(output), joint)
    if output == "-":
        typer.echo(text, nl=False)
    else:
        write_whole(output, text.encode())


def _shown(answer: Answer, output: str, form: Format, quiet: bool) -> None:
    import sys

    from dsd_cli.cli.identification import print_json, say
    from dsd_cli.report.planning import print_table, to_json

    if form is Format.JSON:
        print_json(to_json(answer.plan, answer.experiments, output))
    elif output != "-" or not quiet:
        print_table(answer.plan, answer.experiments, sys.stderr if output == "-" else sys.stdout)
    if output != "-" and answer.plan.motion is not None:
        say(quiet, f"wrote {output}")
