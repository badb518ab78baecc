"""Logs of one machine of the outside rig on several days: a level of its own, and another motion, on each."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from tests.oracle.rig_cases import Array, RigCase
from tests.oracle.rig_designs import Design, design
from tests.oracle.rig_trials import find_trial, run_design

#: Of the effects that differ from day to day, the value that does.
LEVEL = {"coulomb_friction": "level", "constant_load": "force", "viscous_friction": "coefficient"}
#: Seeds between the motions of two days.
_APART = 1000


@dataclass(frozen=True)
class Days:
    """logs : channels of each day. inertia, delay, effects : the machine with the level that the days are around."""

    logs: tuple[dict[str, Array], ...]
    sample_time: float
    inertia: float
    delay: float
    effects: dict[str, dict[str, Any]]


def days_of(case: RigCase, varies: str, factors: tuple[float, ...]) -> Days:
    """A day for each factor on that level; `varies` is one of the effects of the case.

    Raises
    ------
    RuntimeError : the machine ran away.
    """
    trial = find_trial(case)
    made = []
    for day, factor in enumerate(factors):
        plan = _of_machine(design(replace(case, seed=case.seed + _APART * day), 0), trial.design)
        effects = {name: dict(values) for name, values in trial.machine.effects.items()}
        effects[varies][LEVEL[varies]] *= factor
        found = run_design(plan, effects)
        if found is None:
            raise RuntimeError(f"{case} ran away on day {day}")
        _, motion, servo = found
        logged = motion.t >= 0.0
        channels = {"t": motion.t[logged], "u": motion.u[logged], "position": np.array(servo.seen_q)[logged]}
        if "velocity" in plan.sensing.logs:
            channels["velocity"] = np.array(servo.seen_v)[logged]
        made.append(channels)
    step = case.sample_time * trial.design.sensing.rate
    return Days(tuple(made), step, trial.design.inertia, trial.design.delay, dict(trial.machine.effects))


def _of_machine(plan: Design, machine: Design) -> Design:
    """Motion and loop of one design for the machine of another, with gains for its inertia."""
    times, g = machine.inertia / plan.inertia, plan.gains
    return replace(
        plan,
        inertia=machine.inertia,
        delay=machine.delay,
        speed_noise=machine.speed_noise,
        gains=replace(g, kp=g.kp * times, kd=g.kd * times, ki=g.ki * times, kiv=g.kiv * times),
        wanted=replace(plan.wanted, added=plan.wanted.added * times),
    )
