"""`dsd compare`: how well does the model predict, and where does it fail?"""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from dsd_cli.cli.options import (
    CONFIG_FILE,
    ConfigOption,
    EffectOption,
    EffectsFromOption,
    Format,
    FormatOption,
    QuietOption,
    SetOption,
)

if TYPE_CHECKING:
    from dsd_cli.cli.recordings import LoadedRecording
    from dsd_cli.files.config import Config
    from dsd_cli.identify.compare.evaluation import Evaluation
    from dsd_cli.identify.compare.forward import Forward
    from dsd_cli.plant.controllers import ControllerSettings
    from dsd_cli.report.comparison import Report


class Horizon(StrEnum):
    """How far the model looks ahead."""

    PREDICTION = "prediction"
    SIMULATION = "simulation"


LogsArgument = Annotated[
    list[str], typer.Argument(metavar="LOG...", help="Log files (CSV, Parquet, MF4, ...); - is stdin.")
]
HoldoutOption = Annotated[
    str | None, typer.Option("--holdout", metavar="LOG", help="Log to be judged apart; --max-rmse then goes by it.")
]
HorizonOption = Annotated[
    Horizon,
    typer.Option("--horizon", help="Predict d_hat from u and the measured motion, or simulate the motion from u."),
]
PlotOption = Annotated[Path | None, typer.Option("--plot", metavar="FILE", help="Picture to draw (.png).")]
MaxRmseOption = Annotated[
    float | None, typer.Option("--max-rmse", metavar="X", help="Check: the rmse is at most this; else exit 3.")
]


def compare(
    log: LogsArgument,
    config: ConfigOption = CONFIG_FILE,
    holdout: HoldoutOption = None,
    horizon: HorizonOption = Horizon.PREDICTION,
    plot: PlotOption = None,
    max_rmse: MaxRmseOption = None,
    form: FormatOption = Format.TABLE,
    override: SetOption = None,
    effect: EffectOption = None,
    effects_from: EffectsFromOption = None,
    quiet: QuietOption = False,
) -> None:
    """Say how well [model] predicts LOG, and where and on what its error depends.

    Nothing is fitted: the model is taken as the config has it. With several logs, all of them together.
    """
    import sys

    from dsd_cli.cli.identification import check_plot, print_json, put_picture, say
    from dsd_cli.cli.recordings import believed_model, load_recording
    from dsd_cli.cli.user_effects import use_effects
    from dsd_cli.files.config import load_config
    from dsd_cli.identify.compare.comparison import Comparison
    from dsd_cli.report.comparison import to_json
    from dsd_cli.report.comparison_table import print_table
    from dsd_cli.report.plots_comparison import draw

    _check_options(log, holdout, horizon, plot, max_rmse)
    use_effects(effects_from)
    settings = load_config(config, override or (), effect or ())
    check_plot(plot, [config, *log, *([] if holdout is None else [holdout]), *settings.files, *(effects_from or ())])
    believed_model(settings)  # without an inertia nothing needs to be read
    loaded = [load_recording(path, settings) for path in log]
    aside = None if holdout is None else load_recording(holdout, settings)
    if not quiet:
        for path, one in zip([*log, holdout], [*loaded, aside], strict=True):
            for warning in () if one is None else one.warnings:
                say(quiet, f"dsd: warning: {path}: {warning}")
    if horizon is Horizon.PREDICTION:
        report, evaluation = _predicted(settings, loaded, aside, max_rmse)
    else:
        report, evaluation = _simulated(settings, loaded, aside, max_rmse), None
    if form is Format.JSON:
        print_json(to_json(report))
    else:
        print_table(report, sys.stdout)
    if plot is not None and isinstance(report.result, Comparison) and evaluation is not None:
        compared, judged = report.result, evaluation
        put_picture(plot, lambda: draw(compared, judged), quiet)
    if not report.holds:
        from dsd_cli.errors import CheckFailed

        raise CheckFailed(f"rmse {report.judged_rmse:.4g} of {report.judged_log} is above --max-rmse {max_rmse:g}")


def _check_options(
    log: list[str], holdout: str | None, horizon: Horizon, plot: Path | None, max_rmse: float | None
) -> None:
    import math

    from dsd_cli.cli.identification import check_logs
    from dsd_cli.errors import UsageError

    if max_rmse is not None and not (math.isfinite(max_rmse) and max_rmse >= 0.0):
        raise UsageError(f"--max-rmse {max_rmse:g}", "must be a finite number from 0")
    check_logs(log, [] if holdout is None else [holdout])
    if plot is not None and horizon is Horizon.SIMULATION:
        raise UsageError("--plot", "draws the prediction; leave out --horizon simulation")


def _predicted(
    settings: Config, loaded: list[LoadedRecording], aside: LoadedRecording | None, max_rmse: float | None
) -> tuple[Report, Evaluation]:
    from dsd_cli.cli.plan import observer_settings
    from dsd_cli.cli.recordings import believed_model
    from dsd_cli.identify.compare.comparison import compare as compare_recordings
    from dsd_cli.report.comparison import Report

    comparison, evaluation = compare_recordings(
        [one.recording for one in loaded],
        believed_model(settings),
        observer_settings(settings),
        settings.detector.window,
        None if aside is None else aside.recording,
    )
    return Report(comparison, dropped=_dropped(loaded, aside), max_rmse=max_rmse), evaluation


def _simulated(
    settings: Config, loaded: list[LoadedRecording], aside: LoadedRecording | None, max_rmse: float | None
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
            _controller(settings),
        )

    forward_aside = None if aside is None else run([aside])
    return Report(run(loaded), forward_aside, dropped=_dropped(loaded, aside), max_rmse=max_rmse)


def _controller(settings: Config) -> ControllerSettings | None:
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
