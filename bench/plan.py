"""`python -m bench plan`: does the planned motion settle what a poor log of the outside rig leaves open?

Logs of machines of `tests/oracle/rig*.py` with one hidden effect that move little, slowly, one way or for a moment,
and end in a tie, a weak value or `unknown`. The motion that is planned from such a log, within the limits of the
machine, is run on that machine; so is the old motion for as long. One row per log goes into bench/results/plan.json;
`--page` prints the figures of docs/plan.md.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from dsd_cli.errors import DsdError
from dsd_cli.identify.design.plan import Wanted, plan_next
from dsd_cli.identify.design.results import Plan
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

    def moved(self, t: Any, wanted: Any, take: int) -> tuple[Recording, Any]:
        """(recording, exact motion)."""
        log, exact = follow(self.case, self.trial, t, wanted, take)
        step = float(np.median(np.diff(log["t"])))
        return prepare(Log(log, step, f"log {take}"), self.observer), exact

    def asked(self, recordings: Sequence[Recording]) -> Diagnosis:
        """The diagnosis, its search kept."""
        keep = lambda search, whole: self.kept.append((search, whole))  # noqa: E731
        return diagnose(recordings, self.model, self.observer, Settings(), on_found=keep)

    def plan(self, said: Diagnosis) -> tuple[Plan, float]:
        """(plan within the machine's limits, s of CPU)."""
        begin = time.process_time()
        plan = plan_next(*self.kept[-1], said, self.observer, Wanted(limits=self.limits))
        return plan, time.process_time() - begin

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
        weak = any(e.told in ("weak", "not") for e in own)
        return (
            said.verdict == what and set(said.found) == {what} and not ranking[what].indistinguishable_from and not weak
        )


def left_open(said: Diagnosis) -> bool:
    """Whether a log ends in a tie, a weak value or `unknown`."""
    ranking = {c.effect: c for c in said.ranking}
    ties = any(ranking[name].indistinguishable_from for name in said.found if name in ranking)
    own = [e for name, e in said.estimates.items() if name.partition(".")[0] in said.found]
    return said.verdict == "unknown" or ties or any(e.told in ("weak", "not") for e in own)


def one(case: RigCase, kind: str) -> Row | None:
    """A row; None where the poor log left nothing open, or could not be asked."""
    machine = Machine(case)
    first, _ = machine.moved(*poor_reference(machine.trial, kind, DURATION), 0)
    try:
        said = machine.asked([first])
    except DsdError:
        return None
    if not left_open(said):
        return None
    row: Row = {"what": case.what[0], "seed": case.seed, "kind": kind, "sensing": case.sensing, "verdict": said.verdict}
    try:
        plan, row["cpu"] = machine.plan(said)
    except DsdError as error:
        return {**row, "error": str(error)}
    if plan.motion is None:
        return {**row, "error": "no motion"}
    row["pairs"] = len(plan.pairs)
    row["parts"] = sorted({s.kind for s in plan.stages})
    t = np.arange(len(plan.motion.position)) * plan.motion.step
    next_log, exact = machine.moved(t, (plan.motion.position, plan.motion.velocity, plan.motion.u), 1)
    row["broken"] = _broken(plan, exact)
    after = machine.asked([first, next_log])
    row |= {"after": after.verdict, "settled": machine.settled(after), "found": list(after.found)}
    row["realised"] = _realised(machine, plan)
    old, _ = machine.moved(*poor_reference(machine.trial, kind, plan.motion.seconds), 2)
    again = machine.asked([first, old])
    return row | {"after_old": again.verdict, "settled_old": machine.settled(again)}


def _broken(plan: Plan, exact: Any) -> dict[str, float]:
    """Limits that the rig's machine broke, by which share."""
    step = float(np.median(np.diff(exact.t)))
    width = max(round(0.02 / step), 1)
    smooth = np.convolve(exact.acceleration, np.ones(width) / width, "same")
    return plan.limits.exceeded(exact.q, exact.v, smooth, exact.u)


def _realised(machine: Machine, plan: Plan) -> list[tuple[float, float]]:
    """(expected, realised nats) of pairs with the truth in them, on both logs."""
    search, _ = machine.kept[-1]
    what, found = machine.case.what[0], []
    fits = {o.effect: o.fit for o in search.options(search.refit)} | {"none": search.refit}
    for pair in plan.pairs:
        for truth, rival, expected in ((pair.a, pair.b, pair.nats_if_a), (pair.b, pair.a, pair.nats_if_b)):
            if truth == what and rival in fits and truth in fits and np.isfinite(expected) and expected > 0.0:
                left = [search.nats(search.converged(fits[name]).loss) for name in (rival, truth)]
                found.append((float(expected), left[0] - left[1]))
    return found


def looped(case: RigCase, kind: str) -> Row | None:
    """Plan, run, ask, up to three times; None where the first log settles it, or cannot be asked."""
    machine = Machine(case)
    first, _ = machine.moved(*poor_reference(machine.trial, kind, DURATION), 0)
    logs, row = [first], {"what": case.what[0], "seed": case.seed, "kind": kind}
    try:
        said = machine.asked(logs)
    except DsdError:
        return None
    if machine.settled(said):
        return None
    try:
        for k in range(MOST + 1):
            if machine.settled(said) or k == MOST:
                return row | {"settled": machine.settled(said), "experiments": k, "verdict": said.verdict}
            plan, _ = machine.plan(said)
            if plan.motion is None:
                return row | {"settled": machine.settled(said), "experiments": k, "verdict": said.verdict}
            t = np.arange(len(plan.motion.position)) * plan.motion.step
            logs.append(machine.moved(t, (plan.motion.position, plan.motion.velocity, plan.motion.u), k + 1)[0])
            said = machine.asked(logs)
    except (DsdError, RuntimeError) as error:
        return row | {"settled": False, "experiments": -1, "verdict": str(error)}
    raise AssertionError("the loop ends above")


def kept(case: RigCase, kind: str) -> Row | None:
    """How often plans of one log break a limit on the rig: what is open, in shorter, longer, narrower ones."""
    machine = Machine(case)
    first, _ = machine.moved(*poor_reference(machine.trial, kind, DURATION), 0)
    try:
        said = machine.asked([first])
    except DsdError:
        return None
    limits = machine.limits
    middle = 0.5 * sum(limits["position"])
    narrow = {n: (0.5 * a, 0.5 * b) for n, (a, b) in limits.items()}
    narrow["position"] = tuple(0.5 * (x + middle) for x in limits["position"])  # type: ignore[assignment]
    asked = [Wanted(limits=limits, seconds=(s,)) for s in (4.0, 10.0, 20.0)]
    asked += [Wanted(limits=narrow), Wanted(("inertia",), limits=limits)]
    row: Row = {"what": case.what[0], "seed": case.seed, "kind": kind, "plans": 0, "broken": [], "refused": 0}
    for k, wanted in enumerate(asked):
        try:
            plan = plan_next(*machine.kept[-1], said, machine.observer, wanted)
        except DsdError:
            row["refused"] += 1
            continue
        if plan.motion is not None:
            t = np.arange(len(plan.motion.position)) * plan.motion.step
            _, exact = machine.moved(t, (plan.motion.position, plan.motion.velocity, plan.motion.u), k + 1)
            row["plans"] += 1
            row["broken"] += [broken] if (broken := _broken(plan, exact)) else []
    return row


#: Share of the friction that the inertial force may reach where load friction is to be identified: a sixtieth.
_SLOW_PUSH = 1.0 / 60.0


def impossible(seed: int) -> Row | None:
    """Coulomb friction in a good log: load friction is distinguished from it only where u changes beside it, the gain
    of the drive never. True: said so where it is so, and not where it is not. None: the log cannot test load friction,
    which is said before any plan."""
    machine = Machine(RigCase(what=("coulomb_friction",), seed=seed, sensing="enc4096", duration=10.0))
    plan, on = machine.trial.design, machine.trial.design.t >= 0.0
    t = plan.t[on]
    q = np.asarray(plan.wanted.q)[on]
    v = np.gradient(q, t)
    first, _ = machine.moved(t - t[0], (q, v, 0.8 * plan.inertia * np.gradient(v, t)), 0)
    said = machine.asked([first])
    level = machine.trial.machine.effects["coulomb_friction"]["level"]
    names, limits = ("coulomb_friction", "load_friction"), machine.limits
    slow = {**limits, "acceleration": (0.0, _SLOW_PUSH * level / plan.inertia)}

    def lost(names: tuple[str, ...], limits: dict[str, tuple[float, float]], what: str) -> bool:
        wanted = Wanted(names, limits=limits)
        found = plan_next(*machine.kept[-1], said, machine.observer, wanted).impossible
        return any(what in one.what for one in found)

    if "load_friction" in machine.kept[-1][0].problem.untestable:
        return None
    return {
        "seed": seed,
        "base": list(machine.trial.base),
        "gain": lost(("gain",), limits, "gain"),
        "load friction, pushed hardly": lost(names, slow, "load_friction"),
        "load friction, pushed": not lost(names, limits, "load_friction"),
    }


def cases(first: int = 0) -> Iterator[tuple[RigCase, str]]:
    """Logs in the order in which they are asked."""
    for k in range(first, first + MOST_CASES):
        what, kind = HIDDEN[k % len(HIDDEN)], POOR[(k + k // len(HIDDEN)) % len(POOR)]
        yield RigCase(what=(what,), seed=FROM + k, sensing=SENSORS[k // len(HIDDEN) % 2], duration=10.0), kind


def _keep(name: str, rows: list[Row]) -> None:
    known = json.loads(RESULTS.read_text()) if RESULTS.exists() else {}
    RESULTS.parent.mkdir(exist_ok=True)
    RESULTS.write_text(json.dumps(known | {name: rows}, indent=1))


def page(known: dict[str, list[Row]]) -> list[str]:
    """Figures in words."""
    rows = known.get("plans", [])
    planned = [r for r in rows if "error" not in r]
    ratios = [realised / expected for r in planned for expected, realised in r["realised"]]
    near = sum(0.5 <= x <= 2.0 for x in ratios)
    cpu = [r["cpu"] for r in planned]
    loops, limits, impossible = (known.get(name, []) for name in ("loops", "limits", "impossible"))
    said = [r[k] for r in impossible for k in ("gain", "load friction, pushed hardly")]
    return [
        f"poor logs: {len(rows)}, planned {len(planned)}",
        f"settled after the planned motion: {sum(r['settled'] for r in planned)} of {len(rows)}",
        f"right effect named after it: {sum(r['after'] == r['what'] for r in planned)} of {len(rows)}",
        f"settled after the old motion for as long: {sum(r['settled_old'] for r in planned)} of {len(rows)}",
        f"right effect named after that: {sum(r['after_old'] == r['what'] for r in planned)} of {len(rows)}",
        f"realised nats within a factor of 2 of the expected: {near} of {len(ratios)} pairs",
        f"a limit broken on the rig: {sum(bool(r['broken']) for r in planned)} of {len(planned)}",
        f"CPU of a plan: {np.median(cpu):.1f} s in the middle, {max(cpu):.1f} s at most" if cpu else "",
        f"loops settled: {sum(r['settled'] for r in loops)} of {len(loops)}",
        f"a limit broken by one of five plans of a log: {sum(len(r['broken']) for r in limits)} of "
        f"{sum(r['plans'] for r in limits)} plans",
        f"what no motion identifies is said: {sum(said)} of {len(said)}; and where one does: "
        f"{sum(not r['load friction, pushed'] for r in impossible)} of {len(impossible)}",
    ]


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(prog="python -m bench plan", description=__doc__)
    parser.add_argument("--loops", type=int, default=0, help="ask so many loops, in place of plans")
    parser.add_argument("--limits", type=int, default=0, help="ask so many logs for five plans each, and their limits")
    parser.add_argument("--impossible", type=int, default=0, help="ask so many machines what no motion identifies")
    parser.add_argument("--most", type=int, default=40, help="logs")
    parser.add_argument("--first", type=int, default=0, help="number of the first log")
    parser.add_argument("--page", action="store_true", help="print the figures of what was asked")
    options = parser.parse_args(arguments)
    if options.page:
        print("\n".join(page(json.loads(RESULTS.read_text()))))
        return
    asked, most = one, options.most
    for name in ("loops", "limits", "impossible"):
        if count := getattr(options, name):
            asked, most = {"loops": looped, "limits": kept, "impossible": lambda c, _: impossible(c.seed)}[name], count
            break
    else:
        name = "plans"
    rows: list[Row] = []
    for case, kind in cases(options.first):
        row = asked(case, kind)
        if row is not None:
            rows.append(row)
            _keep(name, rows)
            print(json.dumps(row), flush=True)
        if len(rows) >= most:
            break


if __name__ == "__main__":
    main()
