"""Numbers as people and tools write them: with units, thousands apart, in base 16."""

import math
from pathlib import Path

import numpy as np
import pytest

from dsd_cli.errors import DataError
from dsd_cli.files.csv_cells import is_number, number, seconds, stamps_in, written
from dsd_cli.files.csv_in import CsvTable

VALUES = np.random.default_rng(5).uniform(-5e6, 5e6, 300).round(2).tolist()


def spelt(value: float, thousands: str, decimal: str, unit: str) -> str:
    text = f"{value:,.2f}".replace(",", "\0").replace(".", decimal).replace("\0", thousands)
    return text + unit


@pytest.mark.parametrize(("thousands", "decimal"), [(",", "."), (".", ","), ("'", "."), ("\u202f", ","), ("", ",")])
@pytest.mark.parametrize("unit", ["", " Nm", "A", " %", " N·m", " µm", " mm/s"])
def test_a_column_reads_as_the_numbers_that_were_written(thousands: str, decimal: str, unit: str) -> None:
    cells = [spelt(value, thousands, decimal, unit) for value in VALUES]
    how = written(cells)
    if how is None:
        assert not thousands
        assert not unit
        return
    assert [how.value(cell) for cell in cells] == VALUES
    assert how.unit == unit.strip()
    assert stamps_in(cells).tolist() == VALUES


@pytest.mark.parametrize(
    ("cell", "value"),
    [
        ("12.3 Nm", 12.3), ("0,35 A", 0.35), ("1.2e-3 rad", 1.2e-3), ("-5%", -5.0), ("1,234,567", 1234567.0),
        ("1.234,5", 1234.5), ("0x1F", 31.0), ("0xFFFFFFFF", -1.0), ("0x7FFF", 32767.0), ("0x8000", -32768.0),
        ("1,234", 1.234), ("n/a", math.nan), ("\u22121.5", -1.5),
    ],
)  # fmt: skip
def test_one_cell(cell: str, value: float) -> None:
    assert number(cell) == pytest.approx(value, rel=1e-15, nan_ok=True)


@pytest.mark.parametrize("cell", ["12 apples", "1_000", "12,34,5", "0x", "0xG1", "A 12", "1 2 3", "12.3.4", "5 Nm 3"])
def test_what_is_no_number(cell: str) -> None:
    assert not is_number(cell)


def test_a_lone_sign_is_decimal_unless_only_large_numbers_have_it() -> None:
    assert written(["1,234", "0,500", "2,750"]) is None
    assert [written(["998", "999", "1,000"]).value(cell) for cell in ("999", "1,000")] == [999.0, 1000.0]
    assert written(["0.998", "0.999", "1.000"]) is None


def test_a_minus_of_typesetters_is_one() -> None:
    how = written(["\u22121.5", "2.0", "1e-3"])
    assert [how.value(cell) for cell in ("\u22121.5", "2.0", "1e-3", "-4")] == [-1.5, 2.0, 1e-3, -4.0]


def test_a_column_of_numbers_may_be_spoiled_here_and_there() -> None:
    cells = [str(k) for k in range(100)]
    cells[70] = "#DIV/0!"
    assert stamps_in(cells) is None
    found = stamps_in(cells, 0.1)
    assert np.isnan(found[70])
    assert np.nansum(found) == sum(range(100)) - 70
    assert stamps_in([*cells[:50], *["x"] * 50], 0.1) is None


def test_a_column_of_mixed_units_is_no_numbers() -> None:
    assert written(["950 mA", "1.02 A"]) is None
    assert written(["12 ms", "13 ms"]) is None  # a time: in s, see `seconds`


def table(folder: Path, *rows: str) -> CsvTable:
    (folder / "log.csv").write_text("\n".join(["t;u;q", *rows]) + "\n", encoding="utf-8")
    return CsvTable(str(folder / "log.csv"), {"t": "t", "u": "u", "position": "q"})


def test_units_of_the_cells_are_those_of_the_columns(tmp_path: Path) -> None:
    read = table(tmp_path, "0,1;1,5 Nm;1.999,5", "0,2;;2.000,5", "0,3;-2,5 Nm;999,0")
    assert read.units == {"u": "Nm"}
    (batch,) = read.batches()
    assert np.array_equal(batch.columns["u"], [1.5, np.nan, -2.5], equal_nan=True)
    assert batch.columns["position"].tolist() == [1999.5, 2000.5, 999.0]


def test_a_cell_in_another_unit_far_down_is_found(tmp_path: Path) -> None:
    rows = [f"{k / 1000:.3f};{k % 900} mA;1".replace(".", ",") for k in range(20_000)]
    rows[15_000] = "15,0;1,02 A;1"
    with pytest.raises(DataError, match='line 15002, column "u": "1,02 A" is not written as the rows before, as'):
        list(table(tmp_path, *rows).batches())


@pytest.mark.parametrize(("step", "value"), [("1,125", 1.125), ("2,375 Nm", 2.375)])
def test_a_step_of_three_decimals_is_no_thousands_beside_columns_with_that_decimal_sign(
    step: str, value: float, tmp_path: Path
) -> None:
    zero = step.replace(step.split()[0], "0")
    read = table(tmp_path, *(f"{k / 1000:.3f};{step if k // 50 % 2 else zero};1".replace(".", ",") for k in range(200)))
    (batch,) = read.batches()
    assert batch.columns["u"].tolist() == [value * (k // 50 % 2) for k in range(200)]


@pytest.mark.parametrize("padded", ["04X", "X"])
@pytest.mark.parametrize("low", [-600, 32_000])
def test_numbers_in_base_16_are_those_of_the_smaller_steps(padded: str, low: int) -> None:
    values = [low + 7 * k for k in range(200)]
    cells = [f"0x{value & 0xFFFF:{padded}}" for value in values]
    how = written(cells)
    assert [how.value(cell) for cell in cells] == values


def test_a_cell_in_another_unit_near_the_first_is_found(tmp_path: Path) -> None:
    read = table(tmp_path, "0,1;12,3 Nm;1", "0,2;0,0125 kNm;2", "0,3;12,9 Nm;3")
    with pytest.raises(
        DataError, match='line 3, column "u": "0,0125 kNm" is not written as the rows before, as 1234,5 Nm'
    ):
        list(read.batches())


def test_milliseconds_behind_a_semicolon_are_those_of_a_trend():
    """7:02:11;412 PM, as the trends of a maker of controllers have it."""
    assert seconds("7:02:11;412 PM") == pytest.approx(19 * 3600 + 2 * 60 + 11.412, abs=1e-9)
