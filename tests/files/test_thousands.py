"""A spreadsheet of decimal commas whose larger numbers have a point between thousands, and a row of sums at its end."""

import json
from pathlib import Path

import numpy as np
import pytest

from dsd_cli.errors import DataError
from dsd_cli.files.csv_in import CsvTable
from dsd_cli.files.sample import sample
from tests.cli.rig import done

#: ms; the point comes below what is looked at first.
T = np.arange(0.0, 8000.0)
U = np.round(30.0 * np.sin(0.01 * T), 3)


def german(x: float, places: int) -> str:
    return f"{x:,.{places}f}".translate(str.maketrans(",.", ".,"))


def spreadsheet(folder: Path, below: str = "", before: int = 0) -> Path:
    rows = [f"{german(t, 0)};{german(u, 3)};" for t, u in zip(T, U, strict=True)]
    rows.insert(before or len(rows), below)
    (folder / "log.csv").write_text("\n".join(["Zeit [ms];Moment [Nm];Bemerkung", *filter(None, rows)]) + "\n")
    return folder / "log.csv"


def read(path: Path) -> tuple[np.ndarray, np.ndarray, list[str]]:
    table = CsvTable(str(path), {"t": "Zeit [ms]", "u": "Moment [Nm]"})
    batches = list(table.batches())
    return *(np.concatenate([one.columns[name] for one in batches]) for name in ("t", "u")), table.warnings


def test_a_point_before_three_digits_stands_between_thousands_where_decimals_are_commas(tmp_path: Path) -> None:
    t, u, said = read(spreadsheet(tmp_path))
    np.testing.assert_array_equal(t, T)
    np.testing.assert_array_equal(u, U)
    assert said == ['"Zeit [ms]": decimals are commas here, so that a point stands between thousands (1.000)']


def test_the_list_of_channels_agrees(tmp_path: Path) -> None:
    found = sample(str(spreadsheet(tmp_path, "Summe;31.996.000;-4.441,085;")))
    np.testing.assert_array_equal(found.tables[0].channels[0].values, T)
    assert any("between thousands (1.000)" in note for note in found.notes)
    listed = json.loads(done("columns", "log.csv", "--format", "json", cwd=tmp_path).stdout)["columns"]
    assert (listed[0]["high"], listed[1]["high"]) == (7999.0, U.max())


def test_a_row_of_sums_at_the_end_is_text(tmp_path: Path) -> None:
    t, _, said = read(spreadsheet(tmp_path, "Summe;-4.441,085;"))
    assert (t.size, said[0]) == (T.size, "1 line(s) of text at its end are left out")


@pytest.mark.parametrize("cell", ["0.5", "1.00", "10.0000"])
def test_a_point_before_other_digits_is_an_error_in_its_line(cell: str, tmp_path: Path) -> None:
    with pytest.raises(DataError, match=rf'line 5002, column "Zeit .ms.": "{cell}" has a decimal point'):
        read(spreadsheet(tmp_path, f"{cell};1,5;", before=5000))


def test_a_row_of_words_in_the_middle_is_an_error_in_its_line(tmp_path: Path) -> None:
    with pytest.raises(DataError, match=r'line 5002, column "Zeit .ms.": "Summe" is not a number'):
        read(spreadsheet(tmp_path, "Summe;1,5;", before=5000))
