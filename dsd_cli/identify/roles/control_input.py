"""Which channel makes the axis move: what its motion explains best."""

from __future__ import annotations

from collections.abc import Sequence

from dsd_cli.identify.roles.causes import BETTER, SAME, Cause, cause_of
from dsd_cli.identify.roles.look import ONLY_CAUSE, Guess, Look, Motion, lead_of

#: A channel makes an axis move from this share of it on that the motion explains; below the second it is a guess to ask
#: about; nearer than the third to the next best it could be that one as well.
IS_CAUSE, CLEARLY, AS_WELL = 0.3, 0.7, 0.05


def find_cause(look: Look) -> None:
    """u: what the motion explains best; where no motion is known, the pair that does so best."""
    found = look.found
    motions = [Motion(found[role].column, role) for role in ("velocity", "position") if role in found]
    motions = [one for one in motions if one.column in look.values]
    known = bool(motions)
    if "u" in found and known:
        _doubt_cause(look, motions)
        return
    candidates = [found["u"].column] if "u" in found and found["u"].column in look.values else look.free()
    candidates = [name for name in candidates if name not in look.never_cause]
    if not known:
        kinds = ("velocity", "position")
        motions = [Motion(name, kind) for name in look.free() for kind in kinds if name not in look.never_motion]
    best: tuple[float, Motion, str] | None = None
    for motion in motions:
        for name in candidates:
            if name == motion.column or lead_of(look.values[motion.column], look.values[name]) is not None:
                continue
            cause = cause_of(look.dt, look.values[motion.column], motion.kind, look.values[name])
            if cause.alone > 1.0 - SAME:  # the motion itself in another unit
                continue
            if cause.share > look.causes.get(name, Cause(0.0, 0.0, 0)).share:
                look.causes[name] = cause
            if best is None or cause.share > best[0] + BETTER:
                best = cause.share, motion, name
    if best is None or best[0] < (IS_CAUSE if known else CLEARLY):
        return
    turned = look.causes.get(best[1].column, Cause(0.0, 0.0, 0)).share > best[0] - AS_WELL
    if not known and "u" not in found and (turned or _as_well(look, *best)):
        return  # neither the motion nor what causes it is known, and others, or these two turned, do as well: ask
    _take(look, *best)


def _doubt_cause(look: Look, motions: Sequence[Motion]) -> None:
    """Of forces of one kind that only names make u, one gives way that the motion does not explain as it does others.

    Torques of the motor, from outside and asked for are all called so.
    """
    mine = look.found["u"].column
    others = [name for name in look.free() if name in look.rivals]
    if mine not in look.values or not others:
        return

    def share(name: str) -> float:
        return max(cause_of(look.dt, look.values[one.column], one.kind, look.values[name]).share for one in motions)

    if (own := share(mine)) >= IS_CAUSE:
        return
    shares = {name: share(name) for name in others}
    best = max(shares, key=lambda name: shares[name])
    if shares[best] - own > IS_CAUSE:
        why = f"the motion explains {100 * shares[best]:.0f} % of it, and {100 * own:.0f} % of {mine}"
        look.found["u"] = Guess(best, why)


def _as_well(look: Look, share: float, motion: Motion, name: str) -> list[str]:
    """Other channels that the motion explains about as well."""
    besides = (name, motion.column)
    return [one for one, cause in look.causes.items() if one not in besides and cause.share > share - AS_WELL]


def _take(look: Look, share: float, motion: Motion, name: str) -> None:
    found = look.found
    if not any(role in found for role in ("velocity", "position")):
        found[motion.kind] = Guess(motion.column, f"its {_parts(motion.kind)} explain {name}", ONLY_CAUSE)
    if "u" in found:
        return
    why = f"{_parts(motion.kind)} of {motion.column} explain {100 * share:.0f} % of it"
    others = _as_well(look, share, Motion(found[motion.kind].column, motion.kind), name)
    doubt = f"{others[0]} is explained as well" if others else "" if share > CLEARLY else "that is not much"
    found["u"] = Guess(name, why, doubt)


def _parts(kind: str) -> str:
    return "acceleration, speed and direction" + (" and place" if kind == "position" else "")
