"""What targets that compute have in common: which effects they carry, and how a program of theirs is built and run."""

from __future__ import annotations

import shutil
import subprocess
import tempfile
from pathlib import Path

import numpy as np

from dsd_cli.effects import Role
from dsd_cli.errors import DataError
from dsd_cli.export.base import DELAY, INERTIA, Joint, Motion, NotRun, Verdict
from dsd_cli.export.expression import Refused, number, symbols
from dsd_cli.export.program import T, U, program, symbolic_plant
from dsd_cli.plant.model import PlantModel
from dsd_cli.signals.log import Array

_HOW = {
    Role.APPLIED: "its law, as an expression",
    Role.FRICTION: "its law, as a budget that holds at rest",
    Role.INPUT: "its law on u, before the delay",
    Role.STRUCTURE: "a second mass on the motor",
}
#: s that a compiler and an exported model may take.
_LONGEST = 300.0


def judge(joint: Joint, part: str) -> Verdict:
    """Everything whose law can be an expression."""
    if part == INERTIA:
        return Verdict(part, True, "J of the axis")
    if part == DELAY:
        return Verdict(part, True, "past values of u, and parts of a sample")
    if why := refusal(joint, part):
        return Verdict(part, False, why)
    effect = joint.effect(part)
    assert effect is not None
    return Verdict(part, True, _HOW[effect.role])


def refusal(joint: Joint, part: str) -> str:
    """Why the law of that effect cannot be an expression; "" if it can."""
    alone = Joint(PlantModel(joint.model.inertia, 0.0, {part: joint.model.effects[part]}), joint.sample_time)
    try:
        program(alone)
    except Refused as why:
        return str(why)
    return ""


def symbols_of_force(joint: Joint, part: str) -> set[str]:
    """What the force of that effect depends on at an instant: of t, u, q, v and what effects remember.

    Raises
    ------
    Refused : its law cannot be an expression.
    """
    alone = PlantModel(joint.model.inertia, 0.0, {part: joint.model.effects[part]})
    return symbols(number(x) for x in symbolic_plant(alone).applied(T, U, 0.0))


def compiled(sources: dict[str, str], folder: Path) -> Path:
    """The program that gcc makes of C sources (name -> text), in that folder.

    Raises
    ------
    NotRun : there is no gcc. DataError : it does not take the sources.
    """
    for name, text in sources.items():
        (folder / name).write_text(text, encoding="utf-8")
    _compile([str(folder / name) for name in sources if name.endswith(".c")], folder / "model")
    return folder / "model"


def shared_library(folder: Path, source: str, library: Path) -> None:
    """What gcc makes of a C source in that folder, for other programs to load; raises as `compiled`."""
    _compile([str(folder / source), "-shared", "-fPIC"], library)


def _compile(given: list[str], made: Path) -> None:
    compiler = shutil.which("gcc")
    if compiler is None:
        raise NotRun("gcc is not installed")
    done = ran([compiler, "-std=c99", "-O1", "-Wall", "-Wextra", "-Werror", *given, "-o", str(made), "-lm"])
    if done.returncode != 0:
        raise DataError(
            f"gcc does not take the exported C: {done.stderr.decode(errors='replace').strip()[:200]}",
            "please report this",
        )


def velocities(command: list[str], motion: Motion) -> Array:
    """What a program writes for u on its standard input, doubles in and out.

    Raises
    ------
    NotRun : it fails.
    """
    done = ran(command, np.asarray(motion.u, dtype="<f8").tobytes())
    found = np.frombuffer(done.stdout, dtype="<f8")
    if done.returncode != 0 or len(found) != len(motion.u):
        raise NotRun(f"it failed: {done.stderr.decode(errors='replace').strip()[-200:]}")
    return found


def ran(
    command: list[str], given: bytes = b"", longest: float = _LONGEST, folder: str | None = None
) -> subprocess.CompletedProcess[bytes]:
    """A program that ends by itself, or is ended after `longest` s or with this one.

    Raises
    ------
    NotRun : it cannot be started, or took longer.
    """
    try:
        return subprocess.run(command, input=given, capture_output=True, check=False, timeout=longest, cwd=folder)
    except subprocess.TimeoutExpired:
        raise NotRun(f"took longer than {longest:g} s") from None
    except OSError as error:
        raise NotRun(f"{Path(command[0]).name}: {error}") from None


def scratch() -> tempfile.TemporaryDirectory[str]:
    """A folder that goes when it is left."""
    return tempfile.TemporaryDirectory(prefix="dsd-export-")
