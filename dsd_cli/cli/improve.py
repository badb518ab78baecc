"""`dsd improve`: diagnose, add, measure again, until nothing significant is left."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from dsd_cli.cli.fit_options import FitOptions, StatesOption
from dsd_cli.cli.options import Format
from dsd_cli.cli.sharing import spread
from dsd_cli.cli.transfer import SPREAD

if TYPE_CHECKING:
    from dsd_cli.cli.identification import Given
    from dsd_cli.cli.progress import Progress
    from dsd_cli.files.config import Config
    from dsd_cli.files.config.edit import Origin
    from dsd_cli.identify.compare.versus import Validation
    from dsd_cli.identify.results import Ladder

LogsOrNone = Annotated[
    list[str] | None, typer.Argument(metavar="LOG...", help="Log files (CSV, Parquet, MF4, ...); - is stdin.")
]
ConfigOut = Annotated[
    str | None,
    typer.Option("-o", "--output", metavar="FILE", help="Config to write, may be that of -c; - is stdout."),
]
HoldOption = Annotated[
    bool, typer.Option("--hold", help="Fit nothing that [model] has: a known machine. Also: fit.hold.")
]
FromPriorOption = Annotated[
    bool, typer.Option("--from-prior", help="[model] was learnt on a sister machine: its values are priors, not truth.")
]
SpreadOption = Annotated[
    float, typer.Option("--spread", metavar="SHARE", help="By which sister machines differ, for --from-prior.")
]


@spread
def improve(
    options: FitOptions,
    log: LogsOrNone = None,
    output: ConfigOut = None,
    hold: HoldOption = False,
    from_prior: FromPriorOption = False,
    spread_by: SpreadOption = SPREAD,
    states: StatesOption = False,
    auto: Annotated[bool, typer.Option("--auto", help="Do not ask: add what the diagnosis finds.")] = False,
    learn: Annotated[
        bool, typer.Option("--learn", help="Where it ends in `unknown`, learn the law that no effect has: dsd learn.")
    ] = False,
    history: Annotated[bool, typer.Option("--history", help="Show the steps that the config remembers.")] = False,
    undo: Annotated[
        bool, typer.Option("--undo", help="Take the last step back, in the config or into the file of -o.")
    ] = False,
) -> None:
    """Improve [model] step by step: diagnose LOG, ask, add the effect, measure again, until nothing is left to add.

    Each step is kept only if the error on data that no fit saw falls. Without -o nothing is written.
    """
    from dsd_cli.cli.identification import check_logs
    from dsd_cli.cli.improve_loop import check_outputs
    from dsd_cli.cli.pictures import check_plot
    from dsd_cli.cli.transfer import check_spread, with_priors
    from dsd_cli.files.config.edit import read_origin

    config, plot, form = options.config, options.plot, options.form
    kind = from_prior, states, learn
    wanted = Request(config, tuple(log or ()), options.apart, auto, plot, output, form, options.quiet, *kind)
    if history or undo:
        wanted.check_config_alone(
            "--history" if history else "--undo", both=history and undo, override=options.override
        )
    else:
        wanted.check_logs()
    origin = read_origin(config)
    settings = options.settings(hold)
    check_spread(spread_by, from_prior)
    settings = with_priors(settings, spread_by) if from_prior else settings
    check_logs(wanted.logs, wanted.holdout, settings.signals)
    read = (*wanted.logs, *options.files(settings))
    check_outputs(output, form, read)
    if history:
        _show_history(settings, wanted)
    elif undo:
        _undo(settings, wanted, origin)
    else:
        wanted.check_asker()
        check_plot(plot, [config, *read, *([output] if output else ())])
        _improve(settings, wanted, origin)


@dataclass(frozen=True)
class Request:
    """What the command line asks for."""

    config: Path
    logs: tuple[str, ...]
    holdout: tuple[str, ...]
    auto: bool
    plot: Path | None
    output: str | None
    form: Format
    quiet: bool
    transfer: bool = False
    states: bool = False
    learn: bool = False

    @property
    def inputs(self) -> tuple[str, ...]:
        """All logs."""
        return (*self.logs, *self.holdout)

    def check_config_alone(self, option: str, both: bool, override: list[str] | None) -> None:
        """--history and --undo look at the config and at nothing else.

        Raises
        ------
        UsageError : they are given with something else.
        """
        from dsd_cli.errors import UsageError

        if both:
            raise UsageError("--history and --undo", "give one of them")
        written = option == "--history" and self.output is not None
        if self.inputs or self.auto or self.learn or self.plot or override or written:
            raise UsageError(f"{option} looks at the config alone", "leave out the log and the other options")

    def check_logs(self) -> None:
        """There are logs.

        Raises
        ------
        UsageError : there are none.
        """
        from dsd_cli.errors import UsageError

        if not self.logs:
            raise UsageError("LOG is missing", "give the log to improve the model with, or --history or --undo")

    def check_asker(self) -> None:
        """There is somebody to ask; asked last, for what else is wrong matters more.

        Raises
        ------
        UsageError : there is nobody.
        """
        import sys

        from dsd_cli.errors import UsageError

        terminal = sys.stdin.isatty() and sys.stderr.isatty() and "-" not in self.inputs
        if not self.auto and not terminal:
            raise UsageError("no terminal to ask on", "--auto adds what the diagnosis finds without asking")


def _improve(settings: Config, wanted: Request, origin: Origin) -> None:
    import sys

    from dsd_cli.cli.identification import load_given, print_json, say, warn
    from dsd_cli.cli.improve_loop import put_config, with_steps
    from dsd_cli.cli.learn import with_learnt
    from dsd_cli.cli.other_hold import said_of_hold
    from dsd_cli.cli.pictures import put_picture
    from dsd_cli.cli.plan import widening
    from dsd_cli.cli.progress import Progress
    from dsd_cli.cli.refresh import put_states
    from dsd_cli.cli.transfer import transferred
    from dsd_cli.report.in_units import in_units
    from dsd_cli.report.ladder import LadderReport, improve_json, print_ladder

    output, quiet = wanted.output, wanted.quiet
    with Progress(not quiet) as progress, widening(settings.signals):
        given = load_given(settings, wanted.logs, wanted.holdout, progress)
        ladder = _run(given, wanted.auto, quiet, progress)
        of_hold = said_of_hold(given, wanted.logs, ladder.last)
        ladder = in_units(ladder, settings.signals.units)
        ladder = with_learnt(ladder, given, progress)[0] if wanted.learn else ladder
        held_out = validated(given, ladder) if given.holdout else ()
    moved = transferred(settings, ladder) if wanted.transfer else ()
    warnings = (*given.warnings, *of_hold)
    report = LadderReport(ladder, wanted.logs, output, given.dropped, warnings, held_out, moved)
    text = with_steps(origin.text, ladder.steps[0].score, ladder.steps[1:], wanted.logs, ladder.last.units)
    text, of_states = put_states(text, given, ladder.steps[-1].model, wanted.states)
    if output is not None:
        put_config(output, text, origin)
    warn(quiet, report.warnings)
    if wanted.form is Format.JSON:
        print_json(improve_json(report))
    elif output != "-" or not quiet:
        print_ladder(report, sys.stderr if output == "-" else sys.stdout)
    if output is None:
        say(quiet, "nothing was written: -o FILE writes the improved config")
    elif output != "-":
        say(quiet, f"wrote {output}")
    if of_states and output is not None:
        say(quiet, of_states)
    if wanted.plot is not None:
        from dsd_cli.report.plots_ladder import draw

        put_picture(wanted.plot, lambda: draw(report), quiet)


def _run(given: Given, auto: bool, quiet: bool, progress: Progress) -> Ladder:
    import sys

    from dsd_cli.cli.identification import early
    from dsd_cli.cli.improve_loop import Asker, follow
    from dsd_cli.identify.improve import improve as run
    from dsd_cli.identify.results import Step
    from dsd_cli.report.in_units import in_units
    from dsd_cli.report.ladder import step_line

    steps: list[Step] = []
    units = given.settings.signals.units

    def on_step(step: Step) -> None:
        progress.clear()
        if not quiet and sys.stderr.isatty():
            typer.echo(step_line(in_units(step, units), steps[-1] if steps else None), err=True)
        steps.append(step)

    return run(
        given.recordings,
        given.model,
        given.observer,
        given.engine_settings,
        holdout=given.holdout,
        choose=follow if auto else Asker(progress, units),
        on_step=on_step,
        progress=progress,
        on_told=early(quiet, progress),
    )


def validated(given: Given, ladder: Ladder) -> tuple[Validation, ...]:
    from dsd_cli.cli.compare import controller_of
    from dsd_cli.cli.identification import as_mended
    from dsd_cli.identify.compare.versus import validate

    model, units = ladder.steps[-1].model, given.settings.signals.units
    holdout = as_mended(given, ladder.last).holdout
    return validate(holdout, model, given.observer, controller_of(given.settings), units, ladder.last.band_hz)


def _show_history(settings: Config, wanted: Request) -> None:
    import sys

    from dsd_cli.cli.identification import print_json
    from dsd_cli.report.history import history_json, print_history

    steps = settings.written.get("history", [])
    if wanted.form is Format.JSON:
        print_json(history_json(str(wanted.config), steps))
    else:
        print_history(str(wanted.config), steps, sys.stdout)


def _undo(settings: Config, wanted: Request, origin: Origin) -> None:
    from dsd_cli.cli.identification import print_json, say
    from dsd_cli.cli.improve_loop import put_config
    from dsd_cli.errors import UsageError
    from dsd_cli.files.config.edit import undone
    from dsd_cli.report.history import history_json

    steps = settings.written.get("history", [])
    if not steps:
        raise UsageError(f"{wanted.config}: no [[history]]", "there is no step to take back")
    to = wanted.output or str(wanted.config)
    put_config(to, undone(origin.text), origin)
    if wanted.form is Format.JSON:
        print_json({**history_json(to, steps[:-1]), "undone": steps[-1]})
    say(wanted.quiet, f"wrote {to}: without {steps[-1]['effect']}, as before {steps[-1]['date']}")
