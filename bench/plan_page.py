"""docs/measured/plan.md: figures and rows out of what `python -m bench plan` asked."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from bench.engines import ROOT

PAGE = ROOT / "docs" / "measured" / "plan.md"
Row = Mapping[str, Any]
#: Expected nats from which on no more are wanted: whether there are more decides nothing.
PLENTY = 500.0


def figures(known: Mapping[str, Sequence[Row]]) -> list[str]:
    """Lines of the page."""
    return [*_plans(known.get("plans", [])), *_others(known), "", *_table(known.get("plans", []))]


def _plans(rows: Sequence[Row]) -> list[str]:
    planned = [r for r in rows if "error" not in r]
    ratios = [(realised / expected, expected) for r in planned for expected, realised in r["realised"]]
    near = [0.5 <= x <= 2.0 for x, _ in ratios]
    agree = [0.5 <= x <= 2.0 or (expected > PLENTY and x * expected > PLENTY) for x, expected in ratios]
    cpu, old = [r["cpu"] for r in planned], [r for r in planned if "settled_old" in r]
    found = [
        f"poor logs: {len(rows)}, planned {len(planned)}",
        f"settled after the planned motion: {_of(r['settled'] for r in planned)}",
        f"of these by the new log alone: {sum(r['settled'] and r.get('alone', False) for r in planned)}; alone it "
        f"settled wrongly {sum(r.get('alone', False) and not r['settled'] for r in planned)}",
        f"right effect named after it: {_of(r['after'] == r['what'] for r in planned)}",
        f"realised nats within a factor of 2 of the expected: {_of(near)} pairs",
        f"within a factor of 2, or both beyond {PLENTY:g}: {_of(agree)} pairs",
        f"realised nats less than half of the expected: {_of(x < 0.5 for x, _ in ratios)} pairs",
        f"a limit broken by these plans on the rig: {_of(bool(r['broken']) for r in planned)}",
    ]
    if old:
        found += [
            f"of {len(old)} also run with the old motion for as long, settled after the planned one "
            f"{sum(r['settled'] for r in old)}, after the old one {sum(r['settled_old'] for r in old)}",
            f"right effect named after the old motion: {_of(r['after_old'] == r['what'] for r in old)}",
        ]
    if cpu:
        over = _of(x > 10.0 for x in cpu)
        found.append(
            f"CPU of a plan: {np.median(cpu):.1f} s in the middle, {max(cpu):.1f} s at most, above 10 s {over}"
        )
    return [f"- {line}" for line in found]


def _others(known: Mapping[str, Sequence[Row]]) -> list[str]:
    loops = [r["loop"] | {"first": r["settled"]} for r in known.get("plans", []) if "loop" in r]
    limits, impossible = (known.get(name, []) for name in ("limits", "impossible"))
    right = {k: _of(r[k] for r in impossible) for r in impossible[:1] for k in r if k != "seed"}
    found, again = [], [one for r in loops for one in r["broken"]]
    if loops:
        by_one = _of(r["first"] for r in loops)
        found.append(f"loops settled within three experiments: {_of(r['settled'] for r in loops)}, by one: {by_one}")
        found.append(f"a limit broken by the second and third plans of these loops: {_of(again)}")
    if limits:
        broken = [one for r in limits for one in r["broken"]]
        most = 100.0 * max((by for one in broken for by in one.values()), default=0.0)
        plans, refused = (sum(r[name] for r in limits) for name in ("plans", "refused"))
        found.append(
            f"a limit broken by one of five plans of a log: {len(broken)} of {plans} plans of {len(limits)} logs"
            + (f", by {most:.1f} % at most" if broken else "")
            + f"; {refused} refused"
        )
        all_of = [*broken, *(r["broken"] for r in known.get("plans", []) if "error" not in r), *again]
        count = len(all_of) + plans - len(broken)
        cpu = [x for r in limits for x in r.get("cpu", ())]
        found.append(f"a limit broken by any of all these plans: {sum(map(bool, all_of))} of {count}")
        found.append(f"CPU of one of five: {np.median(cpu):.1f} s in the middle, {max(cpu):.1f} s at most")
    found += [f"what no motion identifies, {name}: right in {count}" for name, count in right.items()]
    return [f"- {line}" for line in found]


def _table(rows: Sequence[Row]) -> list[str]:
    """A row per log."""
    found = [
        "| hidden | log, sensor | it said | after the plan | after the old motion | nats: expected, realised | CPU, s |"
    ]
    found.append("|---|---|---|---|---|---|---|")
    for r in rows:
        if "error" in r:
            found.append(f"| {r['what']} | {r['kind']}, {r['sensing']} | {r['verdict']} | {r['error']} | - | - | - |")
            continue
        after, old = (
            f"{r[verdict]}{'' if r[settled] else ', not settled'}" if verdict in r else "-"
            for verdict, settled in (("after", "settled"), ("after_old", "settled_old"))
        )
        nats = "; ".join(f"{a:,.0f}, {b:,.0f}" for a, b in r["realised"]) or "-"
        log = f"{r['kind']}, {r['sensing']}"
        found.append(f"| {r['what']} | {log} | {r['verdict']} | {after} | {old} | {nats} | {r['cpu']:.1f} |")
    return found


def _of(values: Any) -> str:
    found = list(values)
    return f"{sum(map(bool, found))} of {len(found)}"
