"""Channels of different clocks on one: rows come at the stamps of the slowest that was measured.

Nothing is invented between samples of a slow channel. A faster u is averaged from row to row, which is what an axis
feels of it, or, where it was sampled from a continuous signal, interpolated as faster measurements are: between the two
samples around a row. References are held.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from dsd_cli.errors import DataError
from dsd_cli.files.formats.changes import HOLE, changes_of, filled, held_at, logged_on_change
from dsd_cli.signals.log import Array, Hold

#: Channels whose rate may decide about that of the rows.
DECIDING = ("u", "d_hat", "velocity", "position")
#: Rates closer than this share are the same: then the rows are those of u.
SAME_RATE = 0.01
#: Steps longer than this many mean steps are pauses, and no part of the rate.
PAUSE = 10.0
#: What is done to a channel of another clock.
AVERAGED, INTERPOLATED, HELD = "averaged from row to row", "interpolated", "held"


class Sampled(NamedTuple):
    """Channels of one clock: `t` and values, shape (n,); `label` names the clock.

    `kept`: a control input that was logged only where it changed: it acted until its next value.
    """

    label: str
    t: Array
    values: Mapping[str, Array]
    kept: bool = False

    @property
    def rate(self) -> float:
        """Samples per unit of time, where it was sampled; 0 where there is no knowing."""
        steps = np.diff(self.t[np.isfinite(self.t)])
        steps = steps[steps > 0.0]
        steps = steps[steps <= PAUSE * steps.mean()] if steps.size else steps
        return 1.0 / float(steps.mean()) if steps.size else 0.0


class Joined(NamedTuple):
    """All channels on one clock, and what was done, one sentence each."""

    t: Array
    values: dict[str, Array]
    notes: list[str]


def join(source: str, parts: list[Sampled], u_hold: Hold = "held") -> Joined:
    """One table of channels with different clocks; `u_hold` as in `Log`: how u lives between its own samples.

    Raises
    ------
    DataError : stamps that go backwards or do not overlap, so that nothing can be joined.
    """
    parts, said = _with_unchanged(parts) if u_hold == "held" else (parts, "")
    base = _base(parts)
    out, notes = dict(base.values), [said] if said else []
    for part in parts:
        if part is base:
            continue
        if part.t.size == base.t.size and np.array_equal(part.t, base.t):
            out |= part.values
            continue
        t, values = _ordered(source, part)
        _check_overlap(source, base, part.label, t)
        if part.kept:
            t, values["u"] = held_at(changes_of(t, values["u"]), base.t)
        for name, column in values.items():
            out[name] = _BY_WAY[_way(name, u_hold)](base.t, t, column)
        notes.append(_note(base, part, u_hold))
    return Joined(base.t, out, notes)


def _base(parts: list[Sampled]) -> Sampled:
    sampled = [part for part in parts if not part.kept] or parts
    deciding = [part for part in sampled if any(name in part.values for name in DECIDING) and part.rate > 0.0]
    home = next((part for part in sampled if "u" in part.values), (deciding or sampled)[0])
    slowest = min(deciding, key=lambda part: part.rate, default=home)
    return slowest if slowest.rate < (1.0 - SAME_RATE) * home.rate else home


def _with_unchanged(parts: list[Sampled]) -> tuple[list[Sampled], str]:
    """Channels that were logged only where they changed with what they were in between, and what to say of it."""
    found = {name: changes_of(part.t, x) for part in parts for name, x in part.values.items() if name in DECIDING}
    kept = logged_on_change(found, [name for name in found if name in DECIDING[1:]])
    if not kept:
        return parts, ""
    until = max(float(np.nanmax(part.t)) for part in parts if part.t.size)
    out = []
    for part in parts:
        mine = [name for name in part.values if name in kept]
        rest = {name: x for name, x in part.values.items() if name not in mine}
        out += [part._replace(values=rest)] if rest else []
        for name in mine:
            one = found[name]
            t, x = (one.t, one.x) if name == "u" else filled(one, until)
            out.append(Sampled(part.label, t, {name: x}, kept=name == "u"))
    names = [name for name in found if name in kept]
    verb = "has a value only where it" if len(names) == 1 else "have a value only where they"
    return out, f'{", ".join(names)} {verb} changed: kept until the next (if samples were lost: u_hold = "sampled")'


def _ordered(source: str, part: Sampled) -> tuple[Array, dict[str, Array]]:
    """Rows with a stamp, one per stamp."""
    rows = np.flatnonzero(np.isfinite(part.t))
    t = part.t[rows]
    if t.size and np.any(np.diff(t) < 0.0):
        raise DataError(
            f"{source}: the stamps of {part.label} go backwards, so that it cannot be joined with others",
            "cut the file where a new recording begins",
        )
    rows = rows[np.concatenate([[True], np.diff(t) > 0.0])] if t.size else rows
    return part.t[rows], {name: column[rows] for name, column in part.values.items()}


def _check_overlap(source: str, base: Sampled, label: str, t: Array) -> None:
    at = base.t[np.isfinite(base.t)]
    if not t.size or not at.size or t[0] > at.max() or t[-1] < at.min():
        span = f"{t[0]:g} to {t[-1]:g}" if t.size else "none"
        mine = f"{at.min():g} to {at.max():g}" if at.size else "none"
        raise DataError(f"{source}: the stamps of {label} ({span}) and of {base.label} ({mine}) do not overlap")


def _way(name: str, u_hold: Hold) -> str:
    """What is done to a channel, in the word of the note."""
    if name == "u" and u_hold == "held":
        return AVERAGED
    return INTERPOLATED if name in DECIDING else HELD


def _interpolated(rows: Array, t: Array, values: Array) -> Array:
    if t.size == 1:
        return np.where(rows == t[0], values[0], np.nan)
    right = np.clip(np.searchsorted(t, rows, side="left"), 1, t.size - 1)
    left = right - 1
    step = t[right] - t[left]
    share = (rows - t[left]) / step
    out = values[left] + share * (values[right] - values[left])
    # on a sample, its neighbours do not matter
    out = np.where(rows == t[right], values[right], np.where(rows == t[left], values[left], out))
    alone = (rows == t[right]) | (rows == t[left])
    hole = (step > HOLE * np.median(np.diff(t))) & ~alone
    return np.where((rows >= t[0]) & (rows <= t[-1]) & ~hole, out, np.nan)


def _held(rows: Array, t: Array, values: Array) -> Array:
    at = np.searchsorted(t, rows, side="right") - 1
    return np.where((at >= 0) & np.isfinite(rows), values[np.maximum(at, 0)], np.nan)


def _averaged(rows: Array, t: Array, values: Array) -> Array:
    """The mean of held values from each row to the next; at the last row, and before a jump back, the value there."""
    if t.size == 1:
        return np.where(rows == t[0], values[0], np.nan)
    usual = float(np.median(np.diff(t)))
    ends = np.append(t, t[-1] + usual)
    steps = np.diff(ends)
    known = np.isfinite(values) & (steps <= HOLE * usual)
    at = np.searchsorted(t, rows, side="right") - 1
    out = np.where((at >= 0) & (rows < ends[-1]) & known[at], values[at], np.nan)
    centre = float(values[known].mean()) if known.any() else 0.0  # its digits need not be carried through the sums
    integral = np.concatenate([[0.0], np.cumsum(np.where(known, (values - centre) * steps, 0.0))])
    covered = np.concatenate([[0.0], np.cumsum(np.where(known, steps, 0.0))])
    length = np.diff(rows)
    forward = np.flatnonzero(length > 0.0)
    mean = np.diff(np.interp(rows, ends, integral))[forward] / length[forward] + centre
    complete = np.diff(np.interp(rows, ends, covered))[forward] >= length[forward] * (1.0 - 1e-6)
    out[forward] = np.where(complete, mean, np.nan)
    return out


_BY_WAY = {AVERAGED: _averaged, INTERPOLATED: _interpolated, HELD: _held}


def _note(base: Sampled, part: Sampled, u_hold: Hold) -> str:
    ratio = part.rate / base.rate if base.rate > 0.0 else 0.0
    how = [f"{name} {_way(name, u_hold)}" for name in part.values]
    often = "as often" if f"{ratio:.3g}" == "1" else f"{ratio:.3g} times as often"
    return f"{part.label} (sampled {often}) joined to the stamps of {base.label}: {', '.join(how)}"
