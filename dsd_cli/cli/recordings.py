"""From a log file and a config to a recording: what compare, diagnose, add and improve start from."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import PurePath
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from dsd_cli.cli.progress import Progress
    from dsd_cli.files.config import Config
    from dsd_cli.files.logs import LoadedLog
    from dsd_cli.files.windowed import Window
    from dsd_cli.identify.checks import CheckResult, Finding
    from dsd_cli.identify.fit.priors import PriorKnowledge
    from dsd_cli.identify.recordings.recording import Recording
    from dsd_cli.plant.model import PlantModel
    from dsd_cli.signals.log import Log
    from dsd_cli.signals.updates import Updated


@dataclass(frozen=True)
class LoadedRecording:
    """A recording, and what reading it has to say.

    `dropped` : reason -> rows that were not taken as they are. `blocked` : what must be mended first, as nothing
    that is missing is identifiable before.
    """

    recording: Recording
    dropped: Mapping[str, int]
    warnings: tuple[str, ...]
    blocked: Finding | None = None


def load_recording(
    path: str, config: Config, window: Window | None = None, progress: Progress | None = None
) -> LoadedRecording:
    """Read a log (- is stdin), with d_hat and the motion that can be had.

    Every channel that the config names may be missing but u (and the time).

    Parameters
    ----------
    window : the rows that are read; None: as [signals] says.
    progress : is called with the share that is read.

    Raises
    ------
    DataError : no u, nothing to have d_hat from, too short, or an axis that stands still.
    UsageError : the config lacks [observer].
    """
    from dsd_cli.cli.d_hat_maker import half_said
    from dsd_cli.cli.plan import as_logged, log_columns, naming, observer_of_motion, plant_model, reading
    from dsd_cli.cli.unit_in_name import left_out
    from dsd_cli.errors import DataError, TooShort
    from dsd_cli.files.config import Observer
    from dsd_cli.files.logs import load_log
    from dsd_cli.identify.recordings.recording import prepare
    from dsd_cli.plant.beyond import held_beyond

    config = as_logged(config, path)
    observer = observer_of_motion(config)
    columns = log_columns(config.signals)
    with naming(path):
        optional = {name for name in columns if name not in ("t", "u")}
        how = reading(config) if window is None else {**reading(config), "window": window}
        loaded = load_log(path, columns, optional, **how, watch=None if progress is None else progress.watch)
    if window:
        loaded = replace(loaded, log=replace(loaded.log, source=f"{loaded.log.source} ({window})"))
    if "d_hat" in loaded.log:
        config.require(Observer)  # which made it
    lacking = [*absent(config, columns, loaded), *(one.line for one in left_out(config))]
    loaded = by_updates(loaded)
    _check_channels(loaded.log.source, loaded)
    check_sizes(loaded.log.source, loaded)
    if progress is not None:
        progress(f"looking at {PurePath(path).name}")
    loaded, noisy = on_its_clock(loaded)
    checked = _checked(loaded, config)
    loaded, late = _without_late(loaded, checked)
    try:
        recording = prepare(loaded.log, observer, loaded.restarts, config.model.rest_speed)
    except TooShort as error:
        if window:
            raise DataError(error.message, "leave more of the log to hold out: change --from and --to") from None
        raise
    dropped = {reason: count for reason, count in loaded.dropped.items() if count}
    beyond = held_beyond(plant_model(config, 1.0), recording.pieces) if config.model.effects else []
    wrong = _wrong(config, checked, recording)
    warnings = (*loaded.warnings, *lacking, *noisy, *late, *wrong, *beyond)
    if path == "-" and not loaded.log.channels.keys() & {"velocity", "position"}:
        warnings += half_said(config)
    return LoadedRecording(recording, dropped, warnings, to_turn_u(checked))


def by_updates(loaded: LoadedLog) -> LoadedLog:
    """The log by the clock of its sensors, where it is written faster than they are read, and with the position of
    which a speed is the difference; the warnings say so, and whether u has a slower clock."""
    from dsd_cli.signals.updates import rows_of_u, summed

    taken = _as(summed, of_new_rows(loaded))
    log = taken.log
    each = rows_of_u(log["u"]) if "u" in log and log.u_hold == "held" and taken.regular else 1
    if each == 1:
        return taken
    more = f"{500.0 * (each - 1) * log.sample_time:.3g} ms"
    said = (
        f"u has a new value every {each} rows: if the logger read it so, and no drive held it, delay is {more} longer"
    )
    return replace(taken, warnings=(*taken.warnings, said))


def of_new_rows(loaded: LoadedLog) -> LoadedLog:
    """The log by the clock of its sensors, where it is written faster than they are read; the warnings say so."""
    from dsd_cli.signals.updates import updated

    return _as(updated, loaded)


def _as(taken: Callable[[Log, tuple[int, ...]], Updated], loaded: LoadedLog) -> LoadedLog:
    """A log as it is taken, and what is said of that."""
    found = taken(loaded.log, loaded.restarts)
    said = (found.said,) if found.said else ()
    return replace(loaded, log=found.log, restarts=found.restarts, warnings=(*loaded.warnings, *said))


def _checked(loaded: LoadedLog, config: Config) -> CheckResult:
    """Without values."""
    from functools import partial

    from dsd_cli.cli.plan import observer_of_motion
    from dsd_cli.files.config.remedies import keys_that_multiply
    from dsd_cli.identify.checks import check_log

    factors, keys_of = config.signals.factors(), partial(keys_that_multiply, config.signals)
    shift, observer = config.signals.u_shift, observer_of_motion(config)
    known: dict[str, Any] = {"factors": factors, "keys_of": keys_of, "u_shift": shift}
    return check_log(loaded.log, None, observer, loaded.restarts, **known, with_values=False)


def _without_late(loaded: LoadedLog, checked: CheckResult) -> tuple[LoadedLog, list[str]]:
    """(the log as `checks.without_late` has it, a sentence about it)."""
    from dsd_cli.identify.checks import without_late

    late = next((one for one in checked.findings if one.late_channel), None)
    if late is None or checked.errors:
        return loaded, []
    alone = late.late_channel == "velocity"
    done = "the position alone is used" if alone else "it is taken as so much earlier"
    return replace(loaded, log=without_late(loaded.log, late)), [f"{late.what}; {done}"]


def on_its_clock(loaded: LoadedLog) -> tuple[LoadedLog, list[str]]:
    """(the log on an even clock, if its stamps are rather noise on one, a sentence about it)."""
    from dsd_cli.identify.checks.clock import evened

    log = evened(loaded.log, loaded.restarts)
    if log is loaded.log:
        return loaded, []
    said = f"the motion is smoother on an even clock than at its stamps: {log.sample_time * 1e3:.4g} ms are taken"
    return replace(loaded, log=log), [said]


def _wrong(config: Config, checked: CheckResult, recording: Recording) -> list[str]:
    """What must be said before anything that this log answers, and what mends it: sign, unit, a late u, a loop."""
    from dsd_cli.identify.checks import biased_by_noise, to_mend_first

    first: Sequence[Finding] = to_mend_first(checked)
    if not first and "reference" in recording.pieces[0]:
        given, model = known_values(config), _written_model(config)
        first = biased_by_noise(recording, model, given.fixed.keys() | given.priors.keys())
    return [f"{one.what.rstrip('?')}: {one.remedy} (dsd check says more)" for one in first]


def to_turn_u(checked: CheckResult) -> Finding | None:
    """What is said of a u of the other sign than the motion that it causes, where that is the surest error."""
    return next((one for one in checked.errors[:1] if one.multiply == (("u", -1.0),)), None)


def believed_model(config: Config) -> PlantModel:
    """[model] with what [fit] fixes in it; raises UsageError where neither gives an inertia."""
    return known_values(config).applied(_written_model(config))


def _written_model(config: Config) -> PlantModel:
    from dsd_cli.cli.plan import plant_model

    return plant_model(config, config.fit.fix.get("inertia") or config.require_inertia())


def known_values(config: Config) -> PriorKnowledge:
    """[fit]: what a fit is given of values.

    Raises
    ------
    UsageError : see `Fit.known`.
    """
    return config.fit.known(_written_model(config), config.name)


def of_no_effect(settings: Config) -> list[str]:
    """Values of [fit] fix whose effect [model] does not have: where no effect is added, nothing comes of them."""
    here = _written_model(settings).effects
    told = [(name.partition("."), value) for name, value in known_values(settings).fixed.items()]
    return [
        f"--fix {effect}.{parameter}={value:g} changes nothing here, for the model has no {effect}: "
        f"--effect {effect}:{parameter}={value:g} puts it in"
        for (effect, dot, parameter), value in told
        if dot and effect not in here
    ]


def beyond_known(settings: Config) -> list[str]:
    """Values of [model] beyond their bounds, or far from their priors."""
    from dsd_cli.identify.fit.values import flat

    known, lines = known_values(settings), []
    for name, value in flat(believed_model(settings)).items():
        low, high = known.limits(name)
        if not low <= value <= high:
            lines.append(f"{name} = {value:.4g} is beyond its bounds, {low:g} to {high:g}")
        if name in known.priors and abs(value - known.priors[name][0]) > 3.0 * known.priors[name][1]:
            mean, spread = known.priors[name]
            lines.append(
                f"{name} = {value:.4g} is {abs(value - mean) / spread:.1f} sigma from its prior {mean:g} +- {spread:g}"
            )
    return lines


#: Squares of larger values overflow, and of channels below its inverse vanish.
_LARGEST = 1e100
#: u is so many times d_hat, more than rounding makes of a d_hat that should be 0: one of them is something else.
_FARTHEST = 1e25


def _check_channels(path: str, loaded: LoadedLog) -> None:
    from dsd_cli.errors import DataError

    log = loaded.log
    if not any(name in log for name in ("d_hat", "velocity", "position")):
        raise DataError(
            f"{path}: neither d_hat nor velocity nor position", "set one of them in [signals] to the log's column"
        )
    for name in ("position", "velocity"):
        if name in log and len(log) > 1 and bool((log[name] == log[name][0]).all()):
            raise DataError(
                f"{path}: the axis does not move", f"{name} is {log[name][0]:g} in all rows; is that its column?"
            )


def check_sizes(path: str, loaded: LoadedLog) -> None:
    """Numbers that can be computed with.

    Raises
    ------
    DataError : a channel with values whose squares overflow or vanish, or u and d_hat too far apart for one sum.
    """
    from dsd_cli.errors import DataError

    largest = {name: float(abs(column).max()) for name, column in loaded.log.channels.items()}
    for name, size in largest.items():
        if size > _LARGEST:
            raise DataError(f"{path}: {name} goes beyond {_LARGEST:g}", "is that its column?")
        if name != "t" and 0.0 < size < 1.0 / _LARGEST:
            raise DataError(f"{path}: {name} stays below {1.0 / _LARGEST:g}", f"is signals.{name}_scale right?")
    u, d_hat = largest.get("u", 0.0), largest.get("d_hat", 0.0)
    if d_hat > 0.0 and u > _FARTHEST * d_hat:
        raise DataError(f"{path}: u goes to {u:g} where d_hat stays within {d_hat:.2g}", "are these their columns?")


def absent(config: Config, columns: Mapping[str, str], loaded: LoadedLog) -> list[str]:
    """Channels that the config itself names and the log lacks."""
    return [
        f'no column "{column}" (signals.{name})'
        for name, column in columns.items()
        if name not in loaded.log and config.says(f"signals.{name}")
    ]


def load_holdout(path: str, logs: Sequence[str], config: Config, progress: Progress | None = None) -> LoadedRecording:
    """A log that no fit sees: all of it, or what lies outside of --from and --to of a log that is fitted."""
    from dsd_cli.cli.plan import window
    from dsd_cli.files.windowed import Window

    return load_recording(path, config, window(config.signals).rest if path in logs else Window(), progress)
