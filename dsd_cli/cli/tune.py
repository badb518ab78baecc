"""`dsd tune`: the detector's rho, window, transition and grid from a log."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer

from dsd_cli.cli.options import (
    CONFIG_FILE,
    ConfigOption,
    EffectOption,
    EffectsFromOption,
    Format,
    FormatOption,
    FromOption,
    LogArgument,
    QuietOption,
    SetOption,
    ToOption,
)
from dsd_cli.cli.pictures import PlotOption

if TYPE_CHECKING:
    from dsd_cli.cli.progress import Progress
    from dsd_cli.detect.tune.evidence import Evidence, Gatherer
    from dsd_cli.detect.tune.tuning import Tuning
    from dsd_cli.files.config import Config

ConfigOut = Annotated[
    str | None,
    typer.Option(
        "-o", "--output", metavar="FILE", help="Config to write, may be that of -c; - is stdout. Default: none."
    ),
]


def tune(
    log: LogArgument,
    config: ConfigOption = CONFIG_FILE,
    output: ConfigOut = None,
    form: FormatOption = Format.TABLE,
    plot: PlotOption = None,
    start: FromOption = None,
    end: ToOption = None,
    override: SetOption = None,
    effect: EffectOption = None,
    effects_from: EffectsFromOption = None,
    quiet: QuietOption = False,
) -> None:
    """Choose rho, window, transition and grid of [detector] and [states] from LOG, and say why.

    The noise and the dwell times are fitted (Baum-Welch), candidates that the log shows are added to the grid, and of
    all tunings the one is taken whose labels are most like those that the whole log, seen afterwards, says. What
    detection delay and false alarms to expect is simulated. -o writes the values into the config, keeping comments.
    """
    import sys

    from dsd_cli.cli.identification import print_json, say, warn
    from dsd_cli.cli.pictures import check_plot, put_picture
    from dsd_cli.cli.plan import naming, widening
    from dsd_cli.cli.progress import Progress
    from dsd_cli.cli.user_effects import use_effects
    from dsd_cli.detect.tune.tuning import tune as choose
    from dsd_cli.errors import UsageError, source_name
    from dsd_cli.files.config import load_config
    from dsd_cli.files.config.edit import check_config_output, read_origin, write_text
    from dsd_cli.report.tuning import TuningReport, print_lines, to_json

    use_effects(effects_from)
    origin = read_origin(config)
    settings = load_config(config, override or (), effect or ()).within(start, end)
    if output == "-" and form is Format.JSON:
        raise UsageError("-o - and --format json both want stdout", "write the config to a file")
    if output is not None:
        check_config_output(output, (log, *settings.files, *(effects_from or ())))
    check_plot(plot, [str(config), log, *settings.files, *(effects_from or ()), *([output] if output else [])])
    with Progress(not quiet) as progress, widening(settings.signals), naming(log):
        evidence, warnings = _evidence(log, settings, progress)
        tuning = choose(evidence, progress)
    report = TuningReport(tuning, source_name(log), output)
    text = _written(origin.text, settings, tuning) if output is not None else ""
    warn(quiet, [f"{source_name(log)}: {warning}" for warning in warnings])
    if output == "-":
        typer.echo(text, nl=False)
    elif output is not None:
        write_text(output, text, origin)
    if form is Format.JSON:
        print_json(to_json(report))
    elif output != "-" or not quiet:
        print_lines(report, sys.stderr if output == "-" else sys.stdout)
    if output not in (None, "-"):
        say(quiet, f"wrote {output}")
    if plot is not None:
        from dsd_cli.report.plots_tuning import draw

        put_picture(plot, lambda: draw(report, settings.signals.units), quiet)


def _evidence(log: str, config: Config, progress: Progress) -> tuple[Evidence, tuple[str, ...]]:
    """The part of the log that identifies most, as the engine of the config takes it, and warnings."""
    from dsd_cli.cli.labelling import cleaner_for, open_log, run_log
    from dsd_cli.cli.plan import as_logged
    from dsd_cli.detect.tune.evidence import Gatherer, refuse

    config = as_logged(config, log)
    table, plan = open_log(log, config)
    refuse(plan)
    session = Gatherer(plan, cleaner_for(config, plan))
    warnings = run_log(table, session, progress.watch, "reading").warnings
    if session.repeats.what(session.cleaner.sample_time) and log != "-":  # stdin is read once
        session, warnings = _of_new_rows(log, config)
    return session.evidence(), warnings


def _of_new_rows(log: str, config: Config) -> tuple[Gatherer, tuple[str, ...]]:
    """The log as `dsd observe` writes it: the rows in which its sensors say something new."""
    from itertools import pairwise

    from dsd_cli.cli.plan import detection_plan, log_columns, optional_columns, reading
    from dsd_cli.cli.recordings import of_new_rows
    from dsd_cli.detect.tune.evidence import Gatherer
    from dsd_cli.files.logs import load_log
    from dsd_cli.signals.cleaning import Cleaner

    loaded = of_new_rows(load_log(log, log_columns(config.signals), optional_columns(config), **reading(config)))
    found = dict(loaded.log.channels)
    plan = detection_plan(config, {name: name for name in found}, loaded.log.metadata, log)
    session, t = Gatherer(plan, Cleaner(None, bridge=0)), found.pop("t")
    for a, b in pairwise([0, *loaded.restarts, len(loaded.log)]):
        list(session.feed(t[a:b], {name: x[a:b] for name, x in found.items()}, restart=a > 0))
    list(session.finish())
    use = "these settings are for the log of `dsd observe LOG -o NEW.parquet`, which has those rows"
    return session, (*loaded.warnings, use)


def _written(text: str, config: Config, tuning: Tuning) -> str:
    """The config with the chosen values; those that did not change stay as they are written."""
    from dsd_cli.files.config import States
    from dsd_cli.files.config.values_edit import with_keys
    from dsd_cli.report.tuning import transition_value

    settings, states = tuning.after.settings, config.require(States)
    values: dict[tuple[str, ...], Any] = {
        ("detector", "rho"): settings.rho,
        ("detector", "window"): settings.window,
        ("detector", "transition"): transition_value(settings),
        ("detector", "method"): settings.method,
    }
    if transition_value(settings) == transition_value(tuning.before.settings):
        del values["detector", "transition"]
    if settings.method == config.detector.method:
        del values["detector", "method"]
    if tuning.grid.delays != tuple(states.delays):
        values["states", "delays"] = tuning.grid.delays
    if tuning.grid.inertias != tuple(states.inertias):
        values["states", "inertias"] = tuning.grid.inertias
    return with_keys(text, values)
