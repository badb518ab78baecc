"""A stranger's log of changes alone ends in a config with the inertia of its axis, as the log of every loop does."""

import json
from pathlib import Path

import numpy as np
import pytest

from dsd_cli.files.config import load_config
from tests.cli.rig import done

LOOP, ROWS, INERTIA = 0.02, 800, 0.05


def recorded(later: float) -> list[str]:
    """Rows of a mass with viscous friction, an encoder of 4096 counts and u in hundredths; it stops four times."""
    names, keep = ("volts", "pos", "vel"), {}
    q = v = 0.0
    lines = ["Timestamp,/drive/AppliedVolts,/drive/PositionRad,/drive/VelocityRadPerSec"]
    for k in range(ROWS):
        t, phase = k * LOOP, (k * LOOP) % 4.0
        path = np.sin(1.5 * np.pi * min(phase, 2.0)) * (1.0 + (k // 200) % 2)
        u = round(float(np.clip(6.0 * (path - q) - 0.5 * v, -4.0, 4.0)), 2)
        u = 0.0 if phase > 3.0 else u
        count = 2.0 * np.pi / 4096.0
        now = {"volts": u, "pos": round(q / count) * count, "vel": round(v, 2)}
        fresh = [name for name in names if now[name] != keep.get(name)]
        keep |= now
        for at, some in enumerate([[name] for name in fresh] if later else [fresh] if fresh else []):
            cells = ",".join(f"{now[name]:.7g}" if name in some else "" for name in names)
            lines.append(f"{t + later * at:.6f},{cells}")
        for _ in range(40):
            v += LOOP / 40.0 * (u - 0.4 * v) / INERTIA
            q += LOOP / 40.0 * v
    return lines


@pytest.mark.parametrize("later", [0.0, 4e-5])
def test_the_inertia_is_that_of_the_axis(later: float, tmp_path: Path) -> None:
    (tmp_path / "log.csv").write_text("\n".join(recorded(later)) + "\n", encoding="utf-8")
    done("init", "log.csv", cwd=tmp_path)
    config = load_config(tmp_path / "dsd.toml")
    assert config.observer is not None
    assert config.observer.nominal_inertia == pytest.approx(INERTIA, rel=0.1)
    ran = done("check", "log.csv", "--format", "json", cwd=tmp_path)
    assert "have a value only where they changed" in ran.stderr
    assert json.loads(ran.stdout)["by_log"][0]["samples"] > 0.85 * ROWS
