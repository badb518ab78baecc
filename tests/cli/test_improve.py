"""`dsd improve`: who decides, what is printed and written, history and undo."""

import io
import json
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from dsd_cli.errors import DataError
from dsd_cli.files.config import load_config
from tests.cli.engine import CONFIG, START, Engine, Terminal, engine, files, rig, run
from tests.report.examples import LADDER, NOTHING, STEPS

__all__ = ["engine", "rig"]


class Screen(io.StringIO):
    """Where a person looks."""

    def isatty(self) -> bool:
        return True


def interactive(monkeypatch: pytest.MonkeyPatch, typed: str) -> Screen:
    screen = Screen()
    monkeypatch.setattr(sys, "stdin", Terminal(typed))
    monkeypatch.setattr(sys, "stderr", screen)
    return screen


def test_auto_follows_the_diagnosis_and_writes_every_step(rig: Path, engine: Engine, capsys) -> None:
    assert run("improve", "a.csv", "b.csv", "--auto", "-o", "better.toml") == 0
    out, err = capsys.readouterr()
    assert engine.chosen == ["coulomb_friction", "coulomb_friction"]
    assert out.splitlines()[0] == "a.csv, b.csv: held-out force error below 31.4 Hz (unit of u)"
    assert out.splitlines()[-1].startswith(
        "held-out force error below 31.4 Hz: 0.402 -> 0.054 unit of u (-87 %) in 2 steps; nothing is missing"
    )
    assert err == "dsd: warning: the log is short\nwrote better.toml\n"
    config = load_config(rig / "better.toml")
    assert set(config.model.effects) == {"viscous_friction", "coulomb_friction", "gravity"}
    assert [step.effect for step in config.history] == ["coulomb_friction", "gravity"]
    assert [step.heldout_rmse_before for step in config.history] == [0.402, 0.113]
    assert config.history[1].logs == ("a.csv", "b.csv")
    assert (rig / "dsd.toml").read_text() == CONFIG


def test_without_output_nothing_is_written_and_that_is_said(rig: Path, engine: Engine, capsys) -> None:
    assert run("improve", "a.csv", "--auto") == 0
    assert "nothing was written: -o FILE writes the improved config" in capsys.readouterr().err
    assert run("improve", "a.csv", "--auto", "-q", "--format", "json") == 0
    out, err = capsys.readouterr()
    result = json.loads(out)
    assert (err, result["config"], result["verdict"], result["stopped"]) == ("", None, "none", LADDER.stopped)
    assert [rung["effect"] for rung in result["ladder"]] == ["as given", "coulomb_friction", "gravity"]
    assert files(rig) == START
    assert (rig / "dsd.toml").read_text() == CONFIG


def test_auto_stops_where_nothing_can_be_named(rig: Path, engine: Engine, capsys) -> None:
    engine.diagnosis = NOTHING
    engine.ladder = replace(LADDER, steps=STEPS[:1])
    assert run("improve", "a.csv", "--auto", "-o", "same.toml") == 0
    assert (rig / "same.toml").read_text() == CONFIG
    engine.ladder = LADDER
    assert run("improve", "a.csv", "--auto") == 0
    assert engine.chosen == [None]


def test_config_on_stdout_and_picture(rig: Path, engine: Engine, capsys) -> None:
    assert run("improve", "a.csv", "--auto", "-o", "-", "--plot", "x.png") == 0
    out, err = capsys.readouterr()
    assert out.startswith("# my rig\n")
    assert "[[history]]" in out
    assert "held-out force error below 31.4 Hz: 0.402 -> 0.054" in err
    assert (rig / "x.png").read_bytes().startswith(b"\x89PNG")
    assert files(rig) == START | {"x.png"}


def test_a_person_is_asked_and_can_name_another_effect(
    rig: Path, engine: Engine, capsys, monkeypatch: pytest.MonkeyPatch
) -> None:
    screen = interactive(monkeypatch, "\nrust\nviscous_friction\ngravity\nstribeck_friction\nyes\n")
    assert run("improve", "a.csv", "-o", "dsd.toml") == 0
    assert engine.chosen == ["stribeck_friction", "coulomb_friction"]
    text = screen.getvalue()
    assert text.count("add coulomb_friction? [y]es / [n]o stop / name of another effect: ") == 6
    assert "rust: no such effect" in text
    assert "viscous_friction: it is in the model" in text
    assert "gravity: the log has no position" in text
    assert "coulomb_friction is missing: level" in text
    assert "step 1: coulomb_friction: held-out force error 0.113 (-72 %); level 0.52 u" in text
    assert "[y]es" not in capsys.readouterr().out


@pytest.mark.parametrize("typed", ["n\n", "no\n", "", "N\n"])
def test_no_and_the_end_of_the_input_stop(
    rig: Path, engine: Engine, capsys, monkeypatch: pytest.MonkeyPatch, typed: str
) -> None:
    interactive(monkeypatch, typed)
    assert run("improve", "a.csv") == 0
    assert engine.chosen == [None]


def test_a_person_may_add_what_the_diagnosis_does_not_name(
    rig: Path, engine: Engine, capsys, monkeypatch: pytest.MonkeyPatch
) -> None:
    engine.diagnosis = NOTHING
    screen = interactive(monkeypatch, "y\ninertia\nn\n")
    assert run("improve", "a.csv") == 0
    assert engine.chosen == ["inertia", None]
    assert "[n]o stop / name of an effect to add all the same: " in screen.getvalue()


def test_ctrl_c_at_the_question_writes_nothing(
    rig: Path, engine: Engine, capsys, monkeypatch: pytest.MonkeyPatch
) -> None:
    interactive(monkeypatch, "")

    def interrupt(_: object) -> str:
        raise KeyboardInterrupt

    monkeypatch.setattr(Terminal, "readline", interrupt)
    assert run("improve", "a.csv", "-o", "dsd.toml") == 130
    assert (rig / "dsd.toml").read_text() == CONFIG
    assert files(rig) == START


@pytest.mark.parametrize(
    ("arguments", "code", "text"),
    [
        (["a.csv"], 2, "no terminal to ask on: --auto adds what the diagnosis finds"),
        ([], 2, "LOG is missing"),
        (["--auto"], 2, "LOG is missing"),
        (["a.csv", "--auto", "-o", "a.csv"], 2, "a.csv: is the input"),
        (["a.csv", "--auto", "-o", "-", "--format", "json"], 2, "stdout can take one of them"),
        (["a.csv", "--auto", "--plot", "x.bmp"], 2, "end the name in .png"),
        (["a.csv", "a.csv", "--auto"], 2, "given twice"),
        (["none.csv", "--auto"], 1, "none.csv"),
        (["--history", "--undo"], 2, "give one of them"),
        (["a.csv", "--history"], 2, "--history looks at the config alone"),
        (["--undo", "--auto"], 2, "--undo looks at the config alone"),
        (["--undo"], 2, "no [[history]]"),
        (["--history", "-c", "none.toml"], 2, "no such config file"),
    ],
)
def test_what_cannot_work_is_one_line(
    rig: Path, engine: Engine, capsys, arguments: list[str], code: int, text: str
) -> None:
    assert run("improve", *arguments) == code
    out, err = capsys.readouterr()
    assert (out, len(err.splitlines())) == ("", 1)
    assert text in err
    assert not engine.asked
    assert files(rig) == START


def test_stdin_cannot_be_both_log_and_answers(
    rig: Path, engine: Engine, capsys, monkeypatch: pytest.MonkeyPatch
) -> None:
    screen = interactive(monkeypatch, "y\n")
    assert run("improve", "-") == 2
    assert "--auto" in screen.getvalue()


def test_a_failure_writes_nothing(rig: Path, engine: Engine, capsys) -> None:
    engine.ladder = DataError("a.csv: too short")
    assert run("improve", "a.csv", "--auto", "-o", "dsd.toml", "--plot", "x.png") == 1
    assert (rig / "dsd.toml").read_text() == CONFIG
    assert files(rig) == START


def test_history_and_undo(rig: Path, engine: Engine, capsys) -> None:
    assert run("improve", "--history") == 0
    assert capsys.readouterr().out == "dsd.toml: no steps yet\n"
    assert run("improve", "a.csv", "--auto", "-o", "dsd.toml", "-q") == 0
    capsys.readouterr()
    assert run("improve", "--history") == 0
    out = capsys.readouterr().out
    for part in (
        "coulomb_friction",
        "level 0.52\n",
        "amplitude 0.200 +- 0.004",
        "0.402 -> 0.113 (-72 %)",
        "gravity",
        "from a.csv",
    ):
        assert part in out
    assert run("improve", "--history", "--format", "json") == 0
    result = json.loads(capsys.readouterr().out)
    assert (result["log"], [step["effect"] for step in result["history"]]) == ([], ["coulomb_friction", "gravity"])
    assert run("improve", "--undo", "-o", "one.toml", "--format", "json") == 0
    result = json.loads(capsys.readouterr().out)
    assert (result["undone"]["effect"], len(result["history"])) == ("gravity", 1)
    assert set(load_config(rig / "one.toml").model.effects) == {"viscous_friction", "coulomb_friction"}
    for _ in range(2):
        assert run("improve", "--undo") == 0
        assert "wrote dsd.toml: without" in capsys.readouterr().err
    assert (rig / "dsd.toml").read_text() == CONFIG
    assert run("improve", "--undo", "-c", "one.toml", "-o", "-", "-q") == 0
    assert capsys.readouterr() == (CONFIG, "")
