"""Workbooks as Excel and openpyxl write them: the same numbers, names and stamps as in the sheet."""

from __future__ import annotations

import zipfile
from datetime import datetime, time, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dsd_cli.errors import DataError, UsageError
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


def test_errors_and_breaks_of_lines_in_cells(tmp_path: Path) -> None:
    rows = [["t", None, 'u\n"x"'], [0.5, None, "#DIV/0!"], [1.0, None, True]]
    assert text_of(book(tmp_path, rows)) == b't,,"u ""x"""\n0.5,,\n1,,1\n'


def test_without_the_library_it_says_how_to_install_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = book(tmp_path, table())
    monkeypatch.setattr("dsd_cli.files.workbook.find_spec", lambda name: None)
    with pytest.raises(UsageError, match="openpyxl is not installed") as said:
        text_of(path)
    assert "pip install" in said.value.hint


def test_a_damaged_workbook_is_one_message(tmp_path: Path) -> None:
    whole = book(tmp_path, table())
    with zipfile.ZipFile(whole) as old, zipfile.ZipFile(tmp_path / "bad.xlsx", "w") as new:
        for name in old.namelist():
            new.writestr(name, old.read(name)[: 100 if "sheet1" in name else None])
    with pytest.raises(DataError, match="cannot be unpacked"):
        text_of(tmp_path / "bad.xlsx")


@pytest.mark.parametrize("same", [False, True], ids=["names", "titles"])
def test_sheets_of_a_signal_each_stand_side_by_side(same: bool, tmp_path: Path) -> None:
    made = openpyxl.Workbook()
    made["Sheet"].append(["operator", "x"])
    for title, slope in (("Torque", -0.25), ("Angle", 2.0)):
        sheet = made.create_sheet(title)
        sheet.append(["Time", "value" if same else title])
        for k in range(60):
            sheet.append([k / 500, slope * k])
    made.save(tmp_path / "log.xlsx")
    end = " value" if same else ""
    (batch,) = open_table(
        tmp_path / "log.xlsx", {"t": "Time", "u": f"Torque{end}", "position": f"Angle{end}"}
    ).batches()
    assert np.array_equal(batch.columns["t"], np.arange(60) / 500)
    assert np.array_equal(batch.columns["u"], -0.25 * np.arange(60))
    assert np.array_equal(batch.columns["position"], 2.0 * np.arange(60))


def test_empty_sheets_are_empty(tmp_path: Path) -> None:
    made = openpyxl.Workbook()
    made.create_sheet("Other")
    made.save(tmp_path / "log.xlsx")
    with pytest.raises(DataError, match="is empty"):
        open_table(tmp_path / "log.xlsx", COLUMNS)
