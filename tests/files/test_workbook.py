"""Workbooks as Excel and openpyxl write them: the same numbers, names and stamps as in the sheet."""

from __future__ import annotations

import zipfile
from datetime import datetime, time, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dsd_cli.files.content import text_of
from dsd_cli.files.tables_in import open_table

openpyxl = pytest.importorskip("openpyxl")
COLUMNS = {"t": "t [s]", "u": "M, ist [Nm]"}


def book(folder: Path, rows: list[list[Any]], *, notes: int = 0) -> Path:
    made = openpyxl.Workbook()
    for _ in range(notes):
        made.create_sheet("Notes", 0).append(["operator", "x"])
    for row in rows:
        made["Sheet"].append(row)
    made.save(folder / "log.xlsx")
    return folder / "log.xlsx"


def table(stamp: Any = lambda k: k / 500) -> list[list[Any]]:
    names = [["Bench 2"], [], ["t [s]", None, "M, ist [Nm]", "ok"]]
    return names + [[stamp(k), None, -0.25 * k, True] for k in range(60)]


def read(path: Path) -> dict[str, Any]:
    (batch,) = open_table(path, COLUMNS).batches()
    return dict(batch.columns)


def test_numbers_come_from_the_sheet_with_most_in_it(tmp_path: Path) -> None:
    found = read(book(tmp_path, table(), notes=2))
    assert np.array_equal(found["t"], np.arange(60) / 500)
    assert np.array_equal(found["u"], -0.25 * np.arange(60))


@pytest.mark.parametrize(
    "stamp",
    [
        lambda k: datetime(2025, 11, 25, 23, 59, 59) + timedelta(milliseconds=100 * k),
        lambda k: time(10, 0, k // 10, 100_000 * (k % 10)),
    ],
    ids=["dates", "times of day"],
)
def test_stamps_keep_their_fractions(stamp: Any, tmp_path: Path) -> None:
    found = read(book(tmp_path, table(stamp)))
    assert np.allclose(np.diff(found["t"]), 0.1, atol=2e-6, rtol=0.0)


def test_texts_may_be_shared_or_in_their_cell(tmp_path: Path) -> None:
    cells = (
        '<row r="1"><c r="A1" t="s"><v>0</v></c><c r="C1" t="inlineStr"><is><t>u "x"</t></is></c></row>'
        '<row r="3"><c r="A3"><v>0.5</v></c><c r="C3" t="e"><v>#DIV/0!</v></c></row>'
    )
    main = 'xmlns="http://schemas.openxmlformats.org/spreadsheetml/2006/main"'
    with zipfile.ZipFile(tmp_path / "log.xlsx", "w") as archive:
        archive.writestr("xl/workbook.xml", "<workbook/>")
        archive.writestr("xl/sharedStrings.xml", f"<sst {main}><si><r><t>t</t></r><r><t>ime</t></r></si></sst>")
        archive.writestr("xl/worksheets/sheet1.xml", f"<worksheet {main}><sheetData>{cells}</sheetData></worksheet>")
    assert text_of(tmp_path / "log.xlsx") == b'time,,"u ""x"""\n0.5,,\n'
