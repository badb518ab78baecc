"""What a log does not say of itself: the question to its owner, the command that answers it, the line of the config."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from dsd_cli.cli.init_roles import GIVEN, Chosen, Coarse
from dsd_cli.cli.init_stamps import is_count_of_rows, unit_of_stamps
from dsd_cli.cli.init_units import step_of
from dsd_cli.errors import printable
from dsd_cli.files.recognise import role_of_unit, unit_in
from dsd_cli.files.template import with_value
from dsd_cli.signals.clock import TIME_SCALE

#: A time is coarser than the rows where it stands still in this share of the steps from row to row.
COARSE = 0.5


class Question(NamedTuple):
    """The config with the missing line marked, the question, and the command that answers it; "": nothing can."""

    text: str
    question: str
    command: str


def without_coarse_stamps(chosen: Chosen, apart: float | None = None) -> Chosen:
    """Without a time that stands still from row to row in half of them or more, or that counts rows of which the file
    says how many s they are `apart`.

    One row of each stamp would be left, and of a faster u a sample in place of its mean.
    """
    time = chosen.found.get("time")
    found = {role: one for role, one in chosen.found.items() if role != "time"}
    if is_count_of_rows(time, chosen.table, apart):
        return replace(chosen, found=found)
    channels = () if time is None or chosen.table is None else chosen.table.channels
    values = next((one.values for one in channels if time is not None and one.name == time.column), None)
    stamps = np.zeros(1) if values is None else values[np.isfinite(values)]
    steps = np.diff(stamps)
    if time is None or not steps.any() or steps.min() < 0.0 or np.mean(steps == 0.0) < COARSE:
        return chosen
    apart = float(f"{TIME_SCALE[unit_of_stamps(time, chosen.table)] * (stamps[-1] - stamps[0]) / steps.size:.3g}")
    what = f'"{time.column}" stands still in {100 * np.mean(steps == 0.0):.0f} % of them; {apart:g} if they are even'
    return replace(chosen, found=found, coarse=Coarse(what, apart))


def step_question(path: str, chosen: Chosen, given: Mapping[str, str], text: str) -> Question:
    """The question for the time from row to row, with what the motion, or stamps that are too coarse, make of it."""
    found = step_of(chosen.table, chosen.found)
    what, value = "how many s are its rows apart? nothing in it says", "SECONDS"
    if chosen.coarse is not None:
        what, value = f"how many s are its rows apart? {chosen.coarse.what}", f"{chosen.coarse.apart:g}"
    elif found is not None:
        value = f"{found[0]:g}"
        velocity, position = (chosen.found[role].column for role in ("velocity", "position"))
        what += f'; {value} if "{velocity}" and "{position}" are in units that belong together (rad/s and rad)'
    text = with_value(text, "signals", "sample_time", "0.0", "# <- MISSING: s from row to row")
    options = _options({role: column for role, column in given.items() if role in GIVEN})
    command = f"dsd init {shlex.quote(path)} --force {options}--set signals.sample_time={value}"
    return Question(text, what, command)


def column_question(path: str, chosen: Chosen, given: Mapping[str, str], text: str) -> Question:
    """What is left to say, the command that says it, and the line of the config in which it is missing."""
    what = "the control input (torque, force, current, voltage)" if chosen.missing == "u" else "the motion"
    listed = ", ".join(chosen.candidates[:8]) + (" ..." if len(chosen.candidates) > 8 else "")
    role, other = chosen.missing, ("velocity", "a speed")
    if role != "u" and listed and all(_is_speed(chosen, name) for name in chosen.candidates):
        role, other = "velocity", ("position", "a place")
    text = with_value(text, "signals", role, '""', printable(f"# <- MISSING: {what}{listed and f'; one of {listed}'}"))
    kind, none = "motion", bool(chosen.idle) and not chosen.candidates
    if chosen.missing == "u":
        kind, none = "control input", chosen.none_left and not chosen.again
    if none:
        why = f" that changes: {' and '.join(chosen.idle)}" if chosen.idle else ""
        return Question(text, f"this log has no {kind}{why}; dsd needs one", "")
    moves = any(one in chosen.found for one in ("d_hat", "velocity", "position"))
    if "u" not in chosen.found and not moves and not chosen.elsewhere and len(chosen.left) < 2:
        one = f'only "{chosen.left[0]}"' if chosen.left else "no column"
        return Question(text, f"{one} changes as a control input or a motion does: dsd needs one of each", "")
    named = {role: column for role, column in given.items() if role in GIVEN and role != "u"}
    named = {"u": given.get("u", chosen.found["u"].column if "u" in chosen.found else "NAME"), **named}
    if not moves:
        named.setdefault("velocity" if role == "velocity" else "position", "NAME")
    command = f"dsd init {shlex.quote(path)} --force {_options(named)}".rstrip()
    here = set() if chosen.table is None else {c.name for c in chosen.table.channels}
    listed += " (of another time base: both are joined)" * bool(listed and here.isdisjoint(chosen.candidates))
    speed = f" (--{other[0]} NAME, if it is {other[1]})" * bool(listed and chosen.missing != "u")
    return Question(text, f"which column is {what}? {listed or 'none looks like it'}{speed}", command)


def _is_speed(chosen: Chosen, name: str) -> bool:
    """Whether the unit of a column, or the end of its name, says so."""
    units = {} if chosen.table is None else {one.name: one.unit for one in chosen.table.channels}
    return role_of_unit(units.get(name) or unit_in(name, "velocity")) == "velocity"


def _options(named: Mapping[str, str]) -> str:
    return "".join(f"--{role} {shlex.quote(column)} " for role, column in named.items())
