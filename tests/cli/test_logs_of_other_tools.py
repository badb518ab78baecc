"""Logs of other tools through the real commands: the labels of the CSV file, conversion, one line for what fails."""

import json
from pathlib import Path

import numpy as np
import pytest

from dsd_cli.errors import how_to_install
from tests.cli.rig import CONFIG, csv_text, done, dsd, make_log, read_labels, refused, same, summary
from tests.files.formats import makers

NAMED = ["arrow_file", "npz", "mat5", "mat73", "hdf5", "tdms", "mcap_json", "ros2_bag"]


def config_of(folder: Path, names: dict[str, str], observer: str = CONFIG) -> None:
    keys = {"t": "time", "u": "u", "velocity": "velocity", "d_hat": "d_hat"}
    names = names if "velocity" in names else {**names, "velocity": ""}
    lines = [f"{keys[channel]} = {json.dumps(name)}" for channel, name in names.items()]
    (folder / "dsd.toml").write_text("\n".join(["[signals]", *lines, observer]))


def rig(rows: int = 400) -> dict[str, np.ndarray]:
    """The rig's log with its d_hat under the name that the makers know."""
    log = make_log(rows)
    return {"t": log["t"], "u": log["u"], "velocity": log["d_hat"]}


@pytest.mark.parametrize("kind", NAMED)
def test_the_labels_are_those_of_the_same_log_as_csv(kind: str, tmp_path: Path) -> None:
    data = rig()
    made = getattr(makers, kind)(tmp_path, data)
    config_of(tmp_path, {"t": made.names["t"], "u": made.names["u"], "d_hat": made.names["velocity"]})
    done("detect", made.path, "-o", "labels.parquet", cwd=tmp_path)
    (tmp_path / "log.csv").write_text(csv_text(data))
    config_of(tmp_path, {"t": "t", "u": "u", "d_hat": "velocity"})
    done("detect", "log.csv", "-o", "expected.parquet", cwd=tmp_path)
    found, expected = (read_labels(tmp_path / name) for name in ("labels.parquet", "expected.parquet"))
    stamps = found.pop("t")
    np.testing.assert_allclose(stamps - stamps[0], expected.pop("t"), rtol=0, atol=2e-9)
    same(found, expected, single=True)


def test_observe_converts(tmp_path: Path) -> None:
    data = makers.channels()
    made = makers.mdf(tmp_path, data)
    config_of(tmp_path, made.names)
    result = done("observe", made.path, "-o", "out.parquet", cwd=tmp_path)
    assert "600 samples, d_hat computed from velocity" in result.stderr
    found = read_labels(tmp_path / "out.parquet")
    assert list(found) == ["t", "u", "d_hat", "velocity"]
    np.testing.assert_allclose(found["velocity"], data["velocity"], rtol=0, atol=0)
    np.testing.assert_allclose(found["u"], data["u"], rtol=0, atol=1e-6)


def test_what_was_joined_is_said(tmp_path: Path) -> None:
    asammdf = pytest.importorskip("asammdf", reason="asammdf is not installed")
    log = rig(800)
    with asammdf.MDF(version="4.10") as file:
        file.append([asammdf.Signal(log["u"], log["t"], name="iq")], acq_name="drive")
        file.append([asammdf.Signal(log["velocity"][::2], log["t"][::2], name="dist")], acq_name="observer")
        file.save(tmp_path / "log.mf4")
    config_of(tmp_path, {"t": "t", "u": "iq", "d_hat": "dist"})
    found = summary("log.mf4", cwd=tmp_path)
    assert (found["samples"], found["sample_time"]) == (400, 0.002)
    assert (
        "drive/t (sampled 2 times as often) joined to the stamps of observer/t: u averaged from row to row"
        in (found["warnings"])
    )


BLOCKED = "import sys; sys.modules[{name!r}] = None; from dsd_cli.__main__ import main; main()"


@pytest.mark.parametrize(
    ("kind", "library", "extra"),
    [
        ("mdf", "asammdf", "mf4"),
        ("tdms", "nptdms", "tdms"),
        ("hdf5", "h5py", "hdf5"),
        ("mat73", "h5py", "hdf5"),
        ("mcap_json", "mcap", "mcap"),
        ("ros2_bag", "rosbags", "ros"),
    ],
)
def test_a_missing_library_is_one_line_with_what_installs_it(
    kind: str, library: str, extra: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import subprocess
    import sys

    made = getattr(makers, kind)(tmp_path, makers.channels(50))
    config_of(tmp_path, made.names)
    result = subprocess.run(
        [sys.executable, "-c", BLOCKED.format(name=library), "detect", str(made.path)],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    refused(result, 2, f"{library} is not installed: {how_to_install(extra)}")
    assert f"'{library}" in how_to_install(extra).lower().replace("mat-io", "matio")


def test_channels_that_are_not_there_or_are_there_twice(tmp_path: Path) -> None:
    made = makers.hdf5(tmp_path, makers.channels(50))
    config_of(tmp_path, {**made.names, "u": "drive/i"})
    refused(
        dsd("detect", made.path, cwd=tmp_path), 1, 'no column "drive/i"; it has axis/speed, axis/twice, drive/u, time'
    )
    np.savez(tmp_path / "two.npz", **{"t": np.arange(9.0), "a/u": np.arange(9.0), "b/u": np.arange(9.0)})
    config_of(tmp_path, {"t": "t", "u": "u"})
    refused(dsd("detect", "two.npz", cwd=tmp_path), 1, '2 channels are called "u": write which: a/u, b/u')
    np.savez(tmp_path / "short.npz", t=np.arange(9.0), u=np.arange(9.0), d_hat=np.arange(7.0))
    config_of(tmp_path, {"t": "t", "u": "u", "d_hat": "d_hat"})
    refused(dsd("detect", "short.npz", cwd=tmp_path), 1, 'no time for d_hat: "t" is not in its group')
