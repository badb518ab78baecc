"""What a log says against what the user gave of values."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from dsd_cli.identify.results import Diagnosis
from dsd_cli.identify.verdict.contradictions import Contradiction
from dsd_cli.report.names import listed


def once(warnings: Iterable[str]) -> tuple[str, ...]:
    """Of sentences that say the same of a value with other figures, as fits follow each other, the last."""
    found = {one.about if isinstance(one, Contradiction) else one: one for one in warnings}
    return tuple(found.values())


def first_of_all(result: Diagnosis) -> str:
    """An end for a verdict: what seems to be missing, or not to be, may be so only because of a value that
    was given wrongly; "" without a contradiction.
    """
    said = [one for one in result.warnings if isinstance(one, Contradiction)]
    if not said:
        return ""
    names = listed(dict.fromkeys(one.value for one in said))
    if not any(one.hard or one.kind == "bound" for one in said) and not result.stand_ins:
        return f"; this log is against the prior of {names}, which gave way"
    alone = f" ({listed(result.stand_ins)} may only stand in for that)" if result.stand_ins else ""
    return f"; this log contradicts the given values of {names}: look at that first{alone}"


def against_json(result: Diagnosis) -> list[dict[str, Any]]:
    """Values that the log has otherwise than they were given, and the effects that may only stand in for them."""
    found = once(one for one in result.warnings if isinstance(one, Contradiction))
    return [
        {
            "value": one.value,
            "told_by": one.kind,
            "gave_way": not one.hard,
            "stand_ins": [effect for effect, values in result.stand_ins.items() if one.value in values],
            "text": str(one),
        }
        for one in found
        if isinstance(one, Contradiction)
    ]
