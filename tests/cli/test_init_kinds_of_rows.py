"""A log whose rows begin with the word for their kind, as autopilots print theirs: one line says how to cut one out."""

import subprocess
from pathlib import Path

import pytest

from dsd_cli.files.config import load_config
from tests.cli.rig import done, dsd
from tests.files import strangers

AXIS = strangers.axis()


@pytest.mark.parametrize("named", [True, False])
def test_the_command_that_is_told_cuts_out_a_log(named: bool, tmp_path: Path) -> None:
    columns = (1e6 * AXIS["t"], AXIS["u"], AXIS["v"])
    loop = [f"LOOP, {row}" for row in strangers.rows(AXIS, *columns, by=", ", form="{:.9g}")]
    power = [f"BAT, {k}, 24.{k % 7}" for k in range(len(loop) // 10)]
    names = ["FMT, 4, 20, LOOP, Qff, TimeUS,Torque,Speed", "FMT, 5, 9, BAT, Qf, TimeUS,Volt"] * named
    lines = [line for k, one in enumerate(loop) for line in ([one, power[k // 10]] if k % 10 == 0 else [one])]
    strangers.text(tmp_path, "log a.csv", [*names, *lines])
    told = dsd("init", "log a.csv", cwd=tmp_path).stderr
    assert "each with columns of its own" in told
    command = told[told.index("(echo") :].strip()
    subprocess.run(["bash", "-c", command], cwd=tmp_path, check=True)
    more = () if named else ("--time", "2", "--u", "3", "--velocity", "4", "--set", "signals.time_unit=us")
    done("init", "LOOP.csv", *more, "--force", cwd=tmp_path)
    signals = load_config(tmp_path / "dsd.toml").signals
    assert (signals.time, signals.u, signals.velocity) == (("TimeUS", "Torque", "Speed") if named else ("2", "3", "4"))


def test_a_row_that_is_cut_off_makes_no_kinds_of_labelled_rows(tmp_path: Path) -> None:
    rows = [f"{'run' if k % 2 else 'rest'},{k},{k % 7},{k % 5}" for k in range(99)]
    strangers.text(tmp_path, "a.csv", ["state,t,u,v", *rows[:60], "run,60", *rows[61:]])
    assert "4" in (told := dsd("init", "a.csv", cwd=tmp_path).stderr)
    assert "kinds" not in told
