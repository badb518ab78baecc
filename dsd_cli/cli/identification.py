"""What `dsd diagnose`, `add` and `improve` share: logs and config in, warnings and pictures out."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Annotated, Any

import typer

from dsd_cli.errors import printable, source_name

if TYPE_CHECKING:
    from dsd_cli.cli.progress import Progress
    from dsd_cli.files.config import Config, Signals
    from dsd_cli.identify.checks import Finding
    from dsd_cli.identify.d_hat_makers import Ask, OpenLog
    from dsd_cli.identify.fit.priors import PriorKnowledge
    from dsd_cli.identify.recordings.recording import Recording
    from dsd_cli.identify.results import Diagnosis
    from dsd_cli.identify.verdict.contradictions import Contradiction
    from dsd_cli.identify.verdict.diagnose import Settings
    from dsd_cli.plant.model import ObserverSettings, PlantModel

LogsArgument = Annotated[
    list[str], typer.Argument(metavar="LOG...", help="Log files (CSV, Parquet, MF4, ...); - is stdin.")
]
HoldoutOption = Annotated[
    list[str] | None,
    typer.Option("--holdout", metavar="LOG", help="Log that no fit sees; held-out errors are of it. Repeatable."),
]


@dataclass(frozen=True)
class Given:
    """Logs and config as the engine takes them, and what reading them has to say."""

    settings: Config
    recordings: tuple[Recording, ...]
    holdout: tuple[Recording, ...]
    model: PlantModel
    observer: ObserverSettings
    known: PriorKnowledge
    dropped: dict[str, int]
    warnings: tuple[str, ...]
    blocked: Finding | None = None

    @property
    def engine_settings(self) -> Settings:
        """How the engine shall work."""
        from dsd_cli.identify.verdict.diagnose import Settings

        return Settings(known=self.known, linear=self.settings.signals.units.position == "m")


def check_logs(logs: Sequence[str], holdout: Sequence[str], signals: Signals | None = None) -> None:
    """Each log once; with a window of time in [signals] a log may be held out too: what lies outside of it.

    Raises
    ------
    UsageError : a log is given twice.
    """
    from dsd_cli.cli.plan import window
    from dsd_cli.errors import UsageError

    parted = signals is not None and bool(window(signals))
    names = [*logs, *(name for name in holdout if not (parted and name in logs and name != "-"))]
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        hint = "each log once; --holdout is a log that the others are not, or what --from and --to leave of one"
        raise UsageError(f"{twice} is given twice", hint)


def load_given(config: Config, logs: Sequence[str], holdout: Sequence[str], progress: Progress | None = None) -> Given:
    """Read all logs, reporting to `progress`; d_hat as the likeliest of the makers that are open has made it.

    Raises
    ------
    DataError, UsageError : see `load_recording`; or [model] has no inertia.
    """
    given, asked = load_open(config, logs, holdout, progress)
    if asked is None:
        return given
    from dsd_cli.identify.d_hat_makers import likeliest

    if progress is not None:
        progress("asking who made d_hat")
    found = likeliest(asked)
    if found.best.as_here:
        return given
    made, apart = map(tuple, asked.made(found.best))
    settings, warnings = given.settings.override(found.best.keys), (*given.warnings, found.said("it is read so"))
    return replace(given, settings=settings, recordings=made, holdout=apart, warnings=warnings)


def load_open(
    config: Config, logs: Sequence[str], holdout: Sequence[str], progress: Progress | None = None
) -> tuple[Given, OpenLog | None]:
    """(all logs, d_hat as it was logged where its maker is open; what then says who it was). Raises as `load_given`."""
    from dsd_cli.cli.plan import makers_of, observer_of_motion
    from dsd_cli.cli.recordings import believed_model, known_values, load_holdout, load_recording
    from dsd_cli.identify.d_hat_makers import of_recording

    config, makers = makers_of(config, [*logs, *holdout])
    observer, model = observer_of_motion(config), believed_model(config)
    known = known_values(config)
    loaded = {path: load_recording(path, config, progress=progress) for path in logs}
    aside = {path: load_holdout(path, logs, config, progress) for path in holdout}
    everything = [*loaded.items(), *aside.items()]
    dropped: dict[str, int] = {}
    for _, one in everything:
        for reason, count in one.dropped.items():
            dropped[reason] = dropped.get(reason, 0) + count
    given = Given(
        config,
        tuple(loaded[path].recording for path in logs),
        tuple(one.recording for one in aside.values()),
        model,
        observer,
        known,
        dropped,
        tuple(f"{source_name(path)}: {warning}" for path, one in everything for warning in one.warnings),
        next((one.blocked for one in loaded.values() if one.blocked), None),
    )
    return given, of_recording(given.recordings, model, observer, makers, given.engine_settings, given.holdout)


def diagnosed(given: Given, asked: OpenLog | None, ask: Ask) -> tuple[Diagnosis, Sequence[Recording]]:
    """(the answer, whoever made d_hat; the recordings that it is of)."""
    if asked is None:
        answer = ask(given.recordings, given.holdout)
        return answer, as_mended(given, answer).recordings
    from dsd_cli.identify.d_hat_makers import diagnosed as over_makers

    answer, made = over_makers(asked, ask)
    return answer, as_mended(replace(given, recordings=tuple(made)), answer).recordings


def as_mended(given: Given, answer: Diagnosis) -> Given:
    """The logs that an answer is of: without what did not act in them."""
    mended = answer.mended
    return given if mended is None else replace(given, recordings=mended.recordings, holdout=mended.holdout)


def say(quiet: bool, line: str) -> None:
    """A message, one line."""
    if not quiet:
        typer.echo(printable(line), err=True)


def warn(quiet: bool, warnings: Iterable[str]) -> None:
    """Warnings, one line each."""
    for warning in warnings:
        say(quiet, f"dsd: warning: {warning}")


def early(quiet: bool, progress: Progress) -> Callable[[Sequence[Contradiction]], None]:
    """That the log is against the values given, before the search; with which figures is said at the end."""

    def told(against: Sequence[Contradiction]) -> None:
        progress.clear()
        names = ", ".join(dict.fromkeys(one.value for one in against))
        only = "only effects that it shows without those values are tried"
        say(quiet, f"dsd: this log contradicts the given values of {names}: {only}")

    return told


def print_json(result: dict[str, Any]) -> None:
    """On stdout; a NaN is a mistake of ours and fails."""
    from dsd_cli.report.terminal import json_text

    typer.echo(json_text(result, indent=2))
