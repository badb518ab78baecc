"""`python -m bench machines`: real recordings, what must be named and what must not, of one or more checkouts.

The recordings are found by DSD_RECORDINGS, else in ../shared/recordings. Each is asked `dsd improve --auto` from a bare
mass; rows go to bench/results/machines.json, and with `--page` the table into
docs/measured/machines.md, the worst first. With `--variants` parts and forms of them are asked instead (rows in
machines_variants.json): `open` ones, or those that are `held` back, which are for the end.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from bench.engines import ROOT, Asked, Engine
from bench.machines_cases import RECORDED, Recorded
from bench.machines_regression import regressed
from bench.machines_variants import held_back, table_of_forms, variants
from bench.marked import put

RESULTS = Path(__file__).parent / "results"
PAGE = ROOT / "docs" / "measured" / "machines.md"
Row = dict[str, Any]


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(
        prog="python -m bench machines", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--engine", action="append", metavar="NAME=PATH", help="a checkout; this one if none is given")
    parser.add_argument("--only", nargs="*", default=[], help="recordings whose name contains one of these")
    parser.add_argument("--variants", choices=("open", "held"), help="parts and forms of the recordings")
    parser.add_argument("--output", type=Path, help="default: machines.json or machines_variants.json in bench/results")
    parser.add_argument("--table", action="store_true", help="print what is there and ask nothing")
    parser.add_argument("--page", action="store_true", help="write the table of the first engine into its page")
    options = parser.parse_args(arguments)
    output = options.output or RESULTS / f"machines{'_variants' * bool(options.variants)}.json"
    rows = json.loads(output.read_text()) if output.exists() else []
    if not (options.table or options.page):
        with tempfile.TemporaryDirectory(prefix="dsd-variants-") as place:
            every = variants(_folder(), Path(place)) if options.variants else RECORDED
            kept = (c for c in every if not options.variants or held_back(c.name) == (options.variants == "held"))
            cases = [c for c in kept if not options.only or any(name in c.name for name in options.only)]
            for engine in [Engine.of(text) for text in options.engine or [f"here={ROOT}"]]:
                rows = _asked(engine, cases, rows, output)
    if options.variants:
        lines = table_of_forms(rows)
        print("\n".join(lines))
        if options.page:
            put(PAGE, "variants", lines)
        return
    names = list(dict.fromkeys(r["engine"] for r in rows))
    lines = [line for name in names for line in ("", f"{name}:", "", *table([r for r in rows if r["engine"] == name]))]
    print("\n".join(lines))
    if options.page:
        put(PAGE, "machines", table([r for r in rows if r["engine"] == names[0]]))


def _asked(engine: Engine, cases: Sequence[Recorded], rows: list[Row], output: Path) -> list[Row]:
    """Rows with those of this engine new; kept as they come."""
    output.parent.mkdir(parents=True, exist_ok=True)
    asked = Asked(engine)
    for case in cases:
        row = {"engine": engine.name, "commit": engine.commit, "name": case.name} | ask(case, asked)
        rows = [r for r in rows if (r["engine"], r["name"]) != (engine.name, case.name)] + [row]
        output.write_text(json.dumps(rows, indent=1))
        print(
            f"{case.name}: {row['met']} of {row['musts']}, {row['steps']} {row['verdict']}", file=sys.stderr, flush=True
        )
    asked.close()
    return rows


def ask(case: Recorded, engine: Asked) -> Row:
    """What `improve` makes of it, and how that is judged.

    Raises
    ------
    SystemExit : a recording is not there.
    """
    logs = [_folder() / log for log in case.logs]
    if missing := [str(log) for log in logs if not log.exists()]:
        sys.exit(f"recording {missing[0]} is not there (set DSD_RECORDINGS)")
    with tempfile.TemporaryDirectory(prefix="dsd-machines-") as place:
        (Path(place) / "dsd.toml").write_text(case.config())
        words = ("-c", "dsd.toml", "--auto", "-o", "better.toml", "--format", "json")
        done = engine.run("improve", *logs, *words, cwd=Path(place))
    own = {"own": regressed(case, logs)} if case.regress else {}
    if done["code"] != 0:
        said = {"verdict": "error", "probability": 0.0, "steps": [], "values": {}, "error": done["err"].strip()[-300:]}
        return said | own | judged(case, said | own) | {"seconds": round(done["seconds"], 1)}
    result = json.loads(done["out"])
    back = {s["effect"] for s in result["ladder"] if s["kind"] == "taken_back"}
    said = {
        "verdict": result["verdict"],
        "probability": result.get("probability") or 0.0,
        "steps": [s["effect"] for s in result["ladder"][1:] if s["effect"] not in back],
        "values": result.get("values") or {},
        "before": result["ladder"][0]["heldout_rmse"],
        "after": result["ladder"][-1]["heldout_rmse"],
        "left_percent": result["ladder"][-1].get("relative_error_percent"),
        "warnings": result.get("warnings") or [],
        "missing": result.get("missing"),
        "unexplained": result.get("unexplained"),
    }
    return said | own | judged(case, said | own) | {"seconds": round(done["seconds"], 1)}


def _folder() -> Path:
    """Of the recordings."""
    return (ROOT / os.environ.get("DSD_RECORDINGS", "../shared/recordings")).resolve()


def judged(case: Recorded, said: Row) -> Row:
    """musts and how many are met; what must not be and is; values beside published ones."""
    effects = [e for e in said["steps"] if e not in ("refit", "inertia", "delay")]
    wanted = [set(must.split("|")) for must in case.must]
    unmet = [m for m, names in zip(case.must, wanted, strict=True) if not names & set(effects)]
    late = [m for m in case.must[: case.first] if not set(m.split("|")) & set(effects[: case.first])]
    if late:
        unmet.append("these first" if set(late) <= set(unmet) else f"{', '.join(late)} first")
    if case.unknown and not (said["verdict"] == "unknown" or "inertia" in said["steps"]):
        unmet.append("unknown, or that the inertia differs")
    values = {n: v["value"] for n, v in said["values"].items() if n in case.published}
    off = [n for n, value in values.items() if abs(value / case.published[n] - 1.0) > case.within]
    own = said.get("own") or {}
    margin = {n: max(case.within * abs(v), 2.0 * e) for n, (v, e) in own.items()}
    near = [n for n, value in values.items() if n in own and abs(value - own[n][0]) <= margin[n]]
    told = [n for n in case.open_values if said["values"].get(n, {}).get("identified") == "identified"]
    musts = len(case.must) + bool(case.first) + case.unknown
    if said["verdict"] == "error":
        unmet = [*case.must, "an answer"][:musts]
    return {
        "musts": musts,
        "met": 0 if said["verdict"] == "error" else musts - len(unmet),
        "unmet": unmet,
        "violated": [e for e in effects if e in case.must_not] + [f"{n} called identified" for n in told],
        "published": case.published,
        "within": case.within,
        "off": off,
        "as_regressed": near,
        "hidden": [m for m in unmet if _hidden(m, own)],
    }


def _hidden(must: str, own: dict[str, Any]) -> bool:
    """Whether a plain regression has a value of what must be named, and none that is surely above its error."""
    values = [(v, e) for n, (v, e) in own.items() if n.partition(".")[0] in must.split("|")]
    return bool(values) and all(abs(v) < 2.0 * e for v, e in values)


def table(rows: Sequence[Row]) -> list[str]:
    """Markdown, the worst first: what must be and is not, then what must not be and is, then values that are off.

    Judged anew, so that rows that were asked before a rule changed follow it.
    """
    cases = {case.name: case for case in RECORDED}
    rows = [row | judged(cases[row["name"]], row) for row in rows if row["name"] in cases]
    lines = [
        "| machine | must be named | must not, and is | what `improve` said "
        "| values (published; plain regression) | left of u | CPU |",
        "|---|---|---|---|---|---|---|",
    ]
    order = sorted(rows, key=lambda r: (r["met"] - r["musts"], -len(r["violated"]), -len(r["off"])))
    for r in order:
        missed = f": not {', '.join(r['unmet'])}" if r["unmet"] else ""
        sure = {one["effect"]: f" ({100 * one['probability']:.0f} %)" for one in r.get("missing") or ()}
        steps = ", ".join(_words(s) + sure.get(s, "") for s in r["steps"] if s != "refit") or "nothing"
        said = f"{steps}; then {r['verdict']} ({100 * r['probability']:.0f} %)"
        if r.get("error"):
            said = r["error"].removeprefix("dsd: error: ").partition(":")[0]
        left = f"{r['left_percent']:.1f} %" if r.get("left_percent") is not None else ""
        cells = (r["name"], f"{r['met']} of {r['musts']}{missed}", ", ".join(r["violated"]), said, _values(r), left)
        lines.append("| " + " | ".join(map(_words, cells)) + f" | {r['seconds']:.0f} s |")
    met, musts = sum(r["met"] for r in rows), sum(r["musts"] for r in rows)
    values = sum(len(r["published"]) for r in rows)
    near = sum(len([n for n in r["published"] if n in r["values"] and n not in r["off"]]) for r in rows)
    asked = [r for r in rows if r.get("own")]
    agree = sum(len([n for n in r["published"] if n in r["own"] and n in r["as_regressed"]]) for r in asked)
    compared = sum(len([n for n in r["published"] if n in r["own"]]) for r in asked)
    hidden = sum(len(r["hidden"]) for r in rows)
    broken = sum(len(r["violated"]) for r in rows)
    cpu = sum(r["seconds"] for r in rows)
    said = f"{broken} named that must not be; {near} of {values} published values within their margin"
    more = f"{agree} of {compared} within it of a plain regression; {hidden} unnamed of which that finds nothing"
    return [*lines, "", f"{met} of {musts} that must be named; {said},", f"{more}; {cpu:.0f} s of CPU."]


def _words(text: str) -> str:
    return text.replace("_", " ").replace("|", " or ")


def _values(row: Row) -> str:
    parts = []
    for name, published in row["published"].items():
        found, short = row["values"].get(name), name.split(".")[0]
        own = row.get("own", {}).get(name)
        known = f"({published:.3g})" if own is None else f"({published:.3g}; {own[0]:.3g} +- {own[1]:.1g})"
        if found is None or found["value"] is None:
            parts.append(f"{short} - {known}")
            continue
        spread = f" +- {found['std_error']:.1g}" if found.get("std_error") else ""
        mark = " **off**" if name in row["off"] else ""
        parts.append(f"{short} {found['value']:.3g}{spread} {known}{mark}")
    return "; ".join(parts)


if __name__ == "__main__":
    main()
