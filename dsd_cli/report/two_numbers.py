"""What is missing, and is that all: the two answers of `dsd diagnose` and `dsd improve`, as JSON and as a line."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from dsd_cli.identify.missing import Missing, Unexplained
from dsd_cli.report.names import listed, number_or_none, percent


def missing_json(missing: Sequence[Missing]) -> list[dict[str, Any]]:
    """The first question: what is missing."""
    return [{"effect": one.effect, "probability": number_or_none(one.probability)} for one in missing]


def unexplained_json(one: Unexplained) -> dict[str, Any]:
    """The second: is that all?"""
    return {
        "share_of_u": number_or_none(one.share_of_u),
        "probability": number_or_none(one.probability),
        "on": list(one.on),
    }


def believed(probability: float) -> bool:
    """Whether it is rather so than not; what has no probability is not in doubt."""
    return not probability < 0.5


def two_answers(missing: Sequence[Missing], left: Unexplained, added: Sequence[str] = ()) -> list[str]:
    """`missing: coulomb_friction (98 %)` and `unexplained: 3 % of u (probability that more is missing: 90 %)`.

    added : effects that the model at the end has: they are missing no more.
    """
    lines = []
    for what, inside in (("added", True), ("missing", False)):
        those = [f"{one.effect} ({percent(one.probability)})" for one in missing if (one.effect in added) is inside]
        lines += [f"{what}: {listed(those)}"] if those else []
    if not math.isfinite(left.share_of_u):
        return lines
    over = f", over {listed(left.on)}" if left.on else ""
    share = percent(min(left.share_of_u, 1.0))
    return [*lines, f"unexplained: {share} of u (probability that more is missing: {percent(left.probability)}){over}"]
