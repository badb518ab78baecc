"""The table at the end: every value with its unit, its standard error, and whether it is identifiable."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from typing import Any

from dsd_cli.identify.results import Correlations, Estimate, Estimates
from dsd_cli.report.names import estimate_text, in_words
from dsd_cli.report.terminal import escaped

#: Correlations on the screen; the JSON has all.
MOST_CORRELATIONS = 6
#: What is said of a value that is kept from where the log would have it.
AGAINST = "as given, against this log"


def print_values(
    console: Any, title: str, values: Estimates, correlations: Correlations, against: Collection[str] = ()
) -> None:
    """For a person; nothing where there are none. against : values that are as given, and not as the log has them."""
    from rich import box
    from rich.table import Table

    if not values:
        return
    table = Table(
        box=box.SIMPLE_HEAD,
        title=escaped(title),
        title_justify="left",
        title_style="",
        pad_edge=False,
        padding=(0, 1, 0, 0),
    )
    for name, justify in (
        ("", "left"),
        ("value", "right"),
        ("+-", "right"),
        ("unit", "left"),
        ("grade", "left"),
    ):
        table.add_column(name, justify=justify, no_wrap=name != "grade", overflow="fold")  # type: ignore[arg-type]
    for name, one in values.items():
        number, spread = _number_and_spread(one)
        table.add_row(
            name,
            number,
            spread,
            escaped("" if one.unit == "1" else in_words(one.unit)),
            AGAINST if name in against else grade(one),
        )
    console.print(table)
    for line in correlation_lines(correlations, values):
        console.print(escaped(line))


def _number_and_spread(one: Estimate) -> tuple[str, str]:
    """Both with the digits that the error deserves."""
    bare = Estimate(one.value, one.std_error, "")
    number, _, spread = estimate_text(bare).partition(" +- ")
    return number, spread or ("-" if not one.held else "")


#: Grades of a value, by how large its standard error is beside it, in the words of the field.
GRADES = {"identified": "identifiable", "weak": "weakly identifiable", "not": "not identifiable", "held": "held"}


def grade(one: Estimate) -> str:
    """`identifiable`, `weakly identifiable`, `not identifiable`, `held`, and what else to know."""
    words = [GRADES[one.grade]] if one.grade else []
    words += ["at its bound"] if one.at_bound else []
    words += [f"{abs(one.pull):.1f} sigma from its prior"] if math.isfinite(one.pull) else []
    return ", ".join(words)


def correlation_lines(correlations: Correlations, values: Estimates) -> list[str]:
    """Pairs of values whose estimates are strongly correlated: those of which the log leaves one unsure.

    Two values that are both identified are distinguished, however much their small errors go together.
    """
    sure = {name for name, one in values.items() if one.grade == "identified"}
    open_ = [pair for pair in correlations if not sure.issuperset(pair[:2])]
    lines = [f"strongly correlated: {a} and {b} (correlation {r:.2f})" for a, b, r in open_[:MOST_CORRELATIONS]]
    more = len(open_) - MOST_CORRELATIONS
    return [*lines, f"  and {more} more pairs (--format json lists them)"] if more > 0 else lines


def correlations_json(correlations: Correlations) -> Sequence[dict[str, Any]]:
    """Pairs of values and their correlation."""
    return [{"of": [a, b], "correlation": r} for a, b, r in correlations]
