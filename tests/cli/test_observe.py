"""`dsd observe`: d_hat from velocity or position, rows that cannot be used, and what is refused."""

import json
from pathlib import Path

import numpy as np
import pytest

from dsd_cli.plant.model import ObserverSettings
from dsd_cli.plant.observer import observe_log
from dsd_cli.signals.log import Log
from tests.cli.rig import CONFIG, csv_text, done, dsd, make_log, read_labels, refused, write


@pytest.fixture
def rig(tmp_path: Path) -> Path:
    (tmp_path / "dsd.toml").write_text(CONFIG)
    return tmp_path


def motion(rows: int = 200) -> dict[str, np.ndarray]:
    log = make_log(rows)
    velocity = np.cumsum(log["u"]) * 0.001
    return {"t": log["t"], "u": log["u"], "position": np.cumsum(velocity) * 0.001, "velocity": velocity}


@pytest.mark.parametrize("source", ["velocity", "position"])
def test_d_hat_is_that_of_the_observer(rig, source):
    columns = {name: column for name, column in motion().items() if name in ("t", "u", source)}
    write(rig, "log.csv", columns)
    said = done("observe", "log.csv", "-o", "out.csv", cwd=rig)
    assert (said.stdout, said.stderr) == ("", f"out.csv: 200 samples, d_hat computed from {source}\n")
    got = read_labels(rig / "out.csv")
    expected = observe_log(Log(columns, 0.001), ObserverSettings(time_constant=0.002))
    np.testing.assert_array_equal(got["d_hat"], expected["d_hat"])
    np.testing.assert_array_equal(got["u"], columns["u"])
    assert json.loads((rig / "out.csv.meta.json").read_text())["d_hat_source"] == source
    assert done("observe", "log.csv", "-o", "-", "-q", cwd=rig).stdout == (rig / "out.csv").read_text()
    piped = done("observe", "-", "-o", "-", "-q", cwd=rig, stdin=csv_text(columns))
    assert piped.stdout == (rig / "out.csv").read_text()


def test_velocity_is_preferred_and_the_sign_is_the_users(rig):
    write(rig, "log.parquet", motion())
    said = done("observe", "log.parquet", "-o", "a.parquet", cwd=rig)
    assert "from velocity" in said.stderr
    done("observe", "log.parquet", "-o", "b.parquet", "--set", "observer.sign=-1", "-q", cwd=rig)
    a, b = (read_labels(rig / f"{name}.parquet")["d_hat"] for name in "ab")
    np.testing.assert_array_equal(a, -b)
    assert np.abs(a).max() > 0


def test_a_gap_begins_the_observer_anew_and_rows_are_counted(rig):
    columns = {name: np.delete(column, slice(100, 150)) for name, column in motion().items()}
    columns["u"][20] = np.nan
    write(rig, "log.csv", columns)
    said = done("observe", "log.csv", "-o", "out.csv", cwd=rig)
    assert "not finite: u 1" in said.stderr
    assert "gap 1" in said.stderr
    got = read_labels(rig / "out.csv")
    assert got["d_hat"].size == 150
    assert got["d_hat"][100] == 0.0
    assert np.isfinite(got["d_hat"]).all()


@pytest.mark.parametrize(
    ("content", "options", "code", "text"),
    [
        ("", [], 1, "log.csv: is empty"),
        ("t,u,velocity\n", [], 1, "has a header but no rows"),
        ("t,u,velocity\n0,1,2\n", [], 1, "log.csv: no sample time can be found"),
        ("t,u,x\n0,1,2\n1,1,2\n", [], 1, "neither velocity nor position"),
        ("t,i,velocity\n0,1,2\n", [], 1, 'no column "u"'),
        ("t,u,velocity\n0,1,2\n1,x,2\n", [], 1, 'line 3, column "u"'),
        ("t,u,velocity\n0,1,2\n1,1,2\n", ["-o", "log.csv"], 2, "is the input"),
        ("t,u,velocity\n0,1,2\n1,1,2\n", ["-o", "log.txt"], 2, "end the name in"),
        ("t,u,velocity\n0,1,2\n1,1,2\n", ["--set", "observer.nominal_inertia=0"], 2, "nominal_inertia"),
    ],
)
def test_what_cannot_work_is_one_line(rig, content, options, code, text):
    (rig / "log.csv").write_text(content)
    refused(dsd("observe", "log.csv", "-o", "out.csv", *options, cwd=rig), code, text)
    assert {path.name for path in rig.iterdir()} == {"dsd.toml", "log.csv"}
