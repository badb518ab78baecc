"""`dsd diagnose`: which physical effect is missing?"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from dsd_cli.cli.fit_options import FitOptions
from dsd_cli.cli.identification import LogsArgument
from dsd_cli.cli.options import Format
from dsd_cli.cli.sharing import spread

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dsd_cli.cli.identification import Given
    from dsd_cli.cli.progress import Progress
    from dsd_cli.identify.checks import Finding
    from dsd_cli.identify.d_hat_makers import OpenLog
    from dsd_cli.identify.recordings.recording import Recording
    from dsd_cli.identify.results import Diagnosis


@spread
def diagnose(log: LogsArgument, options: FitOptions) -> None:
    """Say which physical effect, added to [model], predicts best what no fit has seen; or that none is missing.

    Every effect of the catalogue is fitted to LOG together with the values that [model] has, and judged on data that
    the fit did not see. A wrong inertia or delay is ranked like an effect.
    """
    import sys

    from dsd_cli.cli.few_moves import said_of_moves
    from dsd_cli.cli.identification import check_logs, load_open, print_json, warn
    from dsd_cli.cli.other_hold import said_of_hold
    from dsd_cli.cli.pictures import check_plot, put_picture
    from dsd_cli.cli.plan import widening
    from dsd_cli.cli.progress import Progress
    from dsd_cli.report.diagnosis import DiagnosisReport, print_table, to_json
    from dsd_cli.report.verdict import once_late

    apart, plot, quiet = options.apart, options.plot, options.quiet
    settings = options.settings(logs=log)
    check_logs(log, apart, settings.signals)
    check_plot(plot, [options.config, *log, *options.files(settings)])
    with Progress(not quiet) as progress, widening(settings.signals):
        given, asked = load_open(settings, log, apart, progress)
        found, recordings = answer(given, asked, progress, quiet)
        found = replace(found, advice=(*said_of_hold(given, log, found), *found.advice, *said_of_moves(recordings)))
    report = DiagnosisReport(
        replace(found, warnings=once_late(given.warnings, found.warnings)), given.model, apart, given.dropped
    )
    warn(quiet, report.result.warnings)
    if options.form is Format.JSON:
        print_json(to_json(report))
    else:
        print_table(report, sys.stdout)
    if plot is not None:
        from dsd_cli.report.plots_diagnosis import draw
        from dsd_cli.report.views_diagnosis import residual_views

        put_picture(plot, lambda: draw(report, residual_views(found, given.model, recordings)), quiet)


def answer(
    given: Given, asked: OpenLog | None, progress: Progress, quiet: bool
) -> tuple[Diagnosis, Sequence[Recording]]:
    """(the answer, in the user's units; what it is of): that of the command, and of a fleet's row.

    Raises
    ------
    DataError : see `dsd_cli.identify.verdict.diagnose.diagnose`.
    """
    from dsd_cli.cli.identification import diagnosed, early
    from dsd_cli.identify.verdict.diagnose import diagnose as run
    from dsd_cli.report.in_units import in_units

    def ask(recordings: Sequence[Recording], holdout: Sequence[Recording]) -> Diagnosis:
        return run(
            recordings,
            given.model,
            given.observer,
            given.engine_settings,
            holdout=tuple(holdout),
            progress=progress,
            on_told=early(quiet, progress),
        )

    found, recordings = diagnosed(given, asked, ask)
    result: Diagnosis = in_units(found, given.settings.signals.units)
    return _without_verdict(result, given.blocked), recordings


def _without_verdict(found: Diagnosis, blocked: Finding | None) -> Diagnosis:
    """No effect is named while u has the sign that no axis has: the functions that follow it stand for the inertia."""
    if blocked is None:
        return found
    from dsd_cli.identify.results import UNKNOWN

    said = f"{blocked.what}: {blocked.remedy}"
    return replace(found, verdict=UNKNOWN, probability=blocked.sure, blocked=said, found=(), missing=(), depends_on=())
