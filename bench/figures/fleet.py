"""The picture of a fleet: logs of two axes over nine days, the friction of one of them rising."""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

from bench.figures.commands import ROOT

PICTURES = ("fleet",)
_CONFIG = ROOT / "sample_logs" / "servo-friction.toml"
AXES, DAYS, WORN, ROSE = ("axis1", "axis2"), 9, "axis2", 0.4


def draw(name: str, path: Path) -> None:
    """The real commands, in a folder that goes afterwards.

    Raises
    ------
    RuntimeError : one of them failed.
    """
    with tempfile.TemporaryDirectory() as folder:
        for k, axis in enumerate(AXES):
            (Path(folder) / axis).mkdir()
            for day in range(DAYS):
                level = 0.15 * (1.0 + (ROSE * day / (DAYS - 1) if axis == WORN else 0.0))
                changed = f"model.effects.coulomb_friction.level={level}"
                made = ("simulate", "-c", _CONFIG, "--duration", "2", "--seed", 100 * k + day, "--set", changed)
                _run(folder, *made, "-o", f"{axis}/2026-03-{day + 1:02d}.parquet", "--quiet")
        _run(folder, "fleet", "compare", "*/*.parquet", "-c", _CONFIG, "-o", "results.parquet", "--quiet")
        _run(folder, "fleet", "summary", "results.parquet", "--plot", path.resolve())


def _run(folder: str, *arguments: object) -> None:
    command = [sys.executable, "-m", "dsd_cli", *map(str, arguments)]
    done = subprocess.run(
        command, cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, check=False
    )
    if done.returncode:
        raise RuntimeError(f"{' '.join(command[3:5])}: {done.stderr.strip()}")
