"""`dsd export`: the model of a config for simulators, controllers and other tools."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NamedTuple

import typer

from dsd_cli.cli.options import EffectsFromOption, Format, FormatOption, QuietOption, SetOption
from dsd_cli.cli.pictures import PlotOption

if TYPE_CHECKING:
    from collections.abc import Mapping

    from dsd_cli.export.base import Joint, Motion, Target
    from dsd_cli.export.making import Made, Verified
    from dsd_cli.files.config import Config
    from dsd_cli.plant.model import PlantModel
    from dsd_cli.report.export import ExportReport


def target_ids(incomplete: str) -> list[str]:
    """For the completion of a shell."""
    from dsd_cli.export.targets import targets

    return [name for name in targets() if name.startswith(incomplete)]


ConfigArgument = Annotated[Path, typer.Argument(metavar="CONFIG", help="Config whose [model] is exported.")]
TargetOption = Annotated[
    str, typer.Option("--to", metavar="TARGET", autocompletion=target_ids, help="What to write, see docs/export.md.")
]
OutputNeeded = Annotated[str, typer.Option("-o", "--output", metavar="FILE", help="File to write; - is stdout.")]
VerifyOption = Annotated[
    str | None,
    typer.Option("--verify", metavar="LOG", help="Run the exported model under the u of LOG, not a built-in one."),
]
NoVerifyOption = Annotated[bool, typer.Option("--no-verify", help="Do not run the exported model.")]
DropOption = Annotated[
    bool, typer.Option("--drop", help="Leave out what TARGET does not carry, and say what it costs.")
]
NameOption = Annotated[str, typer.Option("--name", help="Name of the joint, block or functions in the file.")]
BudgetOption = Annotated[
    bool, typer.Option("--budget", help="Say of each effect what leaving it out costs under that u.")
]
SamplesOption = Annotated[
    int | None,
    typer.Option("--samples", metavar="N", min=1, max=10_000, help="Write N more files beside it, with drawn values."),
]
SeedOption = Annotated[int, typer.Option("--seed", help="Of the drawn values.")]
ClockOption = Annotated[
    float | None, typer.Option("--sample-time", metavar="S", help="Clock of the controller, s.", show_default=False)
]


#: Percent of u from which on leaving something out is warned of.
_MOST_LOST = 50.0


def export(
    config: ConfigArgument,
    target: TargetOption,
    output: OutputNeeded,
    verify: VerifyOption = None,
    no_verify: NoVerifyOption = False,
    drop: DropOption = False,
    budget: BudgetOption = False,
    samples: SamplesOption = None,
    seed: SeedOption = 0,
    name: NameOption = "joint",
    sample_time: ClockOption = None,
    override: SetOption = None,
    effects_from: EffectsFromOption = None,
    form: FormatOption = Format.TABLE,
    plot: PlotOption = None,
    quiet: QuietOption = False,
) -> None:
    """Write the model of CONFIG for a simulator, a controller or another tool, and run what was written.

    What TARGET cannot carry is refused, or with --drop left out and measured. The exported model is run beside that of
    `dsd simulate`, under the u of LOG or a built-in one, and is refused where its speed is more than 1 % (rms) off.
    """
    from dsd_cli.cli.identification import warn
    from dsd_cli.cli.pictures import check_plot
    from dsd_cli.cli.user_effects import use_effects
    from dsd_cli.errors import UsageError
    from dsd_cli.export.base import INERTIA
    from dsd_cli.export.making import cost, make
    from dsd_cli.export.making import verify as held_against
    from dsd_cli.export.targets import get_target
    from dsd_cli.files.config import load_config
    from dsd_cli.files.whole import check_target
    from dsd_cli.report.export import ExportReport

    use_effects(effects_from)
    found = get_target(target)
    _check(verify, no_verify, sample_time, output, form)
    if samples and output == "-":
        raise UsageError("-o - and --samples", "several files cannot go to stdout; give -o a file")
    settings = load_config(config, override or ())
    if output != "-":
        check_target(output, [config, *settings.files, *(effects_from or ()), *([verify] if verify else [])])
    check_plot(plot, [config, output, *([verify] if verify else [])])
    motion = _motion(settings, verify, sample_time)
    joint = _joint(settings, motion.sample_time, name)
    made = make(found, joint, motion, drop)
    _check_screen(output, made)
    warn(quiet, _lost(made))
    drawn = {} if samples is None else _draw_samples(settings, found, made, _Samples(output, samples, seed), quiet)
    checked = None if no_verify else held_against(found, made, motion)
    _check_holds(target, checked)
    warn(quiet, _not_run(target, verify, checked))
    for file, content in {output: made.content, **drawn}.items():
        _put(file, content)
    costs = {part: cost(joint, [part], motion) for part in joint.parts if part != INERTIA} if budget else None
    logs = (verify,) if verify else ()
    _show(ExportReport(made, checked, found.id, output, logs, settings.signals.units, costs, tuple(drawn)), form, quiet)
    if plot is not None:
        _draw(plot, checked, found.id, settings, quiet)


def _check(verify: str | None, no_verify: bool, sample_time: float | None, output: str, form: Format) -> None:
    """Options that contradict each other.

    Raises
    ------
    UsageError : says which.
    """
    from dsd_cli.errors import UsageError

    if verify is not None and (no_verify or sample_time is not None):
        other = "--no-verify" if no_verify else "--sample-time"
        raise UsageError(f"--verify and {other}", "give one of them")
    if sample_time is not None and not 0.0 < sample_time < 1.0:
        raise UsageError(f"--sample-time {sample_time:g}", "must be above 0 and below 1 s")
    if output == "-" and form is Format.JSON:
        raise UsageError("-o - and --format json", "both would go to stdout; give -o a file")


def _check_screen(output: str, made: Made) -> None:
    """Raises UsageError : bytes that are no text would go to a terminal."""
    import sys

    from dsd_cli.errors import UsageError

    if output == "-" and b"\0" in made.content and sys.stdout.isatty():
        raise UsageError("-o -: the file is binary, and stdout is a terminal", "give -o a file, or redirect stdout")


def _lost(made: Made) -> list[str]:
    """A line where what is left out is more than half of u."""
    if made.lost is None or made.lost.force_percent <= _MOST_LOST:
        return []
    parts = ", ".join(one.part for one in made.dropped)
    return [f"without {parts}, {made.lost.force_percent:.3g} % of u (rms) is missing: what is written is another axis"]


def _not_run(target: str, log: str | None, checked: Verified | None) -> list[str]:
    """A line where a log was given and nothing was run under its u."""
    if log is None or checked is None or checked.ran:
        return []
    return [f"--verify {log}: {checked.how}; nothing of {target} is verified"]


class _Samples(NamedTuple):
    """What --samples asks for: beside which file, how many, from which seed."""

    output: str
    number: int
    seed: int

    @property
    def names(self) -> list[str]:
        """Of the files."""
        path, digits = Path(self.output), len(str(self.number))
        return [str(path.with_name(f"{path.stem}-{i:0{digits}d}{path.suffix}")) for i in range(1, self.number + 1)]


def _draw_samples(settings: Config, target: Target, made: Made, asked: _Samples, quiet: bool) -> dict[str, bytes]:
    """`joint-001.xml`, ... beside `joint.xml`: models drawn from the errors in [[history]] and their correlations."""
    from dataclasses import replace

    from dsd_cli.cli.identification import warn
    from dsd_cli.cli.versus import fitted_errors
    from dsd_cli.export.drawing import draw

    model = made.joint.model
    errors = {
        name: error
        for name, error in fitted_errors(settings).items()
        if name == "inertia" or (name == "delay" and model.delay > 0.0) or name.partition(".")[0] in model.effects
    }
    together = settings.history[-1].fitted_correlations if errors else {}
    if len(errors) > 1 and not together:
        lone = "[[history]] has no correlations of these errors, so each value is drawn by itself"
        warn(quiet, [f"--samples: {lone}; `dsd add` or `improve` write them"])
    same = [name for part in made.joint.parts for name in _same(part, model, errors)]
    if errors and same:
        warn(quiet, [f"--samples: [[history]] has no error of {', '.join(same)}: the same in all files"])
    drawn = draw(model, errors, together, asked.number, asked.seed)
    return {name: target.write(replace(made.joint, model=one)) for name, one in zip(asked.names, drawn, strict=True)}


def _same(part: str, model: PlantModel, errors: Mapping[str, float]) -> list[str]:
    """Values of a part that have no error, numbers and tables; the part alone, where none of them has one."""
    if part not in model.effects:
        return [] if part in errors else [part]
    values = model.effects[part]
    names = [f"{part}.{name}" for name, value in values.items() if not _of_words(value)]
    lacking = [name for name in names if name not in errors]
    return [part] if lacking == names else lacking


def _of_words(value: object) -> bool:
    """A word, or a list of them: which law it is, and not how much of it."""
    return isinstance(value, str) or (isinstance(value, (list, tuple)) and all(isinstance(x, str) for x in value))


def _show(report: ExportReport, form: Format, quiet: bool) -> None:
    """On stdout, or beside a file that goes there on stderr."""
    import sys

    from dsd_cli.cli.identification import print_json
    from dsd_cli.report.export import export_json, print_export

    if form is Format.JSON:
        print_json(export_json(report))
    elif report.file != "-" or not quiet:
        print_export(report, sys.stderr if report.file == "-" else sys.stdout)


def _check_holds(target: str, checked: Verified | None) -> None:
    """Raises CheckFailed : the exported model ran, and is too far off."""
    from dsd_cli.errors import CheckFailed
    from dsd_cli.report.export import percent_off

    if checked is not None and checked.rms_percent is not None and not checked.holds:
        off = percent_off(checked.rms_percent)
        raise CheckFailed(
            f"{target}: the speed of the exported model is {off} off under {checked.how}; nothing is written",
            "1 % is the most; another target carries it, or --no-verify writes it all the same",
        )


def _put(output: str, content: bytes) -> None:
    """Into the file, whole or not at all; - is stdout."""
    import sys

    from dsd_cli.files.whole import write_whole

    if output == "-":
        sys.stdout.buffer.write(content)
        sys.stdout.buffer.flush()
    else:
        write_whole(output, content)


def _draw(plot: Path, checked: Verified | None, target: str, settings: Config, quiet: bool) -> None:
    """Both speeds; where the exported model did not run there is nothing to draw, which is said."""
    from dsd_cli.cli.identification import say
    from dsd_cli.cli.pictures import put_picture

    if checked is None or not checked.ran:
        why = "--no-verify" if checked is None else checked.how
        say(quiet, f"dsd: warning: {plot} is not drawn: {target} {why}")
        return
    from dsd_cli.report.plots_export import draw

    put_picture(plot, lambda: draw(checked, target, settings.signals.units), quiet)


def _joint(settings: Config, sample_time: float, name: str) -> Joint:
    from dsd_cli.cli.recordings import believed_model
    from dsd_cli.export.base import Joint

    units = settings.signals.units
    return Joint(believed_model(settings), sample_time, name, units.position == "m", units)


def _motion(settings: Config, log: str | None, sample_time: float | None) -> Motion:
    """u of the log from its first sample on, or the built-in motion of the config's clock."""
    from dsd_cli.cli.recordings import believed_model
    from dsd_cli.export.motion import built_in, logged

    model = believed_model(settings)
    if log is None:
        known = settings.signals.sample_time or (settings.simulate.sample_time if settings.simulate else 1e-3)
        return built_in(model, known if sample_time is None else sample_time)
    from dsd_cli.cli.plan import as_logged, log_columns, naming, optional_columns, reading
    from dsd_cli.files.logs import load_log

    settings = as_logged(settings, log)
    with naming(log):
        loaded = load_log(log, log_columns(settings.signals), optional_columns(settings), **reading(settings))
    return logged(loaded.log, log, loaded.restarts)
