"""What a log says against what the user told of values."""

from __future__ import annotations

from collections.abc import Iterable

from dsd_cli.identify.verdict.contradictions import Contradiction
from dsd_cli.report.names import listed


def once(warnings: Iterable[str]) -> tuple[str, ...]:
    """Of sentences that say the same of a value with other figures, as fits follow each other, the last."""
    found = {one.about if isinstance(one, Contradiction) else one: one for one in warnings}
    return tuple(found.values())


def first_of_all(warnings: Iterable[str]) -> str:
    """An end for a verdict: what seems to be missing may be what was told wrongly; "" without a contradiction."""
    names = dict.fromkeys(one.value for one in warnings if isinstance(one, Contradiction))
    return f"; this log is against what it was told of {listed(names)}: look at that first" if names else ""
