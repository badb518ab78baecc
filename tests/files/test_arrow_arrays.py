"""Arrow arrays to NumPy and back, against what Arrow's own (slow to import) ways say."""

import datetime
import decimal
import subprocess
import sys

import numpy as np
import pyarrow as pa
import pytest

from dsd_cli.files.arrow_arrays import arrow_column, as_float64

INTEGERS = [pa.int8(), pa.uint8(), pa.int16(), pa.uint16(), pa.int32(), pa.uint32(), pa.int64(), pa.uint64()]
MAKE = {
    **dict.fromkeys(INTEGERS, int),
    pa.float16(): np.float16,
    pa.float32(): float,
    pa.float64(): float,
    pa.bool_(): lambda value: bool(value % 2),
    pa.decimal128(9, 2): lambda value: decimal.Decimal(int(value)) / 4,
}
NO_PANDAS = """
import sys
from dsd_cli.files.tables_in import open_table
for name in sys.argv[1:]:
    for batch in open_table(name, {"t": "t", "u": "u"}).batches():
        assert batch.rows == 300
print("pandas" in sys.modules, "pyarrow.compute" in sys.modules)
"""


@pytest.mark.parametrize("kind", MAKE, ids=str)
@pytest.mark.parametrize("nulls", [0.0, 0.3, 1.0])
def test_any_part_of_any_kind_of_numbers(kind, nulls):
    rng = np.random.default_rng(7)
    for count in (1, 7, 8, 9, 64, 65):
        values = [None if rng.random() < nulls else MAKE[kind](value) for value in rng.integers(0, 100, count)]
        plain = pa.array(values, kind)
        for whole in (plain, *(() if kind == pa.float16() else (plain.dictionary_encode(),))):
            begin = int(rng.integers(0, count))
            part = whole.slice(begin, int(rng.integers(0, count - begin + 1)))
            found = as_float64(part)
            assert found.dtype == np.float64
            expected = [np.nan if value is None else float(value) for value in part.to_pylist()]
            np.testing.assert_array_equal(found, expected)


@pytest.mark.parametrize("kind", [pa.timestamp("ns"), pa.timestamp("ms", "UTC"), pa.duration("us"), pa.time32("ms")])
def test_times_are_seconds(kind):
    ticks = {"ms": 1_000, "us": 1_000_000, "ns": 1_000_000_000}[kind.unit]
    stored = pa.int32() if pa.types.is_time32(kind) else pa.int64()
    found = as_float64(pa.array([0, 5 * ticks // 4, None, 3 * ticks], stored).cast(kind).slice(1))
    np.testing.assert_array_equal(found, [1.25, np.nan, 3.0])


def test_a_stamp_of_today_keeps_its_last_digits():
    stamp = datetime.datetime(2026, 3, 1, 12, 0, 0, 123456)
    (found,) = as_float64(pa.array([stamp], pa.timestamp("us")))
    assert found == stamp.replace(tzinfo=datetime.UTC).timestamp()


@pytest.mark.parametrize(
    ("values", "kind"),
    [
        (["a", None, "", "\u00b5 \U0001f600"], pa.string()),
        ([None, None], pa.string()),
        ([1.5, None, -0.0], pa.float64()),
        ([1, 2.5], pa.float64()),
        ([None, 2**62], pa.int64()),
        ([True, None, False, *[True] * 9], pa.bool_()),
        ([], pa.string()),
    ],
)
def test_what_is_written_is_what_arrow_would_write(values, kind):
    made = arrow_column(values, kind)
    made.validate(full=True)
    assert made.equals(pa.array(values, kind))
    assert made.null_count == sum(value is None for value in values)


def test_reading_imports_neither_pandas_nor_pyarrow_compute(tmp_path):
    pytest.importorskip("pandas", reason="nothing to import")
    import pyarrow.csv as pc
    import pyarrow.parquet as pq

    table = pa.table({"t": np.arange(300.0), "u": pa.array([None, *range(299)], pa.int32())})
    pq.write_table(table, tmp_path / "log.parquet")
    pc.write_csv(table, tmp_path / "log.csv")
    command = [sys.executable, "-c", NO_PANDAS, str(tmp_path / "log.parquet"), str(tmp_path / "log.csv")]
    assert subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip() == "False False"
