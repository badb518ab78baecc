"""Outputs appear whole or not at all, hold what was written, and come back with their metadata."""

import io
import json
import os
import sys

import numpy as np
import pyarrow.parquet as pq
import pytest

from dsd_cli.errors import DataError, UsageError
from dsd_cli.files import tables_out
from dsd_cli.files.logs import load_log, write_log
from dsd_cli.files.tables_in import open_table
from dsd_cli.files.tables_out import Coded, Rounded, Share, open_writer
from dsd_cli.signals.log import Log

KINDS = {
    "t": "float64",
    "state": "int16",
    "delay": Coded(np.array([0.2, 0.3])),
    "log_likelihood": Rounded(4),
    "confident": "bool",
}
LABELS = {
    "t": np.array([0.0, 0.1 + 0.2]),
    "state": np.array([0, 1]),
    "delay": np.array([1, 0]),
    "log_likelihood": np.array([-1.5, np.nan]),
    "confident": np.array([True, False]),
}


def files_in(folder):
    return sorted(path.name for path in folder.iterdir())


@pytest.mark.parametrize("name", ["out.csv", "out.parquet", "out.pq"])
def test_what_is_written_is_read_back(tmp_path, name):
    with open_writer(tmp_path / name, KINDS, {"seed": "1"}) as writer:
        writer.write(LABELS)
        writer.write(LABELS)
        assert name not in files_in(tmp_path)
    table = open_table(tmp_path / name, {n: n for n in ("t", "state", "delay", "log_likelihood")})
    [batch] = table.batches()
    assert table.column_names == list(KINDS)
    assert table.metadata == {"seed": "1"}
    assert batch.columns["t"].tolist() == [0.0, 0.1 + 0.2] * 2
    assert batch.columns["delay"].tolist() == [0.3, 0.2] * 2
    np.testing.assert_array_equal(batch.columns["log_likelihood"], [-1.5, np.nan] * 2)
    assert files_in(tmp_path) == sorted([name] + (["out.csv.meta.json"] if name == "out.csv" else []))


def test_csv_text(tmp_path):
    with open_writer(tmp_path / "out.csv", KINDS) as writer:
        writer.write(LABELS)
    assert (tmp_path / "out.csv").read_text() == (
        "t,state,delay,log_likelihood,confident\n0,0,0.3,-1.5,true\n0.30000000000000004,1,0.2,nan,false\n"
    )


def test_shares(tmp_path):
    shares = np.array([0.0, 1.0, 0.12344, 0.99996, np.nan, 1 + 1e-7])
    for name in ("out.csv", "out.parquet"):
        with open_writer(tmp_path / name, {"probability": Share()}) as writer:
            writer.write({"probability": shares})
    assert (tmp_path / "out.csv").read_text().split()[1:] == ["0.0", "1.0", "0.1234", "1.0", "nan", "1.0"]
    np.testing.assert_array_equal(pq.read_table(tmp_path / "out.parquet")["probability"], shares.astype(np.float32))


def test_parquet_columns_are_plain_numbers_for_other_readers(tmp_path):
    with open_writer(tmp_path / "out.parquet", KINDS) as writer:
        writer.write(LABELS)
    types = [str(field.type) for field in pq.read_schema(tmp_path / "out.parquet")]
    assert types == ["double", "int16", "double", "float", "bool"]


@pytest.mark.parametrize("name", ["out.csv", "out.parquet"])
def test_no_rows_still_give_a_file_with_columns(tmp_path, name):
    with open_writer(tmp_path / name, KINDS):
        pass
    if name == "out.csv":
        assert (tmp_path / name).read_text() == "t,state,delay,log_likelihood,confident\n"
    else:
        assert pq.read_table(tmp_path / name).column_names == list(KINDS)


@pytest.mark.parametrize("name", ["out.csv", "out.parquet"])
@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt])
def test_an_exception_leaves_the_old_file_and_nothing_else(tmp_path, name, error):
    (tmp_path / name).write_text("old")

    def fail_half_way():
        with open_writer(tmp_path / name, KINDS, {"a": "b"}) as writer:
            writer.write(LABELS)
            raise error

    with pytest.raises(error):
        fail_half_way()
    assert files_in(tmp_path) == [name]
    assert (tmp_path / name).read_text() == "old"


@pytest.mark.parametrize("name", ["out.csv", "out.parquet"])
def test_a_failure_while_writing_is_one_line(tmp_path, name):
    def write():
        with open_writer(tmp_path / name, KINDS) as writer:
            writer._file.close()  # as a full disk: every further write fails
            for _ in range(10):
                writer.write(LABELS)

    with pytest.raises(DataError, match="cannot be written"):
        write()
    assert files_in(tmp_path) == []


def test_refused_before_any_work(tmp_path):
    source = tmp_path / "log.csv"
    source.write_text("t,u\n")
    os.symlink(source, tmp_path / "link.csv")
    for name in ("log.csv", "link.csv"):
        with pytest.raises(UsageError, match="is the input"):
            open_writer(tmp_path / name, KINDS, inputs=[source])
    with pytest.raises(UsageError, match=r"end the name in \.csv or \.parquet"):
        open_writer(tmp_path / "out.txt", KINDS)
    with pytest.raises(DataError, match="no such folder"):
        open_writer(tmp_path / "none" / "out.csv", KINDS)
    (tmp_path / "folder.csv").mkdir()
    with pytest.raises(DataError, match="is a directory"):
        open_writer(tmp_path / "folder.csv", KINDS)
    if os.getuid():
        (tmp_path / "locked").mkdir(mode=0o500)
        with pytest.raises(DataError, match="cannot be written to"):
            open_writer(tmp_path / "locked" / "out.csv", KINDS)


def test_stdout(monkeypatch):
    stdout = io.TextIOWrapper(io.BytesIO())
    monkeypatch.setattr(sys, "stdout", stdout)
    with open_writer("-", KINDS) as writer:
        writer.write(LABELS)
    lines = stdout.buffer.getvalue().decode().splitlines()
    assert lines[:2] == ["t,state,delay,log_likelihood,confident", "0,0,0.3,-1.5,true"]


def test_a_closed_pipe_surfaces(monkeypatch):
    reading, writing = os.pipe()
    os.close(reading)
    raw = os.fdopen(writing, "wb", buffering=0)
    monkeypatch.setattr(sys, "stdout", io.TextIOWrapper(raw, write_through=True))
    with pytest.raises(BrokenPipeError):
        open_writer("-", KINDS)
    raw.close()


def test_a_sidecar_of_an_older_file_does_not_stay(tmp_path):
    (tmp_path / "out.csv.meta.json").write_text('{"seed": "old"}')
    with open_writer(tmp_path / "out.csv", KINDS):
        pass
    assert files_in(tmp_path) == ["out.csv"]


@pytest.mark.parametrize("name", ["log.csv", "log.parquet"])
def test_a_log_comes_back_as_it_was(tmp_path, name, monkeypatch):
    monkeypatch.setattr(tables_out, "GROUP_ROWS", 1000)
    rng = np.random.default_rng(0)
    n = 3000
    channels = {
        "velocity": rng.normal(size=n),
        "u": rng.normal(size=n),
        "d_hat": rng.normal(size=n),
        "t": np.arange(n) * 0.001,
    }
    log = Log(channels, 0.001, d_hat_source="position", metadata={"seed": "3", "config": "[model]\ninertia = 1"})
    write_log(tmp_path / name, log)
    again = load_log(tmp_path / name, {c: c for c in channels}).log
    assert list(again.channels) == ["t", "u", "d_hat", "velocity"]
    for channel, values in channels.items():
        np.testing.assert_array_equal(again[channel], values)
    assert again.sample_time == 0.001
    assert again.d_hat_source == "position"
    assert dict(again.metadata) == dict(log.metadata)
    if name == "log.csv":
        assert json.loads((tmp_path / "log.csv.meta.json").read_text())["d_hat_source"] == "position"


def test_what_was_done_to_a_log_is_told(tmp_path):
    rows = [f"{k},{k % 7}" for k in range(40)]
    rows[20] = "20,NA"
    (tmp_path / "log.csv").write_text("t,u\n" + "\n".join(rows + rows))
    loaded = load_log(tmp_path / "log.csv", {"t": "t", "u": "u"})
    assert loaded.dropped == {"not finite: u": 2, "bridged": 2, "restart": 1}
    assert loaded.restarts == (40,)
    assert len(loaded.log) == 80
    assert loaded.regular
    assert "ms" in loaded.warnings[0]


def test_a_log_needs_a_clock_and_rows(tmp_path):
    (tmp_path / "log.csv").write_text("t,u\n0,\n1,\n")
    with pytest.raises(DataError, match=r"signals\.sample_time"):
        load_log(tmp_path / "log.csv", {"u": "u"})
    with pytest.raises(DataError, match="no row has a value"):
        load_log(tmp_path / "log.csv", {"t": "t", "u": "u"})
