"""A friction table as drives take it: speed over force, CSV."""

from __future__ import annotations

import numpy as np

from dsd_cli.effects import Channels, Role
from dsd_cli.export.base import INERTIA, Joint, Target, Verdict, number
from dsd_cli.export.computing import symbols_of_force
from dsd_cli.export.expression import Refused
from dsd_cli.plant.forces import interval_forces

#: Decades of speed, rad/s or m/s, on either side of 0, and speeds in each.
_LOWEST, _HIGHEST, _STEPS = -3, 2, 20


def _judge(joint: Joint, part: str) -> Verdict:
    if part == INERTIA:
        return Verdict(part, True, "not in the table: the drive has a value of its own for it")
    effect = joint.effect(part)
    if effect is None:
        return Verdict(part, False, "a table over the speed has no time")
    if effect.role in (Role.INPUT, Role.STRUCTURE) or effect.memory:
        return Verdict(part, False, "it is more than a force over the speed")
    try:
        others = symbols_of_force(joint, part) - {"v"}
    except Refused as why:
        return Verdict(part, False, str(why))
    if others:
        words = {"q": "position", "u": "command", "t": "time"}
        return Verdict(part, False, f"it depends on {' and '.join(sorted(words[x] for x in others))}")
    return Verdict(part, True, "in the force over the speed")


def _write(joint: Joint) -> bytes:
    size = np.logspace(_LOWEST, _HIGHEST, (_HIGHEST - _LOWEST) * _STEPS + 1)
    speed = np.concatenate([-size[::-1], size])
    still = np.zeros(len(speed))
    force, budget = interval_forces(
        joint.model.effects, Channels(still, still, speed, still, still), joint.model.inertia
    )
    rows = zip(speed, np.sign(speed) * budget - force, strict=True)
    return "".join(["speed,force\n", *(f"{number(v)},{number(f)}\n" for v, f in rows)]).encode()


TARGET = Target(
    id="table",
    summary="A friction table as drives take it: speed and the force that keeps it, CSV.",
    suffix=".csv",
    judge=_judge,
    write=_write,
    not_run="a table of friction has no motion",
)
