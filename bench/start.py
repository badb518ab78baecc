"""Cold starts: what a pipeline pays for one small call."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from bench.files import _detect, make
from bench.measure import Line, ratio, run


def lines(folder: Path, repeats: int) -> Iterator[Line]:
    """`--help` and a detect of 10,000 rows against the imports they rest on."""
    bare = ("-c", "import typer, rich")
    value, a, b = ratio(lambda: run("-m", "dsd_cli", "--help"), lambda: run(*bare), repeats)
    yield Line("dsd --help / import typer, rich", value, 1.4, "times", f"{a:.3f} s / {b:.3f} s")
    detect = _detect(make(folder / "small.csv", 10_000), 9, folder / "labels.csv")
    bare = ("-c", "import numpy, pyarrow, typer, rich")
    value, a, b = ratio(lambda: run(*detect), lambda: run(*bare), repeats)
    yield Line(
        "dsd detect, 10,000 rows of CSV / import numpy, pyarrow, typer, rich",
        value,
        1.6,
        "times",
        f"{a:.3f} s / {b:.3f} s",
    )
