"""From what channels do, alone and to each other, to what they are; names that say it already come first."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from dsd_cli.roles.control_input import AS_TOLD, ONLY_CAUSE, Guess, Look, find_cause
from dsd_cli.signals.facts import BETTER_SLOPE, Channel, Facts, Slope, facts_of, is_rather_the_motion, slope_of
from dsd_cli.signals.log import Array
from dsd_cli.signals.rounding import ROUNDING
from dsd_cli.signals.twins import lead_of

#: A channel is the slope of another from this share of its square on.
IS_SLOPE = 0.98
#: Beside a u that is known it is from this one on: it is not the force that an acceleration asks for.
IS_SLOPE_BESIDE_U = 0.9
#: And wholly that from this share on.
WHOLLY = 0.995
#: Rows and channels that are looked at, and fewest rows out of which behaviour says a role.
ROWS, CHANNELS, FEWEST = 60_000, 14, 50
#: A position that has a name is believed where the velocity is its slope nearly as well as of another: what is left of
#: one that was asked for, the tracking error, is more than this many times what is left of the measured one.
DOUBTED = 3.0
#: A velocity that has a name is none of that position where it explains less than this share of it.
UNRELATED = 0.5


@dataclass(frozen=True)
class Roles:
    """Role -> guess, for those of time, u, velocity, position and reference that were found.

    `causes`: share of each channel that the motion explains, best first: who could be u. `again`: channels that are the
    motion once more, asked for or by another sensor.
    """

    found: Mapping[str, Guess]
    facts: Mapping[str, Facts]
    causes: Mapping[str, float]
    again: frozenset[str] = frozenset()


def guess_roles(
    channels: Sequence[Channel],
    named: Mapping[str, str],
    forces: frozenset[str] = frozenset(),
    motions: frozenset[str] = frozenset(),
    *,
    told: Collection[str] = (),
    rivals: Mapping[str, tuple[str, ...]] | None = None,
    asked: frozenset[str] = frozenset(),
    scale: float = 1.0,
) -> Roles:
    """What the channels of one table are.

    Parameters
    ----------
    channels : in the order of the file, shape (n,) each.
    named : role -> column, what names and units say; kept as it is.
    forces : columns that are no motion, and no clock, by name or unit. motions : that they are one, and so not u.
    told : roles of `named` that the user named: these are beyond doubt.
    rivals : role -> columns whose names make them that as well, best first.
    asked : columns whose names say that they were asked for: none is a motion that was measured.
    scale : s per unit of the time column.
    """
    facts = {one.name: facts_of(one) for one in channels}
    found = {role: Guess(column, AS_TOLD if role in told else "by its name") for role, column in named.items()}
    by_name = {one.name: one.values for one in channels if one.values is not None}
    if "time" not in found and (clock := _clock({n: one for n, one in facts.items() if n not in forces})) is not None:
        found["time"] = clock
    look = _looked(by_name, facts, found, scale)
    steps = frozenset(n for n, one in facts.items() if one.kind == "boolean" and (one.low, one.high) != (0.0, 1.0))
    look = Look(look.values, look.t, look.dt, found, forces, motions, rivals or {}, steps, asked)
    if look.t.size >= FEWEST:
        _find_motion(look)
        _doubt_reference(look)
        _find_reference(look)
        placed = "position" in look.found
        find_cause(look)
        if not placed:
            _find_reference(look)
    causes = {name: one.share for name, one in sorted(look.causes.items(), key=lambda item: -item[1].share)}
    return Roles(found, facts, causes, look.again - {one.column for one in found.values()})


def _clock(facts: Mapping[str, Facts]) -> Guess | None:
    """What rises most evenly; a count of the samples is a clock only where there is no other."""
    found = [(at, name, one) for at, (name, one) in enumerate(facts.items()) if one.kind in ("clock", "counter")]
    clocks = [(round(one.even, 2), one.kind, at, name) for at, name, one in found]
    if not clocks:
        return None
    _, kind, _, name = min(clocks)
    more = ", ".join([other for *_, other in clocks if other != name][:3])
    doubt = f"{more} rises evenly, too" if more else ""
    how = "it counts the samples" if kind == "counter" else f"it rises evenly, in steps of {facts[name].step:.4g}"
    return Guess(name, how, doubt)


def _looked(by_name: Mapping[str, Array], facts: Mapping[str, Facts], found: Mapping[str, Guess], scale: float) -> Look:
    """The rows where all that moves has values, the first of them; what rises exactly as the clock is another clock."""
    clock = found["time"].column if "time" in found else ""
    moving = [name for name in by_name if name != clock and facts[name].moves]
    wanted = [guess.column for role, guess in found.items() if role != "time" and guess.column in by_name]
    moving = [*dict.fromkeys([*wanted, *moving])][:CHANNELS]
    table = {name: by_name[name][:ROWS] for name in moving}
    rows = min((x.size for x in table.values()), default=0)
    t = by_name[clock][:rows] * scale if clock in by_name else np.arange(rows, dtype=np.float64)
    table = {name: _filled(t, x[:rows]) for name, x in table.items()}
    good = np.isfinite(t) & np.all([np.isfinite(x) for x in table.values()], axis=0)
    good[1:] &= np.diff(t, prepend=t[:1])[1:] > 0.0 if rows else True
    values = {name: x[:rows][good] for name, x in table.items()}
    t = t[good]
    clocks = [n for n in values if t.size > 2 and facts[n].kind == "clock" and n not in wanted]
    straight = {n for n in clocks if 1.0 - abs(np.corrcoef(t, values[n])[0, 1]) < ROUNDING}
    values = {n: x for n, x in values.items() if n not in straight}
    steps = np.diff(t)
    return Look(values, t, float(np.median(steps)) if steps.size else 1.0, dict(found))


def _filled(t: Array, x: Array) -> Array:
    """A channel that is blank in most rows, as one with its own clock is, on straight lines between its values."""
    there = np.isfinite(x) & np.isfinite(t)
    if not 0 < 2 * there.sum() <= x.size or np.any(np.diff(t[there]) < 0.0):
        return x
    return np.interp(t, t[there], x[there], left=np.nan, right=np.nan)


def _find_motion(look: Look) -> None:
    """Velocity and position: what is the slope of what."""
    found, free = look.found, look.movable()
    p, w = (found[role].column if role in found else "" for role in ("position", "velocity"))
    if any(c and c not in look.values for c in (p, w)):
        return
    if p and w:
        _doubt_motion(look, p, w, free)
        return
    best: tuple[Slope, str, str] | None = None
    pairs = [(one, other) for one in ([p] if p else free) for other in ([w] if w else free) if one != other]
    pairs += [] if p else [(w, other) for other in look.named_too("velocity")]
    for one, other in pairs:
        slope = slope_of(look.t, look.values[one], look.values[other])
        if slope.share <= IS_SLOPE and not ("u" in found and _swings(look, one, other, slope)):
            continue
        if best is None or _fits_motion(look, (slope, one, other), best):
            best = slope, one, other
    if best is None:
        return
    (_, share, lag, span), one, other = best
    averaged = f", averaged over {span} samples" if span > 1 else ""
    early = "" if lag >= 0 else "it comes before that slope: was it asked for, or is the position late?"
    doubt = early if share > WHOLLY else f"{100 * (1 - share):.1f} % of it is something else"
    if not p:
        found["position"] = Guess(one, f"{other} is its slope{averaged}")
    if w != other:
        found["velocity"] = Guess(other, f"it is the slope of {one}{averaged}", doubt)


def _fits_motion(look: Look, one: tuple[Slope, str, str], other: tuple[Slope, str, str]) -> bool:
    """Whether a (slope, position, velocity) is one rather than another: what comes before the motion was asked for, and
    over a long time a target that is followed is a slope as good as the measured speed. Of three of which each is the
    slope of the one before the last is the acceleration."""
    if {one[2], other[2]} & {one[1], other[1]} and min(one[0].scale, other[0].scale) > 0.0:
        return one[2] == other[1]
    mine, its = ((look.values[p], look.values[w]) for _, p, w in (one, other))
    return is_rather_the_motion(look.t, mine, its, min(one[0].span, other[0].span))


def _swings(look: Look, p: str, w: str, slope: Slope) -> bool:
    """Whether w is the slope of p beside a u that is known, without what any constant is to any drift."""
    if slope.share <= IS_SLOPE_BESIDE_U:
        return False
    mean = float(look.values[w].mean())
    swing = slope_of(look.t, look.values[p] - mean / slope.scale * look.t, look.values[w] - mean)
    return swing.share > IS_SLOPE_BESIDE_U


def _doubt_motion(look: Look, p: str, w: str, free: Sequence[str]) -> None:
    """A position, else a velocity, that only its name makes one gives way to a channel that fits the other.

    That may be each of them the other's.
    """
    mine = slope_of(look.t, look.values[p], look.values[w]).share
    swapped = slope_of(look.t, look.values[w], look.values[p])  # of a sine each is the other's, with a sign
    told = AS_TOLD in (look.found["position"].reason, look.found["velocity"].reason)
    if mine < UNRELATED and swapped.scale > 0.0 and _fits_better(swapped.share, mine) and not told:
        look.found["position"] = Guess(w, f"{p} is its slope, whatever the names say")
        look.found["velocity"] = Guess(p, f"it is the slope of {w}, whatever the names say")
        return
    share, best = max([(slope_of(look.t, look.values[o], look.values[w]).share, o) for o in free], default=(0.0, p))
    if _fits_better(share, mine) and look.found["position"].reason != AS_TOLD:
        look.found["position"] = Guess(best, f"{w} is its slope, and not that of {p}")
        return
    share, best = max([(slope_of(look.t, look.values[p], look.values[o]).share, o) for o in free], default=(0.0, w))
    if mine < UNRELATED and _fits_better(share, mine) and look.found["velocity"].reason != AS_TOLD:
        look.found["velocity"] = Guess(best, f"it is the slope of {p}, and {w} is not")


def _fits_better(share: float, mine: float) -> bool:
    return share > IS_SLOPE and 1.0 - mine > DOUBTED * (1.0 - share) + BETTER_SLOPE


def _doubt_reference(look: Look) -> None:
    """A reference by its name that is the velocity asked for is none of the position: the setpoint of a speed loop."""
    named = {role: look.found[role].column for role in ("reference", "velocity", "position") if role in look.found}
    r, w, p = (look.values.get(named.get(role, "")) for role in ("reference", "velocity", "position"))
    if r is None or w is None or lead_of(r, w) is None or look.found["reference"].reason == AS_TOLD:
        return
    if p is None or lead_of(r, p) is None:
        del look.found["reference"]


def _find_reference(look: Look) -> None:
    """The position that was asked for: the same as the measured one, but earlier. Of two speeds the later is measured.

    One that is not earlier is no reference, however smooth it is: two sensors of one axis differ in their noise, too.
    """
    found = look.found
    for role in ("position", "velocity"):
        mine = found[role].column if role in found else ""
        if mine not in look.values or (role == "position" and "reference" in found):
            continue
        for other in look.free():
            lead = None if other in look.never_motion else lead_of(look.values[other], look.values[mine])
            if lead and _asked_for(look, role, other, lead):
                break


def _asked_for(look: Look, role: str, other: str, lead: int) -> bool:
    """Whether that settles what is the reference of that motion, of which `other` is `lead` samples ahead."""
    found, mine = look.found, look.found[role]
    if lead < 0 and mine.doubt == ONLY_CAUSE:
        found[role] = Guess(other, f"as {mine.column}, {-lead} samples later: measured")
        other, mine, lead = mine.column, found[role], -lead
    elif lead < 0:
        if mine.reason != AS_TOLD:
            found[role] = replace(mine, doubt=f"{other} is as it, {-lead} samples later: is that what was measured?")
        return False
    if role == "position":
        found["reference"] = Guess(other, f"as {mine.column}, {lead} samples earlier")
    return True
