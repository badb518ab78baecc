"""`python -m bench plan`: does the planned motion settle what a poor log of the outside rig leaves open?

Logs of machines of `tests/oracle/rig*.py` with one hidden effect that move little, slowly, one way or for a moment,
and end in a tie, a weak value or `unknown`. The motion that is planned from such a log, within the limits of the
machine, is run on that machine; so is the old motion for as long. Where that settles nothing, it is planned for again,
as `--run-with` does, up to three experiments. One row per log goes into bench/results/plan.json;
`--page` writes the figures into docs/measured/plan.md.
"""

from __future__ import annotations

import argparse
import json
import math
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np

from bench.marked import put
from bench.plan_page import PAGE, figures
from dsd_cli.cli.plan_loop import left_open, misled
from dsd_cli.design.limits import limits_of
from dsd_cli.design.plan import Wanted, plan_next
from dsd_cli.design.results import Motion, Plan
from dsd_cli.design.targets import apart, targets_of
from dsd_cli.errors import DsdError
from dsd_cli.identify.recordings.recording import Recording, prepare
from dsd_cli.identify.results import Diagnosis
from dsd_cli.identify.search.sets import Search
from dsd_cli.identify.verdict.diagnose import Settings, diagnose
from dsd_cli.plant.model import ObserverSettings, PlantModel
from dsd_cli.signals.log import Log
from tests.oracle.rig_cases import RigCase
from tests.oracle.rig_given import POOR, follow, poor_reference
from tests.oracle.rig_trials import find_trial

RESULTS = Path(__file__).parent / "results" / "plan.json"
#: Effects that are hidden; first seed that was never looked at; sensors.
HIDDEN = (
    *("gravity", "constant_load", "stiffness", "cubic_stiffness", "coulomb_friction", "viscous_friction"),
    *("quadratic_drag", "viscous_asymmetry", "stribeck_friction", "cogging"),
)
FROM, SENSORS, DURATION = 81000, ("enc4096", "speed40k"), 8.0
#: Experiments of a loop.
MOST = 3
#: Logs that are made at most; those that leave nothing open are not counted.
MOST_CASES = 200
Row = dict[str, Any]


@dataclass
class Machine:
    """A machine of the rig, what its owner believes, and what his logs so far say."""

    case: RigCase

    def __post_init__(self) -> None:
        self.trial = find_trial(self.case)
        self.observer = ObserverSettings(self.trial.design.inertia, 0.01)
        effects = self.trial.machine.effects
        base = {name: effects[name] for name in self.trial.base}
        beliefs = self.trial.beliefs
        self.model = PlantModel(beliefs["inertia"], beliefs["delay"], base)
        self.kept: list[tuple[Search, Any]] = []
        #: Of the last plan, the fits of both sides of each pair.
        self.sets: dict[tuple[str, str], tuple[Any, Any]] = {}

    def moved(self, t: Any, wanted: Any, take: int) -> tuple[Recording, Any]:
        """(recording, exact motion)."""
        log, exact = follow(self.case, self.trial, t, wanted, take)
        step = float(np.median(np.diff(log["t"])))
        return prepare(Log(log, step, f"log {take}"), self.observer), exact

    def run(self, motion: Motion, take: int) -> tuple[Recording, Any]:
        """The planned motion: (recording, exact motion)."""
        t = np.arange(len(motion.position)) * motion.step
        return self.moved(t, (motion.position, motion.velocity, motion.u), take)

    def asked(self, recordings: Sequence[Recording]) -> Diagnosis:
        """The diagnosis, its search kept."""
        keep = lambda search, whole: self.kept.append((search, whole))  # noqa: E731
        return diagnose(recordings, self.model, self.observer, Settings(), on_found=keep)

    def answer(self, together: Diagnosis, newest: Recording) -> tuple[Diagnosis, bool]:
        """(what the loop takes as its answer, whether that is of the newest log alone)."""
        if not left_open(together):
            return together, False
        if misled(together, alone := self.asked([newest])):
            return alone, True
        self.kept.pop()
        return together, False

    def plan(self, said: Diagnosis) -> tuple[Plan, float]:
        """(plan within the machine's limits, s of CPU)."""
        begin = time.process_time()
        plan = plan_next(*self.kept[-1], said, self.observer, Wanted(limits=self.limits))
        taken, targets = time.process_time() - begin, targets_of(*self.kept[-1], said)
        named = [(e.name, e.fit) for e in targets.explanations]
        self.sets = {apart(named[a][0], named[b][0]): (named[a][1], named[b][1]) for a, b in targets.pairs}
        return plan, taken

    @property
    def limits(self) -> dict[str, tuple[float, float]]:
        """What the machine reached with the motion that it was drawn with."""
        motion = self.trial.motion
        sizes = {"velocity": motion.v, "acceleration": motion.acceleration, "u": motion.u}
        found = {name: (0.0, float(np.quantile(np.abs(x), 0.999))) for name, x in sizes.items()}
        return {**found, "position": (float(motion.q.min()), float(motion.q.max()))}

    def settled(self, said: Diagnosis) -> bool:
        """The truth and nothing else, no tie, all of its values identified."""
        what = self.case.what[0]
        ranking = {c.effect: c for c in said.ranking}
        own = [e for name, e in said.estimates.items() if name.startswith(f"{what}.")]
        weak = any(e.grade in ("weak", "not") for e in own)
        return (
            said.verdict == what and set(said.found) == {what} and not ranking[what].indistinguishable_from and not weak
        )


def opened(case: RigCase, kind: str) -> tuple[Machine, Recording, Diagnosis] | None:
    """(machine, its poor log, what that says); None where it cannot be asked."""
    machine = Machine(case)
    try:
        first, _ = machine.moved(*poor_reference(machine.trial, kind, DURATION), 0)  # the axis may not move in it
        return machine, first, machine.asked([first])
    except DsdError:
        return None


def one(case: RigCase, kind: str, *, old: bool = True) -> Row | None:
    """A row; None where the poor log left nothing open, or could not be asked. old : ask the old motion, too."""
    if (known := opened(case, kind)) is None or not left_open(known[-1]):
        return None
    machine, first, said = known
    row: Row = {"what": case.what[0], "seed": case.seed, "kind": kind, "sensing": case.sensing, "verdict": said.verdict}
    try:
        plan, row["cpu"] = machine.plan(said)
    except DsdError as error:
        return {**row, "error": str(error)}
    if plan.motion is None:
        return {**row, "error": "no motion"}
    row["pairs"] = len(plan.pairs)
    row["parts"] = sorted({s.kind for s in plan.stages})
    next_log, exact = machine.run(plan.motion, 1)
    row["broken"] = _broken(plan, exact)
    together = machine.asked([first, next_log])
    row["realised"] = _realised(machine, plan)
    after, row["alone"] = machine.answer(together, next_log)
    row |= {"after": after.verdict, "settled": machine.settled(after), "found": list(after.found)}
    row |= {"loop": _gone_on(machine, [first, next_log], after, row["alone"])}
    if not old:
        return row
    old_log, _ = machine.moved(*poor_reference(machine.trial, kind, plan.motion.seconds), 2)
    again = machine.asked([first, old_log])
    return row | {"after_old": again.verdict, "settled_old": machine.settled(again)}


def _gone_on(machine: Machine, logs: list[Recording], said: Diagnosis, last: bool) -> Row:
    """From the first experiment on until it is settled, the newest log alone leaves nothing open, or three have run; as
    the command does, and with the limits that each of these plans broke. last : only the newest log counts so far."""
    row: Row = {"experiments": 1, "broken": []}
    try:
        while not ((last and not left_open(said)) or machine.settled(said) or row["experiments"] == MOST):
            logs = logs[-1:] if last else logs
            plan, _ = machine.plan(said)
            if plan.motion is None:
                break
            row["experiments"] += 1
            log, exact = machine.run(plan.motion, 2 + row["experiments"])
            logs.append(log)
            row["broken"].append(_broken(plan, exact))
            said, last = machine.answer(machine.asked(logs), log)
    except (DsdError, RuntimeError) as error:
        return row | {"settled": False, "verdict": str(error)}
    return row | {"settled": machine.settled(said), "verdict": said.verdict}


def _broken(plan: Plan, exact: Any) -> dict[str, float]:
    """Limits that the rig's machine broke, by which share."""
    step = float(np.median(np.diff(exact.t)))
    width = max(round(0.02 / step), 1)
    smooth = np.convolve(exact.acceleration, np.ones(width) / width, "same")
    return plan.limits.exceeded(exact.q, exact.v, smooth, exact.u)


def _realised(machine: Machine, plan: Plan) -> list[tuple[float, float]]:
    """(expected, realised nats) of pairs with the truth in them, on both logs."""
    (search, whole), what, found = machine.kept[-1], machine.case.what[0], []
    for pair in plan.pairs:
        sets = machine.sets[pair.a, pair.b]
        ways = zip((sets, sets[::-1]), (pair.nats_if_a, pair.nats_if_b), strict=True)
        for (truth, rival), expected in ways:
            named = [what in {t.id for t in fit.terms} for fit in (truth, rival)]
            if named == [True, False] and np.isfinite(expected) and expected > 0.0:
                left = [search.nats(_anew(search, whole, fit).loss) for fit in (rival, truth)]
                found.append((float(expected), left[0] - left[1]))
    return found


def _anew(search: Search, whole: Any, known: Any) -> Any:
    """The same set of effects, fitted to the logs of another search: its shapes begin where they were, and where that
    search has them."""
    ids = {t.id for t in known.terms}
    others = [whole, search.refit, *(o.fit for o in search.options(search.refit))]
    same = [search.fit(known.terms, known.tap), *(f for f in others if {t.id for t in f.terms} == ids)]
    return min((search.converged(fit) for fit in same), key=lambda fit: float(fit.loss))


def kept(case: RigCase, kind: str) -> Row | None:
    """How often plans of one log break a limit on the rig: what is open, in shorter, longer, narrower ones, and within
    limits that are drawn, each 1.1 to 3 times what the log reached. What is expected of them, of one plant: nobody asks
    for it."""
    if (known := opened(case, kind)) is None or not left_open(known[-1]):
        return None
    machine, first, said = known
    limits = machine.limits
    middle = 0.5 * sum(limits["position"])
    narrow = {n: (0.5 * a, 0.5 * b) for n, (a, b) in limits.items()}
    narrow["position"] = tuple(0.5 * (x + middle) for x in limits["position"])  # type: ignore[assignment]
    asked = [Wanted(limits=limits, seconds=(s,)) for s in (4.0, 10.0, 20.0)]
    asked += [Wanted(limits=narrow), Wanted(limits=_drawn(machine, first))]
    row: Row = {"what": case.what[0], "seed": case.seed, "kind": kind, "plans": 0, "broken": [], "refused": 0}
    row["cpu"] = []
    for k, wanted in enumerate(asked):
        begin = time.process_time()
        try:
            with patch("dsd_cli.design.plan._DRAWS_SAID", 1):
                plan = plan_next(*machine.kept[-1], said, machine.observer, wanted)
            row["cpu"].append(time.process_time() - begin)
        except DsdError:
            row["refused"] += 1
            continue
        if plan.motion is not None:
            _, exact = machine.run(plan.motion, k + 1)
            row["plans"] += 1
            row["broken"] += [broken] if (broken := _broken(plan, exact)) else []
    return row


def _drawn(machine: Machine, log: Recording) -> dict[str, tuple[float, float]]:
    """Limits of which each is 1.1 to 3 times what a log reached."""
    times = np.exp(np.random.default_rng(machine.case.seed).uniform(np.log(1.1), np.log(3.0), 4)).tolist()
    reached = limits_of([log], {}, math.nan, machine.kept[-1][0].equations.band.hz)
    middle, half = 0.5 * (reached.low + reached.high), 0.5 * times[0] * (reached.high - reached.low)
    sizes = zip(("velocity", "acceleration", "u"), times[1:], strict=True)
    return {"position": (middle - half, middle + half)} | {n: (0.0, x * getattr(reached, n)) for n, x in sizes}


#: How much slower a log is than the machine's usual motion in which friction is nearly all of u.
_CRAWL = 16.0


def impossible(seed: int) -> Row | None:
    """What no motion identifies, and what one does; true: said so where it is so, and not where it is not.

    The gain of the drive: the balance is the same with all of it as many times as large. Load friction beside
    Coulomb friction within the limits of a crawl: u is as large as the friction throughout (within those of the usual
    motion a push tells them apart). None: the usual motion does not show the friction, or a crawl does not move the
    axis.
    """
    brake = Machine(RigCase(what=("coulomb_friction",), seed=seed, sensing="enc4096", duration=10.0))
    names = ("coulomb_friction", "load_friction")
    if (slow := _paced(brake, _CRAWL)) is None:
        return None
    crawl = {
        name: (a / _CRAWL**k, b / _CRAWL**k)
        for k, name in enumerate(("velocity", "acceleration"), 1)
        for a, b in [brake.limits[name]]
    }
    crawling = _said_of("load_friction", brake, slow, names, crawl)
    usual = _paced(brake, 1.0)
    shown = usual is not None and usual.verdict == "coulomb_friction"
    if usual is None or not shown or "load_friction" in brake.kept[-1][0].problem.untestable:
        return None
    return {
        "seed": seed,
        "the gain": _said_of("gain", brake, usual, ("gain",)),
        "load friction, where it is pushed": not _said_of("load_friction", brake, usual, names),
        "load friction, in a crawl": crawling,
    }


def _paced(machine: Machine, times: float) -> Diagnosis | None:
    """Of a log of the machine's usual motion, so many times slower; None where it cannot be asked."""
    plan, on = machine.trial.design, machine.trial.design.t >= 0.0
    t = plan.t[on] - plan.t[on][0]
    q = np.interp(t / times, t, np.asarray(plan.wanted.q)[on])
    v = np.gradient(q, t)
    try:
        return machine.asked([machine.moved(t, (q, v, 0.8 * plan.inertia * np.gradient(v, t)), 0)[0]])
    except DsdError:
        return None


def _said_of(
    what: str,
    machine: Machine,
    said: Diagnosis,
    names: tuple[str, ...],
    narrower: Mapping[str, tuple[float, float]] = {},
) -> bool:
    """Whether the plan for these names says that no motion does it, or that these logs cannot test it."""
    try:
        wanted = Wanted(names, limits={**machine.limits, **narrower})
        plan = plan_next(*machine.kept[-1], said, machine.observer, wanted)
    except DsdError:
        return True
    return any(what in one.what for one in plan.impossible)


def cases(first: int = 0) -> Iterator[tuple[RigCase, str]]:
    """Logs in the order in which they are asked."""
    for k in range(first, first + MOST_CASES):
        what, kind = HIDDEN[k % len(HIDDEN)], POOR[(k + k // len(HIDDEN)) % len(POOR)]
        yield RigCase(what=(what,), seed=FROM + k, sensing=SENSORS[k // len(HIDDEN) % 2], duration=10.0), kind


def _kept_rows() -> dict[str, list[Row]]:
    return dict(json.loads(RESULTS.read_text())) if RESULTS.exists() else {}


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(prog="python -m bench plan", description=__doc__)
    parser.add_argument("--old", type=int, default=MOST_CASES, help="ask so many of the logs for the old motion, too")
    parser.add_argument("--limits", type=int, default=0, help="ask so many logs for five plans each, and their limits")
    parser.add_argument("--impossible", type=int, default=0, help="ask so many machines what no motion identifies")
    parser.add_argument("--most", type=int, default=40, help="logs")
    parser.add_argument("--first", type=int, default=0, help="number of the first log")
    parser.add_argument("--more", action="store_true", help="add to the rows of earlier runs")
    parser.add_argument("--page", action="store_true", help="write the figures of what was asked into the page")
    parser.add_argument("--block", default="rig", help="which marked part of the page: rig, or fresh")
    options = parser.parse_args(arguments)
    if options.page:
        put(PAGE, options.block, figures(_kept_rows()))
        return
    asked, most = lambda c, kind: one(c, kind, old=len(before) + len(rows) < options.old), options.most
    for name in ("limits", "impossible"):
        if count := getattr(options, name):
            asked, most = {"limits": kept, "impossible": lambda c, _: impossible(c.seed)}[name], count
            break
    else:
        name = "plans"
    rows: list[Row] = []
    before: list[Row] = _kept_rows().get(name, []) if options.more else []
    for case, kind in cases(options.first):
        row = asked(case, kind)
        if row is not None:
            rows.append(row)
            RESULTS.parent.mkdir(exist_ok=True)
            RESULTS.write_text(json.dumps(_kept_rows() | {name: before + rows}, indent=1))
            print(json.dumps(row), flush=True)
        if len(rows) >= most:
            break


if __name__ == "__main__":
    main()
