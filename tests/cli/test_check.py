"""`dsd check`: verdict first, keys of the contract, exit codes, configs that lack sections, several logs."""

import io
import json
from pathlib import Path

import numpy as np
import pytest

from dsd_cli.identify.checks import CheckResult, Excitation, Parameter
from dsd_cli.report.checks import print_table, to_json, verdict
from tests.cli.rig import csv_text, done, dsd, refused, write
from tests.identify.checks.rig import servo

SAMPLES = Path(__file__).parents[2] / "sample_logs"
KEYS = {"schema_version", "command", "log", "findings", "parameters", "band_hz", "floor", "unit"}


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("rig")
    case, c = servo().truth, servo().channels
    friction = "".join(
        f"[model.effects.{name}]\n" + "".join(f"{p} = {value}\n" for p, value in values.items())
        for name, values in (*case.base, *case.hidden)
    )
    observer = f"[observer]\nnominal_inertia = {case.nominal_inertia}\ntime_constant = {case.observer_time_constant}\n"
    (folder / "dsd.toml").write_text(
        f"{observer}[model]\ninertia = {case.inertia}\ndelay = {case.delay}\n{friction}", encoding="utf-8"
    )
    (folder / "signals.toml").write_text('[signals]\nvelocity = "velocity"\n', encoding="utf-8")
    write(folder, "log.csv", c)
    write(folder, "turned.csv", {**c, "u": -c["u"]})
    write(folder, "still.csv", {**c, "velocity": 0.0 * c["u"], "position": 1.0 + 0.0 * c["u"]})
    return folder


def checked(*arguments: object, cwd: Path) -> dict:
    return json.loads(done("check", *arguments, "--format", "json", cwd=cwd).stdout)


def test_a_log_that_can_answer(rig):
    found = checked("log.csv", cwd=rig)
    assert set(found) >= KEYS
    assert (found["schema_version"], found["command"], found["log"]) == (1, "check", ["log.csv"])
    assert [one for one in found["findings"] if one["severity"] != "note"] == []
    assert {one["name"]: one["identified"] for one in found["parameters"]} == dict.fromkeys(
        ("inertia", "delay", "coulomb_friction.level", "viscous_friction.coefficient"), "identified"
    )
    assert found["band_hz"] > 20.0
    assert 0.0 < found["floor"] < 0.2
    assert found["unit"] == "u"
    assert found["can_answer"] is True


@pytest.mark.parametrize(
    ("told", "said"),
    [
        ("signals.position_scale=65900", r"rad/s (629,000 rpm) is implausible: is the motion in rad?"),
        ('signals.position_unit="m"', ""),
    ],
)
def test_a_speed_that_no_axis_has_is_doubted_with_its_unit(told, said, rig):
    """One of 1 rad/s, as 65,900 counts, would go at 65,900 * 60 / (2 pi) = 629,302 rpm."""
    t = 0.001 * np.arange(4000)
    q, u = np.sin(t), -2.0 * np.sin(t)
    write(rig, "fast.csv", {"t": t, "u": u, "position": q})
    found = checked("fast.csv", "-c", "signals.toml", "--set", "signals.velocity=", "--set", told, cwd=rig)
    fast = [one for one in found["findings"] if "implausible" in one["what"]]
    assert len(fast) == bool(said)
    if fast:
        assert said in fast[0]["what"]
        assert "signals.position_unit" in fast[0]["remedy"]


def test_a_fit_below_zero_is_explained():
    """A model without the axis' friction: inertia or delay make up for it."""

    def shown(*parameters: Parameter) -> str:
        result = CheckResult("a.csv", (), parameters, 30.0, 0.01, Excitation(None, 0, 0, None, None, 0.0), 1.0, 10)
        out = io.StringIO()
        print_table([result], out)
        return " ".join(out.getvalue().split())

    below, at = Parameter("delay", "weak", -0.004, 0.0008), Parameter("delay", "weak", -0.001, 0.0008)
    assert (
        "delay below 0 compensates for forces that the model lacks, or for a u that is late: `dsd diagnose` says which"
        in shown(below)
    )
    assert "below 0" not in shown(at)
    assert "below 0" not in shown(Parameter("gravity.phase", "weak", -0.4, 0.01))


@pytest.mark.parametrize(
    ("grades", "moves", "little"),
    [(("weak", "not"), 2, True), (("identified", "weak"), 2, False), (("weak", "not"), 3, False)],
)
def test_a_log_that_tells_next_to_nothing_says_so_first(grades, moves, little):
    parameters = tuple(Parameter(name, g, 1.0, 0.3) for name, g in zip(("inertia", "delay"), grades, strict=True))
    result = CheckResult("a.csv", (), parameters, 30.0, 0.01, Excitation(0.5, moves, 0, 1.0, 1.0, 0.0), 1.0, 10)
    assert verdict(result).startswith("can answer little: ") == little
    assert to_json([result])["can_answer"] is True


def test_a_log_that_cannot(rig):
    found = checked("turned.csv", cwd=rig)
    (error,) = [one for one in found["findings"] if one["severity"] == "error"]
    assert set(error) == {"log", "what", "channel", "severity", "sure", "remedy"}
    assert (error["channel"], error["remedy"]) == ("u", "signals.u_sign = -1")
    assert 0.9 < error["sure"] <= 1.0
    assert found["can_answer"] is False
    mended = checked("turned.csv", "--set", "signals.u_sign=-1", cwd=rig)
    assert mended["can_answer"] is True
    again = checked("log.csv", "--set", "signals.u_sign=-1", cwd=rig)
    assert [one["remedy"] for one in again["findings"] if one["severity"] == "error"] == ["signals.u_sign = 1"]


def test_the_remedies_mend_it(rig):
    """The keys and values of a remedy, given with --set, leave nothing to say."""
    c = servo().channels
    write(rig, "units.csv", {**c, "velocity": c["velocity"] * 60.0 / (2.0 * np.pi), "position": -c["position"]})
    settings: list[str] = []
    for _ in range(3):
        wrong = [one for one in checked("units.csv", *settings, cwd=rig)["findings"] if one["severity"] == "error"]
        for one in wrong[:1]:
            for key in one["remedy"].split(" and "):
                settings += ["--set", key.replace(" = ", "=")]
    assert wrong == []
    assert {s.split("=")[0] for s in settings[1::2]} == {"signals.velocity_scale", "signals.position_scale"}


def test_table_says_the_verdict_first_and_fits_80_columns(rig):
    for log in ("log.csv", "turned.csv", "still.csv"):
        lines = done("check", log, cwd=rig, COLUMNS="80").stdout.splitlines()
        verdict = "can answer" if log == "log.csv" else "cannot answer"
        assert lines[0].startswith(f"{log}: {verdict}")
        assert max(map(len, lines)) <= 80
    assert "-> signals.u_sign = -1" in done("check", "turned.csv", cwd=rig, COLUMNS="80").stdout


def test_strict_is_exit_3_with_an_error_only(rig):
    assert dsd("check", "log.csv", "--strict", cwd=rig).returncode == 0
    assert dsd("check", "turned.csv", cwd=rig).returncode == 0
    strict = dsd("check", "turned.csv", "--strict", cwd=rig)
    assert strict.returncode == 3
    assert strict.stdout.startswith("turned.csv: cannot answer")
    assert strict.stderr == "dsd: error: turned.csv: u has the other sign than the motion it causes\n"


def test_signals_alone_are_enough(rig):
    found = checked("log.csv", "-c", "signals.toml", cwd=rig)
    assert [one["name"] for one in found["parameters"]] == ["inertia", "delay"]
    assert found["parameters"][0]["value"] == pytest.approx(servo().truth.inertia, rel=0.05)
    assert checked("turned.csv", "-c", "signals.toml", cwd=rig)["can_answer"] is False


def test_several_logs_are_judged_each_by_itself(rig):
    found = checked("log.csv", "turned.csv", cwd=rig)
    assert found["log"] == ["log.csv", "turned.csv"]
    assert [one["can_answer"] for one in found["by_log"]] == [True, False]
    assert {one["log"] for one in found["findings"] if one["severity"] == "error"} == {"turned.csv"}
    assert {one["identified"] for one in found["parameters"]} == {"identified"}  # by the one that can
    out = done("check", "log.csv", "turned.csv", cwd=rig).stdout
    assert out.index("log.csv: can answer") < out.index("turned.csv: cannot answer")
    refused(dsd("check", "log.csv", "log.csv", cwd=rig), 2, "given twice")


def test_an_axis_at_rest_is_a_finding_and_no_failure(rig):
    assert "does not move" in done("check", "still.csv", cwd=rig).stdout


def test_stdin_gaps_and_missing_columns(rig):
    c = {name: np.delete(x, np.s_[2000:2500]) for name, x in servo().channels.items()}
    found = json.loads(done("check", "-", "--format", "json", cwd=rig, stdin=csv_text(c)).stdout)
    assert any("1 gap" in one["what"] for one in found["findings"])
    c.pop("velocity")
    write(rig, "gap.csv", c)
    said = done("check", "gap.csv", "-c", "signals.toml", cwd=rig)
    assert 'no column "velocity" (signals.velocity)' in said.stderr
    assert done("check", "gap.csv", "-c", "signals.toml", "-q", cwd=rig).stderr == ""


@pytest.mark.parametrize(
    ("content", "code", "text"),
    [
        ({"t": np.arange(200) * 0.001, "x": np.ones(200)}, 1, 'no column "u"'),
        ({"t": np.arange(200) * 0.001, "u": np.full(200, 1e200)}, 1, "goes beyond"),
    ],
)
def test_what_cannot_be_read_is_one_line(rig, content, code, text):
    write(rig, "bad.csv", content)
    refused(dsd("check", "bad.csv", cwd=rig), code, text)


def test_what_a_missing_force_biases_is_said_in_both_values(tmp_path):
    given = ("check", SAMPLES / "servo-friction.csv", "-c", SAMPLES / "servo-bare.toml")
    ran = done(*given, "--format", "json", cwd=tmp_path)
    said = " ".join(one["what"] for one in json.loads(ran.stdout)["findings"])
    assert "the fit of [model] as it is gives inertia 0.0104, delay 0, " in said
    assert "and with friction, weight and stiffness fitted as well 0.01, 0.002: a force is missing in [model]" in said


@pytest.mark.parametrize(
    ("names", "said"),
    [
        (("pos_deg", "vel_deg_per_s"), {"position": '"deg"', "velocity": '"deg/s"'}),
        (("position", "speed [rpm]"), {"velocity": '"rpm"'}),
        (("pos_rad", "vel_rad_s"), {}),
        (("pos_m", "velocity"), {}),
    ],
)
def test_a_unit_in_the_name_of_a_column_that_the_config_leaves_out_is_said(rig, names, said):
    """A config made by hand: degrees were read as rad, and an inertia 57 times too small was "identifiable"."""
    c = servo().channels
    write(rig, "named.csv", {"t": c["t"], "u": c["u"], names[0]: c["position"], names[1]: c["velocity"]})
    channels = [f"signals.{k}='{name}'" for k, name in zip(("position", "velocity"), names, strict=True)]
    columns = [part for one in channels for part in ("--set", one)]

    def found(*more):
        asked = checked("named.csv", *columns, *more, cwd=rig)["findings"]
        return {one["channel"]: one["remedy"] for one in asked if " reads like " in one["what"]}

    assert {k: one.partition(", or ")[0] for k, one in found().items()} == {
        k: f"signals.{k}_unit = {unit}" for k, unit in said.items()
    }
    units = [part for k, unit in said.items() for part in ("--set", f"signals.{k}_unit={unit}")]
    assert found(*units) == {}
    assert found("--set", "signals.position_scale=0.0175", "--set", "signals.velocity_scale=0.0175") == {}
    if said:
        read = done("compare", "named.csv", *columns, cwd=rig).stderr
        assert read.count(" reads like ") == len(said)
