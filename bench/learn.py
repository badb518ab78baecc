"""`python -m bench learn`: laws of no catalogue from an outside rig, what `dsd learn` makes of them.

Every law of `tests/oracle/rig_strange_laws.py`, or of `--laws-from FILE.py` (a file with a dictionary `LAWS` of the
same kind), behind four sensors, from several seeds.
"""

from __future__ import annotations

import argparse
import json
import runpy
import time
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from bench.engines import ROOT
from bench.learn_truth import law_error, settled
from bench.marked import put
from dsd_cli.effects import Role, get_effect
from dsd_cli.identify.fit.problem import pose
from dsd_cli.identify.fit.testability import Settings
from dsd_cli.identify.recordings.recording import Recording, prepare
from dsd_cli.identify.search.sets import Search
from dsd_cli.learn.forgetting import UNKNOWN, forgetting
from dsd_cli.learn.learning import learn
from dsd_cli.learn.results import LEARNT, Learnt
from dsd_cli.plant.model import ObserverSettings, PlantModel
from dsd_cli.signals.log import Log
from tests.oracle.rig_strange import LAWS, SENSORS, StrangeLog, make, on_motion
from tests.oracle.rig_strange_laws import Law

#: Form of a law in the rig -> effects of the formula that are that form.
FORMS = {
    "1/lorentz q": {"learnt_dry_lorentz_q"},
    "1/sine q": {"learnt_dry_sine_q"},
    "1/linear t": {"learnt_dry_linear_t"},
    "1/decay t": {"learnt_dry_decay_t"},
    "1/linear q": {"learnt_dry_linear_q"},
    "root/": {"learnt_root"},
    "v/lorentz v": {"learnt_viscous_peak_v"},
    "v/decay v": {"learnt_viscous_decay_v"},
    "0/tanh v": {"learnt_force_level_v"},
    "a/sine q": {"learnt_inertia_sine_q"},
    "0/hinge q": {"learnt_force_beyond_q"},
    "0/tanh q": {"learnt_force_tanh_q"},
    "0/inverse square q": {"learnt_force_inverse_q"},
    "v/gauss q": {"learnt_viscous_gauss_q"},
    "v/linear q": {"learnt_viscous_linear_q"},
    "v/decay t": {"learnt_viscous_decay_t"},
    "u/sine q": {"learnt_gain_sine_q"},
    "u/linear t": {"learnt_gain_linear_t"},
    "|u|/": {"learnt_size"},
}


PAGE = ROOT / "docs" / "measured" / "learn.md"
#: Share of a channel's range around a knot, and samples in it, from which on the log was there.
_NEAR, _VISITED = 0.004, 3
#: Share of the usual speed below which nothing of a law is seen.
_MOVES = 0.05
#: Errors of a row, as the table has them.
_HELD_OUT, _SECOND = ("before", "after", "exact_law", "true"), ("second", "second_exact_law", "second_true")


@dataclass(frozen=True)
class Row:
    """One log: errors are held-out ones, unit of u; `exact_law` with the true law as an effect (`learn_truth`), `true`
    with the true force taken off."""

    law: str
    sensor: str
    seed: int
    verdict: str
    channels: str
    right: bool
    exact: bool | None
    before: float
    after: float
    true: float
    second: float
    second_true: float
    covered: float | None
    cpu: float
    formula: str
    exact_law: float = float("nan")
    second_exact_law: float = float("nan")


def recording_of(log: StrangeLog, without_law: bool = False) -> tuple[Recording, PlantModel]:
    """The log as it is, or as it would be with the true force of its law known: u at the plant takes it up."""
    channels = dict(log.channels)
    if without_law:  # force k acts in the interval that ends at k, u k - 1 - L before it
        ahead = log.delay / 1e-3 + 1.0
        n, part = int(ahead), ahead - int(ahead)
        later = np.concatenate([log.truth, np.full(n + 2, log.truth[-1])])
        size = len(log.truth)
        channels["u"] = channels["u"] + (1.0 - part) * later[n : n + size] + part * later[n + 1 : n + 1 + size]
    observer = ObserverSettings(log.inertia, 0.01)
    believed = PlantModel(log.inertia, log.delay, dict(log.believed))
    return prepare(Log(channels, 1e-3, log.law), observer), believed


def judged(recording: Recording, model: PlantModel, forgotten: bool) -> Recording:
    """The recording in the rows in which a law was judged: `forgotten`, where what it remembers from before is."""
    if not forgotten:
        return recording
    return forgetting([recording], pose([recording], model, Settings(effects=())))[0]


def true_error(log: StrangeLog, forgotten: bool = False) -> float:
    """Held-out error of the model's own values beside the true law; `forgotten`: see `judged`."""
    recording, model = recording_of(log, without_law=True)
    problem = pose([judged(recording, model, forgotten)], model, Settings(effects=()))
    return problem.score(Search(problem).refit).heldout_rmse


def asked(law: str, sensor: str, seed: int, laws: dict[str, Any]) -> Row:
    """What is made of one law, and of a second motion of the same machine."""
    motions = ("moves", "sines") if seed % 2 else ("sines", "moves")
    log = make(law, seed, sensor, motions[0], laws=laws)
    other = make(law, seed, sensor, motions[1], laws=laws, second=1)
    recording, model = recording_of(log)
    begin = time.process_time()
    found = learn([recording], model)
    cpu = time.process_time() - begin
    second, _ = recording_of(other)
    problem = pose([second], found.model, Settings(effects=()))
    known = settled(problem.errors.equations)[problem.errors.equations.kept]
    hidden = {**LAWS, **laws}[law]
    on, form = hidden.on, hidden.form
    names = set() if found.formula is None else set(found.formula.effects)
    forgotten = any(UNKNOWN in note for note in found.notes)
    return Row(
        law,
        sensor,
        seed,
        found.verdict,
        " ".join(found.channels),
        set(found.channels) == set(on),
        names == FORMS[form] if form in FORMS else None,
        found.refitted.heldout_rmse,
        found.after.heldout_rmse,
        true_error(log, forgotten),
        float(np.sqrt(np.mean(problem.errors.rows_of_model(found.model)[known] ** 2))),
        true_error(other),
        covered(found, log, hidden),
        cpu,
        "" if found.formula is None else found.formula.text,
        law_error(log, hidden, judged(recording, model, forgotten), model),
        law_error(other, hidden, second, model, settled),
    )


def covered(found: Learnt, log: StrangeLog, law: Law) -> float | None:
    """Share of the visited knots of a curve over one channel whose band holds the true law there, evaluated at the
    knot itself; None for other curves."""
    if found.verdict != LEARNT or len(found.curves) != 1 or len(found.curves[0].channels) != 1:
        return None
    curve = found.curves[0]
    effect, channel = get_effect(curve.effect), curve.channels[0]
    if curve.factor != "one" or effect.memory or channel == "u":
        return None
    if set(found.channels) != set(law.on):
        return 0.0
    knots = np.array(curve.knots[0])
    q, v = log.motion
    moves = np.abs(v) > _MOVES * np.sqrt(np.mean(v**2))
    x = {"velocity": v, "position": q, "time": log.channels["t"]}[channel][moves]
    friction = effect.role is Role.FRICTION
    direction = (np.sign(knots) if channel == "velocity" else np.ones(len(knots))) * friction
    at = [knots * (name == channel) for name in ("time", "position", "velocity", "acceleration", "u")]
    level = on_motion(log, law, tuple(at), direction) * (-direction if friction else 1.0)
    visited = np.array([np.sum(np.abs(x - knot) < _NEAR * np.ptp(knots)) > _VISITED for knot in knots])
    told = visited & np.isfinite(curve.low) & (direction != 0.0 if friction else True)
    inside = (np.array(curve.low) <= level) & (level <= np.array(curve.high))
    return float(np.mean(inside[told])) if told.any() else None


def run(laws: Iterable[str], seeds: Iterable[int], sensors: list[str], more: dict[str, Any], out: Path) -> list[Row]:
    """All of them, one line of JSON each as it comes; those that are there are not asked again."""
    rows = [Row(**json.loads(line)) for line in out.read_text().splitlines()] if out.exists() else []
    done = {(row.law, row.sensor, row.seed) for row in rows}
    seeds = list(seeds)
    with out.open("a") as file:
        for law in laws:
            for sensor in sensors:
                for seed in seeds:
                    if (law, sensor, seed) not in done:
                        rows.append(asked(law, sensor, seed, more))
                        file.write(json.dumps(vars(rows[-1])) + "\n")
                        file.flush()
    return rows


def summary(rows: list[Row]) -> list[str]:
    """The figures, one line each."""
    if not rows:
        return []
    speed = [row for row in rows if row.exact is not None and row.sensor.startswith("speed")]
    band = [row.covered for row in rows if row.covered is not None]
    lines = [
        f"{len(rows)} logs of {len({row.law for row in rows})} laws",
        _share("right channels", [row.right for row in rows]),
        _share("held-out error within 10 % of the true law's", [r.after <= 1.1 * r.exact_law for r in rows]),
        _share("second motion within 20 %", [r.second <= 1.2 * r.second_exact_law for r in rows]),
        _share("held-out error within 10 % of the true force's", [r.after <= 1.1 * r.true for r in rows]),
        _share("second motion within 20 % of it", [r.second <= 1.2 * r.second_true for r in rows]),
        _share("error falls by 80 % at least", [row.after < 0.2 * row.before for row in rows]),
        _share("exact form, speed sensors, law in the dictionary", [bool(row.exact) for row in speed]),
        f"knots whose 95 % band holds the law: {100.0 * np.mean(band):.0f} %" if band else "",
        f"CPU of 20 s at 1 kHz: {np.mean([r.cpu for r in rows]):.1f} s, at most {max(r.cpu for r in rows):.1f} s",
    ]
    return [line for line in lines if line]


def _share(what: str, held: list[bool]) -> str:
    return f"{what}: {sum(held)} of {len(held)} ({100.0 * np.mean(held):.0f} %)"


def table(rows: list[Row]) -> list[str]:
    """A line for each law: over its logs."""
    lines = ["| law | right channels | exact form | held-out: without, with, true law, true force | second: with, "
             "true law, true force |",
             "|---|---|---|---|---|"]  # fmt: skip
    for law in dict.fromkeys(row.law for row in rows):
        own = [row for row in rows if row.law == law]
        exact = [row for row in own if row.exact is not None]
        form = f"{sum(bool(r.exact) for r in exact)} of {len(exact)}" if exact else "-"
        errors = " ".join(f"{np.median([getattr(r, name) for r in own]):.2g}" for name in _HELD_OUT)
        seconds = " ".join(f"{np.median([getattr(r, name) for r in own]):.2g}" for name in _SECOND)
        lines.append(
            f"| {law.replace('_', ' ')} | {sum(r.right for r in own)} of {len(own)} | {form} | {errors} | {seconds} |"
        )
    return lines


def main(arguments: list[str] | None = None) -> None:
    """`python -m bench learn [--laws a,b] [--seeds 3] [--first 101] [--laws-from FILE.py] [-o FILE]`,
    `--page FILE...`."""
    parser = argparse.ArgumentParser(prog="python -m bench learn", description=__doc__)
    parser.add_argument("--laws", help="some of them, with commas between")
    parser.add_argument("--laws-from", help="a Python file with a dictionary LAWS of tests.oracle.rig_strange_laws.Law")
    parser.add_argument("--sensors", default=",".join(SENSORS), help="some of them, with commas between")
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--first", type=int, default=101)
    parser.add_argument("-o", "--output", default="out/learn.jsonl")
    parser.add_argument("--page", nargs="+", help="ask nothing; these files of rows into docs/measured/learn.md")
    given = parser.parse_args(arguments)
    if given.page:
        rows = [Row(**json.loads(line)) for path in given.page for line in Path(path).read_text().splitlines()]
        put(PAGE, "rig", [*(f"- {line}" for line in summary(rows)), "", *table(rows)])
        return
    more = runpy.run_path(given.laws_from)["LAWS"] if given.laws_from else {}
    out = Path(given.output)
    out.parent.mkdir(parents=True, exist_ok=True)
    laws = given.laws.split(",") if given.laws else list(more) or list(LAWS)
    rows = run(laws, range(given.first, given.first + given.seeds), given.sensors.split(","), more, out)
    print("\n".join([*summary(rows), "", *table(rows)]))
