"""A Python module without dependencies: the same functions as in C, and the axis itself."""

from __future__ import annotations

import sys
from pathlib import Path

from dsd_cli.export.base import Joint, Motion, Target, comment, number
from dsd_cli.export.computing import judge, scratch, velocities
from dsd_cli.export.control import control
from dsd_cli.export.emit import Syntax, statements
from dsd_cli.export.expression import FUNCTIONS
from dsd_cli.export.program import Outputs, Program, program
from dsd_cli.export.vector_text import Layout, begin_texts, step_text
from dsd_cli.signals.log import Array

PYTHON = Syntax(
    assign="{name} = {value}",
    declare="",
    blank="",
    if_="if {0}:",
    else_="else:",
    end="",
    for_="for {i} in range({count}):",
    end_for="",
    call={**{name: f"math.{name}({{0}})" for name in FUNCTIONS}, "abs": "abs({0})"},
    negate="(not {0})",
    power="({0} ** {1})",
    atan2="math.atan2({0}, {1})",
    index="{0}",
    ternary="({1} if {0} else {2})",
)

_TEXT = '''"""{title}

One axis as `dsd simulate` has it. Parts: {parts}.
t in s, u in the unit of the log, q and v in rad and rad/s or m and m/s: of the middle of the sample that begins at t.
A delay, and a lag of the actuator, are not led by feedforward and compensation: give them the reference of so much
later. Each method is called once a sample, for it takes what effects remember a sample further.
"""

import math

SAMPLE_TIME = {clock}
INERTIA = {inertia}
DELAY = {delay}


class Effects:
    """What a controller takes; e: {remembered}."""

    def __init__(self, q=0.0, v=0.0):
        self.e = [{effects}]
{control}

class Axis:
    """The axis itself; z: position, velocity, samples, past u as it acts (newest first), what effects remember."""

    def __init__(self, q=0.0, v=0.0):
        self.z = [{state}]

    @property
    def position(self):
        return self.z[0]

    @property
    def velocity(self):
        return self.z[1]

    def step(self, u):
        """One sample further, under the command u."""
        z = self.z
{step}
'''


def _write(joint: Joint) -> bytes:
    found = program(joint)
    layout = Layout(found, lambda i: f"z[{i}]", lambda i: f"z[{i}]")
    state = begin_texts(layout, PYTHON, {})
    first = len(state) - len(found.start) - len(found.resting)
    text = _TEXT.format(
        title=comment(f"{joint.name}: written by dsd export"),
        parts=comment(", ".join(joint.parts)),
        clock=number(joint.sample_time),
        inertia=number(joint.model.inertia),
        delay=number(joint.model.delay),
        remembered=comment(", ".join(found.start) or "nothing"),
        effects=", ".join(state[first : first + len(found.start)]),
        control="\n".join(_control(found)),
        state=", ".join(state),
        step="\n".join(step_text(layout, PYTHON, 2).lines),
    )
    return text.encode("ascii")


def _control(found: Program) -> list[str]:
    parts = control(found.joint)
    names = {state: f"e[{i}]" for i, state in enumerate(found.start)}

    def one(what: str, outputs: Outputs, key: str, given: str, words: str) -> str:
        targets = {"result": outputs[key], **{names[s]: outputs[s] for s in found.start}}
        lines = statements(targets, PYTHON, names, 2).lines
        head = [f"    def {what}(self, {given}):", f'        """{words}"""', "        e = self.e"]
        return "\n".join(["", *head, *lines, "        return result"])

    return [
        one("feedforward", parts.feedforward, "u", "t, q, v, a", "u for a reference motion."),
        one("compensation", parts.compensation, "u", "t, u, q, v, direction", "u that cancels the effects."),
        one(
            "friction", parts.friction, "friction", "t, u, q, v", "The force of friction alone; at rest what it holds."
        ),
    ]


_MAIN = """
if __name__ == "__main__":
    import struct, sys
    axis = Axis({position}, {velocity})
    while len(read := sys.stdin.buffer.read(8)) == 8:
        sys.stdout.buffer.write(struct.pack("<d", axis.velocity))
        axis.step(*struct.unpack("<d", read))
"""


def _run(content: bytes, joint: Joint, motion: Motion) -> Array:
    main = _MAIN.format(position=number(motion.position), velocity=number(motion.velocity))
    with scratch() as folder:
        path = Path(folder) / "joint.py"
        path.write_text(content.decode() + main, encoding="ascii")
        return velocities([sys.executable, "-I", str(path)], motion)


TARGET = Target(
    id="python",
    summary="Python: one module without dependencies.",
    suffix=".py",
    judge=judge,
    write=_write,
    run=_run,
)
