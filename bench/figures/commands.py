"""Pictures that a command draws, of the sample logs: name -> what is typed before `--plot`."""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).parents[2]
_LOG, _BARE, _KNOWN = "sample_logs/servo-friction.csv", "sample_logs/servo-bare.toml", "sample_logs/servo-friction.toml"
_UNITS = ("--set", 'signals.u_unit="N m"', "--set", 'signals.position_unit="rad"')
_CHANGE = ("sample_logs/servo-load-change.parquet", "-c", "sample_logs/servo-load-change.toml")
#: A grid that lacks the inertia after the change.
_FEW = ("--set", "states.inertias=[0.01, 0.02]", "--set", "detector.rho=0.1")

#: A log that is made for its picture, by what is typed before `-o`: the brake is in no catalogue.
_BRAKED = "braked.csv"
_BRAKE = ("--effects-from", "sample_logs/my_effect.py", "--effect", "eddy_brake:force=0.1,critical_speed=1.5")
MADE = {_BRAKED: ("simulate", "-c", _BARE, *_BRAKE)}

PICTURES: dict[str, tuple[str, ...]] = {
    "observe": ("observe", _LOG, "-c", _KNOWN, *_UNITS, "-o", "-"),
    "check": ("check", _LOG, "-c", _KNOWN, *_UNITS, "--set", "signals.u_sign=-1"),
    "detect": ("detect", *_CHANGE, *_UNITS),
    "detect-profile": ("detect", *_CHANGE, *_UNITS, "--method", "profile"),
    "tune": ("tune", *_CHANGE, *_UNITS, *_FEW),
    "compare": ("compare", _LOG, "-c", _BARE, *_UNITS),
    "compare-simulation": ("compare", _LOG, "-c", _BARE, *_UNITS, "--horizon", "0.3s"),
    "compare-models": ("compare", _LOG, "-c", _BARE, "-c", _KNOWN, *_UNITS),
    "diagnose": ("diagnose", _LOG, "-c", _BARE, *_UNITS),
    "add": ("add", _LOG, "coulomb_friction", "-c", _BARE, *_UNITS, "-o", "-"),
    "learn": ("learn", _BRAKED, "-c", _BARE, *_UNITS),
    "improve": ("improve", _LOG, "-c", _BARE, *_UNITS, "--auto"),
}


def draw(name: str, path: Path) -> None:
    """The real command, from the root of the project.

    Raises
    ------
    RuntimeError : it failed, or drew nothing.
    """
    with tempfile.TemporaryDirectory() as folder:
        for log in MADE.keys() & set(PICTURES[name]):
            _run(name, [*MADE[log], "-o", f"{folder}/{log}"])
        typed = [f"{folder}/{one}" if one in MADE else one for one in PICTURES[name]]
        said = _run(name, [*typed, "--plot", str(path)])
    if not path.is_file():
        raise RuntimeError(f"{name}: {said}")


def _run(name: str, typed: list[str]) -> str:
    """What a command says on stderr."""
    command = [sys.executable, "-m", "dsd_cli", *typed]
    done = subprocess.run(command, cwd=ROOT, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, check=False)
    if done.returncode:
        raise RuntimeError(f"{name}: {done.stderr.strip()}")
    return done.stderr.strip()
