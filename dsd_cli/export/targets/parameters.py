"""Values as a CSV file: one row per value, with its unit and meaning; lists are JSON."""

from __future__ import annotations

import csv
import io
import json

from dsd_cli.export.base import DELAY, INERTIA, Joint, Target, Verdict, number


def _judge(joint: Joint, part: str) -> Verdict:
    return Verdict(part, True, "its values, by name")


def _write(joint: Joint) -> bytes:
    out, words = io.StringIO(), joint.units.words
    rows = csv.writer(out, lineterminator="\n")
    rows.writerow(["part", "parameter", "value", "unit", "meaning"])
    rows.writerow([INERTIA, "", number(joint.model.inertia), _plain(words("{u}/({v}/s)")), "J of the whole axis"])
    rows.writerow([DELAY, "", number(joint.model.delay), "s", "L of the command"])
    for name, values in joint.model.effects.items():
        effect = joint.effect(name)
        assert effect is not None
        for parameter in (one for one in effect.parameters if one.name in values):  # an optional one may be left out
            unit, meaning = words(parameter.unit), parameter.meaning
            value = values[parameter.name]
            text = number(value) if parameter.numeric else json.dumps(value, allow_nan=False)
            rows.writerow([name, parameter.name, text, _plain(unit), meaning])
    return out.getvalue().encode()


def _plain(unit: str) -> str:
    """A unit that a spreadsheet takes for no formula."""
    return f" {unit}" if unit.startswith(("=", "+", "-", "@")) else unit


TARGET = Target(
    id="parameters",
    summary="Values with units as a CSV file.",
    suffix=".csv",
    judge=_judge,
    write=_write,
    not_run="a table of values has no motion",
)
