"""What the joint of a robot simulator knows of: the vocabulary in which an effect says what it is there.

An effect that is nothing of this has `missing`: why a joint has no such thing.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields
from typing import NamedTuple

from dsd_cli.effects.memory import Coupling


class Sine(NamedTuple):
    """A force amplitude sin(periods q + phase), unit of u; periods in rad per unit of position."""

    amplitude: float
    periods: float
    phase: float


class Ramps(NamedTuple):
    """A force over "velocity" or "position", linear between increasing knots and held beyond them, unit of u."""

    over: str
    knots: tuple[float, ...]
    values: tuple[float, ...]


class Bristle(NamedTuple):
    """Friction that builds up over level/stiffness (Dahl): level in unit of u, stiffness per unit of position."""

    level: float
    stiffness: float


class Stop(NamedTuple):
    """A spring that slips: stretched by the motion, by no more than `radius`; stiffness per unit of position."""

    radius: float
    stiffness: float


class Shaping(NamedTuple):
    """What happens to the command, in order: "limit" (clipped to +-value), "dead" (what is within +-value is lost) or
    "lag" (first order, value in s)."""

    kind: str
    value: float


class Hung(NamedTuple):
    """A load of that share of the inertia behind a spring, a damper and play."""

    share: float
    coupling: Coupling


@dataclass(frozen=True)
class JointTerms:
    """Forces of a joint, unit of u, position q and velocity v in SI.

    Attributes
    ----------
    linear_damping, square_damping : a, b of -(a v + b v |v|).
    linear_spring, cubic_spring : a, c of -(a q + c q^3).
    dry_friction : level that opposes motion and holds at rest.
    constant : force that is always there.
    weights : of arms that hang, for which a whole turn is 2 pi; ripples : any others over the position.
    ramps, bristles, stops, command, loads : see there.
    missing : why a joint has nothing of the kind; "" where it has.
    """

    linear_damping: float = 0.0
    square_damping: float = 0.0
    linear_spring: float = 0.0
    cubic_spring: float = 0.0
    dry_friction: float = 0.0
    constant: float = 0.0
    weights: tuple[Sine, ...] = ()
    ripples: tuple[Sine, ...] = ()
    ramps: tuple[Ramps, ...] = ()
    bristles: tuple[Bristle, ...] = ()
    stops: tuple[Stop, ...] = ()
    command: tuple[Shaping, ...] = ()
    loads: tuple[Hung, ...] = ()
    missing: str = ""

    def __add__(self, other: JointTerms) -> JointTerms:
        both = ((f.name, getattr(self, f.name), getattr(other, f.name)) for f in fields(self))
        return JointTerms(**{name: one + two for name, one, two in both})

    @property
    def used(self) -> tuple[str, ...]:
        """The terms that it has, but for `missing`."""
        return tuple(f.name for f in fields(self) if getattr(self, f.name) and f.name != "missing")


def together(terms: Iterable[JointTerms]) -> JointTerms:
    """The sum: of a command what comes first acts first."""
    return sum(terms, JointTerms())


def speed_dependent(speeds: Sequence[float], levels: Sequence[float]) -> JointTerms:
    """Dry friction whose level changes over the speed: the level at rest holds, and a force along the motion takes off
    what is lost at a speed.

    Parameters
    ----------
    speeds : increasing from 0 on. levels : at the speeds, linear between them and held beyond the last.
    """
    lost = tuple(levels[0] - level for level in levels)
    knots = (*(-v for v in reversed(speeds[1:])), *speeds)
    values = (*(-x for x in reversed(lost[1:])), *lost)
    return JointTerms(dry_friction=levels[0], ramps=(Ramps("velocity", knots, values),))
