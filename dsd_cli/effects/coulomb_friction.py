"""Dry friction of constant level that opposes motion and holds at rest."""

from collections.abc import Mapping
from typing import Any

from dsd_cli.effects.base import Channels, Effect, Parameter, Role
from dsd_cli.effects.joint_terms import JointTerms


def _columns(channels: Channels, _: Mapping[str, float]) -> tuple[Any, ...]:
    return (0.0 * channels.velocity + 1.0,)


EFFECT = Effect(
    id="coulomb_friction",
    role=Role.FRICTION,
    law="-Fc sgn v, sticking at rest",
    summary="Dry friction: a constant force against the motion; at rest it holds against any force up to its level.",
    pattern="the residual is a step over velocity: one level forward, the opposite one backward",
    parameters=(Parameter("level", "{u}", "Fc, the friction force while moving", lower=0.0),),
    needs=("velocity",),
    columns=_columns,
    rarity=0,
    varies=("level",),
    told_apart={
        "presliding_friction": "reverse slowly over a few encoder steps: presliding friction builds up over a distance,"
        " Coulomb at once",
        "load_friction": "move at constant speed under two different loads: only load-dependent friction grows with"
        " the load",
        "stribeck_friction": "move at several constant speeds, very slow ones too: the Stribeck excess fades with"
        " speed",
        "viscous_friction": "move at constant speed, slowly and fast, both ways: only viscous friction grows with"
        " speed",
        "dead_zone": "hold a small constant command while the axis coasts: friction stops it, a dead zone does not",
    },
    joint=lambda values, _: JointTerms(dry_friction=values["level"]),
    of_joint=lambda terms, _: [{"level": terms.dry_friction}] if terms.dry_friction else [],
)
