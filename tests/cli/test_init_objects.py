"""The speed of a drive's object (CiA 402), whose unit is the drive's setting."""

import tomllib
from pathlib import Path

import numpy as np
import pytest

from tests.cli.rig import done

COUNTS, RATED = 8192, 0.01


def log_in(folder: Path, per_rad: float, position: bool) -> None:
    """A driven inertia; its speed in what `per_rad` makes of rad/s."""
    t = np.arange(3000) * 1e-3
    u = np.sin(2.0 * np.pi * 1.3 * t) + 0.5 * np.sin(2.0 * np.pi * 3.1 * t)
    v = np.cumsum(u) * 1e-3 / 0.01
    q = np.cumsum(v) * 1e-3
    columns = {"Time [ms]": t * 1e3, "Torque (6077h)": u / RATED, "Velocity (606Ch)": per_rad * v}
    if position:
        columns["Position (6064h)"] = q * COUNTS / (2.0 * np.pi)
    rows = np.column_stack(list(columns.values()))
    np.savetxt(folder / "log.csv", rows, "%.0f", ";", header=";".join(columns), comments="")


@pytest.mark.parametrize("per_rpm", [1.0, 10.0])
def test_beside_a_position_it_is_what_that_says(per_rpm: float, tmp_path: Path) -> None:
    log_in(tmp_path, per_rpm * 30.0 / np.pi, True)
    done("init", "log.csv", "-o", "rig.toml", "--set", f"signals.counts_per_turn={COUNTS}", cwd=tmp_path)
    signals = tomllib.loads((tmp_path / "rig.toml").read_text(encoding="utf-8"))["signals"]
    assert signals["velocity_scale"] == pytest.approx(np.pi / 30.0 / per_rpm, rel=0.01)


def test_alone_it_is_asked_for_and_the_line_that_sets_it_is_said(tmp_path: Path) -> None:
    log_in(tmp_path, 300.0 / np.pi, False)
    said = done("init", "log.csv", "-o", "rig.toml", cwd=tmp_path).stderr
    assert 'velocity_unit = "rpm"' in said
    assert "velocity_scale = 0.010472 for 0.1 rpm" in said
