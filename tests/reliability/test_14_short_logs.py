"""Logs with little in them, as `bench fuzz` makes them: an answer or one line, and the line is the right one."""

import json
from pathlib import Path

import numpy as np
import pytest

from dsd_cli.errors import DataError
from dsd_cli.files.csv_in import CsvTable
from tests.cli.rig import CONFIG, FEW, done, dsd, read_labels

SAMPLES = Path(__file__).parents[2] / "sample_logs"


def test_a_motion_that_would_drift_away_has_no_origin_to_find(tmp_path):
    """u and d_hat alone, and nothing in them: the speed is rebuilt, its integral is not taken for a position."""
    noise = np.random.default_rng(311922335).normal(size=(4, 120))[:2]  # one of a few that came to it
    rows = [
        f"{k * 1e-3!r},{u!r},{d!r}" for k, (u, d) in enumerate(zip(*(noise * [[1.0], [0.1]]).tolist(), strict=True))
    ]
    (tmp_path / "log.csv").write_text("\n".join(["t,u,d_hat", *rows]) + "\n")
    (tmp_path / "dsd.toml").write_text(
        CONFIG + "[model]\ninertia = 1.0\ndelay = 0.005\n[model.effects.viscous_friction]\ncoefficient = 0.1\n"
    )
    result = dsd("diagnose", "log.csv", cwd=tmp_path)
    assert result.returncode == 0, result.stderr
    assert "would drift away" in result.stdout


@pytest.mark.parametrize("end", ["\r", "\n"])
@pytest.mark.parametrize(("bad", "said"), [("x", '"x" is not a number'), ('"1', "a quote that is not closed")])
def test_the_line_is_named_whatever_ends_it(tmp_path, end, bad, said):
    rows = [f"{k * 1e-3!r},{k % 7},{k % 5}" for k in range(100)]
    rows[60] = f"0.06,{bad},1"
    (tmp_path / "log.csv").write_text(end.join(["t,u,d_hat", *rows]), newline="")
    names = ("t", "u", "d_hat")
    with pytest.raises(DataError) as refused:
        list(CsvTable(str(tmp_path / "log.csv"), dict(zip(names, names, strict=True))).batches())
    assert str(refused.value).startswith(f"{tmp_path / 'log.csv'}, line 62")
    assert said in str(refused.value)


def test_trials_at_rest_joined_in_one_file_have_an_answer(tmp_path):
    """Of a trial in which nothing moves nothing is left: `diagnose` ended in an unexpected ValueError there."""
    log = read_labels(SAMPLES / "servo-friction.csv")
    parts = []
    for k in range(8):
        rows = slice(600 * (k % 4), 600 * (k % 4) + 600)
        still = np.zeros(600) if k % 2 else 1.0
        clock = 5.0 * k + 1e-3 * np.arange(600)
        parts.append(np.column_stack([clock, still * log["u"][rows], still * log["position"][rows]]))
    np.savetxt(tmp_path / "trials.csv", np.concatenate(parts), delimiter=",", header="t,u,position", comments="")
    for command in ("check", "diagnose"):
        words = (command, "trials.csv", "-c", SAMPLES / "servo-bare.toml", "--format", "json")
        found = done(*words, cwd=tmp_path, effects=FEW)
        assert json.loads(found.stdout)["logs"] == ["trials.csv"]
    assert json.loads(found.stdout)["verdict"] == "coulomb_friction"
