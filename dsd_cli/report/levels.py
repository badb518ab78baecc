"""Values that differ between the logs of one rig, as JSON and in words."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import PurePath
from typing import Any

from dsd_cli.identify.results import LogLevels
from dsd_cli.report.names import estimate_text, in_words, listed, number_or_none

#: Logs whose levels a sentence has one by one.
MOST_LOGS = 4


def levels_json(levels: Sequence[LogLevels]) -> dict[str, Any]:
    """{"levels": ...}, or nothing where none differ."""
    return {"levels": {one.deviations.name: _json(one) for one in levels}} if levels else {}


def _json(one: LogLevels) -> dict[str, Any]:
    pairs = zip(one.logs, one.values, strict=True)
    return {
        "mean": number_or_none(one.mean),
        "unit": in_words(one.values[0].unit),
        "logs": [
            {"log": log, "value": number_or_none(e.value), "std_error": number_or_none(e.std_error)} for log, e in pairs
        ],
        "indistinguishable_from": list(one.deviations.alike),
    }


def levels_text(levels: Sequence[LogLevels]) -> str:
    """An end for a verdict: which values differ, and what they are in each log; "" where none do."""
    return "".join(f"; {one.deviations.name} differs between the logs: {_by_log(one)}" for one in levels)


def _by_log(one: LogLevels) -> str:
    names = [PurePath(log).name for log in one.logs]
    by_size = sorted(range(len(names)), key=lambda i: one.values[i].value)
    shown = range(len(names)) if len(names) <= MOST_LOGS else (by_size[0], by_size[-1])
    each = [f"{estimate_text(one.values[i])} ({names[i]})" for i in shown]
    several = listed(each) if len(names) <= MOST_LOGS else f"from {' to '.join(each)}"
    alike = f", or {listed(one.deviations.alike, 'or')} does" if one.deviations.alike else ""
    return f"{several}, mean {one.mean:.4g}{alike}"


def level_rows(levels: Sequence[LogLevels]) -> Iterator[tuple[str, ...]]:
    """(log, level, ...) of each log."""
    for i, log in enumerate(levels[0].logs if levels else ()):
        yield PurePath(log).name, *(estimate_text(one.values[i]) for one in levels)
