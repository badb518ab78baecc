"""What a log does not say of itself: the question to its owner, the command that answers it, the line of the config."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from typing import NamedTuple

from dsd_cli.cli.init_roles import Chosen
from dsd_cli.cli.init_units import step_of
from dsd_cli.errors import printable
from dsd_cli.files.template import with_value


class Question(NamedTuple):
    """The config with the missing line marked, the question, and the command that answers it."""

    text: str
    question: str
    command: str


def step_question(path: str, chosen: Chosen, given: Mapping[str, str], text: str) -> Question:
    """The question for the time from row to row, with what the motion would make of it."""
    found = step_of(chosen.table, chosen.found)
    what, value = "how many s are its rows apart? nothing in it says", "SECONDS"
    if found is not None:
        value = f"{found[0]:g}"
        velocity, position = (chosen.found[role].column for role in ("velocity", "position"))
        what += f'; {value} if "{velocity}" and "{position}" are in units that belong together (rad/s and rad)'
    text = with_value(text, "signals", "sample_time", "0.0", "# <- MISSING: s from row to row")
    options = " ".join(f"--{role} {shlex.quote(column)}" for role, column in given.items())
    command = f"dsd init {shlex.quote(path)} --force {options + ' ' * bool(options)}--set signals.sample_time={value}"
    return Question(text, what, command)


def column_question(path: str, chosen: Chosen, given: Mapping[str, str], text: str) -> Question:
    """What is left to say, the command that says it, and the line of the config in which it is missing."""
    what = "the control input (torque, force, current, voltage)" if chosen.missing == "u" else "the motion"
    listed = ", ".join(chosen.candidates[:8]) + (" ..." if len(chosen.candidates) > 8 else "")
    text = with_value(
        text, "signals", chosen.missing, '""', printable(f"# <- MISSING: {what}{listed and f'; one of {listed}'}")
    )
    moves = any(one in chosen.found for one in ("d_hat", "velocity", "position"))
    named = {role: column for role, column in given.items() if role != "u"}
    named = {"u": given.get("u", chosen.found["u"].column if "u" in chosen.found else "NAME"), **named}
    if not moves:
        named.setdefault("position", "NAME")
    options = " ".join(f"--{role} {shlex.quote(column)}" for role, column in named.items())
    command = f"dsd init {shlex.quote(path)} --force {options}"
    return Question(text, f"which column is {what}? {listed or 'none looks like it'}", command)
