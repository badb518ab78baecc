"""Modelica: a package with a sampled block, the axis one sample further at each tick of its clock."""

from __future__ import annotations

import sys
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from dsd_cli.errors import how_to_install
from dsd_cli.export import spelling
from dsd_cli.export.base import Joint, Motion, NotRun, Target, comment, finite, number
from dsd_cli.export.computing import judge, ran, scratch
from dsd_cli.export.emit import Syntax
from dsd_cli.export.expression import FUNCTIONS
from dsd_cli.export.program import program
from dsd_cli.export.vector_text import Layout, begin_texts, step_text
from dsd_cli.signals.log import Array

#: Samples that rumoca is given at most, at about 1 ms each, and s that it may take.
_MOST, _LONGEST = 5000, 60.0
_WORKER = """
import sys
import numpy as np
import rumoca

model, until, step = sys.argv[1:]
try:
    result = rumoca.Session().loads(sys.stdin.read(), model=model).simulate(float(until), dt=float(step))
    np.save("found.npy", np.array([result["time"], result["velocity"]], dtype=float))
except Exception as error:
    sys.exit(" ".join(str(error).split())[:200])
"""


def _digits(value: float) -> str:
    """No operator may stand before a minus."""
    return number(value) if value >= 0.0 else f"({number(value)})"


MODELICA = Syntax(
    digits=_digits,
    assign="{name} := {value};",
    declare="",
    blank="",
    if_="if {0} then",
    else_="else",
    end="end if;",
    for_="for {i} in 0:{last} loop",
    end_for="end for;",
    call={**{name: f"{name}({{0}})" for name in FUNCTIONS}},
    negate="(not {0})",
    power="({0} ^ {1})",
    index="{0}",
    ternary="(if {0} then {1} else {2})",
    spelt={"expm1": spelling.expm1, "log1p": spelling.log1p},
)

_TEXT = """package {name} "{title}"
  // One axis as `dsd simulate` has it. Parts: {parts}.
  // x: {words}.
  constant Real sampleTime = {clock};
  function step "The state one sample further, under the command u"
    input Real x[{size}];
    input Real u;
    output Real y[{size}];
  protected
    Real z[{size}] = x;
    Real t = 0.0;
    Real ts = 0.0;{locals}
  algorithm
{step}
    y := z;
  end step;

  block Axis "u is the command; velocity and position are those at each tick"
    parameter Real q = 0.0 "position at the start";
    parameter Real v = 0.0 "velocity at the start";
    input Real u;
    output Real position;
    output Real velocity;
  protected
    discrete Real x[{size}](start = {{{state}}}, each fixed = true);
    discrete Real now[2](start = {{q, v}}, each fixed = true);
  equation
    when sample(0.0, {clock}) then
      now = {{pre(x[1]), pre(x[2])}};
      x = step(pre(x), u);
    end when;
    position = now[1];
    velocity = now[2];
  end Axis;
end {name};
"""


def _write(joint: Joint) -> bytes:
    layout = Layout(program(joint), lambda i: f"z[{i + 1}]", lambda i: f"z[{i} + 1]")
    text = step_text(layout, MODELICA, 2)
    return _TEXT.format(
        name=joint.name,
        title=comment(f"{joint.name}: written by dsd export"),
        parts=comment(", ".join(joint.parts)),
        words=comment(
            ", ".join([*layout.words()[:3], "past u as it acts, newest first", *layout.words()[3 + layout.held :]])
        ),
        clock=number(joint.sample_time),
        size=layout.size,
        locals="".join(f"\n    Real {name} = 0.0;" for name in text.reals),
        step="\n".join(text.lines),
        state=", ".join(begin_texts(layout, MODELICA, {})),
    ).encode("ascii")


def _run(content: bytes, joint: Joint, motion: Motion) -> Array:
    """By rumoca, which takes no u over time: u is a table of the block then, and its start values are numbers."""
    if find_spec("rumoca") is None:
        raise NotRun(f"rumoca is not installed: {how_to_install('export')}")
    text = content.decode()
    table = ", ".join(number(x) for x in (*motion.u, 0.0))
    clock = "    discrete Integer tick(start = 1, fixed = true);\n"
    given = f"    constant Real table[{len(motion.u) + 1}] = {{{table}}};\n"
    text = text.replace("    input Real u;\n    output Real position;", f"{given}{clock}    output Real position;")
    text = text.replace(
        "      x = step(pre(x), u);", "      tick = pre(tick) + 1;\n      x = step(pre(x), table[pre(tick)]);"
    )
    for name, value in (("q", motion.position), ("v", motion.velocity)):
        text = text.replace(f"parameter Real {name} = 0.0", f"parameter Real {name} = {number(value)}")
    step, last = joint.sample_time, (len(motion.u) - 1) * joint.sample_time
    times, velocity = _simulated(text, f"{joint.name}.Axis", last + 0.4 * step, 0.5 * step)
    at = np.searchsorted(times, (np.arange(len(motion.u)) + 0.25) * step, side="right") - 1
    return finite(velocity[at], "Modelica")


def _simulated(text: str, model: str, until: float, step: float) -> Array:
    """(times, velocities), shape (2, n). In a process of its own: rumoca heeds no signal before it is done."""
    with scratch() as folder:
        command = [sys.executable, "-c", _WORKER, model, repr(until), repr(step)]
        done = ran(command, text.encode(), _LONGEST, folder)
        if done.returncode != 0:
            why = done.stderr.decode(errors="replace").strip()
            raise NotRun(f"rumoca does not take it: {why[-200:]}")
        found: Array = np.load(Path(folder) / "found.npy")
    return found


TARGET = Target(
    id="modelica",
    summary="Modelica: a package with the axis as a sampled block.",
    suffix=".mo",
    judge=judge,
    write=_write,
    run=_run,
    most=_MOST,
)
