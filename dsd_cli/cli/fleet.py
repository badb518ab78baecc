"""`dsd fleet`: one command over many logs, one row per log."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from dsd_cli.cli.options import (
    CONFIG_FILE,
    ConfigOption,
    EffectOption,
    EffectsFromOption,
    Format,
    FormatOption,
    QuietOption,
    SetOption,
)
from dsd_cli.cli.pictures import PlotOption
from dsd_cli.cli.sharing import spread

if TYPE_CHECKING:
    from dsd_cli.cli.fleet_run import Workers

app = typer.Typer(
    add_completion=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
    help="Run detect, compare or diagnose over many logs; one table with a row per log.",
)

FleetLogs = Annotated[
    list[str] | None, typer.Argument(metavar="LOGS...", help="Logs, globs in quotes ('runs/**/*.mf4'), or URLs.")
]
ListOption = Annotated[
    Path | None,
    typer.Option("--list", metavar="FILE", help="Logs to add: lines, or a table with log, config, machine, date."),
]
TableOption = Annotated[
    str, typer.Option("-o", "--output", metavar="FILE", help="Table of results to write (.parquet or .csv).")
]
WorkersOption = Annotated[
    int | None, typer.Option("--workers", metavar="N", help="Processes of this machine. Default: one per core.")
]
ClusterOption = Annotated[
    str | None, typer.Option("--cluster", metavar="URL", help="Dask: tcp://HOST:PORT of a scheduler, or local:N.")
]
RetriesOption = Annotated[
    int, typer.Option("--retries", metavar="N", help="How often a log is tried alone when its worker died.")
]
AnewOption = Annotated[bool, typer.Option("--anew", help="Work on every log again; keep no row of an earlier run.")]
ShardOption = Annotated[
    str | None,
    typer.Option("--shard", metavar="I/N", help="Every N-th log only, from the I-th (1 to N); dsd fleet merge joins."),
]


@dataclass(frozen=True)
class FleetOptions:
    """What a command over many logs is given beside them."""

    output: TableOption = "results.parquet"
    config: ConfigOption = CONFIG_FILE
    listing: ListOption = None
    shard: ShardOption = None
    workers: WorkersOption = None
    cluster: ClusterOption = None
    retries: RetriesOption = 2
    anew: AnewOption = False
    override: SetOption = None
    effect: EffectOption = None
    effects_from: EffectsFromOption = None
    quiet: QuietOption = False


@app.command("detect")
@spread
def detect(options: FleetOptions, logs: FleetLogs = None) -> None:
    """Label every log; a row has the usual and the final state, how sure, and what is left unexplained."""
    _run("detect", logs, options)


@app.command("compare")
@spread
def compare(options: FleetOptions, logs: FleetLogs = None) -> None:
    """Compare the model with every log; a row has the errors and on what they depend."""
    _run("compare", logs, options)


@app.command("diagnose")
@spread
def diagnose(options: FleetOptions, logs: FleetLogs = None) -> None:
    """Diagnose every log by itself; a row has the verdict and all fitted values with their standard errors."""
    _run("diagnose", logs, options)


@app.command("merge")
def merge(
    parts: Annotated[list[Path], typer.Argument(metavar="PARTS...", help="All parts that --shard has written.")],
    output: TableOption = "results.parquet",
    quiet: QuietOption = False,
) -> None:
    """Join the parts of a fleet; the table is that of one run over all logs."""
    from dsd_cli.cli.fleet_run import refuse_without_result
    from dsd_cli.cli.fleet_tasks import COMMON, DONE
    from dsd_cli.cli.identification import say
    from dsd_cli.files.fleet_parts import joined, refuse_other_table
    from dsd_cli.files.fleet_table import check_table, columns_of, write_table

    target = check_table(output, parts)
    rows = joined(parts)
    refuse_other_table(target, str(rows[0]["command"]))
    write_table(target, iter(rows), columns_of(rows, COMMON))
    reasons = [str(row["reason"]) for row in rows if row["status"] != DONE]
    refuse_without_result(reasons, len(rows), output)
    say(quiet, _ready(output, len(rows), len(reasons)))


@app.command("summary")
def summary(
    results: Annotated[Path, typer.Argument(metavar="RESULTS", help="Table that dsd fleet has written.")],
    form: FormatOption = Format.TABLE,
    plot: PlotOption = None,
    quiet: QuietOption = False,
) -> None:
    """Shares of the verdicts, logs that stand out, and values of a machine that drift over the dates."""
    import sys

    from dsd_cli.cli.identification import print_json, say
    from dsd_cli.cli.pictures import check_plot, put_picture
    from dsd_cli.files.fleet_table import read_rows, rows_file
    from dsd_cli.report.fleet import summarize, to_json
    from dsd_cli.report.fleet_table import print_table

    check_plot(plot, [results])
    rows, where = read_rows(results), rows_file(results)
    found = summarize(str(results), rows)
    if where != results:
        say(quiet, f"{results} is not written yet; these are the rows so far, in {where}")
    if form is Format.JSON:
        print_json(to_json(found))
    else:
        print_table(found, sys.stdout)
    if plot is not None:
        from dsd_cli.report.plots_fleet import draw

        put_picture(plot, lambda: draw(found, rows), quiet)


def _run(command: str, logs: list[str] | None, given: FleetOptions) -> None:
    from dsd_cli.cli.fleet_logs import Asked, entries, once, refuse_output_among, tasks
    from dsd_cli.cli.fleet_run import run_fleet
    from dsd_cli.cli.fleet_shards import cut, shard_of
    from dsd_cli.files.fleet_table import check_table

    output, listing, quiet = given.output, given.listing, given.quiet
    workers = _workers(given.workers, given.cluster, given.retries)
    shard = None if given.shard is None else shard_of(given.shard, output)
    named = entries(logs or (), listing)
    found = once(named)
    if (again := len(named) - len(found)) and not quiet:
        typer.echo(f"{again:,} of {len(named):,} names are of logs that are named already: taken once", err=True)
    found = refuse_output_among(found, output)
    texts = tuple(given.override or ()), tuple(given.effect or ())
    asked = Asked(command, given.config, *texts, tuple(given.effects_from or ()))
    work = tasks(found, asked)
    work, part = (work, None) if shard is None else cut(work, shard)
    inputs: Sequence[str | Path] = [*{task.config.name for task in work}, *asked.effects_from]
    target = check_table(output, [*inputs, *([] if listing is None else [listing])])
    ran = run_fleet(work, target, workers, given.anew, quiet, part)
    if not quiet:
        typer.echo(_ready(output, ran.logs, ran.failed, part is None), err=True)


def _ready(output: str, logs: int, failed: int, whole: bool = True) -> str:
    bad = f", {failed:,} without a result (column reason)" if failed else ""
    return f"{output}: {logs:,} logs{bad}; next: dsd fleet {f'summary {output}' if whole else 'merge, with all parts'}"


def _workers(count: int | None, cluster: str | None, retries: int) -> Workers:
    import os

    from dsd_cli.cli.fleet_run import Workers
    from dsd_cli.errors import UsageError

    if count is not None and cluster is not None:
        raise UsageError("--workers counts processes of this machine, --cluster names others", "give one of them")
    if count is not None and not 1 <= count <= 1024:
        raise UsageError(f"--workers {count}", "from 1 to 1024")
    if not 1 <= retries <= 100:
        raise UsageError(f"--retries {retries}", "from 1 to 100")
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return Workers(count or min(cores, 61), cluster, retries)
