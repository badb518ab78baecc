"""What a log says against what the user told of values."""

from __future__ import annotations

from collections.abc import Iterable

from dsd_cli.identify.verdict.contradictions import SENTENCE
from dsd_cli.report.names import listed


def once(warnings: Iterable[str]) -> tuple[str, ...]:
    """Of sentences that say the same of a value with other figures, as fits follow each other, the last."""
    found: dict[object, str] = {}
    for warning in warnings:
        same = SENTENCE.match(warning)
        found[same.groups() if same else warning] = warning
    return tuple(found.values())


def first_of_all(warnings: Iterable[str]) -> str:
    """An end for a verdict: what seems to be missing may be what was told wrongly; "" without a contradiction."""
    names = dict.fromkeys(found[1] for warning in warnings if (found := SENTENCE.match(warning)))
    return f"; this log is against what it was told of {listed(names)}: look at that first" if names else ""
