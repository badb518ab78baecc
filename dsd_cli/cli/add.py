"""`dsd add`: take an effect into the model, if it helps."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer

from dsd_cli.cli.fit_options import FitOptions, StatesOption
from dsd_cli.cli.options import Format, effect_ids
from dsd_cli.cli.sharing import spread

if TYPE_CHECKING:
    from dsd_cli.cli.identification import Given
    from dsd_cli.identify.compare.balance import Force
    from dsd_cli.identify.results import Addition
    from dsd_cli.report.addition import AdditionReport

# a shell asks the first argument that may be repeated for all of them, the effect as well; it offers files by itself
LogsBefore = Annotated[
    list[str],
    typer.Argument(
        metavar="LOG...",
        autocompletion=lambda incomplete: effect_ids(incomplete) if incomplete else [],
        help="Log files (CSV, Parquet, MF4, ...); - is stdin.",
    ),
]
OutputNeeded = Annotated[
    str, typer.Option("-o", "--output", metavar="FILE", help="Config to write, may be that of -c; - is stdout.")
]


@spread
def add(
    log: LogsBefore,
    effect: Annotated[
        str, typer.Argument(metavar="EFFECT", autocompletion=effect_ids, help="Effect to add, see `dsd effects`.")
    ],
    output: OutputNeeded,
    states: StatesOption = False,
    *,
    options: FitOptions,
) -> None:
    """Add EFFECT to [model], fit all values to LOG again, and write the config with the result.

    Comments and order of the config stay; the old values go into its [[history]]. Nothing is written if the held-out
    error does not fall.
    """
    import sys

    from dsd_cli.cli.identification import check_logs, load_given, print_json, say, warn
    from dsd_cli.cli.improve_loop import check_outputs, put_config, with_steps
    from dsd_cli.cli.pictures import check_plot, put_picture
    from dsd_cli.cli.plan import widening
    from dsd_cli.cli.progress import Progress
    from dsd_cli.cli.refresh import put_states
    from dsd_cli.files.config.edit import read_origin
    from dsd_cli.report.addition import AdditionReport, add_json, added_step, caveats, print_addition

    apart, plot, form, quiet = options.apart, options.plot, options.form, options.quiet
    settings = options.settings(logs=log)
    origin = read_origin(options.config)
    check_logs(log, apart, settings.signals)
    read = [*log, *options.files(settings)]
    check_outputs(output, form, read)
    check_plot(plot, [options.config, *read, output])
    with Progress(not quiet) as progress, widening(settings.signals):
        given = load_given(settings, log, apart, progress)
        progress(f"fitting with {effect}")
        added, force = _added(given, effect)
    report = AdditionReport(added, tuple(log), apart, output, force)
    text = with_steps(origin.text, added.before, [added_step(added)], log, added.units)
    text, of_states = put_states(text, given, added.model, states)
    put_config(output, text, origin)
    warn(quiet, (*given.warnings, *added.warnings, *caveats(report)))
    if form is Format.JSON:
        print_json(add_json(report))
    elif output != "-" or not quiet:
        print_addition(report, sys.stderr if output == "-" else sys.stdout)
    if output != "-":
        say(quiet, f"wrote {output}")
    if of_states:
        say(quiet, of_states)
    if plot is not None:
        put_picture(plot, lambda: _drawn(report, given), quiet)


def _added(given: Given, effect: str) -> tuple[Addition, Force | None]:
    """The addition in the user's units, and the balance of forces of the model without it."""
    from dsd_cli.identify.compare.balance import force_view
    from dsd_cli.identify.final_fit import add_effect
    from dsd_cli.report.in_units import in_units

    added = add_effect(
        given.recordings, given.model, given.observer, effect, given.engine_settings, holdout=given.holdout
    )
    return in_units(added, given.settings.signals.units), force_view(given.recordings, given.model).log


def _drawn(report: AdditionReport, given: Given) -> Any:
    """The figure."""
    from dsd_cli.report.plots_addition import draw
    from dsd_cli.report.views_diagnosis import addition_view

    return draw(report, given.model, addition_view(report.result, given.model, given.recordings))
