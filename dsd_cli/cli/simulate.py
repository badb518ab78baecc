"""`dsd simulate`: what would the log look like?"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from dsd_cli.cli.options import (
    CONFIG_FILE,
    EffectOption,
    EffectsFromOption,
    QuietOption,
    SetOption,
    nearest_config,
    template_names,
)
from dsd_cli.cli.pictures import PlotOption

if TYPE_CHECKING:
    from dsd_cli.files.config import Config, Planned
    from dsd_cli.plant.controllers import ControllerSettings
    from dsd_cli.plant.references import Reference
    from dsd_cli.plant.simulation import SimulationSettings
    from dsd_cli.signals.log import Array, Log

ConfigOrNone = Annotated[
    Path | None, typer.Option("-c", "--config", metavar="FILE", help=f"Config file of the rig; default {CONFIG_FILE}.")
]
OutputNeeded = Annotated[
    str, typer.Option("-o", "--output", metavar="FILE", help="Log to write (.csv or .parquet); - is stdout.")
]
TemplateOption = Annotated[
    str | None,
    typer.Option(
        "--template",
        metavar="NAME",
        autocompletion=template_names,
        help="Run this template (see `dsd init`), not a config file.",
    ),
]
SeedOption = Annotated[int | None, typer.Option("--seed", help="Seed of the noise.")]
NoiseOption = Annotated[
    float | None, typer.Option("--noise", help="Standard deviation of the noise on d_hat, unit of u.")
]
AdaptOption = Annotated[
    bool, typer.Option("--adapt", help="The state that [states] and [detector] find goes back into the controller.")
]
ReferenceOption = Annotated[
    Path | None,
    typer.Option(
        "--reference",
        metavar="FILE",
        help="Follow this motion of dsd plan, in place of [simulate.reference], after a second of rest.",
    ),
]
DurationOption = Annotated[float | None, typer.Option("--duration", metavar="S", help="Length of the log, s.")]


def simulate(
    output: OutputNeeded,
    config: ConfigOrNone = None,
    template: TemplateOption = None,
    override: SetOption = None,
    effect: EffectOption = None,
    effects_from: EffectsFromOption = None,
    seed: SeedOption = None,
    noise: NoiseOption = None,
    duration: DurationOption = None,
    reference: ReferenceOption = None,
    adapt: AdaptOption = False,
    plot: PlotOption = None,
    quiet: QuietOption = False,
) -> None:
    """Run the delayed plant of the config (or of a template) in closed loop and write its log.

    Columns: t, u, d_hat, position, velocity, reference, and the truth (true_delay, true_inertia); with --adapt also
    adopted_delay, adopted_inertia. Config and seed go into the Parquet metadata, or into FILE.meta.json.
    """
    from dsd_cli.cli.identification import say, warn
    from dsd_cli.cli.pictures import check_plot, put_picture
    from dsd_cli.cli.progress import Progress
    from dsd_cli.cli.user_effects import use_effects
    from dsd_cli.files.logs import write_log
    from dsd_cli.files.tables_out import check_output
    from dsd_cli.plant.beyond import held_beyond
    from dsd_cli.plant.simulation import simulate as run

    use_effects(effects_from)
    settings = _config(config, template, quiet)
    values = {"seed": seed, "noise": noise, "duration": duration}
    given = [f"simulate.{name}={value!r}" for name, value in values.items() if value is not None]
    given += _following(reference, duration) if reference is not None else []
    settings = settings.override([*(override or ()), *given], effect or ())
    inputs = (*filter(None, (config,)), *settings.files, *(effects_from or ()))
    if output != "-":
        check_output(output, inputs)
    check_plot(plot, (*inputs, output))
    plant = simulation_settings(settings)
    feedback = None
    if adapt:
        from dsd_cli.cli.adapt import adaptation, adopted_line

        feedback = adaptation(settings, plant)
    with Progress(not quiet) as progress:
        log = run(plant, feedback, progress.rows("simulating", round(plant.duration / plant.sample_time)))
        _check_finite(settings.name, log)
        beyond = held_beyond(plant.model, [log])
        progress("writing")
        write_log(output, _with_provenance(log, settings))
    warn(quiet, beyond)
    say(quiet, f"{output}: {len(log):,} samples, {log.sample_time * 1e3:g} ms apart")
    if adapt:
        say(quiet, adopted_line(log))
    if plot is not None:
        from dsd_cli.report.plots_channels import draw

        name = output if output != "-" else settings.name
        put_picture(plot, lambda: draw(name, log, (), settings.signals.units), quiet)


#: s of rest before a motion.
_REST = 1.0


def _following(reference: Path, duration: float | None) -> list[str]:
    """What --reference says of [simulate]: the motion, and how long it takes."""
    import json

    named = f'{{kind = "plan", file = {json.dumps(str(reference.resolve()))}, delay = {_REST}}}'
    last = _read_column(reference, "t")[-1]
    return [f"simulate.reference={named}"] + [f"simulate.duration={_REST + last!r}"] * (duration is None)


def _check_finite(name: str, log: Log) -> None:
    """A closed loop that is not stable grows beyond all numbers.

    Raises
    ------
    DataError : says from when on.
    """
    import numpy as np

    from dsd_cli.errors import DataError

    bad = [~np.isfinite(log[channel]) for channel in ("u", "d_hat", "position", "velocity") if channel in log]
    if (first := int(np.logical_or.reduce(bad).argmax())) or (bad and any(one[0] for one in bad)):
        raise DataError(
            f"{name}: the simulation diverges, from t = {log['t'][first]:g} s on it is not finite",
            "lower the gains or the delay, or set simulate.controller.limit",
        )


def _config(config: Path | None, template: str | None, quiet: bool) -> Config:
    from dsd_cli.errors import UsageError
    from dsd_cli.files.config import load_config
    from dsd_cli.files.template import load_template

    if template is not None and config is not None:
        raise UsageError("--config and --template", "give one of them")
    if template is not None:
        return load_template(template)
    return load_config(config or nearest_config(CONFIG_FILE, quiet))


def _with_provenance(log: Log, settings: Config) -> Log:
    from dataclasses import replace

    from dsd_cli import __version__
    from dsd_cli.files.config import Simulate

    seed = settings.require(Simulate).seed
    return replace(log, metadata={"dsd_version": __version__, "seed": str(seed), "config": settings.to_toml()})


def simulation_settings(settings: Config) -> SimulationSettings:
    """[observer], [model] and [simulate] as the plant package takes them.

    Raises
    ------
    UsageError : a section is missing.
    """
    from dsd_cli.cli.plan import observer_settings, plant_model
    from dsd_cli.files.config import Simulate
    from dsd_cli.plant.simulation import Event, Measurement, SimulationSettings

    section = settings.require(Simulate)
    return SimulationSettings(
        model=plant_model(settings, settings.require_inertia()),
        duration=section.duration,
        sample_time=section.sample_time,
        observer=observer_settings(settings),
        controller=controller_settings(settings),
        reference=_reference(settings),
        start=section.start,
        feedforward=_feedforward(settings),
        events=tuple(Event(e.time, e.delay, e.inertia, e.effects, e.noise) for e in section.events),
        measurement=Measurement(
            section.noise, section.position_noise, section.velocity_noise, section.encoder_step, section.seed
        ),
    )


def controller_settings(settings: Config) -> ControllerSettings:
    """[simulate.controller]; gains by the coefficient diagram method unless kp and kd are given."""
    import math

    from dsd_cli.files.config import Observer, Simulate
    from dsd_cli.plant.controllers import ControllerSettings, Gains, cdm_gains

    section = settings.require(Simulate).controller
    nominal = settings.require(Observer).nominal_inertia
    if section.kp is not None and section.kd is not None:
        gains = Gains(section.kp, section.kd)
    elif section.time_constant is not None:
        gains = cdm_gains(section.time_constant, nominal, section.gamma)
    else:
        gains = Gains(0.0, 0.0)
    limit = math.inf if section.limit is None else section.limit
    return ControllerSettings(section.kind, gains, section.derivative, limit, section.ki)


def _reference(settings: Config) -> Reference:
    """[simulate.reference]."""
    from dsd_cli.files import config as sections
    from dsd_cli.plant import references

    section = settings.require(sections.Simulate)
    match section.reference:
        case sections.Step() as step:
            return references.Step(step.time, step.amplitude)
        case sections.Sine() as sine:
            return references.Sine(sine.frequency, sine.amplitude, sine.start)
        case sections.Multisine() as sines:
            return references.Multisine(sines.frequencies, sines.amplitude, sines.seed)
        case sections.Trapezoid() as moves:
            return references.Trapezoids(moves.distance, moves.speed, moves.acceleration, moves.dwell, moves.start)
        case sections.Column() as column:
            return references.Samples(_read_column(settings.resolve(column.file), column.column))
        case sections.Planned() as planned:
            position, rate, _ = _planned(settings, planned)
            return references.Planned(position, rate)


def _feedforward(settings: Config) -> Array | None:
    """What a planned motion adds to u; None of other references."""
    from dsd_cli.files import config as sections

    reference = settings.require(sections.Simulate).reference
    return _planned(settings, reference)[2] if isinstance(reference, sections.Planned) else None


def _planned(settings: Config, reference: Planned) -> tuple[Array, Array, Array]:
    """Position, its rate and feedforward that `dsd plan` wrote, at the samples of the simulation.

    Raises
    ------
    DataError : a column is missing.
    """
    import numpy as np

    from dsd_cli.files.config import Simulate
    from dsd_cli.files.motion_out import COLUMNS

    path, step = settings.resolve(reference.file), settings.require(Simulate).sample_time
    t, position, velocity, _, added = (np.array(_read_column(path, name)) for name in COLUMNS)
    at = np.arange(round((reference.delay + t[-1]) / step) + 1) * step - reference.delay
    rate = np.where(at < 0.0, 0.0, np.interp(at, t, velocity))
    return np.interp(at, t, position), rate, np.interp(at, t, added)


def _read_column(path: Path, column: str) -> tuple[float, ...]:
    from dsd_cli.files.tables_in import open_table

    table = open_table(path, {"reference": column})
    return tuple(value for batch in table.batches() for value in batch.columns["reference"].tolist())
