"""A small rig for the tests of the commands: its config, its log, and the real command in a process of its own."""

import csv
import io
import json
import os
import signal
import subprocess
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.csv as pc
import pyarrow.parquet as pq

from dsd_cli.plant.model import ObserverSettings, PlantModel
from dsd_cli.plant.prediction import predict_d_hat
from dsd_cli.signals.log import Log
from tests import warm
from tests.warm import DSD as DSD
from tests.warm import FEW as FEW

LABELS = ["t", "state", "delay", "inertia", "log_likelihood", "probability", "confident"]
CONFIG = """
[observer]
nominal_inertia = 1.0
time_constant = 0.002

[states]
delays = [0.0, 0.005, 0.01]
inertias = [0.5, 1.0, 2.0]

[detector]
window = 40
rho = 0.1
initial = { delay = 0.01, inertia = 2.0 }
"""
#: A small axis of which the position alone is logged; more of [model], and [simulate], follow.
AXIS = """
[signals]
u = "u"
position = "position"

[observer]
nominal_inertia = 0.01
time_constant = 0.005

[model]
inertia = 0.01
delay = 0.004
"""
T = 0.001
DELAY, INERTIA = 0.005, 1.0
#: The state of that delay and inertia in CONFIG.
RIGHT = 4


def dsd(*arguments: object, cwd: Path, **keywords: object) -> subprocess.CompletedProcess:
    """The command; text in and out unless the standard input is bytes. `effects` : see `warm.run`."""
    told = {name: keywords.pop(name) for name in ("stdin", "timeout", "effects") if name in keywords}
    env = {**os.environ, "NO_COLOR": "1", "COLUMNS": "120", **keywords}
    return warm.run(*arguments, cwd=cwd, env=env, **told)


def done(*arguments: object, cwd: Path, **keywords: object) -> subprocess.CompletedProcess:
    """The command, which must succeed."""
    result = dsd(*arguments, cwd=cwd, **keywords)
    assert result.returncode == 0, result.stderr
    return result


def summary(*arguments: object, cwd: Path, **keywords: object) -> dict:
    """`dsd detect` as JSON."""
    return json.loads(done("detect", *arguments, "--format", "json", cwd=cwd, **keywords).stdout)


def refused(result: subprocess.CompletedProcess, code: int, *texts: str) -> None:
    """One line on stderr, nothing on stdout, that exit code, no traceback."""
    assert (result.returncode, result.stdout) == (code, ""), result.stderr
    assert len(result.stderr.splitlines()) == 1
    assert result.stderr.startswith("dsd: error: ")
    assert "unexpected" not in result.stderr
    for text in texts:
        assert text in result.stderr


def make_log(rows: int = 300, seed: int = 0, delay: float = DELAY, inertia: float = INERTIA) -> dict[str, np.ndarray]:
    """t, u, d_hat of a plant with that delay and inertia, and a little noise."""
    rng = np.random.default_rng(seed)
    t = np.round(np.arange(rows) * T, 6)
    u = np.cumsum(rng.normal(size=rows)) * 0.3
    log = Log({"t": t, "u": u}, T)
    d_hat = predict_d_hat(PlantModel(inertia, delay), log, ObserverSettings(time_constant=0.002)) + 0.02 * rng.normal(
        size=rows
    )
    return {"t": t, "u": u, "d_hat": d_hat}


def without_signals(config: Path) -> str:
    """The text of a config, to stand behind another `[signals]`."""
    text = config.read_text(encoding="utf-8")
    begin = text.index("[signals]")
    return text[:begin] + text[text.index("\n[", begin) + 1 :]


def csv_text(columns: dict[str, np.ndarray], delimiter: str = ",", decimal: str = ".") -> str:
    out = io.StringIO()
    out.write(delimiter.join(columns) + "\n")
    for row in zip(*(np.asarray(c).tolist() for c in columns.values()), strict=True):
        out.write(delimiter.join(repr(v).replace(".", decimal) if isinstance(v, float) else str(v) for v in row) + "\n")
    return out.getvalue()


def write(folder: Path, name: str, columns: dict[str, np.ndarray], **how: object) -> Path:
    path = folder / name
    if path.suffix == ".parquet":
        pq.write_table(pa.table(columns), path, **how)
    else:
        path.write_text(csv_text(columns), encoding="utf-8")
    return path


def read_labels(source: Path | str) -> dict[str, np.ndarray]:
    """Labels from a file, or from the text of a CSV, as arrays."""
    if isinstance(source, Path) and source.suffix == ".parquet":
        table = pq.read_table(source)
    elif isinstance(source, Path):
        table = pc.read_csv(source)
    else:
        table = pc.read_csv(io.BytesIO(source.encode()))
    return {name: table[name].to_numpy() for name in table.column_names}


def same(a: dict[str, np.ndarray], b: dict[str, np.ndarray], single: bool = False) -> None:
    """The same labels, bit by bit; `single`: but for what the digits of a CSV file, or single precision, leave out."""
    assert list(a) == list(b)
    for name in a:
        if name in ("log_likelihood", "probability") and single:
            np.testing.assert_allclose(a[name].astype(float), b[name].astype(float), rtol=1e-6, atol=6e-5, err_msg=name)
        else:
            np.testing.assert_array_equal(a[name], b[name], err_msg=name)


def records(text: str) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(text)))


def interruptible() -> None:
    """In a child before it starts: Ctrl-C acts, also where the tests run behind an `&` of a shell, which ignores it."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)
