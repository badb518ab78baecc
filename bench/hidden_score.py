"""What the rows of the hidden-effect study amount to: shares, counts, quantiles. Nothing here knows how to print."""

from __future__ import annotations

import statistics
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from itertools import pairwise
from typing import Any

Row = dict[str, Any]

#: The true law must lower the error by 5 % for a log to count: error before over error after.
LEAST_RATIO = 1.0 / 0.95
#: Verdicts and steps that are no effects.
OWN_VALUES = ("inertia", "delay", "refit")
#: Edges of the bins of stated probability.
BINS = (0.0, 0.3, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 0.98, 1.0)
DEVIATIONS = 3.0
#: A wrong inertia or delay counts as found if so much of the gap to the true value is closed.
GAP_CLOSED = 0.9


def counted(rows: Iterable[Row]) -> list[Row]:
    """Logs with one hidden effect that matters and that can be tested with these channels."""
    return [r for r in rows if r["ratio"] >= LEAST_RATIO and not r.get("untestable")]


def right(row: Row) -> bool:
    return bool(row["verdict"] == row["truth"])


def tied(row: Row) -> bool:
    """Named, or stated to explain the log as well as what was named."""
    return right(row) or row["truth"] in row.get("ties", ())


def share(rows: Sequence[Row], of: Callable[[Row], bool]) -> dict[str, Any]:
    hits = sum(map(of, rows))
    return {"hits": hits, "of": len(rows), "share": hits / len(rows) if rows else None}


def singles(rows: Sequence[Row]) -> dict[str, Any]:
    """Top-1 over all, by amplitude, by sensing and by effect; errors and values by effect."""
    used = counted(rows)
    return {
        "logs": len(rows),
        "too_faint": sum(r["ratio"] < LEAST_RATIO for r in rows),
        "untestable": sum(r["ratio"] >= LEAST_RATIO and bool(r.get("untestable")) for r in rows),
        "top1": share(used, right),
        "tied": share(used, tied),
        "wrong_and_sure": share(
            used, lambda r: not tied(r) and r["verdict"] not in UNNAMED and r["probability"] >= 0.9
        ),
        "by_amplitude": _by("amplitude", used),
        "by_sensing": _by("sensing", used),
        "by_effect": {name: _effect(group) for name, group in _groups("truth", used).items()},
    }


UNNAMED = ("none", "unknown", "error")


def _groups(key: str, rows: Iterable[Row]) -> dict[str, list[Row]]:
    groups: dict[str, list[Row]] = {}
    for row in rows:
        groups.setdefault(row[key], []).append(row)
    return groups


def _by(key: str, rows: Sequence[Row]) -> dict[str, Any]:
    return {k: {"top1": share(g, right), "tied": share(g, tied)} for k, g in _groups(key, rows).items()}


def _effect(rows: Sequence[Row]) -> dict[str, Any]:
    named = [r for r in rows if right(r)]
    values = [v for r in named for v in r["values"] if v["std_error"] == v["std_error"]]
    return {
        "top1": share(rows, right),
        "tied": share(rows, tied),
        "error_ratio": quantiles([r["after"] / r["sensor"] for r in named]),
        "values": share(values, lambda v: abs(v["error"]) <= DEVIATIONS * v["std_error"]),
    }


def quantiles(values: Sequence[float]) -> dict[str, float] | None:
    """Median and 90 % quantile."""
    if not values:
        return None
    ordered = sorted(values)
    return {"median": statistics.median(ordered), "q90": ordered[min(int(0.9 * len(ordered)), len(ordered) - 1)]}


def confusion(rows: Iterable[Row]) -> dict[str, dict[str, int]]:
    """truth -> verdict -> logs."""
    table: dict[str, Counter[str]] = {}
    for row in rows:
        table.setdefault(row["truth"], Counter())[row["verdict"]] += 1
    return {truth: dict(found.most_common()) for truth, found in table.items()}


def none(rows: Sequence[Row]) -> dict[str, Any]:
    """False alarms where nothing is missing; a wrong inertia or delay would be one too."""
    alarms = [r for r in rows if r["verdict"] != "none"]
    return {"alarms": share(rows, lambda r: r["verdict"] != "none"), "verdicts": confusion(alarms).get("none", {})}


def pairs(rows: Sequence[Row]) -> dict[str, Any]:
    """Both in the ladder; both and no other effect."""
    groups = _groups("truth", rows)
    return {
        "both": share(rows, both),
        "exactly": share(rows, exactly),
        "by_pair": {name: {"both": share(g, both), "exactly": share(g, exactly)} for name, g in groups.items()},
    }


def both(row: Row) -> bool:
    """Each is a step; a wrong inertia or delay may be corrected by the fit of another step instead."""
    closed = {name for name, share_ in row.get("own", {}).items() if share_ >= GAP_CLOSED}
    return set(row["what"]) <= set(row.get("steps", ())) | closed


def exactly(row: Row) -> bool:
    """Nothing else, and no unknown left; fitting inertia or delay again adds no effect."""
    effects = set(row.get("steps", ())) - set(OWN_VALUES)
    return both(row) and effects == set(row["what"]) - set(OWN_VALUES)


def strangers(rows: Sequence[Row]) -> dict[str, Any]:
    groups = _groups("truth", rows)
    return {
        "unknown": share(rows, is_unknown),
        "by_stranger": {name: share(group, is_unknown) for name, group in groups.items()},
        "ends": {name: dict(Counter(_end(r) for r in group).most_common()) for name, group in groups.items()},
    }


def is_unknown(row: Row) -> bool:
    return bool(row["verdict"] == "unknown")


def _end(row: Row) -> str:
    return " > ".join((*row.get("steps", ()), row["verdict"]))


def judged(parts: dict[str, list[Row]]) -> list[tuple[float, bool]]:
    """(stated probability, whether the verdict was right) of every diagnosis.

    Too faint to matter: both the effect and "none" are right. A stranger: "unknown" at the end. A pair: the first
    verdict is one of the two.
    """
    found = [(r["probability"], _right_or_none(r)) for r in parts.get("singles", ()) if not r.get("untestable")]
    found += [(r["probability"], right(r)) for r in parts.get("none", ())]
    found += [(r["probability"], is_unknown(r)) for r in parts.get("strangers", ())]
    found += [(r["first_probability"], r["first"] in r["what"]) for r in parts.get("pairs", ()) if "first" in r]
    return found


def _right_or_none(row: Row) -> bool:
    return right(row) or (row["verdict"] == "none" and row["ratio"] < LEAST_RATIO)


def calibration(answers: Sequence[tuple[float, bool]]) -> list[dict[str, Any]]:
    """Per bin of stated probability: its mean, and the share that was right."""
    bins = []
    for low, high in pairwise(BINS):
        inside = [(p, hit) for p, hit in answers if low <= p < high or (p == high == 1.0)]
        if inside:
            stated, hits = sum(p for p, _ in inside) / len(inside), sum(hit for _, hit in inside)
            bins.append({"from": low, "to": high, "stated": stated, "hits": hits, "of": len(inside)})
    return bins


def seconds(rows: Iterable[Row]) -> dict[str, float] | None:
    return quantiles([r["seconds"] for r in rows if "seconds" in r])


def failures(parts: dict[str, list[Row]]) -> list[Row]:
    """Every log that missed its aim, for who wants to see it again."""
    wrong = [r for r in counted(parts.get("singles", ())) if not right(r)]
    wrong += [r for r in parts.get("none", ()) if r["verdict"] != "none"]
    wrong += [r for r in parts.get("pairs", ()) if not exactly(r)]
    return wrong + [r for r in parts.get("strangers", ()) if not is_unknown(r)]


def summary(parts: dict[str, list[Row]]) -> dict[str, Any]:
    """Everything that the page shows."""
    every = [row for rows in parts.values() for row in rows]
    alone = parts.get("singles", [])
    return {
        "singles": singles(alone),
        "none": none(parts.get("none", [])),
        "pairs": pairs(parts.get("pairs", [])),
        "strangers": strangers(parts.get("strangers", [])),
        "confusion": confusion([*counted(alone), *parts.get("none", ())]),
        "calibration": calibration(judged(parts)),
        "seconds": seconds([*alone, *parts.get("none", ())]),
        "crashes": sum(r["verdict"] == "error" for r in every),
    }
