"""The small ones: extreme values, names that are no text, terminals without signs, memory."""

import json
import os
import shlex
import shutil
import subprocess
import tracemalloc
from pathlib import Path

import numpy as np
import pytest

from dsd_cli.detect import DetectorSettings, Engine, Grid
from dsd_cli.detect.engine import Measurement
from dsd_cli.detect.transition import Transition
from dsd_cli.errors import UsageError
from tests.cli.rig import CONFIG, DSD, csv_text, dsd, make_log, refused, write

MODEL = "\n[model]\ninertia = 1.0\ndelay = 0.005\n"


@pytest.fixture
def rig(tmp_path: Path) -> Path:
    (tmp_path / "dsd.toml").write_text(CONFIG + MODEL)
    write(tmp_path, "log.csv", make_log(300))
    return tmp_path


@pytest.mark.parametrize(
    ("value", "text"),
    [
        ("states.delays=[0.0, 1e30]", "at most 10000"),
        ("states.delays=[0.01, 9999.0]", "no sample could be judged"),
        ("observer.time_constant=1e30", "at most 10000"),
        ("signals.sample_time=1e-320", "at least 1e-09"),
        ("model.delay=1e30", "at most 10000"),
        ("detector.rho=1.7e308", "between 1e-100 and 1e+100"),
        ("observer.nominal_inertia=1e-320", "between 1e-100 and 1e+100"),
        ("detector.window=10000000000000000000000", "too much memory"),
        (".".join(["a"] * 5000) + "=1", "5000 levels"),
        ("signals.u=" + "[" * 900 + "]" * 900, "nested too deeply"),
    ],
)
def test_extreme_values_are_one_line(rig, value, text):
    result = dsd("detect", "log.csv", "--set", value, cwd=rig)
    refused(result, 1 if "judged" in text else 2, text)
    assert len(result.stderr) < 1500


def test_an_average_over_more_than_memory_is_refused(rig):
    huge = ("--set", "detector.method=average", "--set", "detector.average=10000000000000000000000")
    refused(dsd("detect", "log.csv", *huge, cwd=rig), 2, "needs too much memory")


@pytest.mark.parametrize("value", ["1e308", "1e-320"])
def test_an_inertia_of_no_machine_is_one_line_of_diagnose_too(rig, value):
    columns = make_log(300)
    columns["velocity"] = np.cumsum(columns["u"]) * 1e-3
    write(rig, "v.csv", columns)
    refused(dsd("diagnose", "v.csv", "--set", f"model.inertia={value}", cwd=rig), 2, "model.inertia", "1e+100")


@pytest.mark.parametrize(("command", "step"), [("detect", 1e-320), ("compare", 1e-30), ("check", 1e-11)])
def test_stamps_closer_than_any_sample_time(rig, command, step):
    columns = make_log(300)
    write(rig, "log.csv", {**columns, "t": np.arange(300) * step, "velocity": columns["u"]})
    refused(dsd(command, "log.csv", cwd=rig), 1, "log.csv: no sample time can be found: the stamps are")


@pytest.mark.parametrize("stamp", ["", "inf", "-inf"])
@pytest.mark.parametrize("row", [1, 100, 300])
def test_a_segment_that_begins_or_ends_at_no_time(rig, stamp, row):
    lines = csv_text(make_log(300)).splitlines()
    lines[row] = stamp + lines[row][lines[row].index(",") :]
    (rig / "log.csv").write_text("\n".join(lines) + "\n")
    result = dsd("detect", "log.csv", "--format", "json", cwd=rig)
    assert result.returncode == 0, result.stderr
    segments = json.loads(result.stdout)["segments"]
    assert [segments[0]["start"] is None, segments[-1]["end"] is None] == [row == 1, row == 300]


def test_a_nested_config(rig):
    (rig / "deep.toml").write_text("x = " + "[" * 900 + "]" * 900 + "\n" + CONFIG)
    refused(dsd("detect", "log.csv", "-c", "deep.toml", cwd=rig), 2, "deep.toml: nested too deeply")


def test_more_history_than_memory_is_refused():
    with pytest.raises(UsageError, match="samples"):
        Engine(Grid((0.0, 1e4), (1.0,)), DetectorSettings(window=2), Measurement(1e-9))


def test_a_simulation_that_diverges_is_refused(rig):
    wild = ("--set", 'simulate.controller={kind="pd", kp=1e6, kd=1e6}')
    result = dsd("simulate", "--template", "servo", *wild, "--duration", "2", "-o", "x.csv", cwd=rig)
    refused(result, 1, "no longer finite at t = ", "lower the gains")
    assert not (rig / "x.csv").exists()


def test_names_that_are_no_text(rig):
    name, out = os.fsencode(rig) + b"/l\xff.csv", b"o\xff"
    os.rename(rig / "log.csv", name)
    for suffix in (b".csv", b".parquet"):
        result = subprocess.run([*DSD, "detect", name, "-o", out + suffix], cwd=rig, capture_output=True, timeout=300)
        assert result.returncode == 0, result.stderr
        assert b"l\\udcff.csv" in result.stdout
    bad = subprocess.run([*DSD, "detect", name, "-o", b"none\xff/x.csv"], cwd=rig, capture_output=True, timeout=300)
    assert (bad.returncode, bad.stdout) == (1, b"")
    assert sorted(os.listdir(os.fsencode(rig))) == [b"dsd.toml", b"l\xff.csv", b"o\xff.csv", b"o\xff.parquet"]


def test_the_history_names_a_log_whose_name_is_no_text(tmp_path):
    samples = Path(__file__).parents[2] / "sample_logs"
    shutil.copy(samples / "servo-friction.csv", os.fsencode(tmp_path) + b"/l\xff.csv")
    add = [*DSD, "add", b"l\xff.csv", "coulomb_friction", "-c", samples / "servo-bare.toml", "-o", "better.toml"]
    result = subprocess.run(add, cwd=tmp_path, capture_output=True, timeout=300)
    assert result.returncode == 0, result.stderr
    assert "udcff.csv" in (tmp_path / "better.toml").read_text()
    assert dsd("improve", "-c", "better.toml", "--history", cwd=tmp_path).returncode == 0


def test_a_terminal_without_the_signs(rig):
    result = dsd("effects", "gravity", cwd=rig, PYTHONIOENCODING="ascii")
    assert result.returncode == 0, result.stderr
    assert dsd("improve", "--help", cwd=rig, PYTHONIOENCODING="ascii").returncode == 0


def test_many_states_with_a_uniform_transition_take_no_matrix():
    tracemalloc.start()
    log_a = Transition().log_matrix(20_000)
    grid = Grid(tuple(np.arange(200) * 1e-3), tuple(1.0 + np.arange(100) * 0.01))
    Engine(grid, DetectorSettings(window=2), Measurement(1e-3))
    assert tracemalloc.get_traced_memory()[1] < 100e6
    tracemalloc.stop()
    assert log_a.shape == (20_000, 20_000)
    assert log_a[3, 7] == log_a[0, 0] == np.log(1.0 / 20_000)


@pytest.mark.parametrize(
    ("kernel", "method"), [("", "dsd"), ("numpy", "dsd"), *(("", name) for name in ("imm", "viterbi", "smooth"))]
)
def test_twenty_thousand_states_in_little_memory(rig, kernel, method):
    """A matrix of all pairs would take 3.2 GB; the process and its libraries may have 2.5."""
    write(rig, "log.csv", make_log(80))
    delays, inertias = (np.arange(200) * 1e-4).round(4).tolist(), (0.5 + np.arange(100) * 0.01).round(2).tolist()
    many = [f"states.delays={delays}", f"states.inertias={inertias}", "detector.window=2", f"detector.method={method}"]
    many.append("detector.initial={delay=0.0, inertia=1.0}")
    command = [*DSD, "detect", "log.csv", "-o", "out.csv", *(text for value in many for text in ("--set", value))]
    limited = f"ulimit -v 2500000; DSD_KERNEL={kernel} exec " + shlex.join(map(str, command))
    result = subprocess.run(["bash", "-c", limited], cwd=rig, capture_output=True, text=True, timeout=300)
    assert result.returncode == 0, result.stderr


def test_stdin_is_called_so(rig):
    (rig / "at_rest.toml").write_text(CONFIG + MODEL + '[signals]\nd_hat = ""\n')
    columns = {**make_log(300), "velocity": np.zeros(300)}
    result = dsd("compare", "-", "-c", "at_rest.toml", cwd=rig, stdin=csv_text(columns))
    refused(result, 1, "<stdin>: the axis does not move")


def test_the_message_about_a_closed_loop_is_whole(rig):
    columns = make_log(300)
    columns["velocity"] = np.cumsum(columns["u"]) * 1e-3
    write(rig, "v.csv", columns)
    result = dsd("compare", "v.csv", "--horizon", "simulation", cwd=rig)
    assert result.returncode == 0, result.stderr
    assert "no closed loop: the config has no [simulate" in result.stdout


@pytest.mark.parametrize("value", ["inf", "1e400", "-1e308"])
def test_a_column_of_one_extreme_value_is_one_line(rig, value):
    columns = make_log(300)
    lines = csv_text(columns).splitlines()
    rows = [",".join([line.split(",")[0], value, line.split(",")[2]]) for line in lines[1:]]
    (rig / "flat.csv").write_text("\n".join([lines[0], *rows]) + "\n")
    result = dsd("detect", "flat.csv", "--format", "json", cwd=rig)
    assert result.returncode in (0, 1)
    assert "unexpected" not in result.stderr


@pytest.mark.parametrize("key", ["simulate.reference.time", "simulate.events.0.time"])
def test_what_happens_after_the_end_does_not_happen(rig, key):
    name = "paper-step" if "reference" in key else "paper-delay-change"
    done = dsd("simulate", "--template", name, "--set", f"{key}=1e100", "--duration", "1", "-o", "x.csv", cwd=rig)
    assert done.returncode == 0, done.stderr


def test_a_transition_that_is_not_there_is_said_so(rig):
    refused(dsd("detect", "log.csv", "--set", "detector.transition={file='a.csv'}", cwd=rig), 2, "read (no such file)")


def test_a_library_that_finds_no_memory_is_one_line(rig):
    """As a shared library that cannot be mapped says it: under `ulimit -v` an ImportError comes of it."""
    code = (
        "import sys, resource; resource.setrlimit(resource.RLIMIT_AS, (1 << 40, 1 << 40)); "
        "from dsd_cli.cli import main; sys.modules['dsd_cli.cli.detect_job'] = None; "
        "sys.exit(main.run(['detect', 'log.csv']))"
    )
    result = subprocess.run([DSD[0], "-c", code], cwd=rig, capture_output=True, text=True)
    refused(result, 1, "not enough memory to load a library", "raise the limit of memory")
