"""`python -m bench hidden`: is the missing effect found? A table on stdout, and bench/results/hidden.json.

Every log is made by the generator in tests/oracle, which shares no code with the package. `--page` writes
docs/measured/hidden.md from the numbers that are there, without running anything.
"""

from __future__ import annotations

import argparse
import json
import platform
import subprocess
import sys
import time
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from bench import hidden_score as score
from bench.hidden_cases import PARTS, jobs
from bench.hidden_run import WORKERS, rows

RESULTS = Path(__file__).parent / "results" / "hidden.json"
CLEAN = 200
Row = dict[str, Any]


def main(arguments: Sequence[str] | None = None) -> None:
    options = _options(arguments)
    data = _load()
    if not options.page and not options.failures:
        for part in options.only:
            _study(part, options, data)
            _save(data)
    if options.failures:
        for row in score.failures(data["parts"]):
            print(failure_line(row))
    elif options.page:
        from bench import hidden_page

        hidden_page.write(data)
    else:
        report(data["parts"])


def _options(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m bench hidden", description=__doc__)
    parser.add_argument("--seeds", type=int, default=2, help="seeds per effect, amplitude and sensing")
    parser.add_argument("--from-seed", type=int, default=0, help="the first of them")
    parser.add_argument("--clean", type=int, default=CLEAN, help="logs with nothing missing")
    parser.add_argument("--workers", type=int, default=WORKERS)
    parser.add_argument("--only", nargs="+", default=[*PARTS, "peers"], choices=[*PARTS, "peers"])
    parser.add_argument("--verbose", action="store_true", help="every log as it is done, on stderr")
    parser.add_argument("--page", action="store_true", help="write its page from bench/results/hidden.json")
    parser.add_argument("--failures", action="store_true", help="the calls that make the logs that went wrong")
    return parser.parse_args(arguments)


def _study(part: str, options: argparse.Namespace, data: dict[str, Any]) -> None:
    seeds = range(options.from_seed, options.from_seed + options.seeds)
    if part == "peers":
        from bench import hidden_peers

        data["peers"] = hidden_peers.study(seeds, options.workers)
        return
    work = list(jobs(part, seeds, options.clean))
    found: list[Row] = []
    begin = time.perf_counter()
    for row in rows(work, options.workers):
        found.append(row)
        if options.verbose:
            print(failure_line(row), file=sys.stderr, flush=True)
        elif sys.stderr.isatty():
            print(f"\r{part}: {len(found)} of {len(work)}", end="", file=sys.stderr, flush=True)
    found.sort(key=lambda r: (r["truth"], r["sensing"], r["amplitude"], r["seed"]))
    data["parts"][part] = found
    data["runs"][part] = _circumstances(len(work), time.perf_counter() - begin, options.workers)


def _circumstances(logs: int, seconds: float, workers: int) -> dict[str, Any]:
    return {
        "logs": logs,
        "seconds": round(seconds, 1),
        "workers": workers,
        "date": datetime.now(UTC).date().isoformat(),
        "python": platform.python_version(),
        "version": _version(),
    }


def _version() -> str:
    """The commit that was measured, "-dirty" if something was changed since."""
    command = ["git", "describe", "--always", "--dirty"]
    found = subprocess.run(command, cwd=Path(__file__).parent, capture_output=True, text=True, check=False)
    return found.stdout.strip() or "unknown"


def _load() -> dict[str, Any]:
    """What earlier runs found: each part is kept until it is run again."""
    if RESULTS.exists():
        return dict(json.loads(RESULTS.read_text(encoding="utf-8")))
    return {"schema_version": 1, "parts": {}, "runs": {}}


def _save(data: dict[str, Any]) -> None:
    data["summary"] = score.summary(data["parts"])
    RESULTS.parent.mkdir(exist_ok=True)
    RESULTS.write_text(json.dumps(data, separators=(",", ":")) + "\n", encoding="utf-8")


def failure_line(row: Row) -> str:
    """The call that makes a log, and what came of it."""
    steps = f" after {' > '.join(row['steps'])}" if row.get("steps") else ""
    ties = f" (tie with {', '.join(row['ties'])})" if row.get("ties") else ""
    error = f": {row['error']}" if "error" in row else ""
    error += f" [{row['stopped']}]" if row.get("stopped") else ""
    end = f"{row['verdict']} {row['probability']:.2f}{ties}{steps}{error}"
    numbers = "".join(f" {k} {row[k]:.4g}" for k in ("before", "refitted", "after", "ceiling", "floor") if k in row)
    return f"{row['call']}  # ratio {row['ratio']:.2f} -> {end};{numbers}"


AIMS = {"top1": 0.98, "alarms": 0.02, "both": 0.95, "exactly": 0.90, "unknown": 0.90}


def report(parts: dict[str, list[Row]]) -> None:
    """The lines of `make bench`."""
    found = score.summary(parts)
    single, clean, two, strange = (found[name] for name in PARTS)
    _line("one effect, true law gains 5 % or more: verdict right", single["top1"], AIMS["top1"])
    _line("    the same, or the truth among the stated ties", single["tied"], AIMS["top1"])
    for key in ("by_amplitude", "by_sensing", "by_effect"):
        for name, group in single[key].items():
            _line(f"    {name}", group["top1"], None, f"with ties {group['tied']['hits']}")
    _line("wrong, no tie stated, and 0.9 or more sure", single["wrong_and_sure"], None)
    _line("nothing missing: false alarms", clean["alarms"], AIMS["alarms"], str(clean["verdicts"] or ""), most=True)
    _line("two effects: both in the ladder", two["both"], AIMS["both"])
    _line("two effects: these and no other", two["exactly"], AIMS["exactly"])
    _line("in no library: unknown at the end", strange["unknown"], AIMS["unknown"])
    if found["seconds"]:
        print(f"seconds per log of 10 s: median {found['seconds']['median']:.2f}, 90 % {found['seconds']['q90']:.2f}")
    print("hidden: verdicts (the truth first)")
    for truth, verdicts in found["confusion"].items():
        others = ", ".join(f"{verdict} {count}" for verdict, count in verdicts.items() if verdict != truth)
        print(f"    {truth:<24} {verdicts.get(truth, 0):>4}   {others}".rstrip())
    for b in found["calibration"]:
        print(f"stated {b['stated']:.3f} ({b['from']:g} to {b['to']:g}): right {b['hits']} of {b['of']}")


def _line(what: str, found: dict[str, Any], aim: float | None, detail: str = "", most: bool = False) -> None:
    if not found["of"]:
        return
    value = f"{100 * found['share']:.1f} %"
    target = ""
    if aim is not None:
        met = found["share"] <= aim if most else found["share"] >= aim
        target = f"({'<=' if most else '>='} {100 * aim:g} %) {'ok' if met else 'MISSED'}"
    print(f"{what:<60} {value:>8}  {found['hits']:>5} of {found['of']:<5} {target:<20} {detail}".rstrip())
