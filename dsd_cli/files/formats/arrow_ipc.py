"""Arrow IPC files and streams, and Feather (pyarrow): batches are read as they are asked for."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import accumulate
from typing import Any

import numpy as np

from dsd_cli.files.arrow_arrays import as_float64, in_record, is_number_type, records_of
from dsd_cli.files.formats.base import Group
from dsd_cli.files.parquet_in import key_values
from dsd_cli.signals.log import Array


class ArrowFile:
    """Columns by their names."""

    def __init__(self, path: str) -> None:
        import pyarrow as pa

        self.notes: list[str] = []
        with open(path, "rb") as file:
            magic = file.read(6)
        if magic == b"ARROW1":
            reader = pa.ipc.open_file(pa.memory_map(path))
            self._batch = reader.get_batch
            count, schema = reader.num_record_batches, reader.schema
            self._edges = [0, *accumulate(self._batch(k).num_rows for k in range(count))]
        else:
            table = _whole(path, feather=magic[:4] == b"FEA1")
            batches, schema = table.to_batches(), table.schema
            self._batch = batches.__getitem__
            self._edges = [0, *accumulate(batch.num_rows for batch in batches)]
        self.metadata = key_values(schema.metadata)
        self._ways = {one.name: (one.name,) for one in schema if is_number_type(one.type)} | records_of(schema)
        names = dict.fromkeys(self._ways, "")
        self.groups: Sequence[Group] = [Group("", self._edges[-1], names)] if self._edges[-1] else []

    def read(self, group: Group, channels: Sequence[str], start: int, rows: int) -> dict[str, Array]:
        stop = min(start + rows, group.rows)
        parts: dict[str, list[Array]] = {name: [] for name in channels}
        for k, (begin, end) in enumerate(zip(self._edges, self._edges[1:], strict=False)):
            if end <= start or begin >= stop:
                continue
            batch = self._batch(k)
            cut = slice(max(start - begin, 0), min(stop, end) - begin)
            for name in channels:
                column, *way = self._ways[name]
                parts[name].append(as_float64(in_record(batch.column(column), way))[cut])
        return {name: np.concatenate(found) for name, found in parts.items()}


def _whole(path: str, feather: bool) -> Any:
    import pyarrow as pa

    if feather:  # version 1
        from pyarrow.feather import read_table

        return read_table(path)
    with pa.OSFile(path) as file:
        return pa.ipc.open_stream(file).read_all()
