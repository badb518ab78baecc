"""Recordings of other tools that were made to do harm: nothing in them is run, followed, or unpacked without end."""

import io
import os
import shlex
import subprocess
import zipfile
from pathlib import Path

import numpy as np
import pytest

from dsd_cli.files.formats.formulas import is_arithmetic
from tests.cli.rig import CONFIG, DSD, dsd, refused

ROWS = 400
T = np.arange(ROWS) * 1e-3
U = np.sin(9.0 * T)
V = np.cumsum(U) * 1e-3


@pytest.fixture
def rig(tmp_path: Path) -> Path:
    (tmp_path / "dsd.toml").write_text(CONFIG + '\n[signals]\ntime = "t"\nu = "u"\nvelocity = "v"\n')
    return tmp_path


def limited(log: str, cwd: Path) -> subprocess.CompletedProcess:
    """`dsd observe` in 3 GB, so that a bomb ends the test and not the machine."""
    command = shlex.join([*map(str, DSD), "observe", log, "-o", "out.csv"])
    limits = f"ulimit -v 3000000; ulimit -t 60; exec {command}"
    return subprocess.run(["bash", "-c", limits], cwd=cwd, capture_output=True, text=True, timeout=300, check=False)


class Harm:
    """Makes a folder when it is unpickled."""

    def __reduce__(self):
        return os.mkdir, ("harm",)


@pytest.mark.parametrize("kind", ["npz", "npy", "object in npz"])
def test_nothing_is_unpickled(rig, kind):
    evil = np.array([Harm()], dtype=object)
    if kind == "npy":
        np.save(rig / "log.npy", evil, allow_pickle=True)
        refused(limited("log.npy", cwd=rig), 1, "log.npy")
    elif kind == "npz":
        np.savez(rig / "log.npz", t=T, u=evil, v=V)
        refused(limited("log.npz", cwd=rig), 1, "log.npz")
    else:
        np.savez(rig / "log.npz", t=T, u=U, v=V, notes=evil)
        assert limited("log.npz", cwd=rig).returncode == 0
    assert not (rig / "harm").exists()


FORMULA = "__import__('os').mkdir('harm')"
STUB = "def symbols(name): return name\ndef lambdify(symbol, formula, **rest): return eval('lambda X: ' + formula)\n"


@pytest.mark.parametrize(
    ("formula", "allowed"),
    [(FORMULA, False), ("X.real", False), ("2 * X + sqrt(abs(X)) ** 2", True)],
)
def test_a_formula_in_a_file_is_arithmetic_or_refused(rig, formula, allowed):
    """asammdf compiles what numexpr refuses by sympy, if that is there: here a stand-in of it is."""
    asammdf = pytest.importorskip("asammdf", reason="asammdf is not installed")
    log = asammdf.MDF(version="4.10")
    signals = [asammdf.Signal(U, T, name="u", conversion={"formula": formula}), asammdf.Signal(V, T, name="v")]
    log.append(signals, common_timebase=True)
    log.save(rig / "log.mf4")
    (rig / "sympy.py").write_text(STUB)
    done = dsd("observe", "log.mf4", "-o", "out.csv", cwd=rig, PYTHONPATH=rig)
    assert not (rig / "harm").exists()
    if allowed:
        assert done.returncode == 0, done.stderr
        found = np.loadtxt(rig / "out.csv", delimiter=",", skiprows=1)
        np.testing.assert_allclose(found[:, 1], 2.0 * U + np.abs(U))
    else:
        refused(done, 1, "log.mf4", "formula", formula)


@pytest.mark.parametrize(
    "formula",
    [
        "9**9**9**9", "9**X", "X**1e9", "X**X", "(lambda: 1)()", "X if X else 1", "[X]", "X and 1", "f'{X}'", "X1.T",
        "ln(X)", "eval('1')", "sin(X, out=X)", "sin(*X)", "X" + "+X" * 1000, "(" * 400 + "X" + ")" * 400, "X; 1", "",
    ],
)  # fmt: skip
def test_more_than_arithmetic_is_no_formula(formula):
    assert not is_arithmetic(formula)


def test_a_header_that_claims_terabytes_is_one_line(rig):
    np.savez(rig / "plain.npz", t=T, u=U, v=V)
    header = io.BytesIO()
    np.lib.format.write_array_header_1_0(header, {"descr": "<f8", "fortran_order": False, "shape": (1 << 40,)})
    with zipfile.ZipFile(rig / "plain.npz") as plain, zipfile.ZipFile(rig / "log.npz", "w") as changed:
        for name in plain.namelist():
            changed.writestr(name, header.getvalue() if name == "u.npy" else plain.read(name))
    refused(limited("log.npz", cwd=rig), 1, "memory")


def test_packed_zeros_beyond_the_memory_are_refused(tmp_path, monkeypatch):
    from dsd_cli.errors import DataError
    from dsd_cli.files.formats.mat import MatFile
    from dsd_cli.files.formats.numpy_file import NumpyFile

    scipy_io = pytest.importorskip("scipy.io")
    np.savez_compressed(tmp_path / "log.npz", t=T, big=np.zeros(300_000))
    scipy_io.savemat(tmp_path / "log.mat", {"t": T, "big": np.zeros(300_000)}, do_compression=True)
    pages = {"SC_PHYS_PAGES": 500, "SC_PAGE_SIZE": 4096}  # a machine of 2 MB
    monkeypatch.setattr(os, "sysconf", pages.__getitem__)
    for opener, name in ((NumpyFile, "log.npz"), (MatFile, "log.mat")):
        with pytest.raises(DataError, match="unpacks to"):
            opener(str(tmp_path / name))


@pytest.mark.parametrize("kind", ["wide", "never written", "elsewhere", "linked"])
def test_hdf5_that_claims_or_borrows(rig, kind):
    h5py = pytest.importorskip("h5py", reason="h5py is not installed")
    (rig / "secret").write_bytes(U.tobytes())
    with h5py.File(rig / "log.h5", "w") as file:
        file["t"], file["v"] = T, V
        if kind == "wide":
            file["u"] = U
            file.create_dataset("picture", shape=(10, 1 << 40), chunks=(1, 1 << 16), dtype="f8")
            file.create_dataset("bands", data=np.zeros((20, 5000)))
        elif kind == "never written":
            file.create_dataset("u", shape=(1 << 40,), chunks=(1 << 16,), dtype="f8")
        elif kind == "elsewhere":
            file.create_dataset("u", shape=(ROWS,), dtype="f8", external=[(str(rig / "secret"), 0, 8 * ROWS)])
        else:
            layout = h5py.VirtualLayout(shape=(ROWS,), dtype="f8")
            layout[:] = h5py.VirtualSource(str(rig / "other.h5"), "u", shape=(ROWS,))
            file.create_virtual_dataset("u", layout)
    done = limited("log.h5", cwd=rig)
    if kind == "wide":
        assert done.returncode == 0, done.stderr
    else:
        said = "next to nothing" if kind == "never written" else "another file"
        refused(done, 1, "log.h5", said)


def test_control_characters_in_names_of_channels_are_shown(rig):
    np.savez(rig / "log.npz", **{"t": T, "\x1b]52;c;aGk=\x07": U, "v": V})
    done = dsd("observe", "log.npz", "-o", "out.csv", cwd=rig)
    refused(done, 1, "log.npz")
    assert "\x1b" not in done.stderr
    asked = dsd("init", "log.npz", "-o", "new.toml", cwd=rig)
    assert "\x1b" not in asked.stdout + asked.stderr
    assert not (rig / "new.toml").exists() or "\x1b" not in (rig / "new.toml").read_text()


@pytest.mark.parametrize("command", ["columns log.mcap", "init log.mcap -o out.toml"])
def test_a_message_that_cannot_be_decoded_is_one_line(rig, command):
    """Libraries find out in the middle of a file, after it was opened."""
    writing = pytest.importorskip("mcap.writer", reason="mcap is not installed")
    with open(rig / "log.mcap", "wb") as stream:
        writer = writing.Writer(stream)
        writer.start()
        topic = writer.register_channel("/drive", "json", writer.register_schema("drive", "jsonschema", b"{}"))
        for k in range(ROWS):
            text = b'{"current": ?}' if k == ROWS // 2 else b'{"current": 1.5}'
            writer.add_message(topic, 1_000_000 * k, text, 1_000_000 * k)
        writer.finish()
    refused(dsd(*command.split(), cwd=rig), 1, "log.mcap: cannot be read as MCAP", "write it again")
