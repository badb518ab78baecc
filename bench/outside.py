"""`python -m bench outside`: is the missing effect found on logs as another laboratory would write them?

The rig of tests/oracle/rig*.py has controllers, references, sensors and habits of its own. A table on stdout,
bench/results/outside.json, and with `--page` docs/measured/outside.md.
"""

from __future__ import annotations

import argparse
import json
import math
import multiprocessing
import os
import time
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from bench.outside_cases import Cell, chosen
from bench.outside_days import of_days
from dsd_cli.effects import kind_of
from dsd_cli.identify.checks import check_log
from dsd_cli.identify.improve import REFIT, improve
from dsd_cli.identify.results import DELAY, INERTIA, NONE, UNKNOWN
from dsd_cli.identify.verdict.diagnose import Settings, diagnose
from dsd_cli.plant.model import PlantModel
from dsd_cli.signals.log import Log
from tests.identify.outside_rig import asked
from tests.oracle.rig import RigCase, RigLog, make
from tests.oracle.rig_cases import RIPPLES, STRANGERS_UNSEEN

RESULTS = Path(__file__).parent / "results" / "outside.json"
#: Values of every model.
OWN = {INERTIA, DELAY}
PAGE = Path(__file__).parents[1] / "docs" / "measured" / "outside.md"
#: A verdict as sure as this is a confident one.
SURE = 0.9
#: Of a period over the travel, by which the periods of a line may be off.
_NEAR = 0.35
Row = dict[str, Any]


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(prog="python -m bench outside", description=__doc__)
    parser.add_argument("--seeds", type=int, help="per cell, in place of its own number")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--only", nargs="*", default=[], help="cells whose name contains one of these")
    parser.add_argument("--page", action="store_true", help="write its page from the numbers that are there")
    parser.add_argument("--failures", action="store_true", help="print the logs that went wrong")
    options = parser.parse_args(arguments)
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    cells = chosen(options.only)
    if not options.page and not options.failures:
        for cell in cells:
            _keep(cell.name, _rows(cell, options.seeds, options.workers))
            print(_line(cell), flush=True)
        return
    if options.page:
        PAGE.write_text("\n".join(page(cells)) + "\n", encoding="utf-8")
    for cell in cells if options.failures else ():
        for row in _known(cell):
            if not row["right"]:
                print(cell.name, json.dumps(row))


def _rows(cell: Cell, seeds: int | None, workers: int) -> list[Row]:
    work = [(cell.kind, case) for case in cell.cases(seeds)]
    with multiprocessing.get_context("spawn").Pool(workers) as pool:
        return sorted(pool.imap_unordered(_row, work), key=lambda r: (r["what"], r["seed"]))


def _row(job: tuple[str, RigCase]) -> Row:
    kind, case = job
    (log,) = make([case])
    begin = time.process_time()
    try:
        found = _ASK[kind](log)
    except Exception as error:  # a crash is a wrong answer, not the end of the study
        found = {"right": False, "verdict": "error", "probability": 0.0, "error": f"{type(error).__name__}: {error}"}
    head = {"what": "+".join(case.what) or NONE, "seed": case.seed, "seconds": time.process_time() - begin}
    return head | found


def _believed_wrong(log: RigLog) -> set[str]:
    """The model's own values that the user believes wrongly: where both are, either is a right answer."""
    return {name for name in OWN if not math.isclose(log.believed[name], log.truth[name])}


def _single(log: RigLog) -> Row:
    recording, model, observer = asked(log)
    answer = diagnose([recording], model, observer, Settings())
    truth = log.case.what[0] if log.case.what else NONE
    named = next((c for c in answer.ranking if c.effect == answer.verdict), None)
    ties = list(named.indistinguishable_from) if named else []
    right = answer.verdict in {truth} | (_believed_wrong(log) if truth in OWN else set())
    return {
        "right": right,
        "verdict": answer.verdict,
        "probability": answer.probability,
        "ties": ties,
        "tied": right or truth in ties,
        "wrong_and_sure": not right and not ties and answer.verdict != UNKNOWN and answer.probability >= SURE,
    }


def _ladder(log: RigLog) -> Row:
    recording, model, observer = asked(log)
    ladder = improve([recording], model, observer, Settings(), choose=lambda found: found.verdict)
    back = {s.effect for s in ladder.steps if s.kind == "taken back"}
    steps = [name for name in dict.fromkeys(s.effect for s in ladder.steps[1:]) if name not in back]
    return {"steps": steps, "verdict": ladder.verdict, "probability": ladder.last.probability}


def _pair(log: RigLog) -> Row:
    """Values of the model are fitted along with every effect, so that they need no step of their own."""
    row = _ladder(log)
    effects = set(log.case.what) - {INERTIA, DELAY}
    taken = set(row["steps"]) - {INERTIA, DELAY, REFIT}
    return row | {"right": taken == effects, "both": effects <= taken}


def _lines(log: RigLog) -> Row:
    """Right: these lines and no other, and no effect that is not there."""
    recording, model, observer = asked(log)
    answer = diagnose([recording], model, observer, Settings())
    named = next((c for c in answer.ranking if c.effect == answer.verdict), None)
    values = answer.whole_values or (named.all_values if named else {})
    there = sorted(x["periods"] for p in log.truth["effects"].values() for x in p.get("lines", ()))
    seen = sorted(e.value for name, e in values.items() if name.endswith(".periods"))
    near = _NEAR * 2.0 * math.pi / log.floor["travel"]
    false = sum(all(abs(n - true) > near for true in there) for n in seen)
    missed = sum(all(abs(n - true) > near for n in seen) for true in there)
    hidden = set(log.case.what) - set(RIPPLES)
    others = {name for name in answer.found if kind_of(name) != "cogging"}
    told = named is not None and not named.indistinguishable_from and answer.probability >= SURE
    return {
        "right": not (false or missed) and len(seen) == len(there) and others == hidden,
        "verdict": answer.verdict,
        "steps": list(answer.found),
        "probability": answer.probability,
        "missed": missed,
        "false": false,
        "wrong_and_sure": told and (false > 0 or answer.verdict not in {"cogging", *hidden}),
    }


def _stranger(log: RigLog) -> Row:
    row = _ladder(log)
    return row | {"right": row["verdict"] == UNKNOWN, "unseen": log.case.what[0] in STRANGERS_UNSEEN}


def _sign(log: RigLog) -> Row:
    return _said(log, log.channels, "u_sign")


def _units(log: RigLog) -> Row:
    """The speed in degrees per second."""
    return _said(log, {**log.channels, "velocity": np.degrees(log.channels["velocity"])}, "velocity_scale")


def _said(log: RigLog, channels: dict[str, Any], key: str) -> Row:
    """Whether the checks name that key as what mends the log."""
    model = PlantModel(log.believed["inertia"], log.believed["delay"], log.believed["effects"])
    result = check_log(Log(channels, log.sample_time, "log"), model)
    said = [f for f in result.findings if key in f.remedy]
    return {"right": bool(said), "verdict": "said" if said else "not said", "probability": 1.0}


_ASK = {
    "singles": _single,
    "none": _single,
    "pairs": _pair,
    "lines": _lines,
    "days": partial(of_days, sure=SURE),
    "strangers": _stranger,
    "sign": _sign,
    "units": _units,
}


def _keep(name: str, rows: list[Row]) -> None:
    known = json.loads(RESULTS.read_text()) if RESULTS.exists() else {}
    RESULTS.parent.mkdir(exist_ok=True)
    RESULTS.write_text(json.dumps(known | {name: rows}, indent=1))


def _known(cell: Cell) -> list[Row]:
    known = json.loads(RESULTS.read_text()) if RESULTS.exists() else {}
    return list(known.get(cell.name, ()))


def _line(cell: Cell) -> str:
    return f"{cell.name}: " + " | ".join(_figures(cell))


def _figures(cell: Cell) -> list[str]:
    """Right, wanted, what else is to be said."""
    rows = _known(cell)
    right, n = sum(r["right"] for r in rows), len(rows)
    wanted = f"{100 * cell.wanted:.0f} %" if cell.wanted else "-"
    said = []
    if cell.kind in ("singles", "none"):
        said.append(f"{sum(r.get('tied', False) for r in rows)} with ties")
        said.append(f"{sum(r['verdict'] == UNKNOWN for r in rows)} unknown")
        said.append(f"{sum(r.get('wrong_and_sure', False) for r in rows)} wrong and sure")
    if cell.kind == "pairs":
        said.append(f"both of them in {sum(r.get('both', False) for r in rows)}")
    if cell.kind == "lines":
        missed, false = (sum(r.get(what, 0) for r in rows) for what in ("missed", "false"))
        said.append(f"{missed} lines missed, {false} that are not there")
        said.append(f"{sum(r.get('wrong_and_sure', False) for r in rows)} wrong and sure")
    if cell.kind == "days":
        said.append(f"the level of each day in {sum(r.get('levels', False) for r in rows)}")
        said.append(f"{sum(r['verdict'] == UNKNOWN for r in rows)} unknown")
        said.append(f"{sum(r.get('wrong_and_sure', False) for r in rows)} wrong and sure")
    if cell.kind == "strangers":
        unseen = [r for r in rows if r.get("unseen")]
        said.append(f"{sum(r['right'] for r in unseen)} of {len(unseen)} of kinds never looked at before")
    said.append(f"{sum(r['seconds'] for r in rows) / max(n, 1):.1f} s CPU")
    said.append(f"seeds from {min((r['seed'] for r in rows), default=0)}")
    return [f"{right} of {n}", f"{100 * right / max(n, 1):.0f} %", wanted, ", ".join(said)]


HEAD = """# Is it found on the logs of another laboratory?

Logs of `tests/oracle/rig*.py`: servo axes with hidden effects, made with controllers, references, sensors and habits
that the tool's own generator does not have (1 kHz, 20 s, delay 20 ms, if nothing else is said). Nothing of the package
is used to make them. The tool gets the log and the model that the user believes, and nothing else. No log was looked at
before it was asked; after a run its failures are, so that the next version gets new seeds. All rows are of one version;
those with one seed have the same machines behind other sensors. The run before, with seeds from 65000 and some commits
earlier: 21, 21, 21, 16, 21, 21 and 19 of 21 in the first seven rows, 21 of 21 of 3 s, 57 of 60 pairs, none wrong and
sure. Two logs at a time on two cores, beside other work, which CPU times show. Since this run rows of a
stop, end stops and tones of encoders are judged otherwise; it was not asked anew.

"Right" is the name of what is hidden as the verdict; for two effects, a ladder with these two and no other (inertia and
delay are fitted along with any step); for several cogging lines, the set that is found: each line to a third of
a period over the travel, and nothing else; for three days (10 s each, friction or a load 30 % apart), exactly what is
hidden; for effects of no catalogue, "unknown" at the end. "Wrong and sure": another name (or a line that is not there),
90 % or more, no tie stated.

| logs | right | | wanted | |
|---|---|---|---|---|"""


def page(cells: Sequence[Cell]) -> list[str]:
    """docs/measured/outside.md."""
    lines = HEAD.splitlines()
    lines += [f"| {c.name} | " + " | ".join(_figures(c)) + " |" for c in cells if _known(c)]
    lines += [
        "",
        "## By what is hidden",
        "",
        "| hidden | " + " | ".join(_SHORT) + " |",
        "|---" * (len(_SHORT) + 1) + "|",
    ]
    for what in sorted({r["what"] for name in _SHORT.values() for r in _of(name)}):
        shares = [[r["right"] for r in _of(name) if r["what"] == what] for name in _SHORT.values()]
        lines.append(f"| {what} | " + " | ".join(f"{sum(s)} of {len(s)}" if s else "" for s in shares) + " |")
    lines += ["", "## What went wrong", "", "| logs | hidden, seed | the tool said |", "|---|---|---|"]
    lines += [f"| {c.name} | {_told(r)} |" for c in cells for r in _known(c) if not r["right"]]
    return [*lines, "", "`python -m bench outside`, then `--page`; `--failures` lists the logs."]


def _told(row: Row) -> str:
    said = ", ".join([*row.get("steps", ()), row["verdict"]])
    return f"{row['what']}, {row['seed']} | {said} ({100 * row['probability']:.0f} %)"


_SHORT = {
    "speed": "speed and 40,000 counts",
    "loud speed": "loud speed",
    "4096": "position only, 4096 counts",
    "1024": "position only, 1024 counts",
    "jitter": "position only, 8192 counts, 500 Hz, irregular stamps",
    "u, d_hat": "u and d_hat only",
    "3 s": "3 s",
    "1 s": "1 s",
}


def _of(name: str) -> list[Row]:
    return _known(next(c for c in chosen([]) if c.name == name))


if __name__ == "__main__":
    main()
