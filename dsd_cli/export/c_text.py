"""C99 of a joint: one header of inline functions, without allocation and without anything but <math.h>."""

from __future__ import annotations

from dsd_cli.export import expression
from dsd_cli.export.base import Joint, comment, number
from dsd_cli.export.control import control
from dsd_cli.export.emit import Syntax, statements
from dsd_cli.export.expression import Expression
from dsd_cli.export.program import Outputs, Program, program

C = Syntax(
    assign="{name} = {value};",
    declare="const double {name} = {value};",
    blank="double {name};",
    if_="if {0} {{",
    else_="} else {",
    end="}",
    for_="for (int {i} = 0; {i} < {count}; {i}++) {{",
    end_for="}",
    call={n: n + "({0})" for n in ("exp", "expm1", "log", "log1p", "sin", "cos", "tan", "sinh", "cosh", "tanh", "sqrt")}
    | {"atan": "atan({0})", "abs": "fabs({0})"},
    carried="double {name} = {value};",
    ternary="({0} ? {1} : {2})",
)

_HEAD = """/* {title}
 * One axis as `dsd simulate` has it: inertia {inertia}, delay {delay} s, clock {clock} s.
 * Parts: {parts}.
 *
 * {name}_feedforward   u for a reference motion: inertia times acceleration less the forces of all effects
 * {name}_compensation  u that cancels the effects at the measured motion
 * {name}_friction      the force of friction alone; at rest what it holds
 * {name}_plant_step    the axis itself under u, one sample further
 *
 * t in s, u in the unit of the log, q and v in rad and rad/s or m and m/s: of the middle of the sample from t on.
 * A delay, and a lag of the actuator, are not led by the first two: give them the reference of so much later.
 * Each is called once a sample, for it takes what effects remember a sample further.
 */
"""


def header(joint: Joint) -> str:
    """The header.

    Raises
    ------
    Refused : a law that cannot be an expression.
    """
    name, found = joint.name, program(joint)
    guard = f"{name.upper()}_H"
    head = _HEAD.format(
        title=comment(f"{name}: written by dsd export"),
        inertia=number(joint.model.inertia),
        delay=number(joint.model.delay),
        clock=number(joint.sample_time),
        parts=comment(", ".join(joint.parts)),
        name=name,
    )
    parts = [head, f"#ifndef {guard}\n#define {guard}\n\n#include <math.h>\n", _types(found), *_control(found)]
    parts += [_init(found), _drive(found), _substep(found), _step(found), f"#endif /* {guard} */\n"]
    return "\n".join(parts)


def _types(found: Program) -> str:
    name = found.joint.name
    states = [*found.start] or ["nothing"]
    inputs = [*found.resting] or ["nothing"]
    return "\n".join(
        [
            "/* what effects remember from sample to sample */",
            f"typedef struct {{ double {', '.join(states)}; }} {name}_effects;",
            "/* what the actuator remembers */",
            f"typedef struct {{ double {', '.join(inputs)}; }} {name}_actuator;",
            "/* the axis: held is u as it acts, newest first */",
            f"typedef struct {{\n    double position, velocity, held[{found.samples + 2}];\n    unsigned long sample;",
            f"    {name}_effects effects;\n    {name}_actuator actuator;\n}} {name}_plant;\n",
        ]
    )


def function(
    head: str, outputs: dict[str, Expression], names: dict[str, str], given: list[str], result: str = ""
) -> str:
    """One inline function whose outputs are assigned; `given`: arguments, of which some may not be used."""
    body = statements(outputs, C, names).lines
    first = [f"    double {result};"] if result else []
    last = [f"    return {result};"] if result else []
    unused = [f"    (void){one};" for one in given]
    return "\n".join([f"static inline {head}\n{{", *first, *unused, *body, *last, "}\n"])


def _control(found: Program) -> list[str]:
    joint, name = found.joint, found.joint.name
    parts = control(joint)
    names = {state: f"e->{state}" for state in found.start}

    def one(what: str, outputs: Outputs, key: str, given: list[str]) -> str:
        targets = {"result": outputs[key], **{names[s]: outputs[s] for s in found.start}}
        arguments = ", ".join(f"double {g}" for g in given)
        head = f"double {name}_{what}({name}_effects *e, {arguments})"
        return function(head, targets, names, ["e", *given], "result")

    return [
        one("feedforward", parts.feedforward, "u", ["t", "q", "v", "a"]),
        one("compensation", parts.compensation, "u", ["t", "u", "q", "v", "direction"]),
        one("friction", parts.friction, "friction", ["t", "u", "q", "v"]),
    ]


def _init(found: Program) -> str:
    name = found.joint.name
    targets = {f"e->{state}": e for state, e in found.start.items()} or {"e->nothing": expression.number(0.0)}
    head = f"void {name}_effects_init({name}_effects *e, double q, double v)"
    begin = function(head, targets, {}, ["q", "v"])
    actuator = [f"    p->actuator.{s} = {number(x)};" for s, x in found.resting.items()]
    return begin + "\n".join(
        [
            f"\nstatic inline void {name}_plant_init({name}_plant *p, double q, double v)\n{{",
            "    p->position = q;\n    p->velocity = v;\n    p->sample = 0;",
            f"    for (int i = 0; i < {found.samples + 2}; i++) p->held[i] = {number(found.held)};",
            *(actuator or ["    p->actuator.nothing = 0.0;"]),
            f"    {name}_effects_init(&p->effects, q, v);\n}}\n",
        ]
    )


def _drive(found: Program) -> str:
    name = found.joint.name
    names = {state: f"s->{state}" for state in found.resting}
    targets = {"result": found.drive["u"], **{names[s]: found.drive[s] for s in found.resting}}
    head = f"double {name}_drive({name}_actuator *s, double t, double u)"
    return "/* u as it acts, from the command */\n" + function(head, targets, names, ["s", "t", "u"], "result")


def _substep(found: Program) -> str:
    name = found.joint.name
    names = {"q": "p->position", "v": "p->velocity", **{s: f"p->effects.{s}" for s in found.start}}
    targets = {names[key]: e for key, e in found.substep.items()}
    head = f"void {name}_substep({name}_plant *p, double t, double u, double h)"
    return "/* the axis h s further, under a u that acts from t on */\n" + function(
        head, targets, names, ["t", "u", "h"]
    )


def _step(found: Program) -> str:
    joint, name = found.joint, found.joint.name
    step, n = number(joint.sample_time), found.samples
    lines = [
        "/* the axis one sample further, under the command u */",
        f"static inline void {name}_plant_step({name}_plant *p, double u)\n{{",
        f"    const double t = (double)p->sample * {step};",
        f"    for (int i = {n + 1}; i > 0; i--) p->held[i] = p->held[i - 1];",
        f"    p->held[0] = {name}_drive(&p->actuator, t, u);",
    ]
    for one in found.stretches:
        at = f"t + {number(one.offset)} + (double)i * {number(one.length)}"
        act = f"p->held[{n + 1 if one.older else n}]"
        lines.append(f"    for (int i = 0; i < {one.substeps}; i++)")
        lines.append(f"        {name}_substep(p, {at}, {act}, {number(one.length)});")
    return "\n".join([*lines, "    p->sample++;\n}\n"])
