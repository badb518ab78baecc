"""`dsd learn`: the law that no effect of the catalogue has."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from dsd_cli.cli.fit_options import FitOptions
from dsd_cli.cli.identification import LogsArgument
from dsd_cli.cli.options import Format
from dsd_cli.cli.sharing import spread

if TYPE_CHECKING:
    from dsd_cli.cli.identification import Given
    from dsd_cli.files.config.edit import Origin
    from dsd_cli.identify.results import Ladder
    from dsd_cli.learn.results import Learnt
    from dsd_cli.report.learning import LearnReport

OutputOption = Annotated[
    str | None,
    typer.Option("-o", "--output", metavar="FILE", help="Config to write, may be that of -c; - is stdout."),
]
LawFileOption = Annotated[
    Path | None,
    typer.Option("--law-file", metavar="FILE.py", help="Effect file of the formula, for --effects-from."),
]
CurveOption = Annotated[
    Path | None, typer.Option("--curve", metavar="FILE.csv", help="Knots, values and band of the law, to write.")
]


@spread
def learn(
    log: LogsArgument,
    options: FitOptions,
    output: OutputOption = None,
    law_file: LawFileOption = None,
    curve: CurveOption = None,
) -> None:
    """Learn the law that [model] lacks and no effect of the catalogue has: its channels, its curve, its formula.

    Free-form laws are fitted to LOG together with the values of [model] and judged on data that they were not fitted
    to. The config of -o has the law and works by itself. Nothing is learnt from a log in which nothing is missing.
    """
    import sys

    from dsd_cli.cli.identification import check_logs, load_given, print_json, say, warn
    from dsd_cli.cli.improve_loop import check_outputs
    from dsd_cli.cli.pictures import check_plot, put_picture
    from dsd_cli.cli.plan import widening
    from dsd_cli.cli.progress import Progress
    from dsd_cli.files.config.edit import read_origin
    from dsd_cli.report.learning import learn_json, print_learnt
    from dsd_cli.report.plots_learning import draw

    config, apart, plot, form, quiet = options.config, options.apart, options.plot, options.form, options.quiet
    settings = options.settings(logs=log)
    origin = read_origin(config)
    check_logs(log, apart, settings.signals)
    read = [*log, *options.files(settings)]
    check_outputs(output, form, read)
    files = Files(output, law_file, curve).checked([config, *read])
    check_plot(plot, [config, *read, *files.paths])
    with Progress(not quiet) as progress, widening(settings.signals):
        given = load_given(settings, log, apart, progress)
        found = learnt_from(given, progress)
    report = put_files(found, given, files, origin, tuple(log))
    warn(quiet, report.warnings)
    if form is Format.JSON:
        print_json(learn_json(report))
    elif output != "-" or not quiet:
        print_learnt(report, sys.stderr if output == "-" else sys.stdout)
    for path in (report.config, report.law_file, report.curve_file):
        if path is not None and path != "-":
            say(quiet, f"wrote {path}")
    if plot is not None:
        put_picture(plot, lambda: draw(found), quiet)


@dataclass(frozen=True)
class Files:
    """What is to be written."""

    config: str | None
    law: Path | None = None
    curve: Path | None = None

    @property
    def paths(self) -> list[str | Path]:
        """Those that are asked for."""
        return [path for path in (self.config, self.law, self.curve) if path is not None]

    def checked(self, inputs: list[str | Path]) -> Files:
        """These, if each can be written and is no other one.

        Raises
        ------
        UsageError, DataError : says which one.
        """
        from dsd_cli.errors import UsageError
        from dsd_cli.files.whole import check_target

        if self.law is not None and self.law.suffix != ".py":
            raise UsageError(f"--law-file {self.law}", "end its name in .py: --effects-from takes it")
        for path in (self.law, self.curve):
            if path is not None:
                check_target(path, [other for other in (*inputs, *self.paths) if other is not path])
        return self


def learnt_from(given: Given, progress: object, stand_ins: tuple[str, ...] = ()) -> Learnt:
    """What these logs teach, in the user's units; stand_ins: effects that are taken back if needless."""
    from dataclasses import replace

    from dsd_cli.learn.learning import learn as run
    from dsd_cli.report.in_units import in_units

    units = given.settings.signals.units
    found = run(given.recordings, given.model, given.engine_settings, given.holdout, progress, stand_ins)  # type: ignore[arg-type]
    formula = found.formula
    if formula is not None:
        formula = replace(formula, parameters=in_units(formula.parameters, units))
    estimates, rungs = in_units(found.estimates, units), in_units(found.rungs, units)
    return replace(found, units=units, formula=formula, estimates=estimates, rungs=rungs)


def with_learnt(ladder: Ladder, given: Given, progress: object) -> tuple[Ladder, Learnt | None]:
    """(the ladder with the law as a rung, where it ends in `unknown` and a law lowers the held-out error further, less
    the effects that only stood in for the law; what was learnt, None where that was not asked).

    The verdict at the end, and what is unexplained, are of a diagnosis of the model with the law.
    """
    from dataclasses import replace

    from dsd_cli.cli.identification import as_mended
    from dsd_cli.identify.results import DELAY, INERTIA, UNKNOWN
    from dsd_cli.identify.verdict.diagnose import diagnose
    from dsd_cli.report.in_units import in_units

    top = ladder.steps[-1]
    if ladder.verdict != UNKNOWN:
        return ladder, None
    given = as_mended(given, ladder.last)
    taken = tuple(name for name in top.model.effects if name not in ladder.steps[0].model.effects)
    found = learnt_from(replace(given, model=top.model), progress, taken)
    if not found.rungs or not found.rungs[0].score.heldout_rmse < top.score.heldout_rmse:
        why = found.why or "the error does not fall"
        return replace(ladder, stopped=f"{ladder.stopped}; no law was learnt ({why})"), found
    rungs = (replace(rung, step=top.step + 1 + i) for i, rung in enumerate(found.rungs))
    settings, units = given.engine_settings, given.settings.signals.units
    settings = replace(settings, known=replace(settings.known, fixed=found.held))
    last = diagnose(given.recordings, found.model, given.observer, settings, given.holdout, progress)  # type: ignore[arg-type]
    last = in_units(last, units)
    stayed = tuple(one for one in ladder.missing if one.effect in {INERTIA, DELAY, *found.model.effects})
    at_end = replace(
        ladder,
        steps=(*ladder.steps, *rungs),
        verdict=last.verdict,
        stopped=in_short(found),
        last=last,
        values=found.estimates,
        correlations=(),
        warnings=last.warnings,
        levels=last.levels,
        missing=tuple({one.effect: one for one in (*stayed, *last.missing)}.values()),
    )
    return at_end, found


def in_short(found: Learnt) -> str:
    """What was learnt, and whether the catalogue has it."""
    formula = found.formula
    if formula is None:
        return f"learnt: {found.family}, which no effect of the catalogue is"
    if formula.known and formula.replaces:
        return f"learnt: {formula.words}, {formula.text}, which is {' and '.join(formula.effects)}"
    if formula.replaces:
        return f"learnt: {found.family}, {formula.text}, which no effect of the catalogue is"
    return f"learnt: {found.family}, nearest formula {formula.text}, which explains less than the curve"


def put_files(found: Learnt, given: Given, files: Files, origin: Origin, logs: tuple[str, ...]) -> LearnReport:
    """Write what there is, each whole or not at all; what was written stands in the report."""
    from dsd_cli.cli.improve_loop import put_config, with_steps
    from dsd_cli.files.whole import write_whole
    from dsd_cli.learn.results import LEARNT
    from dsd_cli.report.learning import LearnReport, curve_csv

    law = files.law if found.formula is not None and found.formula.source and not found.formula.known else None
    curve = files.curve if found.verdict == LEARNT else None
    if files.config is not None:
        text = with_steps(origin.text, found.score, found.rungs, logs, found.units)
        put_config(files.config, text, origin)
    if law is not None and found.formula is not None:
        write_whole(str(law), found.formula.source.encode())
    if curve is not None:
        write_whole(str(curve), curve_csv(found).encode())
    said = [*given.warnings, *found.warnings]
    said += [f"{files.law}: not written, {_why_no_file(found)}"] if files.law is not None and law is None else []
    said += [f"{files.curve}: not written, no law was learnt"] if files.curve is not None and curve is None else []
    written = [None if path is None else str(path) for path in (law, curve)]
    return LearnReport(found, logs, files.config, written[0], written[1], tuple(said), given.dropped)


def _why_no_file(found: Learnt) -> str:
    if found.formula is None:
        return "there is no formula"
    return f"dsd has the law: {', '.join(found.formula.effects)}"
