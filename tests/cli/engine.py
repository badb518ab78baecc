"""A stand-in for the engine, and `dsd` run in this process: the commands are tested here, not what they compute."""

import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from dsd_cli.cli import main as frame
from dsd_cli.identify.results import Diagnosis
from tests.cli.rig import make_log, write
from tests.report.examples import ADDITION, DIAGNOSIS, LADDER

CONFIG = """\
# my rig
[observer]
nominal_inertia = 1.0
time_constant = 0.002
filter = "exact"  # told, so that no command asks who made d_hat (of that tests/cli/test_d_hat_makers.py)
u = "previous"

[model]  # believed
inertia = 1.0
delay = 0.01
[model.effects.viscous_friction]
coefficient = 0.3  # grease
"""


class Terminal:
    """Something to type on."""

    def __init__(self, text: str) -> None:
        self._lines = text.splitlines(keepends=True)

    def isatty(self) -> bool:
        return True

    def readline(self) -> str:
        return self._lines.pop(0) if self._lines else ""


@dataclass
class Engine:
    """Answers as told, and remembers what it was asked; an exception as answer is raised."""

    diagnosis: Any = DIAGNOSIS
    addition: Any = ADDITION
    ladder: Any = LADDER
    asked: list[tuple[Any, ...]] = field(default_factory=list)
    chosen: list[str | None] = field(default_factory=list)

    def diagnose(self, *arguments: Any, **keywords: Any) -> Diagnosis:
        self.asked.append((arguments, keywords))
        keywords["progress"]("fitting", 0.5)
        return _answer(self.diagnosis)

    def add_effect(self, *arguments: Any, **keywords: Any) -> Any:
        self.asked.append((arguments, keywords))
        return _answer(self.addition)

    def improve(self, *arguments: Any, choose: Callable, on_step: Callable, **keywords: Any) -> Any:
        self.asked.append((arguments, keywords))
        ladder = _answer(self.ladder)
        on_step(ladder.steps[0])
        for step in ladder.steps[1:]:
            self.chosen.append(choose(self.diagnosis))
            if self.chosen[-1] is None:
                break
            on_step(step)
        return ladder


def _answer(answer: Any) -> Any:
    if isinstance(answer, BaseException):
        raise answer
    return answer


@pytest.fixture
def engine(monkeypatch: pytest.MonkeyPatch) -> Engine:
    """In place of `identify.diagnose`, `identify.final_fit` and `identify.improve`."""
    stub = Engine()
    monkeypatch.setattr("dsd_cli.identify.verdict.diagnose.diagnose", stub.diagnose)
    for place, name in (("final_fit", "add_effect"), ("improve", "improve")):
        module = ModuleType(f"dsd_cli.identify.{place}")
        setattr(module, name, getattr(stub, name))
        monkeypatch.setitem(sys.modules, module.__name__, module)
    return stub


@pytest.fixture
def rig(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with config and two logs, to be in."""
    (tmp_path / "dsd.toml").write_text(CONFIG)
    write(tmp_path, "a.csv", make_log(400))
    write(tmp_path, "b.csv", make_log(400, seed=1))
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("NO_COLOR", "1")
    monkeypatch.setenv("COLUMNS", "120")
    return tmp_path


def run(*arguments: object) -> int:
    """The exit code; a command that asks for a real terminal gets none."""
    return frame.run([str(argument) for argument in arguments])


def files(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir()}


START = {"dsd.toml", "a.csv", "b.csv"}
