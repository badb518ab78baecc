"""From logs and a config to what a page says, by the functions of check, detect, compare, diagnose and improve."""

from __future__ import annotations

import hashlib
import platform
import shlex
import sys
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from copy import deepcopy
from dataclasses import dataclass, field, replace
from functools import partial
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from dsd_cli.cli.check import checked_log
from dsd_cli.cli.detect_checks import Judgement
from dsd_cli.cli.detect_job import Destination, Job
from dsd_cli.cli.identification import Given, load_given, warn
from dsd_cli.cli.improve import validated
from dsd_cli.cli.improve_loop import follow, with_steps
from dsd_cli.cli.labels_out import ESTIMATES
from dsd_cli.cli.learn import with_learnt
from dsd_cli.cli.plan_loop import left_open
from dsd_cli.cli.plan_request import plan_for, request
from dsd_cli.cli.progress import Progress
from dsd_cli.cli.recordings import beyond_known, known_values
from dsd_cli.cli.refresh import Refreshed, refreshed
from dsd_cli.design.results import Plan
from dsd_cli.detect.grid import Grid
from dsd_cli.detect.rows import Rows
from dsd_cli.errors import DsdError, printable
from dsd_cli.files.config import Config
from dsd_cli.files.config.config import parse_tables, read_config
from dsd_cli.files.config.edit import Origin, now
from dsd_cli.files.config.values_edit import merged, with_keys
from dsd_cli.identify.compare.comparison import compare
from dsd_cli.identify.improve import improve
from dsd_cli.identify.results import Diagnosis, Ladder, Step
from dsd_cli.learn.results import Learnt
from dsd_cli.report.comparison import Report
from dsd_cli.report.diagnosis import DiagnosisReport
from dsd_cli.report.in_units import in_units
from dsd_cli.report.ladder import LadderReport, step_line
from dsd_cli.report.names import listed
from dsd_cli.report.page.series import Views, channels_of, views
from dsd_cli.report.page.story import Labels, Outcome, SourceFile, Story
from dsd_cli.report.verdict import once_late

if TYPE_CHECKING:
    from dsd_cli.cli.labels_out import Write

T = TypeVar("T")

#: Libraries whose versions can matter to the numbers.
_LIBRARIES = ("numpy", "scipy", "pyarrow")


def tell(teller: Teller, origin: Origin, others: Sequence[Path]) -> Story:
    """Everything that the teller's logs say under its config.

    Parameters
    ----------
    others : files that were read beside the logs.

    Raises
    ------
    DataError : a log that cannot be read at all.
    UsageError : values of [fit] that contradict the config.
    """
    config, logs, holdout = teller.config, teller.logs, teller.holdout
    if config.model.inertia is not None:
        known_values(config)  # what is asked wrongly is no matter of this log
    with Progress(not teller.quiet) as progress:
        looked = [checked_log(path, config, teller.quiet, progress) for path in logs]
    given = teller.attempt("the model", lambda: load_given(config, logs, holdout))
    if given.value is not None:
        config = teller.config = given.value.settings
    comparison, ladder, diagnosis, curves = teller.identified(given, 2 * _axes(config))
    plan = teller.planned(given, diagnosis)
    text, detector, with_what = teller.at_the_end(origin.text, given, ladder)
    detections = teller.detections(detector)
    if curves.value is None:
        curves = teller.attempt("curves", lambda: channels_of([(one.log, one.restarts) for one in looked]))
    return Story(
        logs=logs,
        holdout=holdout,
        checks=tuple(one.result for one in looked),
        detections=detections,
        comparison=comparison,
        diagnosis=diagnosis,
        ladder=ladder,
        views=curves,
        plan=plan,
        law=teller.law,
        config_name=str(origin.path),
        config_text=text,
        detected_with=with_what,
        command=shlex.join(["dsd", *sys.argv[1:]]),
        made=now(),
        units=config.signals.units,
        files=tuple(source_file(path) for path in (*logs, *holdout, origin.path, *others)),
        versions=_versions(),
        warnings=(*(given.value.warnings if given.value else ()), *teller.warnings),
    )


def _axes(config: Config) -> int:
    """Number of axes of the grid of states."""
    states = config.states
    return 0 if states is None else 2 + sum(map(len, states.effects.values()))


def _labels(log: str, config: Config) -> Labels:
    """What the detector says of one log."""
    to = _Kept("table", None, True, ())
    result = Job(log, config, False, to).run(Judgement())
    rows = to.rows
    t, state, confident = (np.concatenate([getattr(r, n) for r in rows]) for n in ("t", "state", "confident"))
    axes = {name: np.asarray(values)[state] for name, values in to.grids[0].axes.items()}
    columns = zip(*(r.estimates for r in rows), strict=True)
    estimates = dict(zip(ESTIMATES, (np.concatenate(column) for column in columns), strict=False))
    between = {axis: estimates[f"{axis}_estimate"] for axis in axes if f"{axis}_estimate" in estimates}
    return Labels(result, t, axes, confident, between)


@dataclass
class Teller:
    """Runs one command after the other; what fails is a line and not the end.

    learn : a law too, where the ladder ends in `unknown`.
    """

    config: Config
    logs: tuple[str, ...]
    holdout: tuple[str, ...]
    quiet: bool
    learn: bool = False
    warnings: list[str] = field(default_factory=list)
    law: Learnt | None = None

    def attempt(self, what: str, run: Callable[[], T]) -> Outcome[T]:
        """The result, or why there is none; that is said on stderr too."""
        try:
            return Outcome(run())
        except DsdError as failure:
            line = str(failure)
        except MemoryError:
            line = "not enough memory"
        warn(self.quiet, [f"{what}: {line}"])
        return Outcome(None, line)

    def at_the_end(self, text: str, given: Outcome[Given], ladder: Outcome[LadderReport]) -> tuple[str, Config, str]:
        """(the config that results, the one to detect with, what that has from the model at the end, in words)."""
        steps = ladder.value.result.steps if ladder.value else ()
        if not steps or given.value is None:
            return "", self.config, ""
        known, units = given.value, self.config.signals.units
        resulting = with_steps(text, steps[0].score, steps[1:], self.logs, units)
        if len(steps) == 1 or self.config.states is None:
            return resulting, self.config, ""
        found = self.attempt("detect", lambda: refreshed(self.config, known, steps[-1].model))
        fresh = found.value or Refreshed({}, "")
        new = with_keys(resulting, fresh.values)
        written = deepcopy(dict(self.config.written))  # with the options of the command line
        values = {("model",): parse_tables(new, self.config.name)["model"], **fresh.values}
        config = read_config(merged(written, values), self.config.name, self.config.folder)
        model = "with the model at the end, inertia {0.inertia:.4g}, delay {0.delay:.4g} s".format(steps[-1].model)
        effects = f", with {listed(steps[-1].model.effects)}" if steps[-1].model.effects else ""
        return new, config, f"{model}{effects}" + (f"; refreshed: {fresh.said}" if fresh.said else "")

    def detections(self, config: Config) -> tuple[tuple[str, Outcome[Labels]], ...]:
        """The labels of each log, where the config has states."""
        if config.states is None:
            return ()
        parts = (self.attempt("detect", partial(_labels, log, config)) for log in self.logs)
        return tuple(zip(self.logs, parts, strict=True))

    def identified(
        self, given: Outcome[Given], more: int
    ) -> tuple[Outcome[Report], Outcome[LadderReport], Outcome[DiagnosisReport], Outcome[Views]]:
        """compare, improve, diagnose, and the curves of all steps; `more` curves are drawn beside these."""
        if given.value is None:
            why = given.missing
            return Outcome(None, why), Outcome(None, why), Outcome(None, why), Outcome(None, "")
        known = given.value
        self.warnings += beyond_known(self.config)
        comparison = self.attempt("compare", lambda: _compared(known))
        first: list[Diagnosis] = []
        ladder = self.attempt("improve", lambda: self._climbed(known, first))
        diagnosis = (
            self.attempt("diagnose", lambda: _diagnosed(known, first)) if first else Outcome(None, ladder.missing)
        )
        models = [step.model for step in ladder.value.result.steps] if ladder.value else [known.model]
        curves = self.attempt("curves", lambda: views(known.recordings, models, known.observer, more))
        return comparison, ladder, diagnosis, curves

    def planned(self, given: Outcome[Given], diagnosis: Outcome[DiagnosisReport]) -> Outcome[Plan]:
        """The motion that would settle what the first diagnosis leaves open; none where it leaves nothing."""
        if given.value is None or diagnosis.value is None or not left_open(diagnosis.value.result):
            return Outcome(None, "")
        known, wanted = given.value, request(self.config, (), (None, (), None, None)).wanted
        with Progress(not self.quiet) as progress:
            return self.attempt("plan", lambda: plan_for(known, wanted, progress)[0])

    def _climbed(self, given: Given, first: list[Diagnosis]) -> LadderReport:
        """`improve --auto`; the first diagnosis goes into `first`."""

        def choose(diagnosis: Diagnosis) -> str | None:
            first.append(diagnosis)
            return follow(diagnosis)

        with Progress(not self.quiet) as progress:
            on_step = _StepLines(progress, not self.quiet and sys.stderr.isatty())
            found = improve(
                given.recordings,
                given.model,
                given.observer,
                given.engine_settings,
                holdout=given.holdout,
                choose=choose,
                on_step=on_step,
                progress=progress,
            )
            ladder: Ladder = in_units(found, given.settings.signals.units)
            if self.learn:
                ladder, self.law = with_learnt(ladder, given, progress)
        first[:] = [first[0] if first else found.last]
        held_out = validated(given, ladder) if given.holdout else ()
        return LadderReport(ladder, self.logs, None, given.dropped, given.warnings, held_out)


class _StepLines:
    """Says each step on a terminal, as improve does."""

    def __init__(self, progress: Progress, wanted: bool) -> None:
        self._progress, self._wanted = progress, wanted
        self._before: Step | None = None

    def __call__(self, step: Step) -> None:
        self._progress.clear()
        if self._wanted:
            print(printable(step_line(step, self._before)), file=sys.stderr)
        self._before = step


def _compared(given: Given) -> Report:
    config = given.settings
    aside = given.holdout[0] if len(given.holdout) == 1 else None  # of several, improve's validation speaks
    window = config.detector.window
    found, _ = compare(given.recordings, given.model, given.observer, window, aside)
    return Report(replace(found, units=config.signals.units), dropped=given.dropped)


def _diagnosed(given: Given, first: Sequence[Diagnosis]) -> DiagnosisReport:
    """What `diagnose` says: the first diagnosis of the ladder."""
    found = in_units(first[0], given.settings.signals.units)
    found = replace(found, warnings=once_late(given.warnings, found.warnings))
    return DiagnosisReport(found, given.model, tuple(r.name for r in given.holdout), given.dropped)


@dataclass(frozen=True)
class _Kept(Destination):
    """Labels that stay in memory."""

    rows: list[Rows] = field(default_factory=list)
    grids: list[Grid] = field(default_factory=list)

    def writer(self, grid: Grid, estimates: bool) -> AbstractContextManager[Write]:
        self.grids.append(grid)
        return nullcontext(self.rows.append)


def source_file(path: str | Path) -> SourceFile:
    if Path(path).is_dir():  # some logs are folders
        return SourceFile(str(path), sum(file.stat().st_size for file in Path(path).rglob("*") if file.is_file()), "")
    with open(path, "rb") as stream:
        digest = hashlib.file_digest(stream, "sha256").hexdigest()
        return SourceFile(str(path), stream.tell(), digest)


def _versions() -> Mapping[str, str]:
    from dsd_cli.cli.main import version_text

    found = {"dsd": version_text(), "Python": f"{platform.python_version()} on {platform.system()}"}
    for name in _LIBRARIES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            continue
    return found
