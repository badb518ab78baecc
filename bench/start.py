"""Cold starts: what a pipeline pays for one small call."""

from __future__ import annotations

import compileall
from collections.abc import Iterator
from pathlib import Path

import dsd_cli
from bench.files import _detect, make
from bench.measure import Line, ratio, run


def lines(folder: Path, repeats: int) -> Iterator[Line]:
    """`--help` and a detect of 10,000 rows against the imports they rest on."""
    compileall.compile_dir(
        dsd_cli.__path__[0], quiet=1
    )  # as an installation has it, like the libraries it is compared with
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
