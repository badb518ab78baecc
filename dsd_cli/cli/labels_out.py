"""Labels to a file or to stdout."""

from __future__ import annotations

import contextlib
import math
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any

from dsd_cli.detect.grid import Grid
from dsd_cli.detect.rows import Rows
from dsd_cli.files.tables_out import Coded, Kind, Rounded, Share, open_writer

Write = Callable[[Rows], None]

#: Columns of method "profile", in the order of `Estimates`.
ESTIMATES = (
    "delay_estimate",
    "delay_std",
    "inertia_estimate",
    "inertia_std",
    "delay_confident",
    "inertia_confident",
)


class NoLabels(contextlib.AbstractContextManager[Write]):
    """Only the summary is wanted."""

    def __enter__(self) -> Write:
        return lambda rows: None

    def __exit__(self, *_: object) -> None:
        return None


class LabelsFile:
    """Columns t, state, the axes of the grid, log_likelihood, probability, confident; whole or not at all.

    With `estimates` those of `Estimates` follow; a delay or inertia that is one stands under <name>_estimate.
    """

    def __init__(
        self,
        path: str,
        grid: Grid,
        metadata: Mapping[str, str],
        inputs: Sequence[str | Path],
        estimates: bool = False,
    ) -> None:
        self._axes = list(grid.axes)
        columns: dict[str, Kind] = {"t": "float64", "state": "int16" if len(grid) < 32768 else "int32"}
        columns |= {name: Coded(values) for name, values in grid.axes.items()}
        columns |= {"log_likelihood": Rounded(4), "probability": Share(), "confident": "bool"}
        if estimates:
            columns |= {name: "bool" if name.endswith("confident") else "float64" for name in ESTIMATES}
        self._writer = open_writer(path, columns, metadata, inputs)

    def __enter__(self) -> Write:
        self._writer.__enter__()
        return self._write

    def _write(self, rows: Rows) -> None:
        if rows.state.size:
            estimates = dict(zip(ESTIMATES, rows.estimates, strict=False))
            self._writer.write({**rows._asdict(), **dict.fromkeys(self._axes, rows.state), **estimates})

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self._writer.__exit__(kind, error, at)


@contextlib.contextmanager
def json_lines(grid: Grid) -> Iterator[Write]:
    """One JSON object per sample on stdout; what could not be judged is null."""
    import json

    axes = {name: values.tolist() for name, values in grid.axes.items()}

    def write(rows: Rows) -> None:
        estimates = _objects(rows)
        for t, state, ll, probability, confident in zip(*(column.tolist() for column in rows[:5]), strict=True):
            out = {"t": _finite(t), "state": state, **{name: values[state] for name, values in axes.items()}}
            out |= {"log_likelihood": _finite(ll), "probability": _finite(probability), "confident": confident}
            if rows.estimates:
                out |= next(estimates)
            sys.stdout.write(json.dumps(out) + "\n")
        sys.stdout.flush()

    yield write


def _objects(rows: Rows) -> Iterator[dict[str, Any]]:
    """The estimates of each row."""
    for values in zip(*(column.tolist() for column in rows.estimates), strict=True):
        yield {
            name: value if isinstance(value, bool) else _finite(value)
            for name, value in zip(ESTIMATES, values, strict=True)
        }


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
