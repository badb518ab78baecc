"""What the true law leaves of a log of the outside rig: written as an effect on the measured motion, or as a force that
is known sample by sample.

A law that anybody could learn looks at the motion as the sensors show it. The force itself is known better: in which
millisecond the axis stuck and broke away, which no sensor shows.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from dsd_cli.effects.general import CURVE
from dsd_cli.identify.fit.equations import Equations
from dsd_cli.identify.fit.problem import pose
from dsd_cli.identify.fit.testability import Settings
from dsd_cli.identify.recordings.recording import Recording
from dsd_cli.learn.choose import left_of
from dsd_cli.learn.families import Columns, Family
from dsd_cli.learn.judge import Judge
from dsd_cli.learn.rows import Balance, balance_of
from dsd_cli.plant.forces import Mask
from dsd_cli.plant.model import PlantModel
from tests.oracle.rig_strange import StrangeLog, on_motion
from tests.oracle.rig_strange_laws import Law

#: Rounds in which the delay is found beside the law.
_ROUNDS = 3
#: s after which it is.
_FORGOTTEN = 2.0


def law_error(
    log: StrangeLog,
    law: Law,
    recording: Recording,
    model: PlantModel,
    rows: Callable[[Equations], Mask] = lambda equations: equations.kept,
) -> float:
    """Held-out error, in these rows, of the true law as an effect of the model, one coefficient fitted along."""
    problem = pose([recording], model, Settings())
    balance = balance_of(problem, log.delay / problem.solver.bank.tap_time)
    for _ in range(_ROUNDS):
        judge = Judge(balance)
        law_there = _columns(log, law, balance)
        fit = judge.fit([law_there] if law_there.rows[0].any() else [])  # an end stop that this motion never meets
        balance = balance.at(judge.delay(fit)).beside(judge.residual(fit, held_out=False))
    return left_of(judge, fit, rows(balance.equations))


def settled(equations: Equations) -> Mask:
    """Rows of a log in which what a law remembers from before it is forgotten."""
    times = equations.of_rows([s.frame.times for s in equations.stretches])
    return np.asarray(equations.kept & (times > times[0] + _FORGOTTEN))


def _columns(log: StrangeLog, law: Law, balance: Balance) -> Columns:
    forces = []
    for s, u in zip(balance.equations.stretches, balance.drive, strict=True):
        motion = (s.frame.times, s.middle.position, s.middle.velocity, s.acceleration, u)
        forces.append(-on_motion(log, law, motion, s.sign))
    smooth = law.friction is None
    rows = balance.equations.acting(forces, smooth, True)
    family = Family("the true law", law.on, CURVE, ("u",) if "u" in law.on else (), "one", 0)
    return Columns(family, (rows,), np.zeros((1, 1)), None, np.eye(1), lambda _: {})
