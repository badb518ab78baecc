"""A whole log through a session of any kind, where no label is written: `dsd tune`, `dsd detect --method a,b`."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from dsd_cli.cli.plan import TRUTH, detection_plan, limits, log_columns, naming, optional_columns, rows_read
from dsd_cli.detect.plan import Plan
from dsd_cli.detect.rows import Rows
from dsd_cli.detect.session import Session
from dsd_cli.errors import DataError
from dsd_cli.files.config import Config
from dsd_cli.files.table_source import TableSource
from dsd_cli.files.tables_in import open_table
from dsd_cli.files.watched import Watch, watched
from dsd_cli.signals.cleaning import BRIDGE, Cleaner
from dsd_cli.signals.clock import TIME_SCALE
from dsd_cli.signals.log import Array


class Labelled(NamedTuple):
    """Labels of all rows, the truth of the same rows where the log has it, and warnings."""

    rows: list[Rows]
    truth: dict[str, Array]
    warnings: tuple[str, ...]


def open_log(log: str, config: Config) -> tuple[TableSource, Plan]:
    """The log, and the plan of the config for it (see `as_logged`)."""
    columns = log_columns(config.signals)
    columns.pop("reference", None)
    table = rows_read(
        open_table(log, columns, optional_columns(config) & set(columns), layout=config.signals.layout), config
    )
    return table, detection_plan(config, table.columns, table.metadata, table.name)


def cleaner_for(config: Config, plan: Plan) -> Cleaner:
    """What makes samples of the rows; positions and speeds are not bridged, they will be differentiated."""
    signals = config.signals
    bridge = BRIDGE if plan.d_hat_source == "logged" else 0
    return Cleaner(signals.sample_time, TIME_SCALE[signals.time_unit], bridge, limits(signals))


def run_log(table: TableSource, session: Session, watch: Watch | None = None, what: str = "labelling") -> Labelled:
    """Feed everything, reporting to `watch`.

    Raises
    ------
    DataError : the log cannot be read, or no row can be used.
    """
    rows: list[Rows] = []
    truth: dict[str, list[Array]] = {name: [] for name in TRUTH if name in table.columns}
    with naming(table.name):
        for batch in watched(table, watch, what).batches():
            rows += session.feed(batch.columns.get("t"), batch.columns, batch.restart)
            for name, parts in truth.items():
                parts.append(batch.columns[name])
        rows += session.finish()
    if session.engine is None:
        needed = ", ".join(table.columns.values())
        raise DataError(f"{table.name}: no row has a value in every needed column ({needed})")
    joined = {name: np.concatenate(parts) for name, parts in truth.items()}
    return Labelled(rows, joined, (*table.warnings, *session.warnings))
