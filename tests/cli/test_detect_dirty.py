"""`dsd detect` on logs as they really are: handled and counted, or refused in one line."""

from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from tests.cli.rig import CONFIG, csv_text, done, dsd, make_log, read_labels, refused, same, summary, write


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("rig")
    (folder / "dsd.toml").write_text(CONFIG)
    write(folder, "clean.csv", make_log())
    done("detect", "clean.csv", "-o", "clean.labels.csv", cwd=folder)
    return folder


def counts(got: dict) -> dict[str, int]:
    return {entry["reason"]: entry["count"] for entry in got["dropped"]}


def without(log, rows):
    return {name: np.delete(column, rows) for name, column in log.items()}


def jittered(log):
    return log | {"t": log["t"] + np.where(np.arange(300) % 50 == 30, 1e-4, 0.0)}


def duplicated(log):
    return {name: np.insert(column, 100, column[99:101]) for name, column in log.items()}


def backwards(log):
    return {name: np.concatenate([column[:200], column[:100]]) for name, column in log.items()}


def spoiled(log):
    u, d_hat = log["u"].copy(), log["d_hat"].copy()
    u[[50, 51]], d_hat[[51, 120, 130]] = np.nan, [np.inf, -np.inf, np.nan]
    return log | {"u": u, "d_hat": d_hat}


DIRT = {
    "jitter": (jittered, {"jittered stamp": 12}, 300),
    "bridged": (lambda log: without(log, slice(100, 103)), {"bridged": 3}, 297),
    "gap": (lambda log: without(log, slice(100, 150)), {"gap": 1}, 250),
    "duplicates": (duplicated, {"duplicate stamp": 2}, 302),
    "backwards": (backwards, {"restart": 1}, 300),
    "NaN and inf": (spoiled, {"not finite: u": 2, "not finite: d_hat": 2, "bridged": 4}, 300),
}


@pytest.mark.parametrize("dirt", DIRT)
def test_dirt_is_counted_and_every_row_has_its_label(rig, tmp_path, dirt):
    """The same from CSV, from Parquet and from a stream, with both kernels."""
    spoil, expected, rows = DIRT[dirt]
    log = spoil(make_log())
    source = write(tmp_path, "log.csv", log)
    write(tmp_path, "log.parquet", log, row_group_size=70)
    got = summary(source, "-o", tmp_path / "a.parquet", cwd=rig)
    assert (counts(got), got["samples"]) == (expected, rows)
    assert (got["final"]["delay"], got["final"]["inertia"]) == (0.005, 1.0)
    labels = read_labels(tmp_path / "a.parquet")
    np.testing.assert_array_equal(labels["t"], log["t"])
    assert labels["state"].size == rows
    assert np.isin(labels["state"], [4, 8]).all()
    done("detect", tmp_path / "log.parquet", "-o", tmp_path / "b.parquet", cwd=rig, DSD_KERNEL="numpy")
    other = read_labels(tmp_path / "b.parquet")
    for name in ("t", "state", "delay", "inertia", "confident"):
        np.testing.assert_array_equal(labels[name], other[name])
    streamed = done("detect", "-", cwd=rig, stdin=source.read_text())
    same(read_labels(streamed.stdout), labels, single=True)


def text_of(**how):
    return csv_text(make_log(), **how)


def quoted(text):
    header, rest = text.split("\n", 1)
    return ",".join(f'"{name}"' for name in header.split(",")) + "\n" + rest


def more_columns(text):
    header, *rows = text.splitlines()
    names = ",".join(f"x{i}" for i in range(10))
    return "\n".join([f"{names},{header}", *(f'a,"b, c",,d d,é,5,6,7,8,nan,{row}' for row in rows)]) + "\n"


STYLES = {
    "BOM": lambda: ("\ufeff" + text_of()).encode(),
    "semicolons and decimal commas": lambda: text_of(delimiter=";", decimal=",").encode(),
    "tabs": lambda: text_of(delimiter="\t").encode(),
    "quoted headers": lambda: quoted(text_of()).encode(),
    "ten columns of no interest": lambda: more_columns(text_of()).encode(),
    "CRLF": lambda: text_of().replace("\n", "\r\n").encode(),
    "no last line end": lambda: text_of().rstrip("\n").encode(),
    "spaces": lambda: text_of().replace(",", " , ").encode(),
}


@pytest.mark.parametrize("style", STYLES)
def test_styles_of_csv_give_the_same_labels(rig, tmp_path, style):
    content = STYLES[style]()
    (tmp_path / "log.csv").write_bytes(content)
    clean = (rig / "clean.labels.csv").read_text()
    assert done("detect", tmp_path / "log.csv", "-o", "-", cwd=rig).stdout == clean
    assert done("detect", "-", cwd=rig, stdin=content).stdout.decode() == clean


ROW = "0.3,1.0,0.5\n"
REFUSED = {
    "empty": (b"", "is empty"),
    "header only": (b"t,u,d_hat\n", "has a header but no rows"),
    "one row": (b"t,u,d_hat\n" + ROW.encode(), "no sample time can be found"),
    "text in a number column": ((text_of() + "0.3,stop,0\n").encode(), 'line 302, column "u": "stop" is not a number'),
    "a field too many": ((text_of() + "0.3,1,0,9\n").encode(), "line 302: 4 fields where the header has 3"),
    "no header": (ROW.encode() * 20, "has no header"),
    "no u": (b"t,current,d_hat\n" + ROW.encode() * 3, 'no column "u"; it has t, current, d_hat'),
    "no disturbance": (b"t,u,x\n" + ROW.encode() * 3, "neither d_hat nor velocity nor position"),
    "twice u": (b"t,u,d_hat,u\n" + b"1,2,3,4\n" * 3, '2 columns are called "u"'),
    "time stands still": (b"t,u,d_hat\n" + ROW.encode() * 300, "time stays at 0.3 s"),
    "newest first": (b"t,u,d_hat\n" + b"".join(b"%d,1.0,0.5\n" % (300 - k) for k in range(300)), "time goes backwards"),
    "no value at all": (b"t,u,d_hat\n" + b"nan,nan,nan\n" * 20, "no finite time stamp"),
    "binary": (b"\x00\x01\x02" * 50, "neither CSV nor Parquet"),
    "half a Parquet": (b"PAR1" + b"x" * 100, "not a readable Parquet file"),
    "half a zip": (b"PK\x03\x04" + b"x" * 100, "cannot be unpacked"),
}


@pytest.mark.parametrize("what", REFUSED)
def test_what_cannot_be_read_is_one_line(rig, tmp_path, what):
    content, text = REFUSED[what]
    (tmp_path / "log.csv").write_bytes(content)
    refused(dsd("detect", tmp_path / "log.csv", "-o", tmp_path / "out.csv", cwd=rig), 1, "log.csv", text)
    assert not (tmp_path / "out.csv").exists()


@pytest.mark.parametrize("what", ["empty", "header only", "one row", "no u", "twice u", "no value at all", "binary"])
def test_what_cannot_be_read_from_a_stream(rig, what):
    content, text = REFUSED[what]
    said = dsd("detect", "-", "-o", "-", "-q", cwd=rig, stdin=content)
    assert said.returncode == 1
    assert text in said.stderr.decode()
    assert b"Traceback" not in said.stderr


def test_text_in_a_live_stream_is_counted(rig):
    header, *rows = text_of().splitlines()
    rows[100] = "what,is,this"
    said = done("detect", "-", cwd=rig, stdin="\n".join([header, *rows]) + "\n")
    assert "line 102 cannot be read" in said.stderr
    assert "unreadable line 1" in said.stderr
    assert len(said.stdout.splitlines()) == 301


def test_a_missing_file_and_a_folder(rig, tmp_path):
    refused(dsd("detect", "nothing.csv", cwd=rig), 1, "nothing.csv: no such file")
    refused(dsd("detect", "nothing.csv", "--follow", cwd=rig), 1, "nothing.csv: no such file")
    refused(dsd("detect", tmp_path, cwd=rig), 1, "is a directory")


def test_time_in_milliseconds(rig, tmp_path):
    source = write(tmp_path, "log.csv", make_log() | {"t": np.arange(300.0)})
    got = summary(source, cwd=rig)
    assert any('is the time column in ms? set signals.time_unit = "ms"' in warning for warning in got["warnings"])
    options = ["--set", "signals.time_unit=ms"]
    got = summary(source, "-o", tmp_path / "a.csv", *options, cwd=rig)
    assert (got["sample_time"], got["final"]["delay"], got["warnings"]) == (0.001, 0.005, [])
    labels, clean = read_labels(tmp_path / "a.csv"), read_labels(rig / "clean.labels.csv")
    np.testing.assert_allclose(labels["t"], clean["t"], atol=1e-12)
    np.testing.assert_array_equal(labels["state"], clean["state"])
    streamed = done("detect", "-", *options, cwd=rig, stdin=source.read_text())
    assert streamed.stdout == (tmp_path / "a.csv").read_text()


def test_without_a_time_column(rig, tmp_path):
    log = make_log()
    source = write(tmp_path, "log.csv", {"torque": log["u"], "d_hat": log["d_hat"]})
    (rig / "untimed.toml").write_text(CONFIG + '[signals]\nu = "torque"\nsample_time = 0.001\n')
    done("detect", source, "-c", "untimed.toml", "-o", tmp_path / "a.csv", cwd=rig)
    labels, clean = read_labels(tmp_path / "a.csv"), read_labels(rig / "clean.labels.csv")
    np.testing.assert_allclose(labels["t"], clean["t"], atol=1e-12)
    np.testing.assert_array_equal(labels["log_likelihood"], clean["log_likelihood"])
    refused(dsd("detect", source, "--set", "signals.u=torque", cwd=rig), 1, 'no column "t"', "[signals] time")


def test_parquet_of_every_make(rig, tmp_path):
    """Row groups, nulls, integers, float32, times as timestamps, dictionary columns."""
    log = make_log()
    u = np.round(log["u"] * 10)
    coarse = log | {"u": u, "d_hat": np.round(log["d_hat"] * 10)}
    tuning = ["--set", "detector.rho=1"]
    done("detect", write(tmp_path, "a.parquet", coarse), "-o", tmp_path / "a.csv", *tuning, cwd=rig)
    columns = {
        "t": pa.array((log["t"] * 1e6).round().astype("int64"), pa.duration("us")),
        "u": pa.array(u.astype("int32")),
        "d_hat": pa.array(coarse["d_hat"].astype("float32")).dictionary_encode(),
        "note": pa.array(["x"] * 300),
    }
    pq.write_table(pa.table(columns), tmp_path / "b.parquet", row_group_size=37)
    done("detect", tmp_path / "b.parquet", "-o", tmp_path / "b.csv", *tuning, cwd=rig)
    a, b = (read_labels(tmp_path / name) for name in ("a.csv", "b.csv"))
    np.testing.assert_array_equal(a["state"], b["state"])
    np.testing.assert_array_equal(a["log_likelihood"], b["log_likelihood"])
    holes = pa.array([None if k in (70, 71, 200) else value for k, value in enumerate(u.tolist())])
    pq.write_table(pa.table(columns | {"u": holes}), tmp_path / "c.parquet", row_group_size=37)
    assert counts(summary(tmp_path / "c.parquet", *tuning, cwd=rig)) == {"not finite: u": 3, "bridged": 3}
    pq.write_table(pa.table(columns | {"u": pa.array(["1"] * 300)}), tmp_path / "d.parquet")
    refused(dsd("detect", tmp_path / "d.parquet", cwd=rig), 1, 'column "u" holds string', "convert it")
    pq.write_table(pa.table(columns).slice(0, 0), tmp_path / "e.parquet")
    refused(dsd("detect", tmp_path / "e.parquet", cwd=rig), 1, "has no rows")
