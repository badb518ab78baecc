"""`python -m bench values`: how often the +- of values holds the truth, tier by tier, and how wide it is.

Logs of the paired study's tiers (bench/paired.py), but for d_hat by other makers and second masses, whose values are
those of the response above the band. All that is in a log is in
the model, with values that are off; the fit gives values and standard errors, as every command states them. Rows go to
a JSONL file as they come and are not asked again; `--beside` has those of another version, run with its package first
on PYTHONPATH; `--page` writes docs/measured/values.md.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np

from bench.engines import ROOT
from bench.paired import all_tiers, read
from bench.paired_ask import compared, deviation
from bench.paired_score import WITHIN
from dsd_cli.identify.fit.problem import Settings, pose
from dsd_cli.identify.recordings.recording import prepare
from dsd_cli.identify.search.sets import Search
from dsd_cli.plant.model import ObserverSettings, PlantModel
from dsd_cli.signals.log import Log
from tests.oracle.questions import Question

Row = dict[str, Any]
RESULTS = Path(__file__).parent / "results" / "values.jsonl"
PAGE = ROOT / "docs" / "measured" / "values.md"
TIERS = (
    *("geared joint", "geared joint, friction believed", "crawl through cogging", "periodic motion", "small travel"),
    *("one direction", "point to point", "speed loop", "weak loop", "speed and 40,000 counts", "loud speed"),
    *("4096 counts",),
)
#: Factors on the true values from which a fit starts: of forces and times, and of what a line is known by.
OFF, OFF_LINE = 1.1, 1.0005
LINE = ("periods", "frequency")
LOADS = {"backlash", "flexible_coupling"}


def asked(tier: str, seed: int, question: Question) -> Row | None:
    """Values of one log; None for one with a second mass."""
    if LOADS & set(question.truth["effects"]):
        return None
    model = PlantModel(
        OFF * question.truth["inertia"],
        question.truth["delay"],
        {effect: _off(values) for effect, values in question.truth["effects"].items()},
    )
    channels = dict(question.channels)
    log = Log(channels, float(np.median(np.diff(channels["t"]))), "log")
    observer = ObserverSettings(question.observer["nominal_inertia"], question.observer["time_constant"])
    problem = pose([prepare(log, observer)], model, Settings(effects=()))
    problem = problem.measured_again(Search(problem).refit)
    found = problem.values(Search(problem).refit).estimates
    told = {
        n: {"value": e.value, "std_error": _plain(e.std_error), "identified": e.grade, "at_bound": e.at_bound}
        for n, e in found.items()
    }
    return {"tier": tier, "seed": seed, "values": compared(told, question.truth)}


def _off(values: dict[str, Any]) -> dict[str, Any]:
    factors = {name: OFF_LINE if name in LINE else OFF for name in values if name != "phase"}
    return {n: v * factors[n] if isinstance(v, float) and n in factors else v for n, v in values.items()}


def _plain(x: float) -> float | None:
    return x if math.isfinite(x) else None


def sigmas(rows: Sequence[Row]) -> Iterator[tuple[str, float, float]]:
    """(name, deviation in standard errors, standard error as a share of the true value; NaN of a phase)."""
    for row in rows:
        for value in row["values"]:
            off = deviation(value, row["values"])
            if off is not None and value["identified"] != "not":
                size = math.nan if value["name"].endswith("phase") or not value["true"] else abs(value["true"])
                yield value["name"], off, value["std_error"] / size


def table(kinds: dict[str, Sequence[Row]]) -> list[str]:
    """Of each tier and of each kind of value, for every version: held, of how many; median standard error."""
    heads = [f"{name}: within 1.96 s.e. | {name}: median s.e., %" for name in kinds]
    lines = [f"| | logs | {' | '.join(heads)} |", "|---|" + "---|" * (1 + 2 * len(heads))]
    groups = [(t, [[r for r in rows if r["tier"] == t] for rows in kinds.values()]) for t in TIERS]
    every = [list(rows) for rows in kinds.values()]
    for name, parts in [*groups, ("**all**", every)]:
        if parts[0]:
            lines.append(f"| {name} | {len(parts[0])} | {' | '.join(_cells(list(sigmas(p))) for p in parts)} |")
    for name in ("inertia", "delay"):
        parts = [[s for s in sigmas(p) if s[0] == name] for p in every]
        lines.append(f"| {name} | {len(every[0])} | {' | '.join(map(_cells, parts))} |")
    return lines


def _cells(found: Sequence[tuple[str, float, float]]) -> str:
    held, sizes = sum(abs(z) <= WITHIN for _, z, _ in found), [s for *_, s in found if math.isfinite(s)]
    share = f" ({100.0 * held / len(found):.0f} %)" if found else ""
    return f"{held} of {len(found)}{share} | {100.0 * median(sizes):.2g}" if sizes else f"{held} of {len(found)} | -"


def main(arguments: Sequence[str] | None = None) -> None:
    """Ask, print the table; write it into the page."""
    parser = argparse.ArgumentParser(prog="python -m bench values", description=__doc__)
    parser.add_argument("--logs", type=int, default=240, help="of all tiers")
    parser.add_argument("--seed", type=int, default=320_000, help="the first")
    parser.add_argument("--output", type=Path, default=RESULTS, help="JSONL, one row a log")
    parser.add_argument("--beside", type=Path, help="rows of the version before")
    parser.add_argument("--page", action="store_true", help="write the table of what is there into the page")
    options = parser.parse_args(arguments)
    options.output.parent.mkdir(parents=True, exist_ok=True)
    rows = read(options.output)
    known = {(r["tier"], r["seed"]) for r in rows}
    by_name = {t.name: t for t in all_tiers(None)}
    for i in range(0 if options.page else options.logs):
        tier, seed = TIERS[i % len(TIERS)], options.seed + i // len(TIERS)
        if (tier, seed) in known:
            continue
        row = asked(tier, seed, by_name[tier].draw(seed))
        if row is not None:
            rows.append(row)
            with options.output.open("a", encoding="utf-8") as file:
                file.write(json.dumps(row) + "\n")
        print(f"\r{i + 1} of {options.logs} logs", end="", file=sys.stderr, flush=True)
    versions: dict[str, Sequence[Row]] = {"now": rows}
    if options.beside:
        before = [r for r in read(options.beside) if (r["tier"], r["seed"]) in {(x["tier"], x["seed"]) for x in rows}]
        versions = {"before": before, "now": rows}
    found = table(versions)
    print("\n".join(found))
    if options.page:
        head, _, rest = PAGE.read_text(encoding="utf-8").partition("<!-- values -->")
        tail = rest.partition("<!-- end of values -->")[2]
        marked = "\n".join(["<!-- values -->", "", *found, "", "<!-- end of values -->"])
        PAGE.write_text(head + marked + tail, encoding="utf-8")
