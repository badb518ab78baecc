"""`python -m bench learn-machines`: real machines, a law learnt from one part and judged on another that nothing saw.

`dsd improve --auto --learn` from a bare mass sees the first half of a recording, or some of its logs; `dsd compare`
judges the model with the learnt step, and without it (`--undo`), on the rest. The recordings are found as for
`python -m bench machines`. Rows go to bench/results/learn_machines.json, and with `--page` into docs/measured/learn.md.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from bench.engines import ROOT, Asked, Engine
from bench.learn import PAGE
from bench.machines_cases import RECORDED, Recorded
from bench.marked import put

RESULTS = Path(__file__).parent / "results" / "learn_machines.json"
Row = dict[str, Any]


def _recorded(name: str) -> Recorded:
    return next(one for one in RECORDED if one.name == name)


def _of(name: str, used: str, *logs: str) -> Recorded:
    """Some logs of a recording; `used` says which, after its folder."""
    whole = _recorded(name)
    folder = Path(whole.logs[0]).parts[0]
    return replace(whole, name=f"{folder}, {used}", logs=tuple(f"{folder}/{log}" for log in logs))


_WHOLE = _recorded("silverbox test_multisine")
_MULTISINE = replace(_WHOLE, hold="")
_SAMPLED = replace(_WHOLE, name=f"{_WHOLE.name}, u as sampled")
_STARTS = ("pos_0.06_1", "neg_0.04_1", "neg_0.045_1")
_RUNS = ("sin_sin", "sin_time_square", "up_and_down")
#: What is learnt from, and the logs that nothing saw; none: the second half of the same.
CASES: tuple[tuple[Recorded, tuple[str, ...]], ...] = (
    (_recorded("emps"), ()),
    (_recorded("dfki_pendulum ddp"), ()),
    (_recorded("dfki_pendulum dircol"), ()),
    (_recorded("kuka_kr300 A"), ()),
    (_recorded("odrive_cogging slow2_nocomp_0"), ()),
    (
        _of("bam_xl330, twelve runs", "three runs at kp 200", *(f"kp200_{run}.csv" for run in _RUNS)),
        tuple(f"bam_xl330/kp400_{run}.csv" for run in _RUNS),
    ),
    (
        _of("frc_drivetrain, four tests", "two tests of four", "slow_forward.csv", "fast_backward.csv"),
        ("frc_drivetrain/slow_backward.csv", "frc_drivetrain/fast_forward.csv"),
    ),
    (
        _of("hsm150 all five runs", "three runs of five", *(f"idf_{run}.parquet" for run in _STARTS)),
        ("hsm150/idf_pos_0.065_1.parquet", "hsm150/idf_neg_0.045_2.parquet"),
    ),
    (_recorded("rack_pinion, as logged"), ()),
    (_MULTISINE, ("silverbox/test_arrow.parquet",)),
    (_SAMPLED, ("silverbox/test_arrow.parquet",)),
)


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(prog="python -m bench learn-machines", description=__doc__)
    parser.add_argument("--only", nargs="*", default=[], help="recordings whose name contains one of these")
    parser.add_argument("--output", type=Path, default=RESULTS)
    parser.add_argument("--page", action="store_true", help="ask nothing; write what is there into its page")
    options = parser.parse_args(arguments)
    rows: list[Row] = json.loads(options.output.read_text()) if options.output.exists() else []
    options.output.parent.mkdir(parents=True, exist_ok=True)
    if not options.page:
        engine = Asked(Engine.of(f"here={ROOT}"))
        for case, unseen in CASES:
            if not options.only or any(name in case.name for name in options.only):
                row = {"name": case.name} | ask(case, unseen, engine)
                rows = [r for r in rows if r["name"] != case.name] + [row]
                options.output.write_text(json.dumps(rows, indent=1))
                print(row, file=sys.stderr, flush=True)
        engine.close()
    print("\n".join(table(rows)))
    if options.page:
        put(PAGE, "machines", table(rows))


def ask(case: Recorded, unseen: Sequence[str], engine: Asked) -> Row:
    """What is learnt, and the force error on what nothing saw without it and with it."""
    folder = (ROOT / os.environ.get("DSD_RECORDINGS", "../shared/recordings")).resolve()
    logs, aside = [folder / log for log in case.logs], [folder / log for log in unseen]
    if missing := [str(log) for log in (*logs, *aside) if not log.exists()]:
        sys.exit(f"recording {missing[0]} is not there (set DSD_RECORDINGS)")
    with tempfile.TemporaryDirectory(prefix="dsd-learn-") as place:
        here = Path(place)
        (here / "dsd.toml").write_text(case.config())

        def run(*words: object) -> Row:
            done = engine.run(*words, "--format", "json", cwd=here)
            return json.loads(done["out"]) if done["code"] == 0 else {"error": done["err"].strip()[-200:]}

        first: tuple[object, ...] = ()
        second: tuple[object, ...] = tuple(aside)
        if not aside:
            times = run("compare", *logs, "-c", "dsd.toml")["where_time"]
            middle = 0.5 * (times[0]["start"] + times[-1]["end"])
            first, second = ("--to", middle), (*logs, "--from", middle)
        found = run("improve", *logs, "-c", "dsd.toml", "--auto", "--learn", "-o", "better.toml", *first)
        if "error" in found:
            return {"said": found["error"], "learnt": "", "before": None, "after": None, "unit": ""}
        learnt = [step["effect"] for step in found["ladder"] if step["kind"] == "learnt"]
        row: Row = {"said": found["stopped"], "learnt": "".join(learnt), "unit": found.get("unit") or ""}
        row["after"] = _left(run("compare", *second, "-c", "better.toml")) if learnt else None
        for i, step in enumerate(
            reversed(found["ladder"]) if learnt else ()
        ):  # stand-ins that the law made needless too
            engine.run("improve", "-c", "before.toml" if i else "better.toml", "--undo", "-o", "before.toml", cwd=here)
            if step["kind"] == "learnt":
                break
        return row | {"before": _left(run("compare", *second, "-c", "before.toml" if learnt else "better.toml"))}


def _left(compared: Row) -> float | str | None:
    """Force error, or why `compare` failed; None where it gave none."""
    if "error" in compared:
        return f"failed: {compared['error']}"
    force = compared.get("force")
    return None if force is None else float(force["rmse"])


def table(rows: Sequence[Row]) -> list[str]:
    """A line for each recording."""
    lines = [
        "| recording | unseen part, force error without | with the learnt step | what was learnt, or why nothing |",
        "|---|---|---|---|",
    ]
    for row in rows:
        cells = (row["name"], *(_cell(row[k], row["unit"]) for k in ("before", "after")), row["said"])
        lines.append("| " + " | ".join(" ".join(cell.replace("|", "/").split()) for cell in cells) + " |")
    return lines


def _cell(left: float | str | None, unit: str) -> str:
    if left is None:
        return "-"
    return left if isinstance(left, str) else f"{left:.4g} {unit}"
