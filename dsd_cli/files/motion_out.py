"""A planned motion as a file that a drive, a robot or `dsd simulate` takes."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np

from dsd_cli.design.results import Motion
from dsd_cli.errors import UsageError
from dsd_cli.signals.log import Array

#: Columns of the CSV file, in the order of the contract.
COLUMNS = ("t", "position", "velocity", "acceleration", "u_feedforward")


def motion_format(path: str | Path) -> str:
    """The suffix that says how a motion is written; "-" is CSV.

    Raises
    ------
    UsageError : none of the known ones.
    """
    suffix = ".csv" if str(path) == "-" else Path(path).suffix.lower()
    if suffix not in _WRITERS:
        raise UsageError(f"{path}: unknown kind of file for a motion", f"end the name in {', '.join(_WRITERS)}")
    return suffix


def motion_text(motion: Motion, suffix: str, joint: str = "joint") -> str:
    """The file; `joint` : its name in a JointTrajectory."""
    return _WRITERS[suffix](motion, joint)


def _table(motion: Motion) -> Array:
    t = np.arange(len(motion.position)) * motion.step
    return np.column_stack([t, motion.position, motion.velocity, motion.acceleration, motion.u])


def _csv(motion: Motion, _: str) -> str:
    rows = [",".join(COLUMNS)]
    rows += [",".join(f"{x:.9g}" for x in row) for row in _table(motion).tolist()]
    return "\n".join(rows) + "\n"


def _yaml(motion: Motion, joint: str) -> str:
    """trajectory_msgs/JointTrajectory, as `ros2 topic pub` takes it; effort is the feedforward."""
    lines = ["joint_names:", f"  - {_quoted(joint)}", "points:"]
    for t, *values in _table(motion).tolist():
        seconds, nanoseconds = divmod(round(t * 1e9), 1_000_000_000)
        named = zip(("positions", "velocities", "accelerations", "effort"), values, strict=True)
        first, *others = [f"{name}: [{x:.9g}]" for name, x in named]
        lines.append(f"  - {first}")
        lines += [f"    {line}" for line in others]
        lines.append(f"    time_from_start: {{sec: {seconds}, nanosec: {nanoseconds}}}")
    return "\n".join(lines) + "\n"


def _quoted(name: str) -> str:
    return '"' + name.replace("\\", "\\\\").replace('"', '\\"') + '"'


def _c(motion: Motion, _: str, kept: str = "") -> str:
    """C99: one row per sample time. `kept` : "static " in a header, which several files may include."""
    head = [
        f"/* {len(motion.position)} samples, {motion.step:.9g} s apart: {', '.join(COLUMNS[1:])} */",
        f"#define PLAN_SAMPLES {len(motion.position)}",
        f"#define PLAN_SAMPLE_TIME {motion.step:.9g}",
        f"{kept}const double plan[PLAN_SAMPLES][4] = {{",
    ]
    rows = ["  {" + ", ".join(f"{x:.9g}" for x in row[1:]) + "}," for row in _table(motion).tolist()]
    return "\n".join([*head, *rows, "};"]) + "\n"


def _st(motion: Motion, _: str) -> str:
    """IEC 61131-3 structured text: constant arrays, one for each channel."""
    last = len(motion.position) - 1
    lines = [
        "VAR_GLOBAL CONSTANT",
        f"  PLAN_LAST : DINT := {last};",
        f"  PLAN_SAMPLE_TIME : LREAL := {_lreal(motion.step)};",
    ]
    for name, column in zip(COLUMNS[1:], _table(motion).T[1:].tolist(), strict=True):
        lines.append(f"  PLAN_{name.upper()} : ARRAY[0..{last}] OF LREAL := [")
        pieces = [", ".join(map(_lreal, column[i : i + 8])) for i in range(0, len(column), 8)]
        lines.append("    " + ",\n    ".join(pieces) + "];")
    return "\n".join([*lines, "END_VAR"]) + "\n"


def _lreal(x: float) -> str:
    """A real literal needs a point."""
    text = f"{x:.9g}"
    mantissa, mark, exponent = text.partition("e")
    return (mantissa if "." in mantissa else f"{mantissa}.0") + mark.upper() + exponent


_WRITERS: dict[str, Callable[[Motion, str], str]] = {
    ".csv": _csv,
    ".yaml": _yaml,
    ".yml": _yaml,
    ".c": _c,
    ".h": partial(_c, kept="static "),
    ".st": _st,
}
