"""One log of the paired study: drawn, written as a user would have it, asked of each engine, one row for each."""

from __future__ import annotations

import hashlib
import json
import math
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from bench.engines import Asked
from tests.oracle.questions import Question

Row = dict[str, Any]
#: Values of every model, which any step fits along with it.
OWN = ("inertia", "delay")


def ask(question: Question, engines: Mapping[str, Asked]) -> dict[str, Row]:
    """{name of the engine: its row}, in the order of `engines`."""
    with tempfile.TemporaryDirectory(prefix="dsd-paired-") as place:
        folder = Path(place)
        digest = write(question, folder)
        head = {
            "digest": digest,
            "hidden": list(question.hidden),
            "judged": question.judged,
            "also": list(question.also),
            "tied": question.tied,
            "promised": question.notes.get("promised", 1.0),
        }
        command = "improve" if question.judged in ("set", "stranger") else "diagnose"
        more = ("--auto", "-o", "better.toml") if command == "improve" else ()
        rows = {}
        for name, engine in engines.items():
            done = engine.run(command, "log.parquet", "-c", "dsd.toml", *more, "--format", "json", cwd=folder)
            rows[name] = head | {"seconds": round(done["seconds"], 2)} | said(question, command, done)
            (folder / "better.toml").unlink(missing_ok=True)
        return rows


def write(question: Question, folder: Path) -> str:
    """log.parquet and dsd.toml; a digest of the log."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    pq.write_table(pa.table(dict(question.channels)), folder / "log.parquet")
    (folder / "dsd.toml").write_text(config(question))
    digest = hashlib.sha1(usedforsecurity=False)
    for name in sorted(question.channels):
        digest.update(np.ascontiguousarray(question.channels[name]).tobytes())
    digest.update(config(question).encode())
    return digest.hexdigest()[:16]


def config(question: Question) -> str:
    """What the owner of the log believes, as dsd.toml."""
    names = {"time": "t", "u": "u", "d_hat": "", "velocity": "", "position": ""}
    names |= {name: name for name in names if name in question.channels}
    lines = ["[signals]", *(f'{name} = "{column}"' for name, column in names.items()), "[observer]"]
    lines += [f"{name} = {json.dumps(value)}" for name, value in question.observer.items()]
    lines += ["[model]", *(f"{name} = {float(question.believed[name])!r}" for name in OWN)]
    for effect, values in question.believed["effects"].items():
        lines += [f"[model.effects.{effect}]", *(f"{name} = {float(value)!r}" for name, value in values.items())]
    return "\n".join(lines) + "\n"


def said(question: Question, command: str, done: Row) -> Row:
    """What the JSON of an engine says, in plain values; the verdict "error" where it says nothing."""
    if done["code"] != 0:
        ended = f"exit code {done['code']}: {done['err'].strip()[-300:]}"
        return {"verdict": "error", "probability": 0.0, "named": [], "error": ended}
    result = json.loads(done["out"])
    row = _ladder(result) if command == "improve" else _diagnosis(result)
    return row | {
        "verdict": result["verdict"],
        "probability": result.get("probability") or 0.0,
        "missing": result.get("missing"),
        "unexplained": result.get("unexplained"),
        "values": compared(row.pop("estimates"), question.truth),
    }


def _diagnosis(result: Row) -> Row:
    named = next((c for c in result["ranking"] if c["effect"] == result["verdict"]), None)
    values = dict(result.get("estimates") or {})
    if named:
        values |= {f"{named['effect']}.{name}": e for name, e in named["parameters"].items()}
    values |= result.get("found_values") or {}
    found = list(result.get("found") or ())
    return {
        "named": list(dict.fromkeys([*([named["effect"]] if named else []), *found])),
        "ties": list(named["indistinguishable_from"]) if named else [],
        "before": named["heldout_rmse_before"] if named else result["heldout_rmse"],
        "after": named["heldout_rmse_after"] if named else result["refitted"]["heldout_rmse"],
        "estimates": values,
    }


def _ladder(result: Row) -> Row:
    back = {s["effect"] for s in result["ladder"] if s["kind"] == "taken_back"}
    steps = [s["effect"] for s in result["ladder"][1:]]
    named = [name for name in dict.fromkeys(steps) if name not in back and name not in (*OWN, "refit")]
    return {
        "named": named,
        "ties": [],
        "steps": steps,
        "before": result["ladder"][0]["heldout_rmse"],
        "after": result["ladder"][-1]["heldout_rmse"],
        "estimates": result.get("values") or {},
    }


def compared(estimates: Mapping[str, Any], truth: Mapping[str, Any]) -> list[Row]:
    """Estimated values of which the truth is known: name, true, value, std_error, identified."""
    there = {name: truth[name] for name in OWN}
    for effect, values in truth["effects"].items():
        there |= {f"{effect}.{name}": value for name, value in values.items() if isinstance(value, float)}
    rows = []
    for name, estimate in estimates.items():
        if name in there and estimate.get("value") is not None:
            rows.append({"name": name, "true": there[name], **{k: estimate.get(k) for k in _KEPT}})
    return rows


_KEPT = ("value", "std_error", "identified", "at_bound")


def deviation(value: Row, others: Sequence[Row]) -> float | None:
    """(value - true) / std_error; None where no error is stated. Phases go round."""
    spread = value.get("std_error")
    if not spread or not math.isfinite(spread) or value.get("at_bound"):
        return None
    error = value["value"] - value["true"]
    if value["name"].endswith(".phase"):
        size = next((v for v in others if v["name"] == value["name"][:-5] + "amplitude"), None)
        turned = math.pi if size and size["value"] * size["true"] < 0.0 else 0.0
        error = math.remainder(error + turned, 2.0 * math.pi)
    elif value["name"].endswith(".amplitude"):
        error = abs(value["value"]) - abs(value["true"])
    return error / spread
