"""`dsd plan`: files, limits, what is refused, and the loop with a command of the user."""

import csv
import io
import json
import re
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from dsd_cli.cli.plan_loop import closed, command_words, misled
from dsd_cli.cli.plan_request import Answer, Request, Told, _limit, _possible, told_by
from dsd_cli.cli.plan_request import planned as planned_by
from dsd_cli.design.limits import Limits
from dsd_cli.design.plan import Wanted
from dsd_cli.design.results import Impossible, Motion, Plan, PlannedPair, PlannedValue, Stage
from dsd_cli.design.targets import Targets, apart, targets_of
from dsd_cli.errors import DataError, UsageError
from dsd_cli.files.config import load_config
from dsd_cli.files.motion_out import COLUMNS, motion_text
from dsd_cli.identify.fit.solve import Fit
from dsd_cli.identify.results import Diagnosis
from dsd_cli.identify.search.sets import Search
from dsd_cli.report.planning import headline, print_table, to_json
from tests.cli.rig import FEW, done, dsd, refused

SAMPLES = Path(__file__).parents[2] / "sample_logs"
ARM, BARE = SAMPLES / "servo-arm.toml", SAMPLES / "servo-arm-bare.toml"
#: What the short moves of the arm leave open, and what it has.
RIVALS = (*FEW, "gravity", "stiffness")
PLAN = ("plan", "small.csv", "-c", BARE, "--seconds", "6")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    here = tmp_path_factory.mktemp("plan")
    done("simulate", "-c", ARM, "-o", "small.csv", cwd=here)
    return here


@pytest.fixture(scope="module")
def planned(folder: Path) -> dict:
    return json.loads(done(*PLAN, "-o", "next.csv", "--format", "json", cwd=folder, effects=RIVALS).stdout)


def columns(path: Path) -> dict[str, np.ndarray]:
    with path.open() as file:
        rows = list(csv.DictReader(file))
    return {name: np.array([float(row[name]) for row in rows]) for name in rows[0]}


def read_motion(columns: dict[str, np.ndarray]) -> Motion:
    return Motion(0.001, *(columns[name] for name in COLUMNS[1:]))


def test_the_motion_has_the_columns_of_the_contract(folder: Path, planned: dict) -> None:
    motion = columns(folder / "next.csv")
    assert list(motion) == ["t", "position", "velocity", "acceleration", "u_feedforward"]
    np.testing.assert_allclose(np.diff(motion["t"]), 0.001, atol=1e-9)
    limits = planned["limits"]
    assert limits["position"] == [-1.5, 1.5]
    assert "position" in planned["limits_given"]
    assert np.abs(motion["position"]).max() < 1.5
    assert np.abs(motion["velocity"]).max() < 6.0
    # velocity and acceleration are those of the position
    np.testing.assert_allclose(np.gradient(motion["position"], 0.001)[5:-5], motion["velocity"][5:-5], atol=2e-3)
    np.testing.assert_allclose(np.gradient(motion["velocity"], 0.001)[5:-5], motion["acceleration"][5:-5], atol=0.2)
    assert planned["seconds"] >= 6.0 - 1e-9
    assert planned["pairs"]
    for pair in planned["pairs"]:
        low, high = pair["nats_range"]
        assert 6.0 < low <= pair["nats_expected"] <= high
        if pair["a"] == "gravity":  # what the logs have told of it is not lost
            assert pair["nats_if_a"] > pair["nats_before"]
            assert pair["nats_before"] > 0.0 or set(pair["b"].split(" + ")) == {"constant_load", "stiffness"}
    assert -1.5 < planned["reached"]["position_low"] < planned["reached"]["position_high"] < 1.5


def test_a_length_is_judged_by_what_is_said_of_it(planned: dict) -> None:
    """But for the loops, in which no part has to be much smaller here."""
    lost = {one["what"] for one in planned["impossible"]}
    values = [v for v in planned["values"] if v["name"] not in lost]
    said = [0.5 * (v["value"] / v["std_error_expected"]) ** 2 for v in values]
    said += [pair["nats_expected"] for pair in planned["pairs"]]
    assert planned["cost"][0]["nats"] == pytest.approx(min(said), rel=0.5)


def test_other_files_hold_the_same_numbers(folder: Path, planned: dict) -> None:
    wanted = columns(folder / "next.csv")
    yaml, c, st = (motion_text(read_motion(wanted), suffix, "arm") for suffix in (".yaml", ".h", ".st"))
    assert "static" in c
    assert "static" not in motion_text(read_motion(wanted), ".c")  # other files have it by its name
    assert yaml.startswith('joint_names:\n  - "arm"\npoints:\n')
    for key, column in (("positions", "position"), ("velocities", "velocity"), ("effort", "u_feedforward")):
        found = [float(x) for x in re.findall(rf"\b{key}: \[(.*)\]", yaml)]
        np.testing.assert_array_equal(found, wanted[column])
    stamps = [int(s) + 1e-9 * int(n) for s, n in re.findall(r"sec: (\d+), nanosec: (\d+)", yaml)]
    np.testing.assert_allclose(stamps, wanted["t"], atol=1e-9)
    rows = re.findall(r"^  \{(.*)\},$", c, re.MULTILINE)
    table = np.array([[float(x) for x in row.split(",")] for row in rows])
    np.testing.assert_array_equal(table, np.column_stack(list(wanted.values())[1:]))
    (body,) = re.findall(r"PLAN_POSITION : ARRAY\[0\.\.(?:\d+)\] OF LREAL := \[(.*?)\];", st, re.DOTALL)
    literals = [x.strip() for x in body.split(",")]
    assert all("." in x for x in literals)
    np.testing.assert_array_equal([float(x) for x in literals], wanted["position"])


def test_dsd_simulate_follows_it(folder: Path, planned: dict) -> None:
    done("simulate", "-c", ARM, "--reference", "next.csv", "-o", "followed.csv", cwd=folder)
    motion, log = columns(folder / "next.csv"), columns(folder / "followed.csv")
    assert np.abs(log["reference"][:1000] - motion["position"][0]).max() < 1e-12  # a second of rest
    np.testing.assert_allclose(log["reference"][1000:], motion["position"][: len(log["t"]) - 1000], atol=1e-6)
    assert np.abs(log["position"] - log["reference"]).max() < 0.3


@pytest.fixture(scope="module")
def told(folder: Path) -> dict:
    words = ("diagnose", "small.csv", "-c", BARE, "--format", "json")
    return json.loads(done(*words, cwd=folder, effects=RIVALS).stdout)


def test_a_diagnosis_in_a_file_asks_for_what_one_anew_does(folder: Path, planned: dict, told: dict) -> None:
    """And on stdout it is the motion alone."""
    assert planned["pairs"]
    (folder / "told.json").write_text(json.dumps(told))
    ran = done(*PLAN, "--diagnosis", "told.json", "-o", "-", cwd=folder, effects=RIVALS)
    assert ran.stdout.startswith("t,position,velocity,acceleration,u_feedforward\n")
    assert ran.stdout.encode() == (folder / "next.csv").read_bytes()


def test_what_the_logs_cannot_test_is_skipped() -> None:
    problem = SimpleNamespace(untestable={"load_friction": "u hardly changes beside the friction"}, candidates=())
    told = Told(Path("other.json"), {"coulomb_friction": ("load_friction",)}, ())
    names, (line,) = _possible(told, SimpleNamespace(problem=problem))  # type: ignore[arg-type]
    assert names == ("coulomb_friction",)
    assert line.startswith("other.json: load_friction is skipped: these logs cannot test it; u hardly changes")


def test_of_another_diagnosis_what_is_no_effect_is_skipped(
    folder: Path, told: dict, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Rivals take the place of the member that they stand in for, beside all else that was found."""
    assert {"gravity", "coulomb_friction"} == set(told["found"])
    for one in told["ranking"]:
        if one["effect"] == "gravity":
            one["indistinguishable_from"] += ["viscous_friction", "rust"]
    (folder / "other.json").write_text(json.dumps(told))
    motion = Motion(0.001, *np.zeros((4, 1001)))
    asked: list[tuple[Wanted, Targets]] = []

    def plan_next(search: Search, whole: Fit, found: Diagnosis, _observer: object, wanted: Wanted, *_: object) -> Plan:
        asked.append((wanted, targets_of(search, whole, found, wanted.names)))
        return Plan(("small.csv",), found.verdict, motion, (), (), (), LIMITS)

    monkeypatch.setattr("dsd_cli.design.plan.plan_next", plan_next)
    request = Request(Wanted(), told_by(folder / "other.json"))
    answer = planned_by(load_config(BARE), [str(folder / "small.csv")], request, quiet=True)
    ((wanted, targets),) = asked
    assert any("other.json: rust is skipped: neither an effect nor a value" in line for line in answer.warnings)
    assert "viscous_friction" in wanted.names
    names = [one.name for one in targets.explanations]
    pairs = {frozenset(apart(names[a], names[b])) for a, b in targets.pairs}
    assert frozenset(("coulomb_friction", "viscous_friction")) in pairs
    assert frozenset(("gravity", "viscous_friction")) not in pairs


def test_what_no_motion_tells_is_not_said_to_be_told() -> None:
    limits = Limits(-1.0, 1.0, 3.0, 20.0, 400.0, 1.0, 0.0)
    values = (PlannedValue("delay", 0.002, "s", 1e-3, 9e-4), PlannedValue("inertia", 0.01, "kg m^2", 1e-3, 1e-5))
    motion = Motion(0.001, *np.zeros((4, 1001)))
    lost = (Impossible("delay", "take a finer sensor"),)
    line = headline(Plan(("a.csv",), "none", motion, (Stage("chirp", 0.0, 1.0, {}),), (), values, limits, lost))
    assert line.endswith("identifies inertia better")


def test_who_was_not_counted_is_said() -> None:
    limits = Limits(-1.0, 1.0, 3.0, 20.0, 400.0, 1.0, 0.0)
    motion = Motion(0.001, *np.zeros((4, 1001)))
    reached, stage = (
        dict.fromkeys(("position_low", "position_high", "velocity", "u"), 0.5),
        Stage("chirp", 0.0, 1.0, {}),
    )
    names = ("gravity", "drag")
    plan = Plan(("a.csv",), "unknown", motion, (stage,), (), (), limits, reached=reached, not_counted=names)
    file = io.StringIO()
    print_table(plan, (), file)
    assert "every likely plant" not in file.getvalue()
    assert "not counted, for it breaks a limit on every motion: gravity, drag" in file.getvalue()
    assert to_json(plan)["not_counted"] == ["gravity", "drag"]


def test_where_the_logs_may_have_misled_both_ways_are_said() -> None:
    limits = Limits(-1.0, 1.0, 3.0, 20.0, 400.0, 1.0, 0.0)
    pair = PlannedPair("gravity", "constant_load", 22.0, 1.0, 234.0, 1.0)
    file = io.StringIO()
    print_table(Plan(("a.csv",), "gravity", None, (), (pair,), (), limits), (), file)
    assert "234 if gravity; 1 if constant_load" in file.getvalue()


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (("-o", "next.txt"), "unknown kind of file for a motion"),
        (("-o", "next.csv", "--limit", "speed=3"), "no limit 'speed'"),
        (("-o", "next.csv", "--seconds", "60:5"), "--seconds 60:5"),
        (("-o", "next.csv", "--for", "rust"), "neither an effect nor a value"),
        (("-o", "next.csv", "--start", "9"), "plan.start = 9"),
        (("-o", "next.csv", "--start", "nan"), "must be a position"),
        (("-o", "next.csv", "--sample-time", "5"), "motions go up to"),
        (("-o", "next.csv", "--diagnosis", "small.csv"), "no result of dsd diagnose"),
        (("-o", "next.csv", "--run-with", "echo {log}"), "has no {reference}"),
        (("-o", "-", "--run-with", "echo {log} {reference}"), "--run-with needs a file"),
        (("-o", "-", "--format", "json"), "both need stdout"),
        (("-o", "small.csv"), "small.csv"),
    ],
)
def test_what_is_refused(folder: Path, arguments: tuple[str, ...], text: str) -> None:
    refused(dsd("plan", "small.csv", "-c", BARE, *arguments, cwd=folder, effects=RIVALS), 2, text)


@pytest.mark.parametrize(
    ("read", "text"),
    [
        (lambda: _limit("velocity=fast"), "not a number"),
        (lambda: _limit("u=0"), "must be above 0"),
        (lambda: _limit("velocity=nan"), "must be finite"),
        (lambda: _limit("u=1:2"), "one size, of either sign"),
        (lambda: command_words("echo '{log} {reference}"), "close the quotes"),
    ],
)
def test_what_cannot_be_read_is_refused(read: Callable[[], object], text: str) -> None:
    with pytest.raises(UsageError) as refusal:
        read()
    assert text in f"{refusal.value.message} {refusal.value.hint}"


def test_the_gain_of_the_drive_takes_a_known_mass(folder: Path) -> None:
    words = (*PLAN, "--for", "gain", "-o", "gain.csv", "--format", "json")
    told = json.loads(done(*words, cwd=folder, effects=RIVALS).stdout)
    assert [one["what"] for one in told["impossible"]] == ["the gain of the drive (the unit of u) or the inertia"]
    assert told["output"] is None
    assert not (folder / "gain.csv").exists()


RIG = f"""
import subprocess, sys
reference, log = sys.argv[1:3]
open("runs.txt", "a").write(log + chr(10))
sys.exit(subprocess.call([sys.executable, "-m", "dsd_cli", "simulate", "-q", "-c", {str(ARM)!r},
                          "--reference", reference, "-o", log, *sys.argv[3:]]))
"""


def test_the_loop_ends_when_nothing_is_left_open(folder: Path) -> None:
    (folder / "rig.py").write_text(RIG)
    command = f"{sys.executable} rig.py {{reference}} {{log}}"
    words = (*PLAN, "-o", "auto.csv", "--format", "json", "--run-with", command)
    told = json.loads(done(*words, cwd=folder, effects=RIVALS).stdout)
    last = told["experiments"][-1]
    assert (last["verdict"], last["left_open"]) == ("gravity", [])
    assert (told["output"], told["pairs"], told["values"]) == (None, [], [])  # no motion is asked for
    assert not (folder / "auto.csv").exists()
    assert (folder / "auto-1.csv").is_file()
    assert (folder / "auto-1-log.csv").is_file()
    assert len((folder / "runs.txt").read_text().splitlines()) == len(told["experiments"])


def _said(
    verdict: str, *found: str, tied: tuple[str, ...] = (), unnamed: float = 0.01, weak: bool = False
) -> SimpleNamespace:
    """unnamed : probability that something nobody has named is there."""
    ranking = [SimpleNamespace(effect=name, indistinguishable_from=tied) for name in found]
    estimates = {f"{name}.level": SimpleNamespace(grade="weak", held=False) for name in found if weak}
    said = SimpleNamespace(verdict=verdict, found=found, ranking=ranking, whole_values=estimates, estimates=estimates)
    said.probability, said.unexplained = 1.0 - unnamed, SimpleNamespace(probability=unnamed)
    return said


def test_a_log_that_says_all_alone_is_not_hidden_by_a_poor_one() -> None:
    alone = _said("coulomb_friction", "coulomb_friction")
    assert misled(_said("coulomb_friction", "coulomb_friction", tied=("stribeck_friction",)), alone)
    assert misled(_said("unknown"), alone)
    # with all logs it is one of a tie, and the other was taken
    assert misled(_said("stribeck_friction", "stribeck_friction", tied=("coulomb_friction",)), alone)
    # with all logs another is named, and something that has no name is likelier
    assert misled(_said("backlash", "backlash", tied=("inertia",), unnamed=0.89), alone)
    # nothing is open; another effect is named; alone it says nothing, or as little
    assert not misled(_said("coulomb_friction", "coulomb_friction"), alone)
    assert not misled(_said("gravity", "gravity", tied=("stiffness",)), alone)
    assert not misled(_said("unknown"), _said("none"))
    assert not misled(_said("unknown"), _said("gravity"))  # a value of the model, and nothing found
    assert not misled(_said("unknown"), _said("coulomb_friction", "coulomb_friction", tied=("stribeck_friction",)))
    # with all logs nobody knows what it is, and alone only values are open: the next motion is for these
    weak = _said("coulomb_friction", "coulomb_friction", weak=True)
    assert misled(_said("backlash", "backlash", unnamed=0.89, weak=True), weak)
    assert not misled(_said("backlash", "backlash", weak=True), weak)
    assert not misled(_said("unknown"), _said("coulomb_friction", "coulomb_friction", unnamed=0.6, weak=True))


#: Moves nothing: leaves a log of an axis at 0.3, and says that it was run.
STAND = """
import sys
open("runs.txt", "a").write(sys.argv[2] + chr(10))
rows = [f"{k / 1000},{0.1 * (k % 2)},{0.3 - k // 100 / 1000}" for k in range(200)]
open(sys.argv[2], "w").write(chr(10).join(["t,u,position", *rows]))
"""
LIMITS = Limits(-1.0, 1.0, 3.0, 20.0, 400.0, 1.0, 0.0)


def closed_with(
    command: str, monkeypatch: pytest.MonkeyPatch, limits: Limits = LIMITS, *, stands: bool = False
) -> tuple[Answer, list[int]]:
    """(answer of a loop whose plans are always the same motion, number of logs of each): open until two logs are.

    stands : the new log alone shows an axis that does not move.
    """
    plan = Plan(("small.csv",), "gravity", Motion(0.001, *np.zeros((4, 101))), (), (), (), limits)
    asked: list[int] = []

    def planned(_settings: object, logs: list[str], *_: object) -> Answer:
        asked.append(len(logs))
        if stands and logs == ["auto-1-log.csv"]:
            raise DataError("auto-1-log.csv: the axis does not move", "a log with moves in both directions is needed")
        said = _said("gravity", "gravity", tied=("stiffness",) if len(logs) < 3 else ())
        said.probability = 0.9
        return Answer(plan, said)  # type: ignore[arg-type]

    monkeypatch.setattr("dsd_cli.cli.plan_loop.planned", planned)
    job = load_config(BARE), ["small.csv"], Request(Wanted()), True
    return closed(job, command, "auto.csv", 3), asked


def test_the_loop_goes_on_where_it_was(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Logs that are there are not run again."""
    monkeypatch.chdir(tmp_path)
    Path("rig.py").write_text(STAND)
    command = f"{sys.executable} rig.py {{reference}} {{log}}"
    first, asked = closed_with(command, monkeypatch)
    assert [one.left_open for one in first.experiments] == [("gravity or stiffness",), ()]
    assert asked == [1, 2, 1, 3]  # the new log is asked alone, too, where something is open
    runs = Path("runs.txt").read_text()
    assert [Path(line).name for line in runs.splitlines()] == ["auto-1-log.csv", "auto-2-log.csv"]
    again, _ = closed_with(command, monkeypatch)
    assert again.experiments == first.experiments
    assert Path("runs.txt").read_text() == runs


def test_the_loop_goes_on_where_the_new_log_alone_says_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("rig.py").write_text(STAND)
    answer, asked = closed_with(f"{sys.executable} rig.py {{reference}} {{log}}", monkeypatch, stands=True)
    assert [one.left_open for one in answer.experiments] == [("gravity or stiffness",), ()]
    assert asked == [1, 2, 1, 3]


def test_a_command_sees_words_and_no_shell(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(DataError, match=r"left no auto-1-log\.csv"):
        closed_with(f"{sys.executable} -c pass {{reference}} {{log}} ; touch pwned", monkeypatch)
    assert Path("auto-1.csv").read_text().startswith("t,position,velocity,acceleration,u_feedforward\n")
    assert not Path("pwned").exists()


def test_a_broken_limit_or_command_ends_the_loop(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """An axis that stands beyond its range; a command that says that it failed."""
    monkeypatch.chdir(tmp_path)
    Path("rig.py").write_text(STAND)
    command = f"{sys.executable} rig.py {{reference}} {{log}}"
    with pytest.raises(DataError, match="position went 20 % beyond its limit"):
        closed_with(command, monkeypatch, replace(LIMITS, low=-0.6, high=0.15))
    assert Path("auto-1-log.csv").is_file()
    assert not Path("auto-2.csv").exists()
    Path("auto-1-log.csv").unlink()
    Path("rig.py").write_text(STAND + "sys.exit(3)\n")
    with pytest.raises(DataError, match="ended with exit code 3"):
        closed_with(command, monkeypatch)
    # what it left is no log of the whole motion
    assert not Path("auto-1-log.csv").exists()
    assert Path("auto-1-log-failed.csv").is_file()
    Path("rig.py").write_text("import sys\nopen(sys.argv[2], 'w')\n")  # a logger that opened its file and wrote nothing
    with pytest.raises(DataError, match=r"left no auto-1-log\.csv"):
        closed_with(command, monkeypatch)
    assert not Path("auto-1-log.csv").exists()


def test_a_u_that_was_constant_is_what_a_motion_mends(folder: Path) -> None:
    t = 1e-3 * np.arange(2000)
    rows = zip(t, np.full(2000, 0.5), 20.0 * t, 10.0 * t**2, strict=True)
    lines = ["t,u,velocity,position", *(",".join(f"{x:.6g}" for x in row) for row in rows)]
    (folder / "pushed.csv").write_text("\n".join(lines) + "\n")
    model = ("-c", BARE, "--set", "signals.d_hat=", "--limit", "u=2")
    words = ("plan", "pushed.csv", *model, "--seconds", "4", "-o", "pushed-next.csv")
    ran = dsd(*words, cwd=folder, effects=RIVALS)
    assert "no motion mends this" not in ran.stderr
    assert ran.stdout.startswith("pushed.csv: ")
