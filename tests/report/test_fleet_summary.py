"""The summary of a fleet: what was planted is found, and in fleets without anything nothing is."""

import json
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from dsd_cli.report.fleet import Reason, summarize
from dsd_cli.report.fleet_table import drift_line
from tests.cli.rig import done

MACHINES, DATES = 10, 30


def table(seed: int, drift: float = 0.0) -> list[dict]:
    """Rows of diagnose, ten machines on thirty days: m3's friction rises by `drift` of itself over them."""
    rng = np.random.default_rng(seed)
    rows = []
    for machine in range(MACHINES):
        own = 0.1 * (1 + 0.05 * rng.normal())
        for day in range(DATES):
            rise = 1.0 + (drift * day / (DATES - 1) if machine == 3 else 0.0)
            level = own * rise * (1 + 0.04 * rng.normal())
            inertia = 0.01 * (1 + 0.01 * rng.normal())
            row = {"log": f"m{machine}/{day:02d}.csv", "machine": f"m{machine}", "date": f"2026-01-{day + 1:02d}"}
            row |= {"config": "dsd.toml", "status": "done", "reason": "", "verdict": "none", "key": f"{machine}-{day}"}
            row |= {"force_rmse": float(0.02 * np.exp(0.1 * rng.normal()))}
            row |= {"value.coulomb_friction.level": level, "error.coulomb_friction.level": 0.004}
            rows.append(row | {"value.inertia": inertia, "error.inertia": 0.0001})
    rng.shuffle(rows)
    return rows


def test_the_machine_whose_friction_drifts_is_named_and_no_other() -> None:
    for seed in range(20):
        found = summarize("r", table(seed, 0.4))
        assert [(one.machine, one.column) for one in found.drifts] == [("m3", "value.coulomb_friction.level")]
        (drift,) = found.drifts
        assert drift.last / drift.first - 1.0 == pytest.approx(0.4, abs=0.12)
        assert (drift.begin, drift.end, drift.logs) == ("2026-01-01", "2026-01-30", 30)


def test_without_a_drift_none_is_named() -> None:
    named = sum(len(summarize("r", table(seed)).drifts) for seed in range(100))
    assert named == 0  # 100 fleets of ten machines with three values each


def test_a_log_that_stands_out_is_named_and_the_usual_spread_is_not() -> None:
    for seed in range(20):
        rows = table(seed)
        assert summarize("r", rows).odd == ()
        rows[17] = {**rows[17], "value.inertia": 0.013}
        (odd,) = summarize("r", rows).odd
        assert (odd.log, odd.column, odd.value) == (rows[17]["log"], "value.inertia", 0.013)
        assert odd.usual == pytest.approx(0.01, rel=0.01)


def test_shares_and_reasons() -> None:
    rows = table(0)[:10]
    for k in range(4):
        rows[k] = {**rows[k], "status": "failed", "verdict": None, "reason": f"{rows[k]['log']}: is empty"}
    rows[9] = {**rows[9], "verdict": "backlash"}
    found = summarize("r", rows)
    assert (found.logs, found.failed, found.reasons) == (10, 4, (Reason("is empty", 4, rows[0]["log"]),))
    assert [(one.verdict, one.logs, one.share) for one in found.verdicts] == [
        ("none", 5, pytest.approx(5 / 6)),
        ("backlash", 1, pytest.approx(1 / 6)),
    ]


def test_the_command_says_it_as_table_and_json(tmp_path: Path) -> None:
    rows = table(1, 0.4)
    pq.write_table(pa.Table.from_pylist(rows), tmp_path / "r.parquet")
    found = summarize("r.parquet", rows)
    shown = done("fleet", "summary", "r.parquet", cwd=tmp_path).stdout
    assert " ".join(drift_line(found.drifts[0]).split()) in " ".join(shown.split())
    said = json.loads(done("fleet", "summary", "r.parquet", "--format", "json", cwd=tmp_path).stdout)
    assert (said["schema_version"], said["logs"], said["failed"]) == (1, 300, 0)
    assert said["drifts"][0]["machine"] == "m3"
