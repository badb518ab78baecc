"""What the effects of a model are in the joint of a simulator, and which of it a target carries."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import NamedTuple

from dsd_cli.effects.joint_terms import JointTerms, Shaping, together
from dsd_cli.export.base import INERTIA, Joint, Verdict


def terms_of(joint: Joint, part: str) -> JointTerms:
    """What that effect is in a joint; inertia, delay and what does not say are nothing."""
    effect = joint.effect(part)
    if effect is None or effect.joint is None:
        return JointTerms()
    return effect.joint(joint.model.effects[part], joint.model.inertia)


def all_terms(joint: Joint) -> JointTerms:
    """The sum over the effects of the joint."""
    return together(terms_of(joint, name) for name in joint.model.effects)


def judged(joint: Joint, part: str, carried: Mapping[str, str], inertia: str, name: str) -> Verdict:
    """The verdict of the target `name` on one part.

    Parameters
    ----------
    carried : terms that the target has -> by which of its means. inertia : the same of the inertia.
    """
    effect = joint.effect(part)
    if effect is None:
        how = inertia if part == INERTIA else carried.get(part, "")
        return Verdict(part, bool(how), how or f"{name} has no delay")
    if effect.joint is None:
        return Verdict(part, False, "it does not say what it is in a joint: Effect(joint=...)")
    terms = terms_of(joint, part)
    if terms.missing:
        return Verdict(part, False, f"a joint of {name} has no {terms.missing}")
    if joint.linear and terms.weights and "ripples" not in carried:
        return Verdict(part, False, f"a sliding joint of {name} has no force that is a sine of the position")
    means = [carried.get(term, "") for term in terms.used]
    if not all(means):
        lacks = next(term for term, how in zip(terms.used, means, strict=True) if not how)
        return Verdict(part, False, f"a joint of {name} has no {WORDS[lacks]}")
    return Verdict(part, True, ", ".join(dict.fromkeys(means)) or "it is 0")


#: Terms in words.
WORDS = {
    "linear_damping": "damping",
    "square_damping": "damping that grows with the square of the speed",
    "linear_spring": "spring",
    "cubic_spring": "spring that stiffens",
    "dry_friction": "dry friction",
    "constant": "constant force",
    "weights": "weight",
    "ripples": "force that is a sine of the position",
    "ramps": "force that is a table",
    "bristles": "friction that builds up over a distance",
    "stops": "springs that slip",
    "command": "shaping of the command",
    "loads": "load behind a spring",
}


@dataclass(frozen=True)
class Stage:
    """y = clip(x, +-limit) - clip(x, +-dead): what a limit and a dead zone in either order make of a command."""

    limit: float | None = None
    dead: float | None = None

    def then(self, shaping: Shaping) -> Stage:
        """With one more behind it; two of a kind are the narrower one."""
        if shaping.kind == "limit":
            reach = shaping.value + (self.dead or 0.0)
            return Stage(reach if self.limit is None else min(reach, self.limit), self.dead)
        dead = shaping.value + (self.dead or 0.0)
        return Stage(self.limit, dead if self.limit is None else min(dead, self.limit))


class Chain(NamedTuple):
    """A command through a stage, a lag (s; 0: none) and another stage."""

    before: Stage
    lag: float
    after: Stage


def chain_of(shapings: Collection[Shaping]) -> Chain | None:
    """The command as a chain; None where it is none: two lags, or a limit behind a lag behind a dead zone."""
    before, lag, after = Stage(), 0.0, Stage()
    for shaping in shapings:
        if shaping.kind == "lag":
            if lag > 0.0:
                return None
            lag = shaping.value
        elif lag > 0.0:
            after = after.then(shaping)
        else:
            before = before.then(shaping)
    return None if before.dead is not None and after != Stage() else Chain(before, lag, after)


def only_a_limit(joint: Joint, verdict: Verdict, name: str) -> Verdict:
    """The verdict, against what shapes a command otherwise than a limit: dead zones and lags."""
    effect = joint.effect(verdict.part)
    shapings = terms_of(joint, verdict.part).command if effect is not None and verdict.carried else ()
    if all(shaping.kind == "limit" for shaping in shapings):
        return verdict
    return Verdict(verdict.part, False, f"a joint of {name} has no shaping of the command but a limit")


def effort_limit(terms: JointTerms) -> float | None:
    """The narrowest limit of the command; None without one."""
    return min((shaping.value for shaping in terms.command if shaping.kind == "limit"), default=None)
