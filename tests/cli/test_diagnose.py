"""`dsd diagnose`: what goes to the engine, what comes out where, and what is refused."""

import json
import os
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from dsd_cli.errors import DataError
from tests.cli.engine import START, Engine, engine, files, rig, run
from tests.cli.rig import AXIS, DSD, FEW, done, dsd, refused
from tests.report.examples import DIAGNOSIS

__all__ = ["engine", "rig"]

SAMPLES = Path(__file__).parents[2] / "sample_logs"


def test_the_engine_gets_all_logs_and_the_model(rig: Path, engine: Engine, capsys) -> None:
    assert run("diagnose", "a.csv", "b.csv", "--set", "model.delay=0.02") == 0
    (((recordings, model, observer, settings), keywords),) = engine.asked
    assert [r.name for r in recordings] == ["a.csv", "b.csv"]
    assert (model.delay, dict(model.effects["viscous_friction"])) == (0.02, {"coefficient": 0.3})
    assert (observer.time_constant, settings.effects, keywords["holdout"]) == (0.002, None, ())


def test_the_table_goes_to_stdout_and_warnings_to_stderr(rig: Path, engine: Engine, capsys) -> None:
    assert run("diagnose", "a.csv", "--holdout", "b.csv") == 0
    out, err = capsys.readouterr()
    assert out.startswith("coulomb_friction is missing: level 0.52 +- 0.03 u, probability 97 %")
    assert "held out b.csv" in out
    assert "\x1b" not in out + err
    assert err == "dsd: warning: the log is short\n"
    assert [r.name for r in engine.asked[0][1]["holdout"]] == ["b.csv"]
    assert files(rig) == START


def test_a_turned_command_is_said_with_the_key_that_mends_it(tmp_path: Path) -> None:
    encoder_only = ("--set", 'signals.d_hat=""', "--set", 'signals.velocity=""')
    given = ("diagnose", SAMPLES / "servo-friction.csv", "-c", SAMPLES / "servo-bare.toml", "--to", 1, *encoder_only)
    assert "signals.u_sign = 1" in dsd(*given, "--set", "signals.u_sign=-1", cwd=tmp_path, effects=FEW).stderr
    assert "warning" not in dsd(*given, cwd=tmp_path, effects=FEW).stderr


@pytest.mark.parametrize(("unit", "asked"), [("m", False), ("rad", True)])
def test_a_position_that_is_a_length_has_no_weight_that_goes_with_an_angle(
    tmp_path: Path, unit: str, asked: bool
) -> None:
    """Of a spring over a short way a weight was as good, and the remedy was half a turn."""
    t = 0.002 * np.arange(3000)
    lines = [(0.02, 0.7, 0.0), (0.01, 2.3, 1.0)]
    x = sum(a * np.sin(2.0 * np.pi * f * t + p) for a, f, p in lines)
    u = sum((800.0 - 1.2 * (2.0 * np.pi * f) ** 2) * a * np.sin(2.0 * np.pi * f * t + p) for a, f, p in lines)
    table = np.column_stack([t, u, np.round(x, 6)])
    np.savetxt(tmp_path / "log.csv", table, "%.9g", ",", header="t,u,position", comments="")
    (tmp_path / "axis.toml").write_text(AXIS.replace("0.01", "1.2"))
    more = ("--set", f'signals.position_unit="{unit}"', "--format", "json")
    found = json.loads(
        done("diagnose", "log.csv", "-c", "axis.toml", *more, cwd=tmp_path, effects=("stiffness", "gravity")).stdout
    )
    assert found["verdict"] == "stiffness"
    assert (found["probability"] > 0.9) is not asked
    reasons = {one["effect"]: one.get("not_testable", "") for one in found["ranking"]}
    assert ("length" in reasons["gravity"]) is not asked


def test_json_and_quiet(rig: Path, engine: Engine, capsys) -> None:
    assert run("diagnose", "a.csv", "--format", "json", "--quiet", "--holdout", "b.csv") == 0
    out, err = capsys.readouterr()
    result = json.loads(out, parse_constant=pytest.fail)
    assert err == ""
    assert (result["command"], result["log"], result["holdout"]) == ("diagnose", ["a.csv"], ["b.csv"])
    assert (result["verdict"], result["warnings"]) == ("coulomb_friction", ["the log is short"])


def test_a_channel_that_the_config_names_and_the_log_lacks_is_a_warning(rig: Path, engine: Engine, capsys) -> None:
    assert run("diagnose", "a.csv", "--format", "json", "--set", "signals.position=x") == 0
    out, err = capsys.readouterr()
    assert json.loads(out)["warnings"] == ['a.csv: no column "x" (signals.position)', "the log is short"]
    assert 'dsd: warning: a.csv: no column "x"' in err


def test_the_picture(rig: Path, engine: Engine, capsys) -> None:
    # the log has no measured speed: the one that was reconstructed will do
    assert run("diagnose", "a.csv", "--plot", "out.png") == 0
    assert (rig / "out.png").read_bytes().startswith(b"\x89PNG")
    assert files(rig) == START | {"out.png"}
    assert "out.png: drawn" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "code", "text"),
    [
        (["a.csv", "a.csv"], 2, "a.csv is given twice"),
        (["a.csv", "--holdout", "a.csv"], 2, "a.csv is given twice"),
        (["a.csv", "--plot", "x.jpg"], 2, "end the name in .png"),
        (["a.csv", "--plot", "none/x.png"], 1, "no such folder"),
        (["none.csv"], 1, "none.csv"),
        (["a.csv", "-c", "none.toml"], 2, "no such config file"),
        (["a.csv", "--format", "csv"], 2, "'csv' is not one of"),
        (["a.csv", "--set", "model={}"], 2, "[model] inertia is missing"),
        (["a.csv", "--effects-from", "none.py"], 2, "none.py"),
        ([], 2, "LOG"),
    ],
)
def test_what_cannot_work_is_one_line(
    rig: Path, engine: Engine, capsys, arguments: list[str], code: int, text: str
) -> None:
    assert run("diagnose", *arguments) == code
    out, err = capsys.readouterr()
    assert (out, len(err.splitlines())) == ("", 1)
    assert text in err
    assert "unexpected" not in err
    assert not engine.asked
    assert files(rig) == START


def test_a_failure_of_the_engine_is_one_line_and_draws_nothing(rig: Path, engine: Engine, capsys) -> None:
    engine.diagnosis = DataError("a.csv: too short", "a longer log is needed")
    assert run("diagnose", "a.csv", "--plot", "x.png") == 1
    assert capsys.readouterr() == ("", "dsd: error: a.csv: too short: a longer log is needed\n")
    assert files(rig) == START


def test_what_nobody_knows_is_null(rig: Path, engine: Engine, capsys) -> None:
    engine.diagnosis = replace(DIAGNOSIS, probability=float("nan"), noise=float("inf"))
    assert run("diagnose", "a.csv", "--format", "json", "-q") == 0
    result = json.loads(capsys.readouterr().out, parse_constant=pytest.fail)
    assert (result["probability"], result["noise"]) == (None, None)


@pytest.fixture(scope="module")
def servo(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A simulated axis with Coulomb friction that the config does not have."""
    folder = tmp_path_factory.mktemp("servo")
    done("init", "--template", "servo", "-q", cwd=folder)
    done("simulate", "-c", "dsd.toml", "-o", "log.csv", "-q", "--duration", 2, cwd=folder)
    text = (folder / "dsd.toml").read_text()
    head, rest = text.split("[model.effects.coulomb_friction]\n")
    (folder / "dsd.toml").write_text(head + rest.split("\n", 1)[1])
    return folder


def test_friction_is_found_by_the_real_command(servo: Path) -> None:
    result = json.loads(done("diagnose", "log.csv", "--format", "json", cwd=servo).stdout)
    assert result["verdict"] == "coulomb_friction"
    level = result["ranking"][0]["parameters"]["level"]
    assert abs(level["value"] - 0.15) < 0.01
    assert level["unit"] == "u"
    assert result["heldout_rmse"] > result["ranking"][0]["heldout_rmse_after"]
    assert "coulomb_friction" in result["found"]
    assert result["unit"] == "unit of u"
    assert 2.0 <= result["band_hz"] <= 125.0  # of 1 kHz, at most an eighth
    assert 0.0 < result["floor"] <= result["ranking"][0]["heldout_rmse_after"]


def test_the_observer_plays_no_role_where_d_hat_is_computed(servo: Path) -> None:
    """d_hat from the position by two observers: verdict, values and errors are the same to rounding."""
    words, numbers = [], []
    for tau, nominal in ((0.001, 0.01), (0.2, 1e-4)):
        own = (f"observer.time_constant={tau}", f"observer.nominal_inertia={nominal}", 'signals.d_hat=""')
        given = (x for one in own for x in ("--set", one))
        said = done("diagnose", "log.csv", "--format", "json", *given, cwd=servo, effects=FEW)
        result = json.loads(said.stdout)
        first = result["ranking"][0]
        level = first["parameters"]["level"]
        words.append((result["verdict"], result["found"], [one["effect"] for one in result["ranking"]]))
        errors = [result[key] for key in ("rmse", "heldout_rmse", "band_hz", "floor", "noise")]
        numbers.append([*errors, first["heldout_rmse_after"], level["value"], level["std_error"]])
    assert words[0][0] == "coulomb_friction"
    assert words[1] == words[0]
    assert numbers[1] == pytest.approx(numbers[0], rel=1e-6)


def test_a_closed_pipe_ends_quietly(servo: Path) -> None:
    read, closed = os.pipe()
    os.close(read)
    ended = subprocess.run(
        [*DSD, "diagnose", "log.csv", "-q", "--to", "1"],
        stdout=closed,
        stderr=subprocess.PIPE,
        text=True,
        check=False,
        cwd=servo,
    )
    os.close(closed)
    assert (ended.returncode, ended.stderr) == (141, "")


def test_a_log_without_u_is_refused(servo: Path, tmp_path: Path) -> None:
    (tmp_path / "x.csv").write_text("t,d_hat\n0,1\n1,2\n")
    refused(dsd("diagnose", "x.csv", "-c", servo / "dsd.toml", cwd=tmp_path), 1, 'no column "u"')
