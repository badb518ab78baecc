"""From what channels do, alone and to each other, to what they are; names that say it already come first."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from dsd_cli.identify.roles.causes import BETTER, SAME, Cause, cause_of
from dsd_cli.identify.roles.facts import Channel, Facts, facts_of
from dsd_cli.identify.roles.slopes import BETTER_SLOPE, lag_of, slope_of
from dsd_cli.signals.log import Array
from dsd_cli.signals.rounding import ROUNDING

#: A channel is the slope of another from this share of its square on.
IS_SLOPE = 0.98
#: And wholly that from this share on.
WHOLLY = 0.995
#: A channel makes an axis move from this share of it on that the motion explains; below the second it is a guess to ask
#: about; nearer than the third to the next best it could be that one as well.
IS_CAUSE, CLEARLY, AS_WELL = 0.3, 0.7, 0.05
#: Two channels are one quantity, asked for and measured, where one leaves less than this share of the other.
TWINS = 0.05
#: And their variances are alike within this factor.
ALIKE = 2.0
#: Rows and channels that are looked at.
ROWS, CHANNELS = 60_000, 14
#: Fewest rows out of which behaviour says a role.
FEWEST = 50
#: Longest time by which a measured position comes after the one that was asked for, samples.
LONGEST = 200
#: A position that has a name is believed where the velocity is its slope nearly as well as of another: what is left of
#: one that was asked for, the tracking error, is more than this many times what is left of the measured one.
DOUBTED = 3.0
ONLY_CAUSE = "only what makes it move says so"


@dataclass(frozen=True)
class Guess:
    """A channel's column, why it is taken for that, and what speaks against it ("" for nothing)."""

    column: str
    reason: str
    doubt: str = ""


@dataclass(frozen=True)
class Roles:
    """Role -> guess, for those of time, u, velocity, position and reference that were found.

    `causes`: share of each channel that the motion explains, best first: who could be u.
    """

    found: Mapping[str, Guess]
    facts: Mapping[str, Facts]
    causes: Mapping[str, float]


class _Motion(NamedTuple):
    column: str
    kind: str


@dataclass
class _Look:
    """What is known so far: values without holes, on steps of `dt` (1 where there is no clock)."""

    values: dict[str, Array]
    t: Array
    dt: float
    found: dict[str, Guess]
    never_motion: frozenset[str] = frozenset()
    never_cause: frozenset[str] = frozenset()
    causes: dict[str, Cause] = field(default_factory=dict)

    def free(self) -> list[str]:
        taken = {guess.column for guess in self.found.values()}
        return [name for name in self.values if name not in taken]


def guess_roles(
    channels: Sequence[Channel],
    named: Mapping[str, str],
    forces: frozenset[str] = frozenset(),
    motions: frozenset[str] = frozenset(),
    scale: float = 1.0,
) -> Roles:
    """What the channels of one table are.

    Parameters
    ----------
    channels : in the order of the file, shape (n,) each.
    named : role -> column, what names and units say; kept as it is.
    forces : columns whose name or unit says that they are no motion. motions : that they are one, and so not u.
    scale : s per unit of the time column.
    """
    facts = {one.name: facts_of(one) for one in channels}
    found = {role: Guess(column, "by its name") for role, column in named.items()}
    by_name = {one.name: one.values for one in channels if one.values is not None}
    if "time" not in found and (clock := _clock(facts)) is not None:
        found["time"] = clock
    look = _looked(by_name, facts, found, scale)
    look = _Look(look.values, look.t, look.dt, found, forces, motions)
    if look.t.size >= FEWEST:
        _find_motion(look)
        _find_reference(look)
        _find_cause(look)
    causes = {name: one.share for name, one in sorted(look.causes.items(), key=lambda item: -item[1].share)}
    return Roles(found, facts, causes)


def _clock(facts: Mapping[str, Facts]) -> Guess | None:
    """What rises most evenly; a count of the samples is a clock only where there is no other."""
    clocks = [
        (round(one.even, 2), one.kind, at, name)
        for at, (name, one) in enumerate(facts.items())
        if one.kind in ("clock", "counter")
    ]
    if not clocks:
        return None
    _, kind, _, name = min(clocks)
    more = [other for *_, other in clocks if other != name]
    doubt = f"{', '.join(more[:3])} rises evenly, too" if more else ""
    how = "it counts the samples" if kind == "counter" else f"it rises evenly, in steps of {facts[name].step:.4g}"
    return Guess(name, how, doubt)


def _looked(
    by_name: Mapping[str, Array], facts: Mapping[str, Facts], found: Mapping[str, Guess], scale: float
) -> _Look:
    """The rows where all that moves has values, the first of them; what rises exactly as the clock is another clock."""
    clock = found["time"].column if "time" in found else ""
    moving = [name for name in by_name if name != clock and facts[name].moves]
    wanted = [guess.column for role, guess in found.items() if role != "time" and guess.column in by_name]
    moving = [*dict.fromkeys([*wanted, *moving])][:CHANNELS]
    most = ROWS if by_name else 0
    table = {name: by_name[name][:most] for name in moving}
    rows = min((x.size for x in table.values()), default=0)
    t = by_name[clock][:rows] * scale if clock in by_name else np.arange(rows, dtype=np.float64)
    table = {name: _filled(t, x[:rows]) for name, x in table.items()}
    good = np.isfinite(t)
    for x in table.values():
        good &= np.isfinite(x[:rows])
    good[1:] &= np.diff(t, prepend=t[:1])[1:] > 0.0 if rows else True
    values = {name: x[:rows][good] for name, x in table.items()}
    t = t[good]
    if t.size > 2:
        values = {n: x for n, x in values.items() if facts[n].kind != "clock" or not _straight(t, x) or n in wanted}
    steps = np.diff(t)
    return _Look(values, t, float(np.median(steps)) if steps.size else 1.0, dict(found))


def _filled(t: Array, x: Array) -> Array:
    """A channel that is blank in most rows, as one with its own clock is, on straight lines between its values."""
    there = np.isfinite(x) & np.isfinite(t)
    if not 0 < 2 * there.sum() <= x.size or np.any(np.diff(t[there]) < 0.0):
        return x
    return np.interp(t, t[there], x[there], left=np.nan, right=np.nan)


def _straight(t: Array, x: Array) -> bool:
    return bool(1.0 - abs(np.corrcoef(t, x)[0, 1]) < ROUNDING)


def _find_motion(look: _Look) -> None:
    """Velocity and position: what is the slope of what."""
    found = look.found
    free = [name for name in look.free() if name not in look.never_motion]
    p, w = (found[role].column if role in found else "" for role in ("position", "velocity"))
    if any(c and c not in look.values for c in (p, w)):
        return
    if p and w:
        _doubt_position(look, p, w, free)
        return
    best: tuple[float, str, str, int, int] | None = None
    for one in [p] if p else free:
        for other in [w] if w else free:
            if one == other:
                continue
            slope = slope_of(look.t, look.values[one], look.values[other])
            if slope.share > IS_SLOPE and (best is None or slope.share > best[0] + BETTER_SLOPE):
                best = slope.share, one, other, slope.lag, slope.span
    if best is None:
        return
    share, one, other, _, span = best
    averaged = f", averaged over {span} samples" if span > 1 else ""
    doubt = "" if share > WHOLLY else f"{100 * (1 - share):.1f} % of it is something else"
    if not p:
        found["position"] = Guess(one, f"{other} is its slope{averaged}")
    if not w:
        found["velocity"] = Guess(other, f"it is the slope of {one}{averaged}", doubt)


def _doubt_position(look: _Look, p: str, w: str, free: Sequence[str]) -> None:
    """A position whose name says so, but of which the velocity is not the slope, gives way to one of which it is."""
    mine = slope_of(look.t, look.values[p], look.values[w]).share
    share, best = max(
        ((slope_of(look.t, look.values[other], look.values[w]).share, other) for other in free), default=(0.0, p)
    )
    if share > IS_SLOPE and 1.0 - mine > DOUBTED * (1.0 - share) + BETTER_SLOPE:
        look.found["position"] = Guess(best, f"{w} is its slope, and not that of {p}")


def _find_reference(look: _Look) -> None:
    """The position that was asked for: the same as the measured one, but earlier.

    One that is not earlier is no reference, however smooth it is: two sensors of one axis differ in their noise, too.
    """
    found = look.found
    if "position" not in found or "reference" in found or found["position"].column not in look.values:
        return
    mine = found["position"].column
    for other in look.free():
        lead = None if other in look.never_motion else _lead(look.values[other], look.values[mine])
        if not lead:
            continue
        if lead > 0:
            found["reference"] = Guess(other, f"as {mine}, {lead} samples earlier")
            return
        if found["position"].doubt == ONLY_CAUSE:
            found["reference"] = Guess(mine, f"as {other}, {-lead} samples earlier")
            found["position"] = Guess(other, f"as {mine}, {-lead} samples later: measured")
            return


def _lead(x: Array, y: Array) -> int | None:
    """By how many samples x is ahead of y; None: they are not one quantity, asked for and measured."""
    power = float(np.var(x))
    if power <= 0.0 or not 1.0 / ALIKE < float(np.var(y)) / power < ALIKE:
        return None
    lag = lag_of(x - x.mean(), y - y.mean(), LONGEST)
    a, b = (x[: x.size - lag], y[lag:]) if lag >= 0 else (x[-lag:], y[:lag])
    return lag if float(np.mean((b - a) ** 2)) < TWINS * power else None


def _find_cause(look: _Look) -> None:
    """u: what the motion explains best; where no motion is known, the pair that does so best."""
    found = look.found
    motions = [_Motion(found[role].column, role) for role in ("velocity", "position") if role in found]
    motions = [one for one in motions if one.column in look.values][:1]
    if "u" in found and motions:
        return
    candidates = [found["u"].column] if "u" in found and found["u"].column in look.values else look.free()
    candidates = [name for name in candidates if name not in look.never_cause]
    if not motions:
        kinds = ("velocity", "position")
        motions = [_Motion(name, kind) for name in look.free() for kind in kinds if name not in look.never_motion]
    best: tuple[float, _Motion, str] | None = None
    for motion in motions:
        for name in candidates:
            if name == motion.column or _lead(look.values[motion.column], look.values[name]) is not None:
                continue
            cause = cause_of(look.dt, look.values[motion.column], motion.kind, look.values[name])
            if cause.alone > 1.0 - SAME:  # the motion itself in another unit
                continue
            if cause.share > look.causes.get(name, Cause(0.0, 0.0, 0)).share:
                look.causes[name] = cause
            if best is None or cause.share > best[0] + BETTER:
                best = cause.share, motion, name
    if best is None or best[0] < (IS_CAUSE if len(motions) == 1 else CLEARLY):
        return
    if len(motions) > 1 and "u" not in found and _as_well(look, *best):
        return  # neither the motion nor what causes it is known, and others do as well: for the user to say
    _take(look, *best)


def _as_well(look: _Look, share: float, motion: _Motion, name: str) -> list[str]:
    """Other channels that the motion explains about as well."""
    besides = (name, motion.column)
    return [one for one, cause in look.causes.items() if one not in besides and cause.share > share - AS_WELL]


def _take(look: _Look, share: float, motion: _Motion, name: str) -> None:
    found = look.found
    if not any(role in found for role in ("velocity", "position")):
        found[motion.kind] = Guess(motion.column, f"its {_parts(motion.kind)} explain {name}", ONLY_CAUSE)
    if "u" in found:
        return
    why = f"{_parts(motion.kind)} of {motion.column} explain {100 * share:.0f} % of it"
    others = _as_well(look, share, _Motion(found[motion.kind].column, motion.kind), name)
    doubt = f"{others[0]} is explained as well" if others else "" if share > CLEARLY else "that is not much"
    found["u"] = Guess(name, why, doubt)
    if motion.kind == "position":
        _find_reference(look)


def _parts(kind: str) -> str:
    return "acceleration, speed and direction" + (" and place" if kind == "position" else "")
