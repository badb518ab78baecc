"""How often the +- of a fit holds the truth: the outside rig, all that is in a log fitted, with help and without.

`python -m bench coverage [--logs 200] [--first SEED] [--sensing NAME ...] [--delay SECONDS]`: the logs take turns with
the sensings; without `--delay` each draws one of 0 to 25 ms, of no whole number of samples.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy import stats

from dsd_cli.identify.fit.priors import PriorKnowledge
from dsd_cli.identify.fit.problem import Problem, Settings, pose
from dsd_cli.identify.fit.solve import Solver
from dsd_cli.identify.fit.values import flat, terms_of
from dsd_cli.identify.recordings.recording import prepare
from dsd_cli.identify.search.sets import Search
from dsd_cli.plant.model import ObserverSettings, PlantModel
from dsd_cli.signals.log import Log

sys.path.insert(0, str(Path(__file__).parents[1]))

from tests.oracle.rig import make
from tests.oracle.rig_cases import RigCase

#: Standard errors within which 95 % of true values lie.
WITHIN = 1.96
HIDDEN = ("coulomb_friction", "viscous_friction")


@dataclass(frozen=True)
class Deviation:
    """A value of one log under that help: (fitted - true) / standard error."""

    help: str
    name: str
    sigma: float

    @property
    def inside(self) -> bool:
        """Whether the 95 % interval holds the truth."""
        return abs(self.sigma) < WITHIN


def deviations(
    seed: int, sensing: str = "speed40k", duration: float = 20.0, delay: float | None = None
) -> Iterator[Deviation]:
    """Of one log: with nothing known, J held at its truth, and a prior of J that is off by a draw of its spread.

    That spread is the error that the log alone has, so that log and prior weigh alike. delay : s; None draws it.
    """
    made = make([RigCase(HIDDEN, seed, sensing, duration=duration, delay=delay)])[0]
    truth = PlantModel(made.truth["inertia"], made.truth["delay"], made.truth["effects"])
    observer = ObserverSettings(made.observer["nominal_inertia"], made.observer["time_constant"])
    recording = prepare(Log(made.channels, made.sample_time, "rig"), observer)
    problem = pose([recording], truth, Settings(effects=()))
    tap = round(truth.delay / problem.solver.bank.tap_time)
    problem = problem.measured_again(Search(problem).fit(terms_of(truth), tap))
    alone = problem.values(Search(problem).fit(terms_of(truth), tap)).estimates["inertia"]
    draw = np.random.default_rng(seed).normal()
    helps = {
        "nothing known": PriorKnowledge(),
        "J held": PriorKnowledge(fixed={"inertia": truth.inertia}),
        "J with a prior": PriorKnowledge(priors={"inertia": (truth.inertia + alone.std_error * draw, alone.std_error)}),
    }
    for name, known in helps.items():
        yield from _deviations(_told(problem, known), truth, name, tap)


def _told(problem: Problem, known: PriorKnowledge) -> Problem:
    """The same question of somebody who knows that."""
    solver = problem.solver
    return replace(problem, solver=Solver(solver.bank, solver.blocks, solver.inertia, known, solver.variance))


def _deviations(problem: Problem, truth: PlantModel, help_: str, tap: int) -> Iterator[Deviation]:
    found = problem.values(Search(problem).fit(terms_of(truth), tap)).estimates
    for name, value in flat(truth).items():
        if found[name].std_error > 0.0:
            sigma = (found[name].value - value) / found[name].std_error
            yield Deviation(help_, name, sigma)


def table(found: Sequence[Deviation]) -> Iterator[str]:
    """Share of logs whose interval holds the truth, with its own 95 % interval, per help and value."""
    for key in dict.fromkeys((d.help, d.name) for d in found):
        own = [d for d in found if (d.help, d.name) == key]
        inside, z = sum(d.inside for d in own), np.array([d.sigma for d in own])
        low, high = (100.0 * x for x in stats.binomtest(inside, len(own)).proportion_ci(0.95))
        yield (
            f"{key[0]:16s} {key[1]:32s} {100.0 * inside / len(own):5.1f} % ({low:.0f}-{high:.0f})"
            f"  mean {z.mean():+.2f}  std {z.std():.2f}  n {z.size}"
        )


def main(arguments: list[str]) -> None:
    """Print a table: help, value, share of logs whose 95 % interval holds the truth."""
    parser = argparse.ArgumentParser(prog="python -m bench coverage")
    parser.add_argument("--logs", type=int, default=200)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--sensing", nargs="+", default=["speed40k"])
    parser.add_argument("--duration", type=float, default=20.0)
    parser.add_argument("--delay", type=float)
    wanted = parser.parse_args(arguments)
    found: list[Deviation] = []
    for i in range(wanted.logs):
        sensing = wanted.sensing[i % len(wanted.sensing)]
        found += deviations(wanted.first + i, sensing, wanted.duration, wanted.delay)
        print(f"\r{i + 1} of {wanted.logs} logs", end="", file=sys.stderr, flush=True)
    print(f"\n{wanted.logs} logs from {wanted.first}, {', '.join(wanted.sensing)}, {wanted.duration:g} s")
    for line in table(found):
        print(line)
