"""What a fit says, by the real command: units of the user's columns, a sister machine, a rung that is taken back."""

import csv
import json
import math
import shlex
import sys
import tomllib
from pathlib import Path

import pytest

from tests.cli.rig import FEW, done, without_signals
from tests.cli.terminal import terminal

SAMPLES = Path(__file__).parents[2] / "sample_logs"
#: What the columns are called and multiplied by in the disguise, and the keys of [signals] that undo it.
COLUMNS = {"t": ("t", 1.0), "u": ("u", 1.0), "velocity": ("rpm", 30.0 / math.pi), "position": ("deg", 180.0 / math.pi)}
SIGNALS = """[signals]
u_unit = "N m"
position = "deg"
position_unit = "deg"
velocity = "rpm"
velocity_unit = "rpm"
"""
#: Of servo-friction.toml, SI; of its sister, whose friction is a third larger.
TRUTH = {"inertia": 0.01, "delay": 0.002, "viscous_friction.coefficient": 0.01, "coulomb_friction.level": 0.15}
SISTER = 0.2
UNITS = {
    "inertia": "kg m^2",
    "delay": "s",
    "coulomb_friction.level": "N m",
    "viscous_friction.coefficient": "(N m)/(rad/s)",
}


def disguised(log: Path, name: Path, seconds: float) -> None:
    """The same log in degrees and revolutions per minute."""
    with log.open(newline="") as file, name.open("w", newline="") as out:
        writer = csv.writer(out)
        writer.writerow([column for column, _ in COLUMNS.values()])
        for row in csv.DictReader(file):
            if float(row["t"]) <= seconds:
                writer.writerow([float(row[channel]) * factor for channel, (_, factor) in COLUMNS.items()])


@pytest.fixture(scope="module")
def learnt(tmp_path_factory):
    """(folder with log, config and what was learnt, what the command printed)."""
    folder = tmp_path_factory.mktemp("told")
    disguised(SAMPLES / "servo-friction.csv", folder / "a.csv", 1.0)
    (folder / "bare.toml").write_text(SIGNALS + without_signals(SAMPLES / "servo-bare.toml"))
    made = done("improve", "a.csv", "-c", "bare.toml", "--auto", "-o", "a.toml", cwd=folder, effects=FEW)
    return folder, made.stdout


def test_the_values_at_the_end_have_the_users_units_and_are_si(learnt):
    folder, out = learnt
    assert "force error below" in out.splitlines()[0]
    assert out.splitlines()[0].endswith("(N m)")
    for name, unit in UNITS.items():
        (line,) = [row for row in out.splitlines() if row.strip().startswith(name)]
        assert f" {unit} " in line
        assert float(line.split()[1]) == pytest.approx(TRUTH[name], rel=0.01)
    assert "unit of u" not in out
    text = (folder / "a.toml").read_text()
    assert "# B, force per speed [(N m)/(rad/s)]" in text
    assert "# Fc, the friction force while moving [N m]" in text


def test_no_number_of_a_table_is_cut(learnt, tmp_path):
    folder, _ = learnt
    (tmp_path / "sister.toml").write_text((folder / "a.toml").read_text())
    wide, narrow = (
        done("compare", "-c", folder / "a.toml", "-c", "sister.toml", cwd=tmp_path, COLUMNS=columns).stdout
        for columns in ("300", "60")
    )
    for name, unit in UNITS.items():
        (line,) = [row.split() for row in narrow.splitlines() if row.strip().startswith(name)]
        (whole,) = [row.split() for row in wide.splitlines() if row.strip().startswith(name)]
        assert line == whole
        assert (line.count("+-"), line[-1]) == (2, unit.split()[-1])


def test_the_history_keeps_values_errors_and_units(learnt):
    folder, _ = learnt
    last = tomllib.loads((folder / "a.toml").read_text())["history"][-1]
    assert last["units"] == {"rmse": "N m", **UNITS}
    assert set(last["fitted"]) == set(last["fitted_errors"]) == set(TRUTH)
    shown = done("improve", "--history", "-c", "a.toml", cwd=folder, COLUMNS="200").stdout
    assert "(N m)/(rad/s)" in shown
    assert "N m (-" in shown


def test_other_commands_name_the_units(learnt):
    folder, _ = learnt
    checked = done("check", "a.csv", "-c", "a.toml", cwd=folder).stdout
    assert "rad/s, travel" in checked
    assert "kg m^2" in checked
    compared = json.loads(done("compare", "a.csv", "-c", "a.toml", "--format", "json", cwd=folder).stdout)
    assert compared["force"]["unit"] == "N m"
    beside = done("compare", "-c", "bare.toml", "-c", "a.toml", cwd=folder).stdout
    assert "kg m^2" in beside


def test_a_sister_machine_says_which_values_moved_and_by_how_many_sigma(learnt):
    """Its Coulomb friction is 0.2 instead of 0.15 N m; all else is the same."""
    folder, _ = learnt
    other = (SAMPLES / "servo-friction.toml").read_text().replace("level = 0.15", f"level = {SISTER}")
    (folder / "sister.toml").write_text(other.replace("duration = 4.0", "duration = 1.0"))
    done("simulate", "-c", "sister.toml", "-o", "plain.csv", cwd=folder)
    disguised(folder / "plain.csv", folder / "b.csv", 1.0)
    again = ("--from-prior", "--auto", "--format", "json")
    made = done("improve", "b.csv", "-c", "a.toml", *again, cwd=folder, effects=FEW)
    told = json.loads(made.stdout)
    moved = {one["name"]: one for one in told["moved"]}
    assert {name: one["unit"] for name, one in moved.items()} == UNITS
    learnt_of = tomllib.loads((folder / "a.toml").read_text())["history"][-1]
    for name, one in moved.items():
        assert one["first"] == pytest.approx(learnt_of["fitted"][name], rel=1e-6)
        spread = math.hypot(learnt_of["fitted_errors"][name], one["second_error"])
        assert one["sigma"] == pytest.approx((one["second"] - one["first"]) / spread, rel=0.01)
    assert moved["coulomb_friction.level"]["second"] == pytest.approx(SISTER, rel=0.01)
    assert abs(moved["coulomb_friction.level"]["sigma"]) > 20.0
    pulls = {name: abs(one["prior_sigma"]) for name, one in told["values"].items() if "prior_sigma" in one}
    assert pulls["coulomb_friction.level"] == pytest.approx(0.05 / 0.015, rel=0.05)
    assert all(pull < 1.0 for name, pull in pulls.items() if name != "coulomb_friction.level")
    assert "coulomb_friction.level = 0.2 pulls against its prior 0.15 +- 0.015" in made.stderr


#: The command, which looks for few effects alone.
FOR_FEW = f"""
from dsd_cli.__main__ import main
from dsd_cli.identify.fit import testability
whole = testability.catalogue()
testability.catalogue = lambda: {{name: whole[name] for name in {FEW}}}
main()
"""


def test_a_needless_effect_is_taken_back_in_a_rung_of_its_own(tmp_path):
    """A person adds drag before friction; drag then has nothing left to explain."""
    words = ["improve", SAMPLES / "servo-friction.csv", "-c", SAMPLES / "servo-bare.toml", "--to", "1.0"]
    command = shlex.join([sys.executable, "-c", FOR_FEW, *map(str, words), "--format", "json", "-o", "back.toml"])
    answers = ("quadratic_drag", "coulomb_friction", "viscous_friction")
    with terminal(cwd=tmp_path, columns=150, lines=100, command=["sh", "-c", f"{command} > ladder.json"]) as person:
        for i, answer in enumerate(answers):
            person.until(lambda: person.raw.count(b"effect: ") > i, wait=300.0)  # noqa: B023
            person.type(answer + "\n")
        assert person.finish(wait=300.0) == 0
        assert "step 4: quadratic_drag taken back: held-out force error" in person.text
    ladder = json.loads((tmp_path / "ladder.json").read_text())["ladder"]
    assert [(rung["effect"], rung["kind"]) for rung in ladder] == [
        ("as given", "given"),
        *((name, "added") for name in answers),
        ("quadratic_drag", "taken_back"),
    ]
    assert "quadratic_drag.coefficient" not in ladder[-1]["values"]
    assert ladder[-1]["heldout_rmse"] < 1.01 * ladder[-2]["heldout_rmse"]
    config = tomllib.loads((tmp_path / "back.toml").read_text())
    assert set(config["model"]["effects"]) == {"coulomb_friction", "viscous_friction"}
    assert [step.get("taken_back", False) for step in config["history"]] == [False, False, False, True]
    assert "quadratic_drag taken back" in done("improve", "--history", "-c", "back.toml", cwd=tmp_path).stdout


def test_labels_name_the_units(learnt):
    folder, _ = learnt
    axis = ["--set", "states.effects.coulomb_friction.level=[0, 0.15]"]
    words = done("detect", "a.csv", "-c", "a.toml", *axis, cwd=folder).stdout
    head = words[words.index("states chosen") : words.index("\u2500")]
    assert {"kg", "m^2", "coulomb_friction.", "level"} <= set(head.split())
    (final,) = [line for line in words.splitlines() if line.startswith("final: ")]
    assert " s, inertia " in final
    assert "kg m^2" in final
    found = json.loads(done("detect", "a.csv", "-c", "a.toml", *axis, "--format", "json", cwd=folder).stdout)
    assert found["unit"] == "N m"
    assert found["units"] == {"delay": "s", "inertia": "kg m^2", "coulomb_friction.level": "N m"}
    plain = json.loads(
        done("detect", "servo-friction.csv", "-c", "servo-friction.toml", "--format", "json", cwd=SAMPLES).stdout
    )
    assert plain["units"] == {"delay": "s", "inertia": "u/(v/s)"}


#: Counts to a turn of the encoder of servo-friction.toml, and what [signals] says of a log in counts.
COUNTS = 2**20
IN_COUNTS = f"""[signals]
u_unit = "N m"
velocity = ""
position_unit = "counts"
counts_per_turn = {COUNTS}
"""


def test_a_log_in_counts_is_told_in_rad_and_newton_metres(tmp_path):
    """Compare, check, detect and add, beside the same log in rad."""
    rows = list(csv.DictReader((SAMPLES / "servo-friction.csv").open(newline="")))
    for name, factor in (("counts.csv", COUNTS / (2.0 * math.pi)), ("rad.csv", 1.0)):
        lines = [f"{row['t']},{row['u']},{float(row['position']) * factor!r}" for row in rows if float(row["t"]) <= 1.0]
        (tmp_path / name).write_text("\n".join(["t,u,position", *lines]) + "\n")
    model = without_signals(SAMPLES / "servo-bare.toml")
    (tmp_path / "counts.toml").write_text(IN_COUNTS + model)
    (tmp_path / "rad.toml").write_text('[signals]\nu_unit = "N m"\nvelocity = ""\nposition_unit = "rad"\n' + model)
    made = {}
    for name in ("counts", "rad"):
        log, config = f"{name}.csv", ("-c", f"{name}.toml", "--format", "json")
        forward = ("--horizon", "0.2s")
        made[name] = [
            json.loads(done("compare", log, *config, cwd=tmp_path).stdout)["force"],
            json.loads(done("compare", log, *config, *forward, cwd=tmp_path).stdout),
            json.loads(done("check", log, *config, cwd=tmp_path).stdout),
            json.loads(done("detect", log, *config, cwd=tmp_path).stdout),
        ]
    for mine, other in zip(made["counts"][:2], made["rad"][:2], strict=True):
        assert mine["rmse"] == pytest.approx(other["rmse"], rel=1e-6)
    force, forward, checked, labels = made["counts"]
    assert force["unit"] == "N m"
    assert [row["unit"] for row in forward["open_loop"]] == ["rad", "rad/s"]
    assert checked["parameters"][0]["unit"] == "kg m^2"
    assert labels["units"]["inertia"] == "kg m^2"
    added = done("add", "counts.csv", "coulomb_friction", "-c", "counts.toml", "-o", "out.toml", cwd=tmp_path).stdout
    assert " N m" in added
    assert "kg m^2" in added
    level = tomllib.loads((tmp_path / "out.toml").read_text())["model"]["effects"]["coulomb_friction"]["level"]
    assert level == pytest.approx(0.175, rel=0.15)  # takes what viscous friction does, too
