"""`dsd compare`: how well does the model predict, and where does it fail?"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from dsd_cli.cli.horizon import PREDICTION, HorizonOption, seconds_of
from dsd_cli.cli.options import (
    BoundsOption,
    EffectOption,
    EffectsFromOption,
    FixOption,
    Format,
    FormatOption,
    FromOption,
    PriorOption,
    QuietOption,
    SetOption,
    ToOption,
    config_options,
)
from dsd_cli.cli.pictures import PlotOption

if TYPE_CHECKING:
    from dsd_cli.cli.progress import Progress
    from dsd_cli.cli.recordings import LoadedRecording
    from dsd_cli.files.config import Config, Signals
    from dsd_cli.identify.compare.comparison import Series
    from dsd_cli.identify.compare.forward import Forward
    from dsd_cli.plant.controllers import ControllerSettings
    from dsd_cli.report.comparison import Report
    from dsd_cli.signals.units import Units


LogsOrNone = Annotated[
    list[str] | None,
    typer.Argument(
        metavar="LOG...", help="Log files (CSV, Parquet, MF4, ...); - is stdin. None: two configs, value by value."
    ),
]
ConfigsOption = Annotated[
    list[Path] | None,
    typer.Option(
        "-c",
        "--config",
        metavar="FILE",
        callback=config_options,
        help="Config of the rig; several: their models side by side.",
    ),
]
HoldoutOption = Annotated[
    str | None, typer.Option("--holdout", metavar="LOG", help="Log to be judged apart; --max-rmse then goes by it.")
]
MaxRmseOption = Annotated[
    float | None, typer.Option("--max-rmse", metavar="X", help="Check: the rmse is at most this; else exit 3.")
]


def compare(
    log: LogsOrNone = None,
    config: ConfigsOption = None,
    holdout: HoldoutOption = None,
    horizon: HorizonOption = PREDICTION,
    plot: PlotOption = None,
    max_rmse: MaxRmseOption = None,
    form: FormatOption = Format.TABLE,
    fix: FixOption = None,
    bounds: BoundsOption = None,
    prior: PriorOption = None,
    start: FromOption = None,
    end: ToOption = None,
    override: SetOption = None,
    effect: EffectOption = None,
    effects_from: EffectsFromOption = None,
    quiet: QuietOption = False,
) -> None:
    """Say how well [model] predicts LOG, and where and on what its error depends.

    Nothing is fitted: the model is taken as the config has it. With several logs, all of them together. With several
    configs their models are put side by side, and without a LOG their values.
    """
    from dsd_cli.cli.plan import widening
    from dsd_cli.cli.user_effects import use_effects
    from dsd_cli.files.config import load_config

    configs, logs = config or [], log or []
    use_effects(effects_from)
    read = [load_config(path, override or (), effect or ()).within(start, end) for path in configs]
    all_settings = [one.knowing(fix or (), bounds or (), prior or ()) for one in read]
    wanted = Wanted(tuple(logs), holdout, seconds_of(horizon), plot, max_rmse, form, quiet)
    inputs = [*configs, *(file for settings in all_settings for file in settings.files), *(effects_from or ())]
    wanted.check(len(configs), inputs, all_settings[0].signals)
    with widening(all_settings[0].signals):
        if len(configs) > 1:
            from dsd_cli.cli.versus import compare_configs

            compare_configs(all_settings, wanted.logs, form, quiet, plot)
        else:
            _compare(all_settings[0], wanted)


@dataclass(frozen=True)
class Wanted:
    """What the command line asks for; `horizon` None: prediction, inf: simulation of the whole log."""

    logs: tuple[str, ...]
    holdout: str | None
    horizon: float | None
    plot: Path | None
    max_rmse: float | None
    form: Format
    quiet: bool

    def check(self, configs: int, inputs: list[Path], signals: Signals) -> None:
        """Raises UsageError : options that contradict each other."""
        import math

        from dsd_cli.cli.identification import check_logs
        from dsd_cli.cli.pictures import check_plot
        from dsd_cli.errors import UsageError

        aside = [] if self.holdout is None else [self.holdout]
        if self.max_rmse is not None and not (math.isfinite(self.max_rmse) and self.max_rmse >= 0.0):
            raise UsageError(f"--max-rmse {self.max_rmse:g}", "must be a finite number from 0")
        if configs > 1:
            alone = [("--holdout", self.holdout), ("--max-rmse", self.max_rmse)]
            given = [name for name, value in [*alone, ("--horizon", self.horizon)] if value is not None]
            if given:
                raise UsageError(f"{given[0]} looks at one model", "run it once for each -c, and compare its figures")
        elif not self.logs:
            raise UsageError("LOG is missing", "give the log to judge the model by, or two configs (-c a -c b)")
        check_logs(self.logs, aside, signals)
        if self.plot is not None and not self.logs:
            raise UsageError("--plot draws models on a log", "give the LOG")
        check_plot(self.plot, [*self.logs, *aside, *inputs])


def _compare(settings: Config, wanted: Wanted) -> None:
    import sys

    from dsd_cli.cli.identification import print_json, say
    from dsd_cli.cli.pictures import put_picture
    from dsd_cli.cli.progress import Progress
    from dsd_cli.cli.recordings import believed_model, beyond_known, load_holdout, load_recording, of_no_effect
    from dsd_cli.report.comparison import to_json
    from dsd_cli.report.comparison_table import print_table

    quiet, holdout = wanted.quiet, wanted.holdout
    believed_model(settings)  # without an inertia nothing needs to be read
    series: Series | None = None
    with Progress(not quiet) as progress:
        loaded = [load_recording(path, settings, progress=progress) for path in wanted.logs]
        aside = None if holdout is None else load_holdout(holdout, wanted.logs, settings, progress)
        progress.clear()
        for path, one in zip([*wanted.logs, holdout], [*loaded, aside], strict=True):
            for warning in () if one is None else one.warnings:
                say(quiet, f"dsd: warning: {path}: {warning}")
        if wanted.horizon is None:
            report, series = _predicted(settings, loaded, aside, wanted.max_rmse, progress)
        else:
            progress("simulating")
            report = _simulated(settings, loaded, aside, wanted.max_rmse, wanted.horizon)
    for line in (*beyond_known(settings), *of_no_effect(settings)):
        say(quiet, f"dsd: warning: {line}")
    if wanted.form is Format.JSON:
        print_json(to_json(report))
    else:
        print_table(report, sys.stdout)
    if wanted.plot is not None:
        put_picture(wanted.plot, lambda: _drawn(report, series, settings.signals.units), quiet)
    if not report.holds:
        from dsd_cli.errors import CheckFailed

        judged_by = f"rmse {report.judged_rmse:.4g} of {report.judged_log}"
        raise CheckFailed(f"{judged_by} is above --max-rmse {wanted.max_rmse:g}")


def _drawn(report: Report, series: Series | None, units: Units) -> Any:
    """The figure of a prediction, or of a simulation."""
    from dsd_cli.identify.compare.comparison import Comparison
    from dsd_cli.report.plots_comparison import draw
    from dsd_cli.report.plots_simulation import draw as draw_simulation

    if not isinstance(report.result, Comparison) or series is None:
        return draw_simulation(report, units)
    return draw(report.result, series)


def _predicted(
    settings: Config,
    loaded: list[LoadedRecording],
    aside: LoadedRecording | None,
    max_rmse: float | None,
    progress: Progress,
) -> tuple[Report, Series]:
    from dsd_cli.cli.plan import observer_settings
    from dsd_cli.cli.recordings import believed_model
    from dsd_cli.identify.compare.comparison import compare as compare_recordings
    from dsd_cli.report.comparison import Report

    comparison, series = compare_recordings(
        [one.recording for one in loaded],
        believed_model(settings),
        observer_settings(settings),
        settings.detector.window,
        None if aside is None else aside.recording,
        progress,
    )
    comparison = replace(comparison, units=settings.signals.units)
    return Report(comparison, dropped=_dropped(loaded, aside), max_rmse=max_rmse), series


def _simulated(
    settings: Config,
    loaded: list[LoadedRecording],
    aside: LoadedRecording | None,
    max_rmse: float | None,
    horizon: float,
) -> Report:
    from dsd_cli.cli.plan import observer_settings
    from dsd_cli.cli.recordings import believed_model
    from dsd_cli.identify.compare.forward import run_forward
    from dsd_cli.report.comparison import Report

    def run(recordings: list[LoadedRecording]) -> Forward:
        return run_forward(
            [one.recording for one in recordings],
            believed_model(settings),
            observer_settings(settings),
            controller_of(settings),
            horizon=horizon,
            units=settings.signals.units,
        )

    forward_aside = None if aside is None else run([aside])
    return Report(run(loaded), forward_aside, dropped=_dropped(loaded, aside), max_rmse=max_rmse)


def controller_of(settings: Config) -> ControllerSettings | None:
    """[simulate.controller], if there is one."""
    if settings.simulate is None:
        return None
    from dsd_cli.cli.simulate import simulation_settings

    return simulation_settings(settings).controller


def _dropped(loaded: list[LoadedRecording], aside: LoadedRecording | None) -> dict[str, int]:
    """Rows not taken as they are, of all logs."""
    total: dict[str, int] = {}
    for one in [*loaded, *([] if aside is None else [aside])]:
        for reason, count in one.dropped.items():
            total[reason] = total.get(reason, 0) + count
    return total
