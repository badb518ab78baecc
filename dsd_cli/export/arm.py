"""A weight as simulators have it: a mass on an arm under gravity, about a level axis (y), down being -z."""

from __future__ import annotations

import math
from typing import NamedTuple

from dsd_cli.effects.joint_terms import JointTerms, Sine
from dsd_cli.export.base import Joint

#: m/s2, and the length of the arm as a share of that at which its mass alone has all of the inertia.
GRAVITY, SHARE = 9.81, 0.1


class Body(NamedTuple):
    """What moves with the joint.

    mass : kg. centre : of mass at q = 0, m. inertia : about the centre of mass, the same about every axis, kg m2.
    """

    mass: float
    centre: tuple[float, float, float]
    inertia: float


def body_of(joint: Joint, terms: JointTerms, share: float = 1.0) -> Body:
    """The body with that share of the inertia and all weights; of a sliding axis the inertia is its mass."""
    inertia = share * joint.model.inertia
    if joint.linear:
        return Body(inertia, (0.0, 0.0, 0.0), inertia)
    weight = _weight(terms)
    if weight is None:
        return Body(1.0, (0.0, 0.0, 0.0), inertia)
    arm = SHARE * SHARE * inertia * GRAVITY / weight.amplitude
    mass = weight.amplitude / (GRAVITY * arm)
    centre = (-arm * math.sin(weight.phase), 0.0, -arm * math.cos(weight.phase))
    return Body(mass, centre, inertia - mass * arm * arm)


def _weight(terms: JointTerms) -> Sine | None:
    """All weights as one, G sin(q + phi) against the motion; None where there is none."""
    force = -sum(w.amplitude * complex(math.cos(w.phase), math.sin(w.phase)) for w in terms.weights)
    return Sine(abs(force), 1.0, math.atan2(force.imag, force.real)) if abs(force) > 0.0 else None


def axis_of(joint: Joint) -> tuple[int, int, int]:
    """Direction of the axis: level, so that a weight acts on what turns and not on what slides."""
    return (1, 0, 0) if joint.linear else (0, 1, 0)
