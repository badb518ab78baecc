"""One log of a fleet: what a worker gets, what it does, and the row that it gives back."""

from __future__ import annotations

import math
import os
import re
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import datetime
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dsd_cli.errors import DataError, DsdError, printable

if TYPE_CHECKING:
    from dsd_cli.files.config import Config

#: A row of the table of results: column -> value.
Row = dict[str, str | float | int | bool | None]
DONE, FAILED = "done", "failed"
#: The column that says which command made the row.
COMMAND = "command"
#: Columns that every row has, in this order; the rest is the command's.
COMMON = ("log", "machine", "date", "config", COMMAND, "status", "reason", "verdict")

_DATE = re.compile(r"(?<!\d)(20\d\d)[-_.]?(\d\d)[-_.]?(\d\d)(?:[T_ -]?(\d\d)[-:_.h]?(\d\d)(?:[-:_.m]?(\d\d))?)?(?!\d)")


@dataclass(frozen=True)
class ConfigText:
    """A config as a worker without the file needs it; `--set` and `--effect` texts go with it."""

    name: str
    folder: str
    text: str
    values: tuple[str, ...] = ()
    effects: tuple[str, ...] = ()


@dataclass(frozen=True)
class Task:
    """One log: `log` as it was given, `path` where any worker on this machine (or any at all: a URL) finds it.

    `key` distinguishes this log in this state with this config from any other.
    """

    command: str
    log: str
    path: str
    config: ConfigText
    effects_from: tuple[str, ...]
    key: str
    machine: str
    date: str


def run_task(task: Task) -> Row:
    """The row of that log; whatever is wrong with it is said in the row."""
    row = _head(task)
    try:
        with _on_disk(task.path) as path:
            row["date"] = row["date"] or recorded_date(path)
            found = _COMMANDS[task.command](path, _settings(task.config, task.effects_from))
        return row | {"status": DONE, "reason": "", **found, "key": task.key}
    except DsdError as error:
        reason = str(error)
    except MemoryError:
        reason = "not enough memory"
    except Exception as error:  # one log must not end the run of ten thousand
        reason = f"unexpected {type(error).__name__}: {error}"
    return row | failed(task, reason)


def failed(task: Task, reason: str) -> Row:
    """The row of a log that gave no result."""
    said = printable(reason.replace(task.path, task.log))
    return _head(task) | {"status": FAILED, "reason": said, "verdict": None, "key": task.key}


def _head(task: Task) -> Row:
    date = task.date or date_in(task.log)
    return {
        "log": task.log,
        "machine": task.machine,
        "date": date,
        "config": task.config.name,
        COMMAND: task.command,
    }


def date_in(name: str) -> str:
    """The last date (and time) in a name, ISO 8601; empty without one."""
    for match in reversed(list(_DATE.finditer(name))):
        year, month, day, hour, minute, second = (int(part or 0) for part in match.groups())
        try:
            found = datetime(year, month, day, hour, minute, second)
        except ValueError:
            continue
        return found.isoformat() if match[4] else found.date().isoformat()
    return ""


def is_url(log: str) -> bool:
    """Whether it is a place that fsspec knows, such as s3://bucket/log.mf4."""
    return re.match(r"[a-z][a-z0-9+.]+://", log) is not None


@contextmanager
def _on_disk(path: str) -> Iterator[str]:
    """The file itself, or a copy of what the URL names for as long as it is read."""
    if not is_url(path):
        of_this_process = path == "/dev/stdin" or path.startswith("/dev/fd/")  # in a worker another thing, or nothing
        if of_this_process or (os.path.exists(path) and not (os.path.isfile(path) or os.path.isdir(path))):
            raise DataError(f"{path}: is a FIFO or a device, which a fleet does not wait for", "save it as a file")
        yield path
        return
    import fsspec

    with tempfile.TemporaryDirectory(prefix="dsd-fleet-") as folder:
        copy = os.path.join(folder, path.rstrip("/").rpartition("/")[2])
        try:
            system, place = fsspec.url_to_fs(path)
            system.get(place, copy)
        except FileNotFoundError:
            raise DataError(f"{path}: no such file") from None
        except Exception as error:  # every file system has its own kinds
            raise DataError(f"{path}: cannot be fetched ({type(error).__name__}: {error})") from None
        try:
            yield copy
        except DsdError as error:
            error.message = error.message.replace(copy, path)
            raise


def recorded_date(path: str) -> str:
    """When a file of another tool says that it was recorded."""
    from dsd_cli.files.formats.base import RECORDED
    from dsd_cli.files.formats.known import HEAD_BYTES, format_of, is_bag, open_container
    from dsd_cli.files.table_source import read_head

    found = format_of(path, b"" if is_bag(path) else read_head(path, HEAD_BYTES))
    return "" if found is None else open_container(path, found).metadata.get(RECORDED, "")


@lru_cache(maxsize=16)
def _settings(config: ConfigText, effects_from: tuple[str, ...]) -> Config:
    from dsd_cli.cli.user_effects import not_loaded, use_effects
    from dsd_cli.files.config import parse_config

    use_effects(not_loaded(Path(file) for file in effects_from))
    return parse_config(config.text, config.name, Path(config.folder)).override(config.values, config.effects)


def _detect(path: str, settings: Config) -> Row:
    from dsd_cli.cli.detect_checks import Judgement
    from dsd_cli.cli.detect_job import Destination, Job

    result = Job(path, settings, False, Destination("json", None, True, ()), ahead=False).run(Judgement())
    summary = result.summary
    usual = max(summary.states, key=lambda state: (state.confident_share, state.share))
    verdict = ", ".join(f"{axis} {value:g}" for axis, value in usual.values.items())
    if summary.confident_share < 0.5:
        verdict = "not confident"
    row: Row = {
        "verdict": verdict if result.explains else "unexplained",
        "samples": summary.samples,
        "sample_time": result.sample_time,
        "d_hat": result.d_hat_source,
        "judged": summary.judged,
        "confident_share": summary.confident_share,
        "explained_share": summary.explained_share,
        "residual_rms": summary.residual_rms,
        "segments": summary.segments_total,
        "usual_share": usual.share,
        **{f"usual.{axis}": value for axis, value in usual.values.items()},
        **{f"final.{axis}": value for axis, value in summary.final.items()},
        "final_confident": summary.final_confident,
    }
    return row | _said(result.dropped.values(), result.warnings)


def _compare(path: str, settings: Config) -> Row:
    from dsd_cli.cli.plan import observer_settings
    from dsd_cli.cli.recordings import believed_model, load_recording
    from dsd_cli.identify.compare.comparison import compare

    model = believed_model(settings)
    loaded = load_recording(path, settings)
    result, _ = compare([loaded.recording], model, observer_settings(settings), settings.detector.window)
    force, accuracy = result.force.log, result.accuracy
    strongest = max(result.dependence, key=lambda one: one.explains, default=None)
    row: Row = {
        "verdict": result.conclusion,
        "samples": accuracy.samples,
        "sample_time": result.sample_time,
        "force_rmse": None if force is None else _finite(force.rmse),
        "band_hz": None if force is None else _finite(force.band_hz),
        "floor": None if force is None else _finite(force.floor),
        "rmse": _finite(accuracy.rmse),
        "bias": _finite(accuracy.bias),
        "fit_percent": _finite(accuracy.fit_percent),
        "max_error": _finite(accuracy.max_error),
        "depends_on": None if strongest is None else strongest.on,
        "explains": None if strongest is None else _finite(strongest.explains),
    }
    return row | _said(loaded.dropped.values(), loaded.warnings)


def _diagnose(path: str, settings: Config) -> Row:
    from dsd_cli.cli.diagnose import answer
    from dsd_cli.cli.identification import load_open
    from dsd_cli.cli.progress import Progress
    from dsd_cli.report.verdict import candidate, verdict_line

    given, asked = load_open(settings, [path], [])
    result, _ = answer(given, asked, Progress(enabled=False), quiet=True)
    winner = candidate(result, result.verdict)
    named = {} if winner is None or result.whole_values else _named(winner.effect, winner.parameters)
    values = {**result.estimates, **named}
    after = result.refitted.heldout_rmse if winner is None else winner.heldout_rmse_after
    after = result.whole_heldout_rmse if result.whole_values else after
    row: Row = {
        "verdict": result.verdict,
        "probability": _finite(result.probability),
        "samples": result.samples,
        "force_rmse": _finite(result.score.rmse),
        "heldout_rmse": _finite(result.score.heldout_rmse),
        "heldout_rmse_after": _finite(after),
        "band_hz": _finite(result.band_hz),
        "floor": _finite(result.floor),
        "found": " + ".join(result.found),
        "said": verdict_line(result, given.model),
    }
    for name, estimate in values.items():
        row |= {f"value.{name}": _finite(estimate.value), f"error.{name}": _finite(estimate.std_error)}
    return row | _said(given.dropped.values(), (*given.warnings, *result.warnings))


def _named(effect: str, parameters: Any) -> dict[str, Any]:
    """Values of an effect by their full names; those of inertia and delay have them already."""
    return {name if name in ("inertia", "delay") else f"{effect}.{name}": one for name, one in parameters.items()}


def _said(dropped: Any, warnings: Any) -> Row:
    return {"not_taken": sum(dropped), "warnings": "; ".join(warnings)}


def _finite(value: float | None) -> float | None:
    return float(value) if value is not None and math.isfinite(value) else None


_COMMANDS = {"detect": _detect, "compare": _compare, "diagnose": _diagnose}
