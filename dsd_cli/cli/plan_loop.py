"""`dsd plan --run-with`: plan, run the user's command, add its log, diagnose, and again until nothing is left open."""

from __future__ import annotations

import re
import shlex
import subprocess
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from dsd_cli.cli.identification import say
from dsd_cli.cli.plan_request import Answer, Request, planned
from dsd_cli.errors import DataError, UsageError

if TYPE_CHECKING:
    from dsd_cli.design.results import Plan
    from dsd_cli.files.config import Config
    from dsd_cli.identify.results import Diagnosis
    from dsd_cli.report.planning import Experiment

#: Share of a limit (of the range, for the position) that a log may go beyond it: noise of its sensor.
_NOISE = 0.05
_PLACES = ("{reference}", "{log}")


def closed(job: tuple[Config, list[str], Request, bool], command: str, output: str, most: int) -> Answer:
    """The last answer, with all experiments. What was run before and left its log is not run again.

    Experiment k has the motion `<output>-k.csv` and the log `<output>-k-log.csv`.

    Raises
    ------
    UsageError : a command that cannot be run so. DataError : it failed, left no log, or a limit was broken.
    """
    settings, logs, asked, quiet = job
    words = command_words(command)
    if output == "-":
        raise UsageError("--run-with needs a file", "give -o next.csv: motions and logs are kept beside it")
    paths = list(logs)
    experiments: list[Experiment] = []
    answer = planned(settings, paths, asked, quiet)
    for k in range(1, most + 1):
        if answer.plan.motion is None:
            break
        reference, log = files_of(output, k)
        if log.exists():
            say(quiet, f"{log}: is there already, taken as it is")
        else:
            _run(words, answer.plan, reference, log, quiet)
        _check_limits(str(log), settings, answer.plan)
        paths.append(str(log))
        asked = _from_where_it_is(asked, answer.plan)
        answer = planned(settings, paths, asked, quiet)
        open_now = left_open(answer.diagnosis)
        alone = _alone(settings, log, asked, quiet) if open_now else None
        if alone is not None and misled(answer.diagnosis, alone.diagnosis):
            together = f"with the logs before it {', '.join(open_now)} would stay open"
            paths, open_now = [str(log)], left_open(alone.diagnosis)
            which = f"names {alone.diagnosis.verdict}" if open_now else "leaves nothing open"
            note = f"{log} alone {which} and is the answer; {together}: they mislead"
            answer = replace(alone, warnings=(*alone.warnings, note))
        experiments.append(_experiment(reference, log, answer.diagnosis, open_now))
        say(quiet, f"experiment {k}: {answer.diagnosis.verdict}, left open: {', '.join(open_now) or 'nothing'}")
        if not open_now:
            answer = replace(answer, plan=_without_motion(answer.plan))
            break
    return replace(answer, experiments=tuple(experiments))


def _alone(settings: Config, log: Path, asked: Request, quiet: bool) -> Answer | None:
    """What the newest log says by itself; None where that cannot be asked: the axis hardly moved in it."""
    try:
        return planned(settings, [str(log)], asked, quiet)
    except DataError:
        return None


def _without_motion(plan: Plan) -> Plan:
    """Nothing is left open: no motion is asked for."""
    nothing = dict.fromkeys(("stages", "pairs", "values", "not_counted", "impossible", "cost"), ())
    return replace(plan, motion=None, reached={}, **nothing)  # type: ignore[arg-type]


def misled(together: Diagnosis, alone: Diagnosis) -> bool:
    """Whether the logs before the newest hide what it says: alone it names an effect and leaves nothing open; with them
    something stays open, and they do not say that it is another effect: it is found with them, or tied to what is, or
    something that nobody has named is likelier than what they name. If that is so with them, and not alone, values may
    be left open, and no tie: it is planned for these by that log, and not by those that make all of it unknown.

    A poor log has forces of its own, that no motion of it shows, and a joint fit finds effects for them.
    """
    from dsd_cli.design.targets import nobody_knows

    found = [c for c in together.ranking if c.effect in together.found]
    may_be = {*together.found, *(rival for c in found for rival in c.indistinguishable_from)}
    unknown = nobody_knows(together)
    tied = any(c.indistinguishable_from for c in alone.ranking if c.effect in alone.found)
    says_more = not left_open(alone) or (unknown and not (tied or nobody_knows(alone)))
    same = unknown or alone.verdict in may_be
    return same and alone.verdict in alone.found and bool(left_open(together)) and says_more


def _experiment(reference: Path, log: Path, found: Diagnosis, open_now: tuple[str, ...]) -> Experiment:
    from dsd_cli.report.planning import Experiment

    return Experiment(str(reference), str(log), found.verdict, found.probability, open_now)


def command_words(command: str) -> list[str]:
    """The words of a command; no shell sees them.

    Raises
    ------
    UsageError : quotes that do not close, or a placeholder that is not there.
    """
    try:
        words = shlex.split(command)
    except ValueError as error:
        raise UsageError(f"--run-with: {error}", "close the quotes") from None
    for place in _PLACES:
        if not any(place in word for word in words):
            raise UsageError(f"--run-with has no {place}", 'such as "./move.sh {reference} {log}"')
    return words


def files_of(output: str, k: int) -> tuple[Path, Path]:
    """Motion and log of experiment k."""
    path = Path(output)
    return path.with_name(f"{path.stem}-{k}.csv"), path.with_name(f"{path.stem}-{k}-log.csv")


def _run(words: Sequence[str], plan: Plan, reference: Path, log: Path, quiet: bool) -> None:
    from dsd_cli.files.motion_out import motion_text
    from dsd_cli.files.whole import write_whole

    assert plan.motion is not None
    write_whole(reference, motion_text(plan.motion, ".csv").encode())
    places = {"{reference}": str(reference.resolve()), "{log}": str(log.resolve())}
    filled = [re.sub(r"\{reference\}|\{log\}", lambda found: places[found[0]], word) for word in words]
    say(quiet, "dsd: " + shlex.join(filled))
    code = None
    try:
        code = subprocess.run(filled, check=False, stdout=subprocess.DEVNULL).returncode
    except OSError as error:
        raise UsageError(f"--run-with {filled[0]}: cannot be run", error.strerror or str(error)) from None
    finally:
        # a part of a log, or nothing, which the same command must not take for its log
        if log.is_file() and (code != 0 or log.stat().st_size == 0):
            log.replace(log.with_stem(f"{log.stem}-failed"))
    if code != 0:
        raise DataError(f"{filled[0]} ended with exit code {code}", f"run it by hand with {reference}")
    if not log.is_file():
        raise DataError(f"{filled[0]} left no {log}", "it must write the log where {log} says")


def _check_limits(path: str, settings: Config, plan: Plan) -> None:
    """A log beyond the limits ends the loop: the machine is not what was simulated.

    Raises
    ------
    DataError : names the limit.
    """
    import numpy as np

    from dsd_cli.cli.recordings import load_recording

    recording, limits = load_recording(path, settings).recording, plan.limits
    nothing = np.zeros(1)
    for piece in recording.pieces:
        q = piece["position"] if "position" in piece and "position" not in recording.missing else None
        drifts = "reconstructed" in recording.provenance.get("position", "")
        place = np.array([limits.start]) if q is None or drifts else q
        broken = limits.exceeded(place, piece["velocity"], nothing, piece["u"])
        for name, by in broken.items():
            if by > _NOISE:
                raise DataError(
                    f"{path}: {name} went {100.0 * by:.0f} % beyond its limit",
                    "the loop ends here; look at the machine and its controller before the next motion",
                )


def _from_where_it_is(asked: Request, plan: Plan) -> Request:
    """The same limits for the next motion: those of the first logs would grow with what it reached."""
    x = plan.limits
    given = {name: (0.0, size) for name, size in x.sizes.items()} | {"position": (x.low, x.high)}
    return replace(asked, wanted=replace(asked.wanted, limits=given, start=x.start))


def left_open(found: Diagnosis) -> tuple[str, ...]:
    """Ties of what was found, an unknown verdict, and values of it that are not identified; where nothing is missing,
    the inertia: a log that does not even identify that shows no force that is missing."""
    from dsd_cli.identify.results import INERTIA, NONE, UNKNOWN

    ranking = {c.effect: c for c in found.ranking}
    named = found.found or ((found.verdict,) if found.verdict in ranking else ())
    ties = [f"{n} or {r}" for n in named for r in (ranking[n].indistinguishable_from if n in ranking else ())]
    values = found.whole_values or found.estimates
    named = (INERTIA,) if found.verdict == NONE else named
    weak = [n for n, e in values.items() if e.grade in ("weak", "not") and n.partition(".")[0] in named]
    return (*(["what is missing"] if found.verdict == UNKNOWN else []), *ties, *weak)
