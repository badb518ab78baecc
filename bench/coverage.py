"""How often the +- of a fit holds the truth: the outside rig, all that is in a log fitted, with help and without.

`python -m bench coverage [--logs 200]`
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dsd_cli.identify.fit.known import Known
from dsd_cli.identify.fit.problem import Settings, pose
from dsd_cli.identify.fit.values import flat, terms_of
from dsd_cli.identify.recordings.recording import prepare
from dsd_cli.identify.search.sets import Search
from dsd_cli.plant.model import ObserverSettings, PlantModel
from dsd_cli.signals.log import Log

sys.path.insert(0, str(Path(__file__).parents[1]))

from tests.oracle.rig import make
from tests.oracle.rig_cases import RigCase, RigLog

#: Relative standard deviation of a prior's error; two-sided 95 % of a normal distribution.
SPREAD, TWO_SIDED = 0.02, 1.959964
HIDDEN = ("coulomb_friction", "viscous_friction")


@dataclass(frozen=True)
class Deviation:
    """A value of one log: (fitted - true) / standard error, under that help."""

    help: str
    name: str
    sigma: float


def deviations(seed: int, sensing: str = "speed40k", duration: float = 20.0) -> Iterator[Deviation]:
    """Of one log: with nothing known, J held at its truth, and a prior of J that is off by a draw of its spread."""
    made = make([RigCase(HIDDEN, seed, sensing, duration=duration)])[0]
    truth = PlantModel(made.truth["inertia"], made.truth["delay"], made.truth["effects"])
    draw = np.random.default_rng(seed).normal()
    helps = {
        "nothing known": Known(),
        "J held": Known(fixed={"inertia": truth.inertia}),
        "J with a prior": Known(priors={"inertia": (truth.inertia * (1.0 + SPREAD * draw), SPREAD * truth.inertia)}),
    }
    for name, known in helps.items():
        yield from _deviations(made, truth, name, known)


def _deviations(made: RigLog, truth: PlantModel, help_: str, known: Known) -> Iterator[Deviation]:
    observer = ObserverSettings(made.observer["nominal_inertia"], made.observer["time_constant"])
    recording = prepare(Log(made.channels, made.sample_time, "rig"), observer)
    problem = pose([recording], truth, Settings(effects=(), known=known))
    first = Search(problem)
    tap = round(truth.delay / problem.solver.bank.tap_time)
    search = Search(problem.measured_again(first.fit(terms_of(truth), tap)))
    found = search.problem.values(search.fit(terms_of(truth), tap)).estimates
    for name, value in flat(truth).items():
        if found[name].std_error > 0.0:
            yield Deviation(help_, name, (found[name].value - value) / found[name].std_error)


def main(arguments: list[str]) -> None:
    """Print a table: help, value, share of logs whose 95 % interval holds the truth."""
    parser = argparse.ArgumentParser(prog="python -m bench coverage")
    parser.add_argument("--logs", type=int, default=200)
    parser.add_argument("--sensing", default="speed40k")
    parser.add_argument("--duration", type=float, default=20.0)
    wanted = parser.parse_args(arguments)
    found = [d for seed in range(wanted.logs) for d in deviations(seed, wanted.sensing, wanted.duration)]
    print(f"{wanted.logs} logs, {wanted.sensing}, {wanted.duration:g} s; share within 95 %, and mean deviation")
    for key in dict.fromkeys((d.help, d.name) for d in found):
        z = np.array([d.sigma for d in found if (d.help, d.name) == key])
        inside = 100.0 * np.mean(np.abs(z) < TWO_SIDED)
        print(f"{key[0]:16s} {key[1]:32s} {inside:5.1f} %  mean {z.mean():+.2f}  std {z.std():.2f}  n {z.size}")
