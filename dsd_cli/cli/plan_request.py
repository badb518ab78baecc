"""From the options and the config to what a plan is asked for, and to the plan."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from dsd_cli.errors import UsageError, source_name

if TYPE_CHECKING:
    from dsd_cli.cli.identification import Given
    from dsd_cli.cli.progress import Progress
    from dsd_cli.design.plan import Wanted
    from dsd_cli.design.results import Plan
    from dsd_cli.files.config import Config
    from dsd_cli.identify.fit.solve import Fit
    from dsd_cli.identify.results import Diagnosis
    from dsd_cli.identify.search.sets import Search
    from dsd_cli.plant.controllers import ControllerSettings
    from dsd_cli.report.planning import Experiment

#: What --seconds stands for, and the least that a motion can have.
_LENGTHS, _LEAST_SECONDS, _MOST_SECONDS = 5, 1.0, 600.0


@dataclass(frozen=True)
class Request:
    """What is wanted of a plan, by the options and [plan]."""

    wanted: Wanted
    told: Told | None = None


@dataclass(frozen=True)
class Told:
    """A file of `dsd diagnose`: effect that it found -> what is as good, and values that are hardly identified."""

    path: Path
    ties: Mapping[str, Sequence[str]]
    weak: Sequence[str]

    @property
    def names(self) -> tuple[str, ...]:
        """What the file leaves open."""
        rivals = [r for some in self.ties.values() for r in some]
        return tuple(dict.fromkeys([*(self.ties if rivals else ()), *rivals, *self.weak]))

    def same_as(self, found: Diagnosis) -> bool:
        """Whether the logs, diagnosed anew, leave the same effects open."""
        ties = {c.effect: set(c.indistinguishable_from) for c in found.ranking if c.effect in found.found}
        return {name: set(some) for name, some in self.ties.items()} == ties


@dataclass(frozen=True)
class Answer:
    """A plan, the diagnosis before it, and the experiments that were run."""

    plan: Plan
    diagnosis: Diagnosis
    warnings: tuple[str, ...] = ()
    experiments: tuple[Experiment, ...] = ()


Numbers = tuple[str | None, Sequence[str], float | None, float | None]


def names_of(wanted: Sequence[str] | None, diagnosis: Path | None) -> tuple[str, ...]:
    """What is to be identified by --for; () for what the logs, or a diagnosis, leave open.

    Raises
    ------
    UsageError : both are given, or --for names nothing.
    """
    names = tuple(name.strip() for text in wanted or () for name in text.split(",") if name.strip())
    if wanted and not names:
        raise UsageError("--for names nothing", "give effects or values, such as gravity,constant_load")
    if names and diagnosis is not None:
        raise UsageError("--for and --diagnosis", "give one of them")
    return names


def told_by(path: Path | None) -> Told | None:
    """What a diagnosis left open.

    Raises
    ------
    UsageError : the file is no result of `dsd diagnose`.
    """
    import json

    if path is None:
        return None
    try:
        told = json.loads(path.read_text(encoding="utf-8"))
        ranking = {one["effect"]: one for one in told["ranking"]}
        ties = {name: tuple(ranking[name]["indistinguishable_from"]) for name in told["found"] if name in ranking}
        weak = [name for name, one in told["estimates"].items() if one.get("identified") in ("weak", "not")]
    except FileNotFoundError:
        raise UsageError(f"{path}: no such file") from None
    except OSError as error:
        raise UsageError(f"{path}: cannot be read", error.strerror or str(error)) from None
    except (ValueError, KeyError, TypeError, AttributeError):
        raise UsageError(f"{path}: no result of dsd diagnose", "write it with --format json") from None
    return Told(path, ties, weak)


def request(settings: Config, names: tuple[str, ...], numbers: Numbers, told: Told | None = None) -> Request:
    """What the options and [plan] say: the options come first.

    Parameters
    ----------
    numbers : --seconds, --limit, --start, --sample-time. `told` : by a file of --diagnosis.

    Raises
    ------
    UsageError : an option that cannot be read.
    """
    from dsd_cli.design.plan import Wanted

    seconds, limits, start, rate = numbers
    section = settings.plan
    given = {n: (0.0, float(x)) for n in ("velocity", "acceleration", "jerk", "u") if (x := getattr(section, n))}
    if section.position is not None:
        given["position"] = section.position
    given |= dict(_limit(text) for text in limits)
    begin = section.start if start is None else start
    if rate is not None and not rate > 0.0:
        raise UsageError(f"--sample-time {rate:g}", "must be above 0, in s")
    if begin is not None and not math.isfinite(begin):
        raise UsageError(f"--start {begin:g}", "must be a position")
    in_config = () if section.seconds is None else (section.seconds,)
    lengths = in_config if seconds is None else _lengths(seconds)
    return Request(
        Wanted(
            names=names,
            seconds=lengths,
            limits=given,
            start=math.nan if begin is None else begin,
            controller=_controller(settings),
            rate=math.nan if rate is None else rate,
        ),
        told,
    )


def _controller(settings: Config) -> ControllerSettings | None:
    """[simulate.controller], where it closes a loop that follows a reference."""
    if settings.simulate is None or settings.observer is None or settings.simulate.controller.kind == "open_loop":
        return None
    from dsd_cli.cli.simulate import controller_settings

    return controller_settings(settings)


def _limit(text: str) -> tuple[str, tuple[float, float]]:
    from dsd_cli.design.limits import NAMES

    name, _, value = text.partition("=")
    form = "write position=-1:1, velocity=3, acceleration=20, jerk=400 or u=2"
    if name not in NAMES:
        raise UsageError(f"--limit {text}: no limit '{name}'", form)
    low, colon, high = value.partition(":")
    try:
        numbers = [float(x) for x in ((low, high) if colon else (low,))]
    except ValueError:
        raise UsageError(f"--limit {text}: not a number", form) from None
    if not all(math.isfinite(x) for x in numbers):
        raise UsageError(f"--limit {text}: must be finite", form)
    if colon and name != "position":
        raise UsageError(f"--limit {text}: one size, of either sign", form)
    if len(numbers) == 1 and not numbers[0] > 0.0:
        raise UsageError(f"--limit {text}: must be above 0", form)
    return name, (numbers[0], numbers[1]) if colon else (-numbers[0], numbers[0])


def _lengths(text: str) -> tuple[float, ...]:
    """`10`, or `5:60`: a few between, each the same factor longer."""
    try:
        ends = [float(x) for x in text.split(":")]
    except ValueError:
        ends = []
    known = 1 <= len(ends) <= 2 and all(_LEAST_SECONDS <= x <= _MOST_SECONDS for x in ends) and ends == sorted(ends)
    if not known:
        allowed = f"a length from {_LEAST_SECONDS:g} to {_MOST_SECONDS:g} s, or two such as 5:60"
        raise UsageError(f"--seconds {text}", allowed)
    if len(ends) == 1 or ends[0] == ends[1]:
        return (ends[0],)
    ratio = (ends[1] / ends[0]) ** (1.0 / (_LENGTHS - 1))
    return tuple(round(ends[0] * ratio**k, 2) for k in range(_LENGTHS))


def planned(settings: Config, logs: Sequence[str], asked: Request, quiet: bool) -> Answer:
    """Diagnose, then plan.

    Raises
    ------
    DataError, UsageError : as `dsd diagnose`; no motion within the limits.
    """
    from dsd_cli.cli.identification import early, load_given
    from dsd_cli.cli.plan import widening
    from dsd_cli.cli.progress import Progress

    with Progress(not quiet) as progress, widening(settings.signals):
        given = load_given(settings, list(logs), [], progress)
        plan, found = plan_for(given, asked.wanted, progress, early(quiet, progress), asked.told)
    plan = replace(plan, logs=tuple(map(source_name, logs)))
    return Answer(plan, found, (*given.warnings, *plan.warnings))


def plan_for(
    given: Given,
    wanted: Wanted,
    progress: Progress,
    on_told: Callable[..., None] = lambda _: None,
    told: Told | None = None,
) -> tuple[Plan, Diagnosis]:
    """The plan in the user's units, and the diagnosis that it begins with.

    A file of `dsd diagnose` that leaves open what the logs do asks for nothing else; else it asks by names.

    Raises
    ------
    DataError, UsageError : as `planned`.
    """
    from dsd_cli.design.plan import plan_next
    from dsd_cli.identify.fit.testability import constant_u
    from dsd_cli.identify.verdict.diagnose import diagnose

    kept: list[tuple[Search, Fit]] = []
    found = diagnose(
        given.recordings,
        given.model,
        given.observer,
        given.engine_settings,
        progress=progress,
        on_told=on_told,
        on_found=lambda search, whole: kept.append((search, whole)),
    )
    skipped: tuple[str, ...] = ()
    if told is not None and not told.same_as(found):
        names, skipped = _possible(told, kept[-1][0])
        wanted = replace(wanted, names=names)
    if not wanted.names and found.blocked and not constant_u(given.recordings):  # that a motion does mend
        raise UsageError("no motion mends this", found.blocked)
    band = kept[-1][0].equations.band.hz
    if wanted.rate > (longest := 0.5 / band):
        raise UsageError(f"--sample-time {wanted.rate:g}", f"motions go up to {band:.3g} Hz: at most {longest:.3g} s")
    plan = plan_next(*kept[-1], found, given.observer, wanted, progress)
    return replace(plan, units=given.settings.signals.units, warnings=(*plan.warnings, *skipped)), found


def _possible(told: Told, search: Search) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """(names that these logs can test, a line for each of the others)."""
    from dsd_cli.design.targets import why_not

    why = {name: why_not(name, search) for name in told.names}
    lines = tuple(f"{told.path}: {name} is skipped: {no[0]}; {no[1]}" for name, no in why.items() if no is not None)
    return tuple(name for name, no in why.items() if no is None), lines
