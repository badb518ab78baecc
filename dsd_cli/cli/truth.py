"""What a log says the true state was, row by row beside the labels."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from dsd_cli.files.table_source import Batch
from dsd_cli.signals.log import Array


class Truth:
    """Truth columns, handed out by row as the labels of these rows come."""

    def __init__(self, names: list[str]) -> None:
        self._columns: dict[str, Array] = {name: np.empty(0) for name in names}

    def put(self, batch: Batch) -> None:
        for name, waiting in self._columns.items():
            new = batch.columns.get(name)
            new = np.full(batch.rows, np.nan) if new is None else new
            self._columns[name] = np.concatenate([waiting, new]) if waiting.size else new

    def take(self, rows: int) -> Mapping[str, Array]:
        taken = {name: column[:rows] for name, column in self._columns.items()}
        self._columns = {name: column[rows:] for name, column in self._columns.items()}
        return taken
