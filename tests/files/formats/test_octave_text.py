"""Octave's default `save`: the same numbers, ranges and fields of structs."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from dsd_cli.errors import DataError
from dsd_cli.files.sample import sample

HEAD = "# Created by Octave 8.4.0, Tue Nov 25 10:11:12 2025 CET <lab@pc7>\n"


def matrix(name: str, rows: list[str], columns: int = 1, kind: str = "matrix") -> str:
    head = f"# name: {name}\n# type: {kind}\n# rows: {len(rows)}\n# columns: {columns}\n"
    return head + "".join(f" {row}\n" for row in rows) + "\n\n"


def channels(folder: Path, text: str) -> dict[str, np.ndarray]:
    (folder / "log.txt").write_text(HEAD + text)
    return {c.name: c.values for table in sample(str(folder / "log.txt")).tables for c in table.channels}


def test_variables_ranges_and_fields_are_channels(tmp_path: Path) -> None:
    text = "# name: t\n# type: double_range\n# base, limit, increment\n0 0.4 0.1\n\n\n"
    text += matrix("u", ["1", "-2e-3", "NaN", "Inf", "5"]) + "# name: fs\n# type: scalar\n1000\n\n\n"
    text += "# name: who\n# type: string\n# elements: 1\n# length: 3\nlab\n\n\n"
    text += "# name: s\n# type: scalar struct\n# ndims: 2\n 1 1\n# length: 2\n"
    text += matrix("q", ["1", "2", "3", "4", "5"]) + matrix("both", ["1 2", "3 4", "5 6", "7 8", "9 10"], 2)
    text += "\n" + matrix("after", ["9", "8", "7", "6", "5"])
    found = channels(tmp_path, text)
    assert set(found) == {"t", "u", "s/q", "s/both/1", "s/both/2", "after"}
    assert np.allclose(found["t"], [0.0, 0.1, 0.2, 0.3, 0.4])
    assert np.array_equal(found["u"], [1.0, -2e-3, np.nan, np.inf, 5.0], equal_nan=True)
    assert np.array_equal(found["s/both/2"], [2, 4, 6, 8, 10])
    assert np.array_equal(found["after"], [9, 8, 7, 6, 5])


def test_a_row_that_is_none_names_its_variable(tmp_path: Path) -> None:
    with pytest.raises(DataError, match=r'log\.txt: variable "u" has a line that is no row of numbers'):
        channels(tmp_path, matrix("u", ["1", "oops", "3"]))
