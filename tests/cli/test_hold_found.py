"""A u that surely was sampled is taken so by every command that fits, said each time; the config overrules it."""

import json
from pathlib import Path

import numpy as np
import pytest

from tests.cli.rig import done
from tests.oracle import resonator

CONFIG = (
    '[signals]\ntime = "t"\nu = "u"\nposition = "position"\n[observer]\nnominal_inertia = 5e-6\ntime_constant = 0.01\n'
    "[model]\ninertia = 5e-6\n[model.effects]\nviscous_friction.coefficient = 2e-4\nstiffness.coefficient = 0.3\n"
    "cubic_stiffness.coefficient = 4.0\n"
)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    swung = resonator.swung(4, held=False)
    table = np.column_stack([*swung.values()])
    np.savetxt(tmp_path / "log.csv", table, delimiter=",", header=",".join(swung), comments="")
    (tmp_path / "dsd.toml").write_text(CONFIG)
    return tmp_path


def test_it_is_taken_as_it_is_and_said(folder: Path) -> None:
    """With the true model 0.4 % of u is left; taken as held u comes half a sample late, and most of it is."""
    taken = done("compare", "log.csv", "--format", "json", cwd=folder)
    assert 'a continuous signal that was sampled, and is taken so (signals.u_hold = "sampled"' in taken.stderr
    assert json.loads(taken.stdout)["force"]["relative_error_percent"] < 1.0
    told = done("compare", "log.csv", "--format", "json", "--set", "signals.u_hold=held", cwd=folder)
    assert "is taken so" not in told.stderr
    assert json.loads(told.stdout)["force"]["relative_error_percent"] > 10.0


def test_init_writes_it(folder: Path) -> None:
    done("init", "log.csv", "-o", "own.toml", cwd=folder)
    assert any(line.startswith('u_hold = "sampled"') for line in (folder / "own.toml").read_text().splitlines())
    assert "u_hold" not in done("compare", "log.csv", "-c", "own.toml", cwd=folder).stderr
