"""MATLAB: the file of a discrete-time idnlgrey model, the axis one sample further."""

from __future__ import annotations

from dsd_cli.export.base import Joint, Target, comment, number
from dsd_cli.export.computing import judge
from dsd_cli.export.emit import Syntax
from dsd_cli.export.expression import FUNCTIONS
from dsd_cli.export.program import program
from dsd_cli.export.vector_text import Layout, begin_texts, step_text

MATLAB = Syntax(
    assign="{name} = {value};",
    declare="",
    blank="",
    if_="if {0}",
    else_="else",
    end="end",
    for_="for {i} = 0:{last}",
    end_for="end",
    call={name: f"{name}({{0}})" for name in FUNCTIONS},
    negate="(~{0})",
    power="({0} ^ {1})",
    index="{0}",
)

_TEXT = """function [dx, y] = {name}(~, x, u, varargin)
% {title}
% One axis as dsd simulate has it. Parts: {parts}.
% dx is the state one sample further under the command u, y is velocity and position when u begins to act:
%     start = @(q, v) [{start}];
%     model = idnlgrey("{name}", [2 1 {size}], {{}}, start(0, 0), {clock});   % from position 0 at speed 0
% x: {words}.
z = x;
{step}
dx = z;
y = [x(2); x(1)];
end
"""


def _write(joint: Joint) -> bytes:
    layout = Layout(program(joint), lambda i: f"z({i + 1})", lambda i: f"z({i} + 1)")
    words = [*layout.words()[:3], "past u as it acts, newest first", *layout.words()[3 + layout.held :]]
    return _TEXT.format(
        name=joint.name,
        title=comment(f"{joint.name}: written by dsd export"),
        parts=comment(", ".join(joint.parts)),
        start="; ".join(begin_texts(layout, MATLAB, {})),
        size=layout.size,
        clock=number(joint.sample_time),
        words=comment(", ".join(words)),
        step="\n".join(step_text(layout, MATLAB, 0).lines),
    ).encode("ascii")


TARGET = Target(
    id="matlab",
    summary="MATLAB: the file of a discrete-time idnlgrey model.",
    suffix=".m",
    judge=judge,
    write=_write,
    not_run="there is no MATLAB here",
)
