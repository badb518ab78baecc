"""`dsd export --samples`: models drawn jointly from what a fit leaves open."""

import csv
import json
import math
import tomllib
from pathlib import Path

import numpy as np
import pytest

from tests.cli.rig import done, dsd, refused

FITTED = """
[model]
inertia = 0.5
[model.effects.viscous_friction]
coefficient = 0.3
[model.effects.coulomb_friction]
level = 0.1

[[history]]
effect = "refit"
date = "2026-01-31T12:00:00Z"
fitted = { inertia = 0.5, "viscous_friction.coefficient" = 0.3, "coulomb_friction.level" = 0.1 }
fitted_errors = { inertia = 0.02, "viscous_friction.coefficient" = 0.05, "coulomb_friction.level" = 0.02 }
"""
TOGETHER = (
    'fitted_correlations = { "viscous_friction.coefficient" = { inertia = 0.2 }, '
    '"coulomb_friction.level" = { inertia = 0.0, "viscous_friction.coefficient" = -0.95 } }\n'
)
STRIBECK = "[model.effects.stribeck_friction]\nexcess = 0.2\nvelocity = 0.1\n"
SPEED_LOGGED = """
[signals]
velocity = "velocity"
[observer]
nominal_inertia = 0.01
time_constant = 0.005
[model]
inertia = 0.01
[model.effects.viscous_friction]
coefficient = 0.3
"""
NAMES = ("inertia", "viscous_friction", "coulomb_friction")


def drawn(folder: Path, config: str, count: int) -> tuple[dict[str, np.ndarray], str]:
    """(part -> its value in each file, what stderr says)."""
    (folder / "better.toml").write_text(config)
    given = ("export", "better.toml", "--to", "parameters", "-o", "v.csv", "--samples", str(count), "--format", "json")
    ran = done(*given, cwd=folder)
    found: dict[str, list[float]] = {}
    for name in json.loads(ran.stdout)["samples"]:
        for part, _, value, *_ in csv.reader((folder / name).read_text().splitlines()[1:]):
            found.setdefault(part, []).extend([] if part == "curve" else [float(value)])
    return {part: np.array(values) for part, values in found.items()}, ran.stderr


def test_values_are_drawn_with_the_correlations_of_their_errors(tmp_path: Path) -> None:
    values, said = drawn(tmp_path, FITTED + TOGETHER, 400)
    assert said == ""
    together = np.corrcoef([values[name] for name in NAMES])
    assert together[1, 2] == pytest.approx(-0.95, abs=0.02)
    assert together[0, 1] == pytest.approx(0.2, abs=0.15)
    assert together[0, 2] == pytest.approx(0.0, abs=0.15)
    for name, mean, error in zip(NAMES, (0.5, 0.3, 0.1), (0.02, 0.05, 0.02), strict=True):
        assert values[name].mean() == pytest.approx(mean, abs=4.0 * error / math.sqrt(400))
        assert values[name].std() == pytest.approx(error, rel=0.15)


def test_without_correlations_each_is_drawn_by_itself_and_that_is_said(tmp_path: Path) -> None:
    values, said = drawn(tmp_path, FITTED, 400)
    assert "no correlations of these errors, so each value is drawn by itself" in said
    together = np.corrcoef([values[name] for name in NAMES])
    assert np.abs(together - np.eye(3)).max() < 0.2


def test_what_has_no_error_stays_and_is_named(tmp_path: Path) -> None:
    table = "channels = ['velocity']\nknots = [[0.0, 1.0]]\nvalues = [0.0, -0.1]\nfactor = 'one'\nscale = 1.0\n"
    first, _, history = (FITTED + TOGETHER).partition("[[history]]")
    values, said = drawn(tmp_path, f"{first}[model.effects.curve]\n{table}\n[[history]]{history}", 5)
    assert said == "dsd: warning: --samples: [[history]] has no error of curve: the same in all files\n"
    assert len(set(values["inertia"])) == 5


def test_a_value_that_was_held_is_named_beside_one_that_was_fitted(tmp_path: Path) -> None:
    """Stribeck's excess has an error, its velocity was held; of an inertia without one the name is said."""
    held = (FITTED + TOGETHER).replace("[[history]]", STRIBECK + "\n[[history]]")
    for values in ("fitted = {", "fitted_errors = {"):
        held = held.replace(values, f'{values} "stribeck_friction.excess" = 0.2,')
    held = held.replace("inertia = 0.02, ", "").replace("{ inertia = 0.2 }", "{}").replace("inertia = 0.0, ", "")
    _, said = drawn(tmp_path, held, 5)
    assert said == (
        "dsd: warning: --samples: [[history]] has no error of inertia, stribeck_friction.velocity: "
        "the same in all files\n"
    )


def test_correlations_hold_where_a_bound_cuts_the_values_off(tmp_path: Path) -> None:
    """Friction is never below 0; what it is drawn with then goes the other way."""
    values, _ = drawn(tmp_path, (FITTED + TOGETHER).replace("= 0.1", "= 0.01"), 400)
    assert values["coulomb_friction"].min() >= 0.0
    assert np.corrcoef(values["coulomb_friction"], values["viscous_friction"])[0, 1] < -0.85
    # the half-normal beyond -1/2 sigma: mean 0.5092 sigma above the one that was fitted
    assert values["coulomb_friction"].mean() == pytest.approx(0.01 + 0.5092 * 0.02, rel=0.1)
    assert values["viscous_friction"].mean() == pytest.approx(0.3 - 0.95 * 0.5092 * 0.05, rel=0.05)


def test_without_errors_nothing_is_drawn_and_nothing_is_written(tmp_path: Path) -> None:
    (tmp_path / "bare.toml").write_text(FITTED.partition("[[history]]")[0])
    ran = dsd("export", "bare.toml", "--to", "parameters", "-o", "v.csv", "--samples", "3", cwd=tmp_path)
    refused(ran, 2, "[[history]] has no standard errors")
    assert not (tmp_path / "v.csv").exists()


@pytest.mark.parametrize(
    ("written", "line"),
    [
        ("{ inertia = 3 }", "fitted_correlations = { inertia = 3 }: must be a table of tables of values"),
        ("{ inertia = { delay = 1.5 } }", "must be a number of at least -1 and of at most 1"),
        ("{ inertia = { delay = nan } }", "must be a number of at least -1 and of at most 1"),
    ],
)
def test_what_is_no_correlation_is_refused(written: str, line: str, tmp_path: Path) -> None:
    (tmp_path / "better.toml").write_text(FITTED + f"fitted_correlations = {written}\n")
    ran = dsd("export", "better.toml", "--to", "parameters", "-o", "v.csv", "--samples", "2", cwd=tmp_path)
    refused(ran, 2, line)
    assert not list(tmp_path.glob("v*"))


def test_a_fit_writes_what_goes_with_what(tmp_path: Path) -> None:
    """Speeds of +-(1 + sin/2): of a level and a slope over x the errors go together as -mean x / rms x."""
    step = 0.002
    t = np.arange(8000) * step
    size = 1.0 + 0.5 * np.sin(2.0 * np.pi * 1.3 * t)
    way = np.tanh(30.0 * np.sin(2.0 * np.pi * 0.5 * t))
    velocity = way * size
    force = 0.01 * np.gradient(velocity, step) + 0.1 * velocity + 0.2 * np.sign(velocity)
    u = force + 0.02 * np.random.default_rng(5).standard_normal(len(t))
    rows = np.column_stack([t, u, velocity])
    np.savetxt(tmp_path / "log.csv", rows, "%.9g", ",", header="t,u,velocity", comments="")
    (tmp_path / "m.toml").write_text(SPEED_LOGGED)
    done("add", "log.csv", "coulomb_friction", "-c", "m.toml", "-o", "better.toml", cwd=tmp_path)
    last = tomllib.loads((tmp_path / "better.toml").read_text())["history"][-1]
    names = list(last["fitted_errors"])
    assert {name: list(row) for name, row in last["fitted_correlations"].items()} == {
        name: names[:i] for i, name in enumerate(names) if i
    }
    together = last["fitted_correlations"]["coulomb_friction.level"]
    assert together["viscous_friction.coefficient"] == pytest.approx(-1.0 / math.sqrt(1.125), abs=0.04)
    values, said = drawn(tmp_path, (tmp_path / "better.toml").read_text(), 300)
    assert said == ""
    assert np.corrcoef(values["coulomb_friction"], values["viscous_friction"])[0, 1] < -0.9
