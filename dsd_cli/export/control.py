"""What a controller takes from a model: the force of friction, the disturbance to cancel, the command for a motion."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from dsd_cli.effects import Channels
from dsd_cli.export.base import Joint
from dsd_cli.export.expression import Expression, make, negation, number, symbol, where
from dsd_cli.export.program import Law, Outputs, Q, T, U, V, symbolic_plant
from dsd_cli.export.ways import repeat, substituted
from dsd_cli.plant.motion import Actuator

#: Acceleration of the reference, and the direction in which the axis is to go (its sign), where it stands still.
A, DIRECTION = symbol("a"), symbol("direction")

#: Steps of Steffensen's rule for a force that depends on the command itself; friction by |u| needs two.
_STEPS = 4
#: Doublings and halvings in which the command is found that an input effect makes into a wanted force.
_HALVINGS = 60


@dataclass(frozen=True)
class Control:
    """Each of the motion at the middle of the sample and the states: its value, and the states at the sample's end.

    friction : of t, u, q, v: "friction", the force of friction alone; at rest what it holds, u being what acts.
    compensation : of t, u, q, v, direction: "u" that cancels all effects; the direction stands in for that of v = 0.
    feedforward : of t, q, v, a: "u" for this motion: J a less the forces.
    """

    friction: Outputs
    compensation: Outputs
    feedforward: Outputs


def control(joint: Joint) -> Control:
    """The joint's.

    Raises
    ------
    Refused : a law that cannot be an expression.
    """
    plant, step = symbolic_plant(joint.model), joint.sample_time
    after = symbolic_plant(joint.model)
    after._remember(Channels(T, U, V, Q, step))
    states = after.remembered()

    force, budget = plant.applied(T, U, step)
    held = _within(make("+", U, force), budget)
    friction = make("neg", where(V == 0.0, held, _sign(V) * budget))
    way = where(V == 0.0, _sign(DIRECTION), _sign(V))
    moving = where(V == 0.0, _sign(A), _sign(V))

    def needed(u: Any) -> Any:
        force, budget = plant.applied(T, u, step)
        return plant.inertia * A - force + moving * budget

    wanted = _solved(needed)
    return Control(
        friction={"friction": friction, **states},
        compensation={"u": _command(joint, way * budget - force), **states},
        feedforward={"u": _command(joint, wanted), **_given(states, wanted)},
    )


def _given(states: Outputs, u: Expression) -> Outputs:
    """The states where the command is this one."""
    return {name: substituted(e, {U: u}) for name, e in states.items()}


def _sign(x: Any) -> Any:
    return where(make("<", 0.0, x), 1.0, where(make("<", x, 0.0), -1.0, 0.0))


def _within(x: Any, limit: Any) -> Any:
    return where(make("<", limit, x), limit, where(make("<", x, make("neg", limit)), make("neg", limit), x))


def _solved(needed: Any) -> Expression:
    """u = needed(u), where friction grows with u: Steffensen's rule, exact where that is linear."""
    first = needed(number(0.0))
    if needed(U) is first:
        return number(first)

    def better(_: Any, u: Any) -> tuple[Any]:
        one = needed(u)
        two = needed(one)
        bend = two - 2.0 * one + u
        flat = abs(bend) <= 1e-14 * (abs(one) + abs(u))
        return (where(flat, two, u - (one - u) * (one - u) / where(flat, 1.0, bend)),)

    return repeat(_STEPS, better, first)[0]


def _command(joint: Joint, wanted: Any) -> Expression:
    """The smallest command of which the input effects make this force; those with memory (a lag) are left to the loop.

    Where the actuator cannot give it, the force itself.
    """
    laws = [law for law in map(Law, Actuator(joint.model)._inputs) if not law.memory]
    if not laws:
        return number(wanted)
    size, sign = abs(number(wanted)), _sign(wanted)

    def short(c: Any) -> Any:
        u = sign * c
        for law in laws:
            (u,), _ = law.run(Channels(T, u, number(0.0), number(0.0), joint.sample_time), law.shape)
        return sign * u < size

    (high,) = repeat(_HALVINGS, lambda _, c: (where(short(c), 2.0 * c, c),), size)

    def halved(_: Any, low: Any, high: Any) -> tuple[Any, Any]:
        middle = 0.5 * (low + high)
        less = short(middle)
        return where(less, middle, low), where(less, high, middle)

    _, found = repeat(_HALVINGS, halved, 0.0, high)
    return where(negation(short(high)), sign * found, wanted)
