"""One run of `dsd detect`: where rows come from, what labels them, where labels go."""

from __future__ import annotations

import sys
from collections.abc import Callable, Generator, Iterator
from contextlib import AbstractContextManager, closing, nullcontext
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from dsd_cli.cli.detect_checks import Judgement
from dsd_cli.cli.ending import interrupt_ends_reading
from dsd_cli.cli.labels_out import LabelsFile, NoLabels, Write, json_lines
from dsd_cli.cli.plan import (
    TRUTH,
    as_logged,
    detection_plan,
    limits,
    log_columns,
    naming,
    optional_columns,
    rows_read,
    widening,
)
from dsd_cli.cli.progress import Progress
from dsd_cli.cli.truth import Truth
from dsd_cli.cli.unit_in_name import left_out
from dsd_cli.detect.grid import Grid
from dsd_cli.detect.kernel import active_backend
from dsd_cli.detect.plan import Plan
from dsd_cli.detect.rows import Rows
from dsd_cli.detect.session import Session
from dsd_cli.detect.settings import ESTIMATING, OFFLINE
from dsd_cli.detect.summary import Summarizer
from dsd_cli.errors import DataError, TooShort, UsageError, printable
from dsd_cli.files.background import read_ahead
from dsd_cli.files.config import Config
from dsd_cli.files.table_source import Batch, TableSource, read_head
from dsd_cli.files.tables_in import dropped_with_unreadable, is_stream, open_table
from dsd_cli.files.tables_out import check_output
from dsd_cli.files.watched import about_rows
from dsd_cli.report.detection import Detection, print_table, to_json
from dsd_cli.report.terminal import json_text
from dsd_cli.signals.cleaning import BRIDGE, Cleaner
from dsd_cli.signals.clock import TIME_SCALE

if TYPE_CHECKING:
    from dsd_cli.detect.watched import WatchedSession
    from dsd_cli.report.changes import Changes

#: Forms whose lines are labels, not the summary.
LABEL_LINES = ("csv", "jsonl")


@dataclass(frozen=True)
class Destination:
    """Where labels and summary go: `form` is that of stdout, `output` a file, "-" or None."""

    form: str
    output: str | None
    quiet: bool
    inputs: tuple[str | Path, ...]

    @property
    def labels_on_stdout(self) -> bool:
        """Then the summary goes to stderr."""
        return self.output == "-" or self.form in LABEL_LINES

    def check(self) -> None:
        """Refuse what cannot work before any data is read."""
        if self.output == "-" and self.form == "json":
            raise UsageError("-o - and --format json both want stdout", "write the labels to a file")
        if self.output in (None, "-"):
            return
        if self.form in LABEL_LINES:
            raise UsageError(f"--format {self.form} puts the labels on stdout, -o into {self.output}", "give one")
        check_output(str(self.output), self.inputs)

    def writer(self, grid: Grid, estimates: bool) -> AbstractContextManager[Write]:
        """Gives a function that writes rows of labels, with the columns of `Estimates` if there are any."""
        if self.form == "jsonl":
            return json_lines(grid)
        if self.labels_on_stdout:
            return LabelsFile("-", grid, {}, (), estimates)
        if self.output is None:
            return NoLabels()
        return LabelsFile(self.output, grid, {}, self.inputs, estimates)

    def show(self, result: Detection) -> None:
        """The summary on stdout; on stderr where stdout carries the labels."""
        if not self.quiet:
            for warning in result.warnings:
                print(printable(f"dsd: warning: {result.log}: {warning}"), file=sys.stderr)
        if self.form == "json":
            print(json_text(to_json(result), indent=1))
        elif not self.labels_on_stdout:
            print_table(result, sys.stdout)
        elif not self.quiet:
            print_table(result, sys.stderr)


class Job:
    """Reads `log` and labels it; live where lines come one by one, with a panel that shows it if that is wanted.

    `ahead`: a thread of its own decodes the next rows meanwhile. With `watched` the session remembers what a picture
    shows: the attribute of that name, once it runs.
    """

    def __init__(
        self,
        log: str,
        config: Config,
        follow: bool,
        to: Destination,
        *,
        panel: bool = False,
        watched: bool = False,
        ahead: bool = True,
    ) -> None:
        config = as_logged(config, log)
        self.log, self.config, self.follow, self.to, self.panel, self.ahead = log, config, follow, to, panel, ahead
        self._watched = watched
        self.watched: WatchedSession | None = None
        self.live = follow or log == "-"
        self._time_scale = TIME_SCALE[config.signals.time_unit]

    def run(self, judgement: Judgement) -> Detection:
        """All labels written, and the summary.

        Raises
        ------
        UsageError : options, or keys of the config, that contradict each other.
        DataError : the log cannot be read, or nothing in it can be used.
        """
        if self.follow and self.log == "-":
            raise UsageError("--follow needs a file", "stdin is followed anyway")
        if self.panel and not self.follow:
            raise UsageError("--live watches a log that grows", "give --follow too")
        if self.panel and self.to.labels_on_stdout and sys.stdout.isatty():
            raise UsageError("--live and labels on the same terminal", "write the labels to a file, -o FILE or > FILE")
        with interrupt_ends_reading(self.follow) as interrupted:
            table = self._open(interrupted)
            plan = self._plan(table)
            summarizer = judgement.summarizer(plan)
            session = self._session(plan)
            with naming(table.name), widening(self.config.signals):
                self._label_all(table, session, summarizer)
        found = _detection(table, session, summarizer)
        unread = [one.line for one in left_out(self.config) if one.channel in table.columns]
        return replace(found, units=self.config.signals.units, warnings=(*found.warnings, *unread))

    def _session(self, plan: Plan) -> Session:
        # a straight line through positions or speeds would be differentiated into a false d_hat
        bridge = BRIDGE if plan.d_hat_source == "logged" else 0
        signals = self.config.signals
        cleaner = Cleaner(signals.sample_time, self._time_scale, bridge, limits(signals))
        if not self._watched:
            return Session(plan, cleaner)
        from dsd_cli.detect.watched import WatchedSession

        self.watched = WatchedSession(plan, cleaner)
        return self.watched

    def _open(self, interrupted: list[bool]) -> TableSource:
        columns = log_columns(self.config.signals)
        columns.pop("reference", None)
        optional = optional_columns(self.config) & set(columns)
        if not self.follow or is_stream(self.log):
            return rows_read(open_table(self.log, columns, optional, layout=self.config.signals.layout), self.config)
        from dsd_cli.files.line_stream import LineStream

        read_head(self.log, 1)
        stream = LineStream(
            Path(self.log), columns, optional, stop=lambda: bool(interrupted), layout=self.config.signals.layout
        )
        return rows_read(stream, self.config)

    def _plan(self, table: TableSource) -> Plan:
        plan = detection_plan(self.config, table.columns, table.metadata, table.name)
        if self.follow and plan.settings.method in OFFLINE:
            raise UsageError(
                f"method '{plan.settings.method}' needs the whole log", "use dsd, average, imm or profile live"
            )
        return plan

    def _label_all(self, table: TableSource, session: Session, summarizer: Summarizer) -> None:
        truth = Truth([name for name in TRUTH if name in table.columns])
        labels = closing(self._labels(table, session, truth))  # a label that cannot be written ends the reading too
        has_estimates = session.plan.settings.method in ESTIMATING
        writer, view = self.to.writer(session.plan.grid, has_estimates), self._view(table, session)
        with writer as write, labels as parts, view as show:
            for rows in parts:
                known = truth.take(rows.state.size)
                summarizer.add(rows, known)
                if self.watched is not None:
                    self.watched.watch(rows, known)
                write(rows)
                show(rows)
            if not self.live:
                _refuse_nothing(table, session, summarizer)

    def _labels(self, table: TableSource, session: Session, truth: Truth) -> Generator[Rows, None, None]:
        busy = self.panel or (self.to.labels_on_stdout and sys.stdout.isatty())
        with Progress(not (self.to.quiet or busy)) as progress:
            total = None if self.live or busy else about_rows(table.name)
            done = progress.rows(f"labelling {Path(table.name).name}", total)
            with self._batches(table) as batches:
                for batch in batches:
                    yield from self._labels_of(batch, table, session, truth)
                    done(batch.rows)
            progress("finishing")
            yield from session.finish()

    def _view(self, table: TableSource, session: Session) -> AbstractContextManager[Callable[[Rows], None]]:
        """The panel of --live; nothing without it, or where nobody wants to see anything."""
        if not self.panel or self.to.quiet:
            return nullcontext(lambda rows: None)
        from dsd_cli.cli.live import LiveView

        return LiveView(Path(self.log).name, session, table, self.config.signals.units.force)

    def _batches(self, table: TableSource) -> AbstractContextManager[Iterator[Batch]]:
        """Live lines are labelled as they come; of a file, the next rows may be decoded meanwhile."""
        return read_ahead(table.batches()) if self.ahead and not self.live else nullcontext(table.batches())

    def _labels_of(self, batch: Batch, table: TableSource, session: Session, truth: Truth) -> Iterator[Rows]:
        self._check_columns(table, session.plan, batch)
        truth.put(batch)
        yield from session.feed(batch.columns.get("t"), batch.columns, batch.restart)
        if self.live and "t" in batch.columns:
            early = session.held(batch.columns["t"] * self._time_scale)
            if early is not None:
                yield early

    def _check_columns(self, table: TableSource, plan: Plan, batch: Batch) -> None:
        """A log that is followed may be begun anew with other columns."""
        lost = [name for name in plan.columns if name not in batch.columns]
        if lost:
            raise DataError(f"{table.name}: begun anew without {', '.join(lost)}", "start dsd detect again")


def _refuse_nothing(table: TableSource, session: Session, summarizer: Summarizer) -> None:
    """A log of which no sample could be judged is no result: say why, and write no labels."""
    if summarizer.judged:
        return
    needed, sample_time = ", ".join(table.columns.values()), session.cleaner.sample_time
    if session.engine is None or sample_time is None:
        raise DataError(f"{table.name}: no row has a value in every needed column ({needed})")
    longest = max(session.plan.grid.delays)
    raise TooShort(
        f"{table.name}: no sample could be judged: {summarizer.samples} rows {sample_time:g} s apart, and a "
        f"label needs the largest candidate delay ({longest:g} s), 5 tau and 16 samples behind it",
        "is signals.time_unit right, and is the log long enough?",
    )


def _detection(table: TableSource, session: Session, summarizer: Summarizer) -> Detection:
    plan, cleaner = session.plan, session.cleaner
    dropped = dropped_with_unreadable(cleaner.dropped, table.unreadable)
    return Detection(
        log=table.name,
        summary=summarizer.result(session.label),
        method=plan.settings.method,
        kernel=active_backend(),
        sample_time=cleaner.sample_time,
        regular=cleaner.regular,
        d_hat_source=plan.d_hat_source,
        rho=plan.settings.rho,
        changes=_changes(session),
        dropped={reason: count for reason, count in dropped.items() if count},
        warnings=(*table.warnings, *session.warnings),
        output="d(d_hat)/dt" if plan.settings.output == "derivative" else "d_hat",
    )


def _changes(session: Session) -> Changes | None:
    """What the test for changes found; None where there was no test."""
    settings, sample_time = session.plan.settings, session.cleaner.sample_time
    if settings.method != "profile" or settings.change <= 0.0 or sample_time is None:
        return None
    from dsd_cli.detect.profile.alarms import false_alarms_per_hour
    from dsd_cli.report.changes import Changes

    free = sum(len(set(values.tolist())) > 1 for values in session.plan.grid.axes.values())
    tau = session.plan.observer.time_constant
    expected = false_alarms_per_hour(settings.change, settings.window, sample_time, tau, free)
    return Changes(tuple(session.changes), settings.change, expected, tuple(session.plan.grid.combinations))
