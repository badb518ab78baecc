"""`python -m bench learn-nothing`: logs whose model lacks nothing, and what `dsd learn` takes for a law there.

Every second log is of the outside rig (`COMPLETE`: friction, and effects of the catalogue that the model has), behind
one of its four sensors, by moves or sines, of 2 to 20 s; the others are of the paired study's tiers (bench/paired.py:
geared joints, crawls, cycles, one direction, 100 Hz, 3 s, open and weak loops, ...) with all that is there in the
model. Forces of the model are a fifth too small. Rows go to a JSONL file as they come and are not asked again.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from bench.paired import all_tiers, read
from dsd_cli.effects import Role, get_effect
from dsd_cli.identify.recordings.recording import Recording, prepare
from dsd_cli.learn.learning import learn
from dsd_cli.learn.results import LEARNT
from dsd_cli.plant.model import ObserverSettings, PlantModel
from dsd_cli.signals.log import Log
from tests.oracle.questions import Question
from tests.oracle.rig_strange import SENSORS, StrangeLog, make
from tests.oracle.rig_strange_laws import Law

RESULTS = Path(__file__).parent / "results" / "learn_nothing.jsonl"
#: Of its true size, that the model believes a force to have.
_BELIEVED = 0.8
DURATIONS = (2.0, 8.0, 12.0, 20.0)
#: Tiers that are asked; second masses, which no law of the motion is, are left out.
TIERS = (
    *("nothing missing, new axes", "geared joint", "speed and 40,000 counts", "geared joint, friction believed"),
    *("100 Hz", "3 s", "4096 counts", "point to point", "loud speed", "small travel", "crawl through cogging"),
    *("nothing missing, irregular stamps", "speed loop", "one direction", "periodic motion", "weak loop", "open loop"),
    "nothing missing, 4096 counts",
)
_LOADS = {"backlash", "flexible_coupling"}


def _none(s: Any, t: float, q: float, v: float, u: float) -> float:
    return 0.0


#: Name -> the law, and what a model has of it.
_KNOWN: dict[str, tuple[Law, Callable[[Any], dict[str, dict[str, float]]]]] = {
    "nothing": (Law("", lambda s: {}, _none), lambda s: {}),
    "gravity": (
        Law("", lambda s: {"phi": s.between(-1.5, 1.5)}, lambda s, t, q, v, u: -s.size * math.sin(q + s.phi)),
        lambda s: {"gravity": {"amplitude": _BELIEVED * s["size"], "phase": s["phi"]}},
    ),
    "cogging": (
        Law("", lambda s: {"phi": s.between(-1.5, 1.5)}, lambda s, t, q, v, u: 0.5 * s.size * math.sin(9 * q + s.phi)),
        lambda s: {"cogging": {"amplitude": 0.5 * _BELIEVED * s["size"], "periods": 9.0, "phase": s["phi"]}},
    ),
    "spring": (
        Law("", lambda s: {}, lambda s, t, q, v, u: -s.size * q),
        lambda s: {"stiffness": {"coefficient": _BELIEVED * s["size"]}},
    ),
    "offset": (
        Law("", lambda s: {}, lambda s, t, q, v, u: 0.5 * s.size),
        lambda s: {"constant_load": {"force": 0.5 * _BELIEVED * s["size"]}},
    ),
    "drag": (
        Law("", lambda s: {}, lambda s, t, q, v, u: -0.1 * s.size * abs(v) * v),
        lambda s: {"quadratic_drag": {"coefficient": 0.1 * _BELIEVED * s["size"]}},
    ),
    "stribeck": (
        Law("", lambda s: {"vs": s.between(0.2, 0.8)}, _none,
            friction=lambda s, t, q, v, u: s.size * math.exp(-((v / s.vs) ** 2))),
        lambda s: {"stribeck_friction": {"excess": _BELIEVED * s["size"], "velocity": s["vs"]}},
    ),
}  # fmt: skip
#: Laws of machines that the model explains.
COMPLETE: Mapping[str, Law] = {name: law for name, (law, _) in _KNOWN.items()}


def known_of(log: StrangeLog) -> dict[str, dict[str, float]]:
    """Effects of the law of a log that the model has; none where it is one of no catalogue."""
    return _KNOWN[log.law][1](log.drawn) if log.law in _KNOWN else {}


def of_rig(seed: int) -> tuple[str, Recording, PlantModel]:
    """(what it is, log, model) of the outside rig."""
    rng = np.random.default_rng([seed, 77])
    law, sensor = list(COMPLETE)[seed % len(COMPLETE)], list(SENSORS)[seed // len(COMPLETE) % len(SENSORS)]
    motion, duration = ("moves", "sines")[int(rng.integers(2))], float(rng.choice(DURATIONS))
    log = make(law, seed, sensor, motion, duration, laws=dict(COMPLETE))
    model = PlantModel(log.inertia, log.delay, {**log.believed, **known_of(log)})
    recording = prepare(Log(log.channels, 1e-3, law), ObserverSettings(log.inertia, 0.01))
    return f"{law} {sensor} {motion} {duration:g} s", recording, model


def of_tier(name: str, seed: int) -> tuple[str, Recording, PlantModel] | None:
    """The same of a tier; None for an axis with a second mass."""
    asked: Question = next(tier for tier in all_tiers(None) if tier.name == name).draw(seed)
    truth, channels = asked.truth, dict(asked.channels)
    if _LOADS & set(truth["effects"]):
        return None
    model = PlantModel(truth["inertia"], truth["delay"], {e: _smaller(e, v) for e, v in truth["effects"].items()})
    observer = ObserverSettings(asked.observer["nominal_inertia"], asked.observer["time_constant"])
    log = Log(channels, float(np.median(np.diff(channels["t"]))), name)
    return f"{name}: {' '.join(truth['effects'])}", prepare(log, observer), model


def _smaller(name: str, values: Mapping[str, Any]) -> dict[str, Any]:
    """Its force alone: distances, speeds and phases stay, which other values may be shares of."""
    effect = get_effect(name)
    if effect.role is Role.INPUT:  # what acts on u has no force that could be smaller
        return dict(values)
    coefficients, shape = effect.to_columns(values)
    return dict(effect.from_columns(tuple(_BELIEVED * c for c in coefficients), shape))


def main(arguments: Sequence[str] | None = None) -> None:
    """Ask, print every law, and how many there are."""
    parser = argparse.ArgumentParser(prog="python -m bench learn-nothing", description=__doc__)
    parser.add_argument("--logs", type=int, default=200)
    parser.add_argument("--first", type=int, default=80_000, help="seed of the first")
    parser.add_argument("-o", "--output", type=Path, default=RESULTS)
    options = parser.parse_args(arguments)
    options.output.parent.mkdir(parents=True, exist_ok=True)
    rows = read(options.output)
    known = {row["seed"] for row in rows}
    for i in range(options.logs):
        seed = options.first + i
        drawn = None if seed in known else of_tier(TIERS[i // 2 % len(TIERS)], seed) if i % 2 else of_rig(seed)
        if drawn is not None:
            begin = time.process_time()
            found = learn([drawn[1]], drawn[2])
            said = {"verdict": found.verdict, "family": found.family, "why": found.why}
            rows.append({"seed": seed, "log": drawn[0], **said, "cpu": time.process_time() - begin})
            with options.output.open("a", encoding="utf-8") as file:
                file.write(json.dumps(rows[-1]) + "\n")
        print(f"\r{i + 1} of {options.logs} logs", end="", file=sys.stderr, flush=True)
    laws = [row for row in rows if row["verdict"] == LEARNT]
    print("\n".join(f"{row['seed']} {row['log']}: {row['family']}" for row in laws))
    few = sum("too short" in row["why"] for row in rows)
    print(f"laws in logs with nothing missing: {len(laws)} of {len(rows)} ({few} of them too short to say)")
