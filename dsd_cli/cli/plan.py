"""From a config and the columns of a log to what the detector shall do."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from dsd_cli.detect.coloured import SensorNoise
from dsd_cli.detect.grid import Grid
from dsd_cli.detect.plan import Plan
from dsd_cli.detect.settings import DetectorSettings
from dsd_cli.detect.transition import Transition
from dsd_cli.errors import DataError, TooShort, UsageError, source_name
from dsd_cli.files.as_read import as_read
from dsd_cli.files.command import Command
from dsd_cli.files.config import Config, Detector, Observer, Signals, States, Stay
from dsd_cli.files.remade import Made
from dsd_cli.files.table_source import TableSource
from dsd_cli.files.windowed import Window
from dsd_cli.plant.maker import Maker
from dsd_cli.plant.model import ObserverSettings, PlantModel
from dsd_cli.signals.cleaning import MEASURED
from dsd_cli.signals.clock import TIME_SCALE
from dsd_cli.signals.log import DHatSource
from dsd_cli.signals.outliers import Limits

if TYPE_CHECKING:
    from dsd_cli.files.logs import LoadedLog

#: Channels that d_hat can be had from, best first.
DISTURBANCE = ("d_hat", "velocity", "position")
TRUTH = ("true_delay", "true_inertia")


def as_logged(config: Config, log: str) -> Config:
    """The config for that log: one that `dsd observe` wrote has the tool's names and units, whatever [signals] says;
    what is "auto" in [observer] is what this log says.

    Raises
    ------
    UsageError : it does not say it.
    """
    from dsd_cli.cli.d_hat_maker import known_maker
    from dsd_cli.files.table_source import OWN_CHANNELS
    from dsd_cli.files.tables_in import metadata_of

    if OWN_CHANNELS in metadata_of(log):
        config = config.with_signals(config.signals.applied(config.written.get("signals", {})))
    return known_maker(config, log, _with_d_hat_as_it_is)


def makers_of(config: Config, logs: Sequence[str]) -> tuple[Config, tuple[Maker, ...]]:
    """See `open_makers`, of logs that `dsd` itself has not written."""
    from dsd_cli.cli.d_hat_maker import open_makers
    from dsd_cli.files.table_source import OWN_CHANNELS
    from dsd_cli.files.tables_in import metadata_of

    if any(OWN_CHANNELS in metadata_of(log) for log in logs):
        return config, ()
    return open_makers(config, logs, _with_d_hat_as_it_is)


def _with_d_hat_as_it_is(config: Config, log: str, rows: int) -> LoadedLog:
    """At least so many rows of the log, or all."""
    from dsd_cli.files.logs import load_log

    columns = log_columns(config.signals)
    with naming(log):
        how = {**reading(config), "made": Made(), "most_rows": rows}
        return load_log(log, columns, {name for name in columns if name not in ("t", "u")}, **how)


def log_columns(signals: Signals) -> dict[str, str]:
    """Canonical channel -> column, for all that a config names."""
    columns = dict(signals.columns())
    if "time" in columns:
        columns = {"t": columns.pop("time"), **columns}
    return columns


def limits(signals: Signals) -> Limits:
    """What is no value of a channel, its factor in: [signals] ranges and outlier_factor."""
    given = {name: getattr(signals, f"{name}_range") for name in MEASURED}
    ranges = {name: (found[0], found[1]) for name, found in given.items() if found is not None}
    return Limits(ranges, signals.outlier_factor)


def optional_columns(config: Config) -> set[str]:
    """Channels that a log may lack: all that the config does not name itself, but u and the time."""
    columns = log_columns(config.signals)
    return {name for name in columns if name not in ("t", "u") and not config.says(f"signals.{name}")}


def reading(config: Config) -> dict[str, Any]:
    """How [signals] and [observer] say that a log is read: what `load_log` takes beside the columns."""
    signals = config.signals
    return {
        "made": made(config),
        "sample_time": signals.sample_time,
        "time_scale": TIME_SCALE[signals.time_unit],
        "factors": signals.factors(),
        "offsets": signals.offsets(),
        "command": command(signals),
        "limits": limits(signals),
        "window": window(signals),
        "layout": signals.layout,
    }


def made(config: Config) -> Made:
    """How a logged d_hat was made; as here without [observer], and for what is "auto" and was not found."""
    section = config.observer
    if section is None:
        return Made()
    kept = {name: value for name in ("filter", "u") if (value := getattr(section, name)) != "auto"}
    return Made(Maker(**kept), section.time_constant, section.sign)


def command(signals: Signals) -> Command:
    """How u was logged."""
    return Command(signals.u_hold, signals.u_shift, signals.u_filter)


def window(signals: Signals) -> Window:
    """The rows that are read: [signals] start and end."""
    return Window(signals.start, signals.end)


def rows_read(table: TableSource, config: Config) -> TableSource:
    """The rows of a table as [signals] and [observer] say that they are read."""
    signals = config.signals
    clock: dict[str, Any] = {"time_scale": TIME_SCALE[signals.time_unit], "sample_time": signals.sample_time}
    clock |= {"offsets": signals.offsets(), "made": made(config)}
    return as_read(table, command(signals), window(signals), signals.factors(), **clock)


@contextmanager
def widening(signals: Signals) -> Iterator[None]:
    """Where only a part of a log is read, and it is too short, that is what can be mended."""
    try:
        yield
    except TooShort as error:
        if part := window(signals):
            raise DataError(error.message, f"only its part {part} is read, widen --from and --to") from None
        raise


@contextmanager
def naming(log: str) -> Iterator[None]:
    """What is wrong with the rows of a log is said with the name of the log, once."""
    try:
        yield
    except DataError as error:
        if source_name(log) not in error.message:
            error.message = f"{source_name(log)}: {error.message}"
        raise


def observer_settings(config: Config) -> ObserverSettings:
    """[observer]."""
    section = config.require(Observer)
    return ObserverSettings(section.nominal_inertia, section.time_constant, section.sign)


#: s: the filter of an observer that nobody described.
_STAND_IN = 0.01


def observer_of_motion(config: Config) -> ObserverSettings:
    """[observer], or one of [model] inertia: d_hat that is computed from the motion changes no number of a fit."""
    if config.observer is None and config.model.inertia is not None:
        return ObserverSettings(config.model.inertia, _STAND_IN)
    return observer_settings(config)


def plant_model(config: Config, inertia: float) -> PlantModel:
    """[model]; where its inertia does not matter, `inertia` stands in."""
    model = config.model
    return PlantModel(model.inertia or inertia, model.delay, model.effects, model.rest_speed)


def detection_plan(config: Config, found: Mapping[str, str], metadata: Mapping[str, str], name: str) -> Plan:
    """The plan for a log with the columns `found` (canonical -> column).

    Raises
    ------
    DataError : neither d_hat nor velocity nor position; or a channel that an effect needs is missing.
    UsageError : something that contradicts itself in the config.
    """
    states = config.require(States)
    axes = {
        f"{effect}.{parameter}": tuple(values)
        for effect, parameters in states.effects.items()
        for parameter, values in parameters.items()
    }
    grid = Grid(tuple(states.delays), tuple(states.inertias), axes)
    model = plant_model(config, states.inertias[0])
    source = next((channel for channel in DISTURBANCE if channel in found), None)
    if source is None:
        raise DataError(
            f"{name}: neither d_hat nor velocity nor position", "set one of them in [signals] to the log's column"
        )
    first = {effect: {p: v[0] for p, v in parameters.items()} for effect, parameters in states.effects.items()}
    template = model.changed(effects=first)
    aperture = 2 if metadata.get("d_hat_source") == "position" else 1
    settings = detector_settings(config, grid)
    if settings.output == "derivative":
        from dsd_cli.detect.damping.derivative import check

        check(grid)
        if settings.method == "profile":
            raise UsageError('detector.output = "derivative" has no method "profile"', "use dsd or another method")
        template = model.changed()  # eq. 6 needs no motion
        channels: tuple[str, ...] = ()
    else:
        channels = _effect_channels(template, found, name, from_position=aperture == 2 or source == "position")
    return Plan(
        grid=grid,
        settings=settings,
        model=template,
        observer=observer_settings(config),
        d_hat_source=_source(source),
        logged_aperture=aperture,
        channels=channels,
    )


def _source(channel: str) -> DHatSource:
    if channel == "d_hat":
        return "logged"
    return "velocity" if channel == "velocity" else "position"


def _effect_channels(model: PlantModel, found: Mapping[str, str], name: str, from_position: bool) -> tuple[str, ...]:
    """Motion channels to read for the effects; the speed can be had from the position, as d_hat was."""
    needed = []
    for channel, effect in model.needs().items():
        if channel == "velocity" and "position" in found and (from_position or "velocity" not in found):
            needed.append("position")
        elif channel in ("velocity", "position"):
            if channel not in found:
                raise DataError(f"{name}: no {channel}, and effect {effect} needs it", f"set [signals] {channel}")
            needed.append(channel)
    return tuple(dict.fromkeys(needed))


def detector_settings(config: Config, grid: Grid) -> DetectorSettings:
    """[detector] for this grid."""
    section = config.require(Detector)
    initial = 0
    if section.initial is not None:
        initial = grid.index(section.initial.delay, section.initial.inertia)
    noise = section.sensor_noise
    return DetectorSettings(
        method=section.method,
        window=section.window,
        rho=section.rho,
        average=section.average,
        transition=_transition(config, section, len(grid)),
        initial=initial,
        observer_filter=section.observer_filter,
        hold=section.hold,
        confidence=section.confidence,
        output=section.output,
        change=section.change,
        sensor_noise=SensorNoise(noise.velocity, noise.position) if noise is not None else SensorNoise(),
    )


def _transition(config: Config, section: Detector, states: int) -> Transition:
    if section.transition == "uniform":
        return Transition()
    if isinstance(section.transition, Stay):
        return Transition(stay=section.transition.stay)
    path = config.resolve(section.transition.file)
    transition = Transition(matrix=_read_matrix(path))
    try:
        transition.log_matrix(states)
    except UsageError as error:
        raise UsageError(f"{path}: {error.message}", error.hint) from None
    return transition


def _read_matrix(path: Path) -> np.ndarray:
    try:
        return np.loadtxt(path, delimiter=",", ndmin=2, encoding="utf-8-sig")
    except OSError as error:
        raise UsageError(f"{path}: the transition matrix cannot be read ({error.strerror or 'no such file'})") from None
    except ValueError as error:
        raise UsageError(f"{path}: not a matrix of numbers ({error})", "one row per state, commas between") from None
