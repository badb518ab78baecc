"""A u that was sampled, not held: said by every command that fits, and written by `init`."""

import json
import tomllib
from pathlib import Path

import numpy as np
import pytest

from tests.cli.rig import done
from tests.identify.checks.test_hold import J, fast
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


def test_the_true_model_leaves_next_to_nothing_of_a_fast_motion(folder: Path) -> None:
    """0.4 % of u; taken as held u comes half a sample late, and most of it is left, of which every command warns."""
    right = done("compare", "log.csv", "--format", "json", "--set", "signals.u_hold=sampled", cwd=folder)
    assert json.loads(right.stdout)["force"]["relative_error_percent"] < 1.0
    wrong = done("compare", "log.csv", "--format", "json", cwd=folder)
    assert json.loads(wrong.stdout)["force"]["relative_error_percent"] > 10.0
    assert 'u looks like a continuous signal that was sampled: signals.u_hold = "sampled"' in wrong.stderr


def test_init_writes_it_and_values_as_they_are_with_it(folder: Path) -> None:
    done("init", "log.csv", "-o", "own.toml", cwd=folder)
    assert any(line.startswith('u_hold = "sampled"') for line in (folder / "own.toml").read_text().splitlines())
    assert "u_hold" not in done("compare", "log.csv", "-c", "own.toml", cwd=folder).stderr


def test_a_held_u_that_was_logged_a_row_late_is_late(folder: Path) -> None:
    """Row k has the u that acted until then, as many loggers write it."""
    swung = resonator.swung(4, held=True)
    swung["u"] = np.concatenate([swung["u"][:1], swung["u"][:-1]])
    table = np.column_stack([*swung.values()])
    np.savetxt(folder / "log.csv", table, delimiter=",", header=",".join(swung), comments="")
    assert "looks like" not in done("compare", "log.csv", cwd=folder).stderr


def test_the_inertia_that_init_writes_is_that_of_a_sampled_u(tmp_path: Path) -> None:
    """The integrals of the test have J = 0.2; that of a held u, of the same log, is another."""
    log = fast(False, "velocity")
    table = np.column_stack([log[name] for name in ("t", "u", "velocity")])
    np.savetxt(tmp_path / "log.csv", table, delimiter=",", header="t,u,velocity", comments="")
    done("init", "log.csv", "-o", "own.toml", cwd=tmp_path)
    written = tomllib.loads((tmp_path / "own.toml").read_text())
    assert written["signals"]["u_hold"] == "sampled"
    assert written["observer"]["nominal_inertia"] == pytest.approx(J, rel=0.01)
