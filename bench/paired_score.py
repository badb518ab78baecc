"""What rows of the paired study amount to: shares, discordant pairs, calibration, coverage. Knows no printing."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

from bench.paired_ask import OWN, deviation

Row = dict[str, Any]
#: As sure as this is sure.
SURE = 0.9
#: Edges of the bins of stated probability.
BINS = (0.0, 0.3, 0.5, 0.7, 0.8, 0.9, 0.95, 0.99, 1.0)
#: Standard errors within which 95 % of true values lie.
WITHIN = 1.96


def right(row: Row) -> bool:
    """Whether the answer is the one that the log's maker knows; see tests/oracle/questions.py."""
    hidden, verdict = set(row["hidden"]), row["verdict"]
    if row["judged"] == "none":
        return bool(verdict == "none")
    if row["judged"] == "stranger":
        return bool(verdict == "unknown")
    if row["judged"] == "set":
        return set(row["named"]) - set(OWN) == hidden - set(OWN)
    return verdict in hidden | set(row["also"]) or bool(row["tied"] and hidden & set(row.get("ties", ())))


def sure_and_wrong(row: Row) -> bool:
    """A name that is not there, or "none" where something is, at 90 % or more and without a tie that has the truth.

    Of a ladder the last verdict is meant: its steps state no probability.
    """
    if right(row) or row["probability"] < SURE or row["verdict"] in ("unknown", "error"):
        return False
    hidden = set(row["hidden"]) | set(row["also"])
    if row["judged"] == "set":
        return bool(set(row["named"]) - hidden - set(OWN)) or not row["named"]
    return not (hidden & {row["verdict"], *row.get("ties", ())})


def stated(row: Row) -> tuple[float, bool] | None:
    """(probability, whether the verdict holds) of a verdict that states one.

    "none" at the end of a ladder holds if the ladder has all that is hidden; "unknown" if the catalogue lacks it. Of a
    tie the first alone: the probability is its own, not that of all of them.
    """
    if row["verdict"] == "error":
        return None
    if row["judged"] == "set":
        hidden = set(row["hidden"])
        holds = row["verdict"] == "none" and hidden <= set(row["named"]) | set(OWN)
        return row["probability"], holds or row["verdict"] in hidden - set(row["named"])
    return row["probability"], right({**row, "tied": False})


def names(row: Row) -> list[tuple[float, bool]]:
    """(probability, whether it is there) of every effect that an answer lists as missing, a second one of a kind too;
    the verdict is the likeliest of them that matters most, and is there more often than the same number beside it."""
    there = set(row["hidden"]) | set(row["also"])
    listed = row.get("missing") or () if row["verdict"] != "error" else ()
    return [(one["probability"], one["effect"].rstrip("_0123456789") in there) for one in listed]


def brier(answers: Sequence[tuple[float, bool]]) -> float:
    """Mean square of stated probability less what came true."""
    return sum((p - hit) ** 2 for p, hit in answers) / len(answers) if answers else math.nan


@dataclass(frozen=True)
class Bin:
    low: float
    high: float
    stated: float  # mean
    hits: int
    of: int


def reliability(answers: Iterable[tuple[float, bool]]) -> list[Bin]:
    """Per bin of stated probability, bins with nothing in them left out."""
    every, found = list(answers), []
    for low, high in pairwise(BINS):
        inside = [(p, hit) for p, hit in every if low <= p < high or (high == 1.0 and p == 1.0)]
        if inside:
            mean = sum(p for p, _ in inside) / len(inside)
            found.append(Bin(low, high, mean, sum(hit for _, hit in inside), len(inside)))
    return found


def mcnemar(pairs: Iterable[tuple[Row, Row]], of: Callable[[Row], bool] = right) -> tuple[int, int, float]:
    """(only the first right, only the second right, two-sided exact p of such a split by chance)."""
    from scipy.stats import binomtest

    split = [(of(a), of(b)) for a, b in pairs]
    first, second = sum(a and not b for a, b in split), sum(b and not a for a, b in split)
    return first, second, float(binomtest(first, first + second).pvalue) if first + second else 1.0


@dataclass(frozen=True)
class Coverage:
    """Of values with a stated standard error, in rightly explained logs."""

    held: int
    of: int


def coverage(rows: Iterable[Row], only: str | None = None) -> Coverage:
    """How many true values lie within 1.96 stated standard errors; `only` of that name."""
    deviations = []
    for row in rows:
        if not right(row) or row["verdict"] == "error" or row["judged"] == "stranger":
            continue
        for value in row.get("values", ()):
            if only not in (None, value["name"]) or value.get("identified") == "not":
                continue
            off = deviation(value, row["values"])
            if off is not None:
                deviations.append(off)
    return Coverage(sum(abs(d) <= WITHIN for d in deviations), len(deviations))


def paired(rows: Sequence[Row], first: str, second: str) -> list[tuple[Row, Row]]:
    """Rows of two engines on the same bytes."""
    by = {(r["tier"], r["seed"], r["digest"]): r for r in rows if r["engine"] == first}
    both = ((by.get((r["tier"], r["seed"], r["digest"])), r) for r in rows if r["engine"] == second)
    return [(a, b) for a, b in both if a is not None]
