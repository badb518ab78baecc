"""`dsd init LOG`: a config that the log itself proposes, and what in it is a guess."""

from __future__ import annotations

import math
import shlex
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from dsd_cli.cli.identification import say
from dsd_cli.cli.init_numbers import propose_numbers
from dsd_cli.cli.init_proposal import (
    UNITS,
    Proposal,
    answer_unit,
    as_told,
    count_open,
    drop_open,
    factors_of,
    is_open,
    name_unit,
    questions,
    settle_units,
    signals_of,
)
from dsd_cli.cli.init_questions import column_question, step_question, without_coarse_stamps
from dsd_cli.cli.init_roles import Chosen, choose
from dsd_cli.cli.init_stamps import finite_stamps, unit_of_stamps
from dsd_cli.cli.init_units import near, step_of, units_of
from dsd_cli.errors import DsdError, UsageError, source_name
from dsd_cli.files.csv_layout import CsvLayout
from dsd_cli.files.first_look import time_unit_of, unit_of_dates
from dsd_cli.files.formats.base import CLOCK
from dsd_cli.files.logs import LoadedLog, load_log
from dsd_cli.files.sample import sample
from dsd_cli.files.tables_in import metadata_of
from dsd_cli.files.template import headed, template_text, with_table, with_value
from dsd_cli.roles import ONLY_CAUSE
from dsd_cli.signals.clock import EPOCHS, TIME_SCALE, YEAR

#: Rows from which everything is proposed.
ROWS = 200_000


class Asked(NamedTuple):
    """What the user said: role -> column, (section, key) -> value; `ask` him for a column, None: nobody is there.

    `tables`: (section, key) -> what is below it, as [model.effects].
    """

    given: Mapping[str, str]
    values: Mapping[tuple[str, str], object]
    layout: CsvLayout | None = None
    ask: Callable[[str, Sequence[str]], str] | None = None
    tables: Mapping[tuple[str, str], Mapping[str, object]] = MappingProxyType({})


class Proposed(NamedTuple):
    """The text of a config, what was guessed, and the question that is left ("" for none), with its command.

    `unread`: why the rows could not be read, and the numbers are not of this log; None: they are.
    """

    text: str
    said: list[str]
    question: str = ""
    command: str = ""
    unread: DsdError | None = None


def propose(path: str, asked: Asked, name: str = "") -> Proposed:
    """A config for that log; `name` is what it is called where that is not its path.

    Raises
    ------
    DataError : it cannot be read. UsageError : a column that was named is not there.
    """
    name, looked = name or path, sample(path, asked.layout, asked.given.values())
    out = Proposal(said=list(looked.notes))
    chosen = choose(source_name(name), looked, asked.given)
    while chosen.missing and asked.ask is not None and not chosen.none_left:
        given = {**asked.given, chosen.missing: asked.ask(chosen.missing, chosen.candidates)}
        try:
            chosen = choose(source_name(name), looked, given)
        except UsageError as error:  # no such column: a slip of the hand
            say(False, f"  {error.message}")
            continue
        asked = asked._replace(given=given)
    chosen = without_coarse_stamps(as_told(chosen, asked.values), None if "time" in asked.given else looked.sample_time)
    out.said += [*chosen.said, *chosen.idle]
    _name_columns(chosen, out)
    if "dsd_version" in metadata_of(path):  # our own logs are in SI
        drop_open(out)
    for (section, key), value in asked.values.items():
        if section == "signals":  # which the numbers below are read by
            out.put(section, key, value)
            if key.endswith("_scale"):
                drop_open(out, [key.removesuffix("_scale")])
    count_open(out)
    unstamped = not chosen.missing and not chosen.clock and "time" not in chosen.found
    step = _rows_apart(chosen, asked, looked.sample_time, out) if unstamped else None
    if unstamped and step is None and asked.ask is not None and (answer := asked.ask("sample_time", ())):
        step = float(answer)
        asked = asked._replace(values={**asked.values, ("signals", "sample_time"): step})
    unread: DsdError | None = None
    if not chosen.missing and (step or not unstamped):
        try:
            loaded, factors = _read(path, chosen, step, asked, out)
        except DsdError as error:
            unread = error
        else:
            said_in_log = chosen.found["time"].time_unit if "time" in chosen.found else None
            doubted = said_in_log is not None and ("signals", "time_unit") not in asked.values
            propose_numbers(loaded, factors, out, doubted, asked.given)
    for (section, key), value in asked.values.items():
        out.put(section, key, value)
        out.comments.pop((section, key), None)
    said = [*out.said, *questions(out)]
    text = headed(template_text("lab"), source_name(name))
    for (section, key), written in out.values.items():
        text = with_value(text, section, key, written, out.comments.get((section, key), ""))
    for (section, key), table in asked.tables.items():
        text = with_table(text, section, key, table)
    if unread is not None:
        text = f"# <- MISSING: its rows could not be read, all numbers below are the template's\n{text}"
    if not chosen.missing and (step or not unstamped):
        return Proposed(text, said, unread=unread)
    left = (column_question if chosen.missing else step_question)(name, chosen, asked.given, text)
    return Proposed(left.text, said, left.question, left.command)


def _rows_apart(chosen: Chosen, asked: Asked, said: float | None, out: Proposal) -> float | None:
    """s between the rows of a log without a clock: as the user, the file or the motion says; None: nothing does."""
    told = asked.values.get(("signals", "sample_time"))
    if isinstance(told, int | float):
        return float(told)
    found, why = step_of(chosen.table, chosen.found), "the file says so"
    if found is not None and not (said and near(found[0], said)):  # a simulator may write every tenth of its steps
        step, named = found
        roles = [f'"{chosen.found[role].column}"' for role in ("velocity", "position")]
        if named:
            why = f"{roles[0]} is the slope of the position then" + (f"; the file says {said:g}" if said else "")
            said = step
        else:
            why += f"; {step:g} if {' and '.join(roles)} are in units that belong together"
    if said:
        out.put("signals", "sample_time", said, why)
    return said


def _name_columns(chosen: Chosen, out: Proposal) -> None:
    if chosen.clock:
        out.put("signals", "time", CLOCK, "the file stamps its rows itself")
    taken = {one.column for one in chosen.found.values()}
    for channel, one in chosen.found.items():
        if chosen.clock and channel == "time":
            continue
        guess = chosen.reasons.get(channel)
        open_yet = [name for name in one.others if name not in taken][:3]
        others = f"; it could be {', '.join(open_yet)} as well" if open_yet else ""
        unit = f", in {one.spoken}" if one.unit else ""
        why = "by its name" if guess is None else guess.reason
        doubt = f"; {guess.doubt}" if guess is not None and guess.doubt else ""
        if guess is not None and guess.doubt == ONLY_CAUSE:
            other = "position" if channel == "velocity" else "velocity"
            doubt += f"; if it is the {other}: --{other} {shlex.quote(one.column)}"
        out.put("signals", channel, one.column, f"{why}{unit}{doubt}{others}")
        name_unit(channel, one, out)
        if channel == "time" and (one.time_unit or chosen.missing):
            out.put("signals", "time_unit", one.time_unit or unit_of_stamps(one, chosen.table))


def _read(
    path: str, chosen: Chosen, told: float | None, asked: Asked, out: Proposal
) -> tuple[LoadedLog, dict[str, float]]:
    found, layout = chosen.found, asked.layout
    names = {c: one.column for c, one in found.items() if c in ("u", "d_hat", "velocity", "position")}
    unit, sample_time = "s", None
    if chosen.clock:
        names = {"t": CLOCK, **names}
    elif (time := found.get("time")) is not None:
        names = {"t": time.column, **names}
        unit = time.time_unit or ""
    else:
        sample_time = told
    if not unit:
        first = load_log(path, names, most_rows=1, layout=layout).log
        step = first.sample_time
        stamps = finite_stamps(names["t"], chosen.table)
        lasts = float(np.ptp(stamps)) if stamps.size else math.inf
        unit = time_unit_of(step, float(first["t"][0]), lasts)
        why = f"not said; steps of {step:g} are taken as {unit}"
        if unit_of_dates(step, float(first["t"][0])):
            year = EPOCHS[unit] + float(first["t"][0]) * TIME_SCALE[unit] / YEAR
            why = f'"{unit}", in which the first stamp is of {int(year)}'
        out.said.append(f"time_unit: {why}; if it is another: --set signals.time_unit=UNIT")
    out.put("signals", "time_unit", unit)
    apart = load_log(path, names, most_rows=ROWS, layout=layout).log.sample_time if chosen.clock else sample_time
    counted = 1.0 if is_open(out, "position") else factors_of(out).get("position", 1.0)
    settle_units(units_of(chosen.table, found, TIME_SCALE[unit], apart, counted), out)
    if asked.ask is not None and is_open(out, "position") and (answer := asked.ask("position_unit", UNITS)):
        answer_unit(out, answer)
        found = {**found, "position": replace(found["position"], unit=answer)}
        settle_units(units_of(chosen.table, found, TIME_SCALE[unit], apart), out)
    factors = factors_of(out)
    scale = TIME_SCALE[unit]
    clock: dict[str, Any] = {"sample_time": sample_time, "time_scale": scale, "offsets": signals_of(out).offsets()}
    loaded = load_log(path, names, **clock, factors=factors, most_rows=ROWS, layout=layout)
    return loaded, factors
