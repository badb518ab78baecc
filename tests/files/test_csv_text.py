"""Lines of CSV: the shortest text of every number, by Python's repr; both ways to make them give the same bytes."""

import math
import subprocess
import sys
from decimal import Decimal

import numpy as np
import pytest

from dsd_cli.files.columns_out import Coded, Rounded, Share
from dsd_cli.files.csv_text import COMPILED, ROWS, CsvText

WAYS = [pytest.param(COMPILED, id="compiled", marks=pytest.mark.skipif(COMPILED is None, reason="not compiled")), None]
ODD = [
    0.0,
    -0.0,
    math.nan,
    math.inf,
    -math.inf,
    5e-324,
    1.7e308,
    -1e15,
    1e10,
    9999999999.5,
    999999999999999.0,
    1e-6,
    9.99e-7,
    -1.5e-6,
    1e22,
]


def cells(kind, values, compiled):
    text = b"".join(bytes(part) for part in CsvText({"x": kind}, compiled).lines({"x": np.asarray(values)}))
    assert text.endswith(b"\n") or not len(values)
    return text.decode().split("\n")[:-1]


def shortest(value):
    """What repr says, with Arrow's rule for exponents."""
    if not math.isfinite(value):
        return repr(value)
    if value == 0.0 or 1e-6 <= abs(value) < 1e10:
        plain = f"{Decimal(repr(value)):f}"
        return plain.rstrip("0").rstrip(".") if "." in plain else plain
    digits, _, exponent = f"{Decimal(repr(value)).normalize():e}".partition("e")
    return f"{digits}e{int(exponent):+d}"


def sorts_of_numbers():
    rng = np.random.default_rng(1)
    k = rng.integers(-(10**6), 10**6, 3000)
    return {
        "stamps": np.arange(3000) / 1000 + 17.0,
        "products": np.arange(3000) * 1e-3,  # one in seven is no decimal of three places
        "late stamps": 1.7e9 + np.arange(3000) / 1e6,
        "whole": k.astype(float),
        "nanoseconds": np.arange(3000) / 1e9,
        "any": rng.normal(size=3000) * 10.0 ** rng.integers(-30, 30, 3000),
        "few digits": k / 10.0 ** rng.integers(0, 12, 3000),
        "fifteen digits": rng.integers(10**14, 10**15, 3000) / 10.0 ** rng.integers(0, 10, 3000),
        "odd among stamps": np.concatenate([np.arange(100) / 10, ODD]),
    }


@pytest.mark.parametrize("compiled", WAYS)
@pytest.mark.parametrize("sort", sorts_of_numbers())
def test_every_number_is_its_shortest_text(compiled, sort):
    values = sorts_of_numbers()[sort]
    got = cells("float64", values, compiled)
    assert got == [shortest(value) for value in values.tolist()]


@pytest.mark.parametrize("compiled", WAYS)
def test_four_decimals(compiled):
    values = np.concatenate([np.random.default_rng(2).normal(size=3000) * 50, [0.00005, 0.00015, -0.00001, 1e12, *ODD]])
    for value, cell in zip(values.tolist(), cells(Rounded(4), values, compiled), strict=True):
        if not math.isfinite(value):
            assert cell == repr(value)
        elif abs(value) < 1e9:
            assert abs(Decimal(cell) - Decimal(value)) <= Decimal("0.0000500001")
            assert cell == shortest(float(cell))
            assert cell != "-0"
            assert len(cell.partition(".")[2]) <= 4
        else:
            assert float(cell) == pytest.approx(value, rel=1e-15)


@pytest.mark.parametrize("rows", [1, 2, 300, ROWS, ROWS + 1])
@pytest.mark.skipif(COMPILED is None, reason="not compiled")
def test_both_ways_give_the_same_bytes(rows):
    rng = np.random.default_rng(rows)
    grid = np.array([0.1, 1e-7, 300.0, 1e16])
    columns = {
        "t": "float64", "state": "int16", "delay": Coded(grid), "ll": Rounded(4), "p": Share(), "sure": "bool",
        "x": "float64", "n": "int32",
    }  # fmt: skip
    state = rng.integers(0, 4, rows)
    arrays = {
        "t": np.where(rng.random(rows) < 0.01, math.nan, np.arange(rows) * 1e-3), "state": state, "delay": state,
        "ll": rng.normal(size=rows) * 10.0 ** rng.integers(-6, 20, rows),
        "p": np.where(rng.random(rows) < 0.01, math.nan, rng.random(rows)),
        "sure": rng.random(rows) < 0.5, "x": rng.normal(size=rows), "n": rng.integers(-(2**31), 2**31, rows),
    }  # fmt: skip
    one, other = (b"".join(bytes(part) for part in CsvText(columns, way).lines(arrays)) for way in (COMPILED, None))
    assert one == other
    assert one.count(b"\n") == rows


@pytest.mark.skipif(COMPILED is None, reason="not compiled")
def test_buffers_that_do_not_fit_are_refused():
    ends, text, room = np.array([0, 1, 2], dtype=np.int32), b"ab", bytearray(100)
    codes = np.array([0, 1], dtype=np.int32)
    assert COMPILED.lines(2, [(-1, codes, b"", ends, text)], room) == 4
    assert room[:4] == b"a\nb\n"
    assert COMPILED.lines(2, [(-1, codes, b"", ends, text)], bytearray(3)) < 0
    numbers = np.array([1.5, 0.1])
    marked = np.array([1, 0], dtype=np.uint8)
    bad = [
        (2, []),
        (3, [(-1, codes, b"", ends, text)]),
        (-1, [(-1, codes, b"", ends, text)]),
        (2, [(-1, codes + 1, b"", ends, text)]),
        (2, [(-1, codes - 1, b"", ends, text)]),
        (2, [(-1, codes, b"", ends, b"a")]),
        (2, [(-1, codes, b"", ends[::-1].copy(), text)]),
        (2, [(1, numbers, marked, ends[:1], b"")]),
        (2, [(1, numbers, marked[:1], ends, text)]),
        (2, [(10, numbers, marked, ends, text)]),
        (2, [(1, numbers[:1], marked, ends, text)]),
    ]
    for rows, columns in bad:
        with pytest.raises(ValueError, match="do not fit each other"):
            COMPILED.lines(rows, columns, room)
    with pytest.raises(ValueError, match="up to 9 places"):
        COMPILED.marks(numbers, 10, np.zeros(2, dtype=np.uint8))
    with pytest.raises(ValueError, match="a byte each"):
        COMPILED.marks(numbers, 1, np.zeros(1, dtype=np.uint8))


def test_texts_of_floats_load_no_more_of_arrow_than_a_file_needs():
    """pyarrow.compute would be a tenth of the time of a short `dsd detect`."""
    code = (
        "import sys; from dsd_cli.files.csv_text import CsvText; "
        "print([bytes(part) for part in CsvText({'x': 'float64'}).lines({'x': [0.1 + 0.2, 1e-300]})]); "
        "print('pyarrow.compute' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "[b'0.30000000000000004\\n1e-300\\n']\nFalse\n"
