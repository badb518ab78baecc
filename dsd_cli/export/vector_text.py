"""A joint whose state is one vector of numbers, as statements of a language: position, speed, count of samples, past
values of u as it acts (newest first), what effects and then what input effects remember."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from dsd_cli.export.emit import Syntax, Text, statements
from dsd_cli.export.expression import Expression
from dsd_cli.export.program import Outputs, Program

#: Position, speed, count of samples.
_BEFORE_HELD = 3


@dataclass(frozen=True)
class Layout:
    """Where each number of the state is, and what it is; `cell` writes the element of that number, counted from 0."""

    found: Program
    cell: Callable[[int], str]
    moving: Callable[[str], str]

    @property
    def held(self) -> int:
        return self.found.samples + 2

    @property
    def size(self) -> int:
        return _BEFORE_HELD + self.held + len(self.found.start) + len(self.found.resting)

    def names(self) -> dict[str, str]:
        """Symbol -> element."""
        first = _BEFORE_HELD + self.held
        states = {name: self.cell(first + i) for i, name in enumerate((*self.found.start, *self.found.resting))}
        return {"q": self.cell(0), "v": self.cell(1), **states}

    def words(self) -> list[str]:
        """What each element is."""
        held = ["u as it acts"] + [f"the same {i} samples ago" for i in range(1, self.held)]
        return ["position", "velocity", "samples", *held, *self.found.start, *self.found.resting]

    def begin(self) -> list[Expression | float]:
        """Values before the first sample; of q and v."""
        from dsd_cli.export.program import Q, V

        return [Q, V, 0.0, *[self.found.held] * self.held, *self.found.start.values(), *self.found.resting.values()]


def step_text(layout: Layout, syntax: Syntax, indent: int) -> Text:
    """The state one sample further, under the command `u`; `t` and `ts` are reals that it needs."""
    found, names = layout.found, layout.names()
    pad, step, n = "    " * indent, found.joint.sample_time, layout.held
    at = syntax.assign.format
    lines = [pad + at(name="t", value=f"({layout.cell(2)} * {syntax.digits(step)})")]
    lines.append(pad + syntax.for_.format(i="i", count=n - 1, last=n - 2))
    last = _BEFORE_HELD + n - 1
    lines.append(pad + "    " + at(name=layout.moving(f"{last} - i"), value=layout.moving(f"{last - 1} - i")))
    lines += [pad + syntax.end_for] if syntax.end_for else []
    newest = layout.cell(_BEFORE_HELD)
    driven = statements({newest: found.drive["u"], **_states(names, found.drive, found.resting)}, syntax, names, indent)
    texts = [driven]
    lines += driven.lines
    for one in found.stretches:
        act = layout.cell(_BEFORE_HELD + n - (1 if one.older else 2))
        lines.append(pad + syntax.for_.format(i="i", count=one.substeps, last=one.substeps - 1))
        index = syntax.index.format("i")
        start = f"((t + {syntax.digits(one.offset)}) + ({index} * {syntax.digits(one.length)}))"
        lines.append(pad + "    " + at(name="ts", value=start))
        inside = {**names, "t": "ts", "u": act, "h": syntax.digits(one.length)}
        text = statements({names[key]: e for key, e in found.substep.items()}, syntax, inside, indent + 1)
        texts.append(text)
        lines += text.lines + ([pad + syntax.end_for] if syntax.end_for else [])
    lines.append(pad + at(name=layout.cell(2), value=f"({layout.cell(2)} + {syntax.digits(1.0)})"))
    return Text(lines, _longest([t.reals for t in texts]), _longest([t.counters for t in texts]))


def _states(names: dict[str, str], outputs: Outputs, which: dict[str, float]) -> Outputs:
    return {names[state]: outputs[state] for state in which}


def _longest(lists: list[list[str]]) -> list[str]:
    return max(lists, key=len)


def begin_texts(layout: Layout, syntax: Syntax, names: dict[str, str]) -> list[str]:
    """The elements before the first sample, as expressions of q and v."""
    found = []
    for value in layout.begin():
        if isinstance(value, Expression):
            text = statements({"": value}, _bare(syntax), names, 0)
            assert len(text.lines) == 1, "what an effect remembers at the start is a plain expression"
            found.append(text.lines[0])
        else:
            found.append(syntax.digits(value))
    return found


def _bare(syntax: Syntax) -> Syntax:
    from dataclasses import replace

    return replace(syntax, assign="{value}")
