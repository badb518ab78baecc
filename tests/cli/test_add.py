"""`dsd add`: the config is written if all went well, and only then."""

import json
import tomllib
from dataclasses import replace
from pathlib import Path

import pytest

from dsd_cli.cli.identification import print_json
from dsd_cli.cli.improve_loop import put_config
from dsd_cli.errors import DataError, UsageError
from dsd_cli.files.config import load_config
from dsd_cli.files.config.edit import undone
from dsd_cli.report.addition import AdditionReport, caveats
from dsd_cli.signals.units import Units
from tests.cli.engine import CONFIG, START, Engine, engine, files, rig, run
from tests.cli.rig import done
from tests.report.examples import ADDITION

__all__ = ["engine", "rig"]


def test_the_new_config_has_the_effect_the_comments_and_the_history(rig: Path, engine: Engine, capsys) -> None:
    assert run("add", "a.csv", "coulomb_friction", "-o", "better.toml", "--holdout", "b.csv") == 0
    out, err = capsys.readouterr()
    assert out.startswith("coulomb_friction added: held-out force error")
    *warnings, wrote = err.splitlines()
    assert (warnings[0], wrote) == ("dsd: warning: a warning", "wrote better.toml")
    assert "more is missing, and biases these values" in warnings[1]
    (((recordings, _, _, effect, _), keywords),) = engine.asked
    assert ([r.name for r in recordings], effect) == (["a.csv"], "coulomb_friction")
    assert [r.name for r in keywords["holdout"]] == ["b.csv"]
    text = (rig / "better.toml").read_text()
    assert text.startswith(CONFIG.replace("inertia = 1.0\ndelay", "inertia = 1.02\ndelay"))
    config = load_config(rig / "better.toml")
    assert config.model.effects["coulomb_friction"] == {"level": 0.52}
    (step,) = config.history
    assert (step.effect, step.logs) == ("coulomb_friction", ("a.csv",))
    assert (step.rmse_before, step.rmse_after, step.heldout_rmse_before, step.heldout_rmse_after) == (
        0.38,
        0.105,
        0.402,
        0.113,
    )
    assert (dict(step.values), dict(step.std_errors)) == ({"level": 0.52}, {"level": 0.03})
    assert undone(text) == CONFIG
    assert (rig / "dsd.toml").read_text() == CONFIG


def test_json(rig: Path, engine: Engine, capsys) -> None:
    assert run("add", "a.csv", "coulomb_friction", "-o", "better.toml", "--format", "json", "-q") == 0
    out, err = capsys.readouterr()
    result = json.loads(out)
    assert err == ""
    assert (result["command"], result["log"], result["config"]) == ("add", ["a.csv"], "better.toml")
    assert (result["heldout_rmse_before"], result["heldout_rmse_after"]) == (0.402, 0.113)
    assert result["parameters"]["level"]["value"] == 0.52


def test_in_place_and_on_stdout(rig: Path, engine: Engine, capsys) -> None:
    assert run("add", "a.csv", "coulomb_friction", "-o", "-") == 0
    out, err = capsys.readouterr()
    assert undone(out) == CONFIG
    assert "coulomb_friction added" in err
    assert run("add", "a.csv", "coulomb_friction", "-o", "-", "-q") == 0
    assert capsys.readouterr().err == ""
    assert run("add", "a.csv", "coulomb_friction", "-o", "dsd.toml", "-q") == 0
    assert tomllib.loads((rig / "dsd.toml").read_text())["model"]["effects"]["coulomb_friction"] == {"level": 0.52}
    assert files(rig) == START


@pytest.mark.parametrize(
    ("failure", "code"),
    [(UsageError("coulomb_friction: is in the model"), 2), (DataError("the held-out error does not fall"), 1)],
)
def test_nothing_is_written_if_the_effect_does_not_help(
    rig: Path, engine: Engine, capsys, failure: Exception, code: int
) -> None:
    engine.addition = failure
    assert run("add", "a.csv", "coulomb_friction", "-o", "dsd.toml") == code
    assert capsys.readouterr() == ("", f"dsd: error: {failure}\n")
    assert (rig / "dsd.toml").read_text() == CONFIG
    assert files(rig) == START


@pytest.mark.parametrize(
    ("arguments", "code", "text"),
    [
        (["a.csv", "coulomb_friction"], 2, "-o"),
        (["a.csv", "-o", "x.toml"], 2, "EFFECT"),
        (["a.csv", "coulomb_friction", "-o", "a.csv"], 2, "a.csv: is the input"),
        (["a.csv", "coulomb_friction", "-o", "b.csv", "--holdout", "b.csv"], 2, "b.csv: is the input"),
        (["a.csv", "coulomb_friction", "-o", "none/x.toml"], 1, "no such folder"),
        (["a.csv", "coulomb_friction", "-o", "-", "--format", "json"], 2, "stdout can take one of them"),
        (["a.csv", "coulomb_friction", "-o", "x.toml", "--holdout", "a.csv"], 2, "given twice"),
    ],
)
def test_what_cannot_work_is_one_line(
    rig: Path, engine: Engine, capsys, arguments: list[str], code: int, text: str
) -> None:
    assert run("add", *arguments) == code
    out, err = capsys.readouterr()
    assert (out, len(err.splitlines())) == ("", 1)
    assert text in err
    assert not engine.asked
    assert files(rig) == START


@pytest.mark.parametrize("output", ["x.toml", "dsd.toml", "-"])
def test_a_config_that_dsd_would_not_read_is_not_written(rig: Path, capsys, output: str) -> None:
    with pytest.raises(UsageError, match="inertia"):
        put_config(output, "[model]\ninertia = -1\n")
    assert capsys.readouterr().out == ""
    assert (rig / "dsd.toml").read_text() == CONFIG
    assert files(rig) == START


def test_json_with_nan_is_never_printed(capsys) -> None:
    with pytest.raises(ValueError, match="JSON"):
        print_json({"x": float("nan")})
    assert capsys.readouterr().out == ""


def test_the_real_command_names_the_band_and_the_floor_that_compare_names(tmp_path: Path) -> None:
    """A servo whose dry friction the config lacks: errors before and after in the same band, that of the log."""
    done("init", "--template", "servo", "-q", cwd=tmp_path)
    done("simulate", "-c", "dsd.toml", "-o", "log.csv", "-q", "--duration", 2, cwd=tmp_path)
    head, rest = (tmp_path / "dsd.toml").read_text().split("[model.effects.coulomb_friction]\n")
    (tmp_path / "dsd.toml").write_text(head + rest.split("\n", 1)[1])
    said = done("compare", "log.csv", "--format", "json", cwd=tmp_path).stdout
    force = json.loads(said)["force"]
    said = done("add", "log.csv", "coulomb_friction", "-o", "new.toml", "--format", "json", cwd=tmp_path).stdout
    result = json.loads(said)
    assert result["log"] == ["log.csv"]
    assert {key: result[key] for key in ("unit", "band_hz", "floor")} == {
        key: force[key] for key in ("unit", "band_hz", "floor")
    }
    assert result["rmse_before"] == pytest.approx(force["rmse"], rel=1e-9)
    after = json.loads(done("compare", "log.csv", "-c", "new.toml", "--format", "json", cwd=tmp_path).stdout)["force"]
    assert after["rmse"] == pytest.approx(result["rmse_after"], rel=0.01)  # values in the file are rounded
    assert after["rmse"] < 0.1 * force["rmse"]


@pytest.mark.parametrize(("unit", "said"), [("unknown", True), ("rad", False)])
def test_an_effect_of_the_place_is_so_called_by_a_unit_that_nothing_says(unit: str, said: bool) -> None:
    units = Units("A", "" if unit == "unknown" else unit, assumed=unit == "unknown")
    added = replace(ADDITION, effect="gravity", units=units)
    report = AdditionReport(added, ("a.csv",), (), "b.toml")
    assert any("so called with the position in rad or m, which nothing says" in one for one in caveats(report)) == said
    assert not caveats(replace(report, result=replace(ADDITION, units=units)))  # friction is friction in any unit


def test_several_logs_are_fitted_together(rig: Path, engine: Engine, capsys) -> None:
    assert run("add", "a.csv", "b.csv", "coulomb_friction", "-o", "better.toml", "--format", "json") == 0
    ((recordings, *_), _), *_ = engine.asked
    assert [one.name for one in recordings] == ["a.csv", "b.csv"]
    assert json.loads(capsys.readouterr().out)["log"] == ["a.csv", "b.csv"]
