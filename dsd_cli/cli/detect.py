"""`dsd detect`: label every sample of a log."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from dsd_cli.cli.options import (
    CONFIG_FILE,
    ConfigOption,
    EffectOption,
    LogArgument,
    OutputOption,
    QuietOption,
    SetOption,
)

if TYPE_CHECKING:
    from dsd_cli.detect.session import Plan, Rows, Session
    from dsd_cli.detect.summary import Expectation, Summarizer
    from dsd_cli.files.config import Config
    from dsd_cli.files.tables_in import Batch, TableSource
    from dsd_cli.report.detection import Detection


class DetectFormat(StrEnum):
    """table and json are the summary; csv and jsonl are the labels, one line per sample."""

    TABLE = "table"
    JSON = "json"
    CSV = "csv"
    JSONL = "jsonl"


ExpectOption = Annotated[
    list[str] | None,
    typer.Option(
        "--expect", metavar="AXIS=VALUE", help="Check: labels have this delay (inertia, ...); else exit 3. Repeatable."
    ),
]
AfterOption = Annotated[
    float | None, typer.Option("--after", metavar="T", help="Check only samples with this stamp or later, s.")
]
ShareOption = Annotated[
    float, typer.Option("--min-share", min=0.0, max=1.0, metavar="SHARE", help="Share of samples a check asks for.")
]
ConfidentOption = Annotated[bool, typer.Option("--confident-only", help="Check only confident samples.")]
FollowOption = Annotated[
    bool, typer.Option("--follow", help="Keep labelling what is appended to LOG, until Ctrl-C.")
]
DetectFormatOption = Annotated[
    DetectFormat | None,
    typer.Option("--format", help="On stdout: summary (table, json) or labels (csv, jsonl). Default: table; csv live."),
]


def detect(
    log: LogArgument,
    config: ConfigOption = CONFIG_FILE,
    output: OutputOption = None,
    expect: ExpectOption = None,
    after: AfterOption = None,
    min_share: ShareOption = 0.95,
    confident_only: ConfidentOption = False,
    follow: FollowOption = False,
    form: DetectFormatOption = None,
    override: SetOption = None,
    effect: EffectOption = None,
    quiet: QuietOption = False,
) -> None:
    """Label every sample of LOG with the most likely delay and inertia.

    Each row of the log gets one label: state, delay, inertia, log likelihood, probability, and whether it is
    confident. stdin (-) and --follow are live: one line out per line in.
    """
    from dsd_cli.files.config import load_config
    from dsd_cli.files.tables_in import open_table

    settings = load_config(config, override or (), effect or ())
    job = _Job(log, settings, output, follow, form, quiet, inputs=(log, config))
    job.check_output()
    columns, optional = job.columns()
    table = open_table(log, columns, optional, follow=follow)
    plan, expectations = job.plan(table, expect or [])
    summarizer = _summarizer(plan, expectations, after, min_share, confident_only)
    result = job.run(table, plan, summarizer)
    job.show(result)
    failed = [check for check in result.summary.checks if not check.holds]
    if failed:
        raise _check_failed(failed)


def _check_failed(failed: list[Any]) -> Exception:
    from dsd_cli.errors import CheckFailed

    texts = [
        f"{check.axis} {check.value:g} in {100 * check.share:.1f} % of {check.samples} samples "
        f"(asked: {100 * check.min_share:g} %)"
        for check in failed
    ]
    return CheckFailed("expectation not met: " + "; ".join(texts))


def _summarizer(
    plan: Plan, expectations: list[Expectation], after: float | None, min_share: float, confident_only: bool
) -> Summarizer:
    from dsd_cli.detect.settings import OFFLINE
    from dsd_cli.detect.summary import Summarizer

    per_sample = plan.settings.method in ("imm", *OFFLINE)
    return Summarizer(
        plan.grid,
        expectations,
        after=-float("inf") if after is None else after,
        min_share=min_share,
        confident_only=confident_only,
        rho=plan.settings.rho,
        window=1 if per_sample else plan.settings.window,
    )


class _Job:
    """One run of the command: where rows come from, where labels go."""

    def __init__(
        self,
        log: str,
        config: Config,
        output: str | None,
        follow: bool,
        form: DetectFormat | None,
        quiet: bool,
        inputs: tuple[str | Path, ...],
    ) -> None:
        self.log, self.config, self.output, self.follow, self.quiet = log, config, output, follow, quiet
        self.inputs = inputs
        self.live = follow or log == "-"
        self.form = form or (DetectFormat.CSV if self.live and output is None else DetectFormat.TABLE)

    @property
    def labels_on_stdout(self) -> bool:
        return self.output == "-" or self.form in (DetectFormat.CSV, DetectFormat.JSONL)

    def check_output(self) -> None:
        """Refuse what cannot work before any data is read."""
        from dsd_cli.errors import UsageError
        from dsd_cli.files.tables_out import check_output

        if self.output == "-" and self.form is DetectFormat.JSON:
            raise UsageError("-o - and --format json both want stdout", "write the labels to a file")
        if self.output not in (None, "-"):
            if self.form in (DetectFormat.CSV, DetectFormat.JSONL):
                raise UsageError(
                    f"--format {self.form.value} puts the labels on stdout, -o into {self.output}", "give one of them"
                )
            check_output(str(self.output), self.inputs)
        if self.follow and self.log == "-":
            raise UsageError("--follow needs a file", "stdin is followed anyway")

    def columns(self) -> tuple[dict[str, str], set[str]]:
        from dsd_cli.cli.plan import log_columns, optional_columns

        columns = log_columns(self.config.signals)
        columns.pop("reference", None)
        return columns, optional_columns(self.config) & set(columns)

    def plan(self, table: TableSource, expect: list[str]) -> tuple[Plan, list[Expectation]]:
        from dsd_cli.cli.plan import detection_plan
        from dsd_cli.detect.settings import OFFLINE
        from dsd_cli.errors import UsageError

        plan = detection_plan(self.config, table.columns, table.metadata, table.name)
        if self.follow and plan.settings.method in OFFLINE:
            raise UsageError(f"method '{plan.settings.method}' needs the whole log", "use dsd, average or imm live")
        return plan, [_expectation(text, plan) for text in expect]

    def run(self, table: TableSource, plan: Plan, summarizer: Summarizer) -> Detection:
        from dsd_cli.cli.plan import TIME_SCALE, TRUTH
        from dsd_cli.detect.kernel import active_backend
        from dsd_cli.detect.session import Session
        from dsd_cli.files.tables_in import dropped_with_unreadable
        from dsd_cli.report.detection import Detection
        from dsd_cli.signals.cleaning import Cleaner

        signals = self.config.signals
        session = Session(plan, Cleaner(signals.sample_time, TIME_SCALE[signals.time_unit]))
        truth = _Truth([name for name in TRUTH if name in table.columns])
        with _labels_writer(self, plan) as write:
            for rows in self._labels(table, session, truth):
                summarizer.add(rows, truth.take(rows.state.size))
                write(rows)
        dropped = dropped_with_unreadable(session.cleaner.dropped, table.unreadable)
        if session.cleaner.sample_time is None:
            self._refuse_nothing(table)
        return Detection(
            log=table.name,
            summary=summarizer.result(session.label),
            method=plan.settings.method,
            kernel=active_backend(),
            sample_time=session.cleaner.sample_time,
            regular=session.cleaner.regular,
            d_hat_source=plan.d_hat_source,
            rho=plan.settings.rho,
            dropped={reason: count for reason, count in dropped.items() if count},
            warnings=(*table.warnings, *session.cleaner.warnings),
        )

    def _refuse_nothing(self, table: TableSource) -> None:
        from dsd_cli.errors import DataError

        needed = ", ".join(table.columns.values())
        raise DataError(f"{table.name}: no row has a value in every needed column ({needed})")

    def _labels(self, table: TableSource, session: Session, truth: _Truth) -> Iterator[Rows]:
        from dsd_cli.cli.plan import TIME_SCALE
        from dsd_cli.cli.progress import Progress
        from dsd_cli.files.background import read_ahead

        batches: Iterator[Batch] = table.batches()
        if not self.live:
            batches = read_ahead(batches)
        progress = Progress("rows", enabled=not self.quiet and not self.labels_on_stdout)
        try:
            for batch in batches:
                truth.put(batch.columns)
                yield from session.feed(batch.columns.get("t"), batch.columns, batch.restart)
                if self.live and "t" in batch.columns:
                    early = session.held(batch.columns["t"] * TIME_SCALE[self.config.signals.time_unit])
                    if early is not None:
                        yield early
                progress.add(batch.rows)
        except KeyboardInterrupt:
            if not self.follow:
                raise
        finally:
            progress.close()
        yield from session.finish()

    def show(self, result: Detection) -> None:
        """The summary on stdout; on stderr where stdout carries the labels."""
        import json

        from dsd_cli.report.detection import print_table, to_json

        if not self.quiet:
            for warning in result.warnings:
                print(f"dsd: warning: {result.log}: {warning}", file=sys.stderr)
        if self.form is DetectFormat.JSON:
            typer.echo(json.dumps(to_json(result), indent=1, allow_nan=False))
        elif not self.labels_on_stdout:
            print_table(result, sys.stdout)
        elif not self.quiet:
            print_table(result, sys.stderr)


class _Truth:
    """Truth columns, handed out by row as the labels of these rows come."""

    def __init__(self, names: list[str]) -> None:
        import numpy as np

        self._columns = {name: np.empty(0) for name in names}

    def put(self, columns: dict[str, Any]) -> None:
        import numpy as np

        for name, waiting in self._columns.items():
            self._columns[name] = np.concatenate([waiting, columns[name]]) if waiting.size else columns[name]

    def take(self, rows: int) -> dict[str, Any]:
        taken = {name: column[:rows] for name, column in self._columns.items()}
        self._columns = {name: column[rows:] for name, column in self._columns.items()}
        return taken


def _expectation(text: str, plan: Plan) -> Expectation:
    from dsd_cli.detect.summary import Expectation
    from dsd_cli.errors import UsageError

    axis, _, value = text.partition("=")
    axes = plan.grid.axes
    if axis not in axes or not value:
        raise UsageError(f"--expect {text}", "write AXIS=VALUE, with an axis of the grid: " + ", ".join(axes))
    try:
        number = float(value)
    except ValueError:
        raise UsageError(f"--expect {text}: '{value}' is not a number") from None
    candidates = sorted(set(axes[axis].tolist()))
    if not any(abs(number - c) <= 1e-9 * abs(c) + 1e-12 for c in candidates):
        listed = ", ".join(f"{c:g}" for c in candidates)
        raise UsageError(f"--expect {text}: no state has that {axis}", f"candidates are {listed}")
    return Expectation(axis, number)


def _labels_writer(job: _Job, plan: Plan) -> Any:
    """A context manager giving a function that writes rows of labels."""
    from dsd_cli.cli.labels_out import LabelsFile, NoLabels, json_lines

    if job.form is DetectFormat.JSONL:
        return json_lines(plan.grid)
    if job.labels_on_stdout:
        return LabelsFile("-", plan.grid, {}, ())
    if job.output is None:
        return NoLabels()
    return LabelsFile(job.output, plan.grid, {"command": "detect", "log": job.log}, job.inputs)
