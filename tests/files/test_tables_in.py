"""Logs as they really are: each file is either read rightly or refused in one line that says where and what to do."""

import datetime
import decimal
import os
import subprocess
import sys

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from dsd_cli.errors import DataError
from dsd_cli.files.tables_in import dropped_with_unreadable, open_table

WANTED = {"t": "t", "u": "u", "d_hat": "d_hat"}
EXPECTED = {"t": [0.0, 0.001, 0.002], "u": [1.5, -2.0, 0.25], "d_hat": [0.0, 1e-7, 3.0]}
PLAIN = "t,u,d_hat\n0,1.5,0\n0.001,-2,1e-7\n0.002,0.25,3\n"


def read(path, columns=WANTED, optional=()):
    batches = list(open_table(path, columns, optional).batches())
    return {name: np.concatenate([b.columns[name] for b in batches]) for name in batches[0].columns}


def written(tmp_path, content, name="log.csv"):
    path = tmp_path / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


def refusal(path, columns=WANTED):
    with pytest.raises(DataError) as caught:
        read(path, columns)
    assert "\n" not in str(caught.value)
    assert str(path) in caught.value.message
    return str(caught.value)


DIALECTS = {
    "plain": PLAIN,
    "no newline at the end": PLAIN.rstrip("\n"),
    "windows": PLAIN.replace("\n", "\r\n"),
    "old mac": PLAIN.replace("\n", "\r"),
    "bom": "\ufeff" + PLAIN,
    "semicolons": PLAIN.replace(",", ";"),
    "tabs": PLAIN.replace(",", "\t"),
    "semicolons and decimal commas": PLAIN.replace(",", ";").replace(".", ","),
    "quoted decimal commas": 't,u,d_hat\n0,"1,5",0\n"0,001",-2,1e-7\n"0,002","0,25",3\n',
    "quoted header": PLAIN.replace("t,u,d_hat", '"t","u","d_hat"'),
    "spaces": PLAIN.replace(",", ", ").replace("t, u", " t , u"),
    "comments first": "# made by a logger\n% v2\n\n" + PLAIN,
    "header in a comment": "# " + PLAIN,
    "units row": PLAIN.replace("d_hat\n", "d_hat\n[s],V,N m\n"),
    "blank lines": PLAIN.replace("\n0.001", "\n\n0.001") + "\n\n",
    "plus signs": PLAIN.replace("1.5", "+1.5"),
    "text of no interest": 'note,t,x,u,d_hat,z\na,0,b,1.5,0,\n"q,r",0.001,,-2,1e-7,-\n#,0.002,ä,0.25,3,NaN\n',
    "units after names in a latin header": PLAIN.replace("t,u,d_hat", "t,u,d_hat,µ")
    .replace("\n", ",1\n")
    .replace("µ,1", "µ"),
}


@pytest.mark.parametrize("content", DIALECTS.values(), ids=DIALECTS)
def test_csv_dialects(tmp_path, content):
    found = read(written(tmp_path, content))
    for name, values in EXPECTED.items():
        np.testing.assert_array_equal(found[name], values)
        assert found[name].dtype == np.float64


def test_missing_values_are_nan(tmp_path):
    tokens = ["", "NA", "NaN", "nan", "null", "-", " NA", "N/A", "-nan(ind)", "inf", "-inf", "Infinity"]
    path = written(tmp_path, "t,u\n" + "".join(f"{k},{token}\n" for k, token in enumerate(tokens)))
    u = read(path, {"t": "t", "u": "u"})["u"]
    np.testing.assert_array_equal(u, [np.nan] * 9 + [np.inf, -np.inf, np.inf])


def test_csv_floats_are_exact(tmp_path):
    values = np.random.default_rng(0).normal(size=5000) * 10.0 ** np.random.default_rng(1).integers(-300, 300, 5000)
    path = written(tmp_path, "u\n" + "".join(f"{v!r}\n" for v in values.tolist()))
    np.testing.assert_array_equal(read(path, {"u": "u"})["u"], values)


def test_iso_time(tmp_path):
    path = written(tmp_path, "t,u\n2024-01-01T00:00:00.250,1\n2024-01-01T00:00:00.500,2\n")
    t = read(path, {"t": "t", "u": "u"})["t"]
    np.testing.assert_array_equal(t, 1704067200 + np.array([0.25, 0.5]))


def test_optional_columns_and_metadata(tmp_path):
    path = written(tmp_path, PLAIN)
    written(tmp_path, '{"seed": "1"}', "log.csv.meta.json")
    table = open_table(path, {**WANTED, "position": "q"}, optional=("position",))
    assert table.columns == WANTED
    assert table.column_names == ["t", "u", "d_hat"]
    assert table.metadata == {"seed": "1"}


def test_a_units_row_is_said(tmp_path):
    assert "line 2 is taken as units" in open_table(written(tmp_path, DIALECTS["units row"]), WANTED).warnings[0]


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("", "is empty"),
        ("\n\n", "is empty"),
        ("# a comment\n", "no header and no rows"),
        ("t,u,d_hat\n", "has a header but no rows"),
        ("0,1,2\n3,4,5\n", 'no column "t"; it has no header; its columns are 1, 2, 3'),
        (PLAIN.replace("-2", "abc"), 'line 3, column "u": "abc" is not a number: mend it'),
        ("# c\n\n" + PLAIN.replace("-2", "0x1F"), 'line 5, column "u": "0x1F" is not a number'),
        (PLAIN.replace("\n0.001,-2", "\n\n0.001,abc"), 'line 4, column "u": "abc"'),
        (PLAIN + "0.003,1\n", "line 5: 2 fields where the header has 3: mend or delete"),
        (PLAIN + "0.003,1,2,3\n", "line 5: 4 fields"),
        (PLAIN.replace(",u,", ",torque,"), 'no column "u"; it has t, torque, d_hat: set [signals] u = "..."'),
        (PLAIN.replace("t,u,", "t,U,"), 'set [signals] u = "U"'),
        (PLAIN.replace("t,u,", "t,u_V,"), 'set [signals] u = "u_V"'),
        (PLAIN.replace("t,u,", "t_s,u,"), 'set [signals] time = "t_s"'),
        (PLAIN.replace("d_hat", "d_hta"), 'set [signals] d_hat = "d_hta"'),
        (PLAIN.replace("d_hat", "u"), '2 columns are called "u"'),
        (b"\x1f\x8b\x08" + b"x" * 50, "gzip"),
        (b"PK\x03\x04" + b"x" * 50, "spreadsheet"),
        ("<!DOCTYPE html>\n<html>\n", "is a web page: fetch the file itself"),
        ('<?xml version="1.0"?>\n<trace/>\n', "is XML: export it as CSV"),
        ("header: \n  stamp: \n    secs: 1\n", "is what a topic was echoed as: record a bag"),
        (b"SQLite format 3\0" + b"x" * 50, "cannot be read as an SQLite database"),
        (b"WPILOG\x00\x01" + b"x" * 50, "is a data log of WPILib"),
        (b"Obj\x01" + b"x" * 50, "is an Avro file"),
        (b"\x00\x01\x02" * 50, "neither CSV nor Parquet"),
        (b"PAR1" + b"x" * 50, "not a readable Parquet file"),
    ],
)
def test_refusals(tmp_path, content, said):
    assert said in refusal(written(tmp_path, content))


def test_a_bad_row_far_down_is_found(tmp_path):
    rows = [f"{k * 0.001:.3f},{k},0.5" for k in range(200_000)]
    rows[150_000] = "150.000,oops,0.5"
    message = refusal(written(tmp_path, "t,u,d_hat\n" + "\n".join(rows) + "\n"))
    assert 'line 150002, column "u": "oops"' in message


def test_a_file_that_cannot_be_opened(tmp_path):
    assert "no such file" in refusal(tmp_path / "none.csv")
    assert "is a directory" in refusal(tmp_path)
    if os.getuid():
        path = written(tmp_path, PLAIN)
        path.chmod(0)
        assert "permission denied" in refusal(path)


def test_one_row(tmp_path):
    assert read(written(tmp_path, "t,u,d_hat\n0,1,2\n"))["u"].tolist() == [1.0]


def test_parquet_with_row_groups_nulls_and_all_kinds_of_numbers(tmp_path):
    start = datetime.datetime(2024, 1, 1)
    n = 250
    table = pa.table(
        {
            "t": pa.array([start + datetime.timedelta(milliseconds=k) for k in range(n)], pa.timestamp("us")),
            "i": pa.array([None, *range(1, n)], pa.int64()),
            "f": pa.array([0.5] * n, pa.float32()),
            "dec": pa.array([decimal.Decimal("1.25")] * n),
            "b": pa.array([True, False] * (n // 2)),
            "h": pa.array(np.ones(n, np.float16)),
            "dict": pa.array([1.0, 2.0] * (n // 2)).dictionary_encode(),
            "none": pa.nulls(n),
            "text": ["x"] * n,
            "nested": [{"a": 1}] * n,
        }
    )
    path = tmp_path / "log.parquet"
    pq.write_table(table.replace_schema_metadata({"seed": "7"}), path, row_group_size=100)
    names = ("t", "i", "f", "dec", "b", "h", "dict", "none")
    found = read(path, {name: name for name in names})
    assert all(found[name].dtype == np.float64 and found[name].size == n for name in names)
    np.testing.assert_allclose(np.diff(found["t"]), 1e-3, rtol=1e-3)
    assert found["t"][0] == 1704067200
    assert np.isnan(found["i"][0])
    assert found["i"][1:].tolist() == list(range(1, n))
    assert [found[name][0] for name in ("f", "dec", "b", "h", "dict")] == [0.5, 1.25, 1.0, 1.0, 1.0]
    assert np.isnan(found["none"]).all()
    assert open_table(path, {"u": "f"}).metadata == {"seed": "7"}
    assert 'column "text" holds string, not numbers' in refusal(path, {"u": "text"})
    assert 'no column "v"' in refusal(path, {"u": "v"})


def test_parquet_without_rows(tmp_path):
    pq.write_table(pa.table({"u": pa.array([], pa.float64())}), tmp_path / "log.parquet")
    assert "has no rows" in refusal(tmp_path / "log.parquet", {"u": "u"})


def test_a_damaged_parquet(tmp_path):
    path = tmp_path / "log.parquet"
    pq.write_table(pa.table({"u": np.random.default_rng(0).normal(size=10_000)}), path, compression="snappy")
    content = bytearray(path.read_bytes())
    content[10:5000] = b"\xff" * 4990
    path.write_bytes(content)
    assert "damaged" in refusal(path, {"u": "u"})


@pytest.mark.parametrize("kind", ["csv", "parquet"])
def test_stdin(tmp_path, kind):
    path = tmp_path / f"log.{kind}"
    if kind == "csv":
        path.write_text(PLAIN)
    else:
        pq.write_table(pa.table(EXPECTED), path)
    code = (
        "from dsd_cli.files.tables_in import open_table\n"
        "table = open_table('-', {'u': 'u'})\n"
        "print([v for b in table.batches() for v in b.columns['u'].tolist()])"
    )
    with path.open("rb") as file:
        done = subprocess.run([sys.executable, "-c", code], stdin=file, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[1.5, -2.0, 0.25]"


def test_unreadable_lines_have_their_own_count():
    assert dropped_with_unreadable({"not finite: t": 3, "gap": 1}, 2) == {
        "unreadable line": 2,
        "not finite: t": 1,
        "gap": 1,
    }
    assert dropped_with_unreadable({"not finite: u": 2}, 2) == {"unreadable line": 2}
    assert dropped_with_unreadable({"gap": 1}, 0) == {"gap": 1}
