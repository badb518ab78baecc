"""Stamps of a counter that wraps, as `micros()` of a board is, through the real command."""

from pathlib import Path

import numpy as np
import pytest

from tests.cli.rig import done

ROWS = 3000


def log(folder: Path, stamps: np.ndarray) -> str:
    """An axis of 0.02 kg m2 on a sum of sines, 1 ms from row to row."""
    t = 0.001 * np.arange(ROWS)
    u = np.sin(7.0 * t) + 0.7 * np.sin(19.0 * t)
    q = -np.sin(7.0 * t) / 49.0 / 0.02 - 0.7 * np.sin(19.0 * t) / 361.0 / 0.02
    rows = "".join(f"{a:d},{b:.9g},{c:.9g}\n" for a, b, c in zip(stamps, u, q, strict=True))
    (folder / "a.csv").write_text(f"time (us),torque,position (rad)\n{rows}")
    (folder / "rig.toml").write_text(
        '[signals]\ntime = "time (us)"\ntime_unit = "us"\nu = "torque"\nposition = "position (rad)"\nvelocity = ""\n'
        "[observer]\nnominal_inertia = 0.02\ntime_constant = 0.005\n[model]\ninertia = 0.02\n"
        "[states]\ndelays = [0.0, 0.01]\ninertias = [0.02, 0.04]\n[detector]\nwindow = 50\nrho = 0.1\n"
    )
    return "a.csv"


@pytest.mark.parametrize(("bits", "begin"), [(16, 0), (32, 2**32 - 1_500_500)])
def test_stamps_go_on_where_the_counter_wraps(bits: int, begin: int, tmp_path: Path) -> None:
    name = log(tmp_path, (begin + 1000 * np.arange(ROWS)) % 2**bits)
    ran = done("check", name, "-c", "rig.toml", cwd=tmp_path)
    wraps = 45 if bits == 16 else 1
    assert f"a counter of {bits} bits, which wraps {wraps} time(s)" in " ".join(ran.stderr.split())
    assert "stamps go back" not in ran.stdout


def test_a_signed_counter_goes_on_too(tmp_path: Path) -> None:
    stamps = (2**31 - 1_500_500 + 1000 * np.arange(ROWS)).astype(np.uint32).view(np.int32)
    ran = done("check", log(tmp_path, stamps), "-c", "rig.toml", cwd=tmp_path)
    assert "a counter of 32 bits, which wraps 1 time(s)" in " ".join(ran.stderr.split())
    assert "stamps go back" not in ran.stdout


def test_a_stream_of_them_gets_the_labels_of_the_file(tmp_path: Path) -> None:
    name = log(tmp_path, (2**32 - 1_500_500 + 1000 * np.arange(ROWS)) % 2**32)
    of_file = done("detect", name, "-c", "rig.toml", "--format", "csv", cwd=tmp_path).stdout
    text = (tmp_path / name).read_bytes()
    live = done("detect", "-", "-c", "rig.toml", "--format", "csv", cwd=tmp_path, stdin=text).stdout
    assert (live.decode() if isinstance(live, bytes) else live) == of_file
    stamps = [float(line.partition(",")[0]) for line in of_file.splitlines()[1:]]
    np.testing.assert_allclose(np.diff(stamps), 0.001, rtol=1e-5)


def test_a_recording_that_begins_again_at_zero_is_another_one(tmp_path: Path) -> None:
    stamps = 1000 * np.concatenate([np.arange(2000), np.arange(1000)])
    ran = done("check", log(tmp_path, stamps), "-c", "rig.toml", cwd=tmp_path)
    assert "counter of" not in ran.stderr
    assert "stamps go back 1 time(s)" in ran.stdout
