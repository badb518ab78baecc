"""The picture of `dsd plan`, of a log that shows little."""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).parents[2]
PICTURES = ("plan",)


def draw(_: str, path: Path) -> None:
    """The real commands.

    Raises
    ------
    RuntimeError : one failed, or drew nothing.
    """
    samples = ROOT / "sample_logs"
    with tempfile.TemporaryDirectory() as folder:
        for command in (
            ("simulate", "-c", str(samples / "servo-arm.toml"), "-o", "small.csv"),
            ("plan", "small.csv", "-c", str(samples / "servo-arm-bare.toml"), "-o", "next.csv", "--plot", str(path)),
        ):
            words = [sys.executable, "-m", "dsd_cli", *command]
            done = subprocess.run(words, cwd=folder, capture_output=True, text=True, check=False)
            if done.returncode:
                raise RuntimeError(f"plan: {done.stderr.strip()}")
    if not path.is_file():
        raise RuntimeError("plan: no picture")
