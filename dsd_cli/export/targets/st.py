"""IEC 61131-3 structured text: function blocks for a controller, and one for the axis itself."""

from __future__ import annotations

from dsd_cli.export import spelling
from dsd_cli.export.base import Joint, Target, comment, number
from dsd_cli.export.computing import judge
from dsd_cli.export.control import control
from dsd_cli.export.emit import Syntax, Text, statements
from dsd_cli.export.program import Outputs, Program, program
from dsd_cli.export.vector_text import Layout, begin_texts, step_text


def _digits(value: float) -> str:
    """A real literal has a point, and no operator may stand before a minus."""
    mantissa, _, exponent = number(abs(value)).partition("e")
    text = (mantissa if "." in mantissa else f"{mantissa}.0") + (f"E{int(exponent)}" if exponent else "")
    return f"(-{text})" if value < 0.0 else text


ST = Syntax(
    assign="{name} := {value};",
    declare="",
    blank="",
    if_="IF {0} THEN",
    else_="ELSE",
    end="END_IF;",
    for_="FOR {i} := 0 TO {last} DO",
    end_for="END_FOR;",
    call={
        **{name: f"{name.upper()}({{0}})" for name in ("exp", "sin", "cos", "tan", "atan", "sqrt", "abs")},
        "log": "LN({0})",
    },
    infix={"==": "="},
    negate="(NOT {0})",
    power="EXPT({0}, {1})",
    digits=_digits,
    index="DINT_TO_LREAL({0})",
    ternary="SEL({0}, {2}, {1})",
    spelt={name: getattr(spelling, name) for name in ("expm1", "log1p", "sinh", "cosh", "tanh", "atan2")},
)

_HEAD = """(* {title}
   One axis as dsd simulate has it. Parts: {parts}.
   t in s, u in the unit of the log, q and v in rad and rad/s or m and m/s: of the middle of the sample from t on.
   Clock {clock} s: call each block once in it. A delay, and a lag of the actuator, are not led: give Feedforward and
   Compensation the reference of so much later. *)
"""
_BLOCK = """
(* {words} *)
FUNCTION_BLOCK {name}
VAR_INPUT
    {inputs} : LREAL;
END_VAR
VAR_OUTPUT
    {outputs} : LREAL;
END_VAR
VAR
    begun : BOOL := FALSE;
    {locals} : LREAL;{counters}
    {state} : ARRAY[0..{last}] OF LREAL;
END_VAR
    IF NOT begun THEN
        begun := TRUE;
{begin}
    END_IF;
{body}
END_FUNCTION_BLOCK
"""


def _write(joint: Joint) -> bytes:
    found = program(joint)
    title, parts = comment(f"{joint.name}: written by dsd export"), comment(", ".join(joint.parts))
    text = _HEAD.format(title=title, parts=parts, clock=number(joint.sample_time))
    return (text + "".join(_control(found)) + _axis(found)).encode("ascii")


def _block(name: str, words: str, ports: tuple[str, str], body: Text, begin: list[str]) -> str:
    state = "z" if name.endswith("_Axis") else "e"
    counters = f"\n    {', '.join(['i', *body.counters])} : DINT;"
    return _BLOCK.format(
        name=name,
        words=words,
        inputs=ports[0],
        outputs=ports[1],
        locals=_wrapped([*(["t", "ts"] if state == "z" else []), *body.reals, "spare"]),
        counters=counters,
        state=state,
        last=max(len(begin), 1) - 1,
        begin="\n".join(f"        {state}[{i}] := {value};" for i, value in enumerate(begin or ["0.0"])),
        body="\n".join(body.lines),
    )


def _wrapped(names: list[str]) -> str:
    """Names in lines of a dozen."""
    return ",\n    ".join(", ".join(names[i : i + 12]) for i in range(0, len(names), 12))


def _control(found: Program) -> list[str]:
    parts, name = control(found.joint), found.joint.name
    names = {state: f"e[{i}]" for i, state in enumerate(found.start)}
    begin = begin_texts(Layout(found, str, str), ST, {})
    first = len(begin) - len(found.start) - len(found.resting)
    begin = begin[first : first + len(found.start)]

    def one(what: str, outputs: Outputs, key: str, ports: tuple[str, str], words: str) -> str:
        targets = {ports[1]: outputs[key], **{names[s]: outputs[s] for s in found.start}}
        return _block(f"{name}_{what}", words, ports, statements(targets, ST, names, 1), begin)

    feed, cancel = "u for a reference motion", "command that cancels the effects at the measured motion"
    return [
        one("Feedforward", parts.feedforward, "u", ("t, q, v, a", "command"), feed),
        one("Compensation", parts.compensation, "u", ("t, u, q, v, direction", "command"), cancel),
        one("Friction", parts.friction, "friction", ("t, u, q, v", "force"), "friction alone; at rest what it holds"),
    ]


def _axis(found: Program) -> str:
    layout = Layout(found, lambda i: f"z[{i}]", lambda i: f"z[{i}]")
    body = step_text(layout, ST, 1)
    body.lines[:0] = ["    velocity := z[1];", "    position := z[0];"]
    words = "the axis itself: velocity and position when u begins to act; q and v are those at the start"
    ports = ("u, q, v", "velocity, position")
    return _block(f"{found.joint.name}_Axis", words, ports, body, begin_texts(layout, ST, {}))


TARGET = Target(
    id="st",
    summary="IEC 61131-3 structured text: function blocks.",
    suffix=".st",
    judge=judge,
    write=_write,
    not_run="there is no PLC here",
)
