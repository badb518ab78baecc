"""What a sensor was read of: rows in which it says something new, and a speed that was made of a position.

A bus, a logger or a table joined from several sources writes the last value again until the next one comes. A row that
repeats a value while the axis moves is no measurement: its differences are 0 for some rows and then those of several,
which is force that nobody applied. Where an encoder stands still between two counts the next value is one count off;
where it was not read, as far as the axis has come.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from dsd_cli.signals.log import Array, Log
from dsd_cli.signals.rounding import ROUNDING

#: A step by so many of the smallest ones is more than a sensor that is read in every row makes after it stood still.
_MOVED = 3.0
#: Neighbours that noise of a standard deviation of `_MOVED` steps makes equal, as a share: 1 / (2 sqrt(pi) 3).
_BY_CHANCE = 1.0 / (2.0 * math.sqrt(math.pi) * _MOVED)
#: More of them than by chance, by so many standard deviations.
_CLEAR = 5.0
#: A channel with fewer values than this share of those of another is left out beside it.
_AS_OFTEN = 0.5
#: Values of which more than this share come in the rows of another channel come with it.
_TOGETHER = 0.5
_SENSORS = ("position", "velocity", "d_hat")

_Rows = NDArray[np.int64]


@dataclass(frozen=True)
class Updated:
    """A log of the rows in which its sensors say something new.

    log : u is its mean from each row to the next.
    restarts : its samples that do not continue the one before.
    said : one sentence; "" where the log is as it was.
    """

    log: Log
    restarts: tuple[int, ...]
    said: str = ""


def updated(log: Log, restarts: Sequence[int] = ()) -> Updated:
    """The log by its sensors' own clock: that of the sensor which says something new most often.

    restarts : samples that do not continue the one before.
    """
    begins = np.array([0, *(at for at in restarts if 0 < at < len(log))], dtype=np.int64)
    rows = {name: _new_rows(log[name], begins) for name in _SENSORS if name in log}
    held = {name: found for name, found in rows.items() if found is not None}
    clock = max(held.values(), key=len, default=begins)
    held |= {name: clock for name in rows if name not in held and _come_with(log[name], clock)}
    live = len(held) < len(rows)
    if not held or (live and "d_hat" in rows):  # a drive's own d_hat is of its own clock
        return Updated(log, tuple(restarts))
    if live:  # by its clock the others are few
        left = {name: x for name, x in log.channels.items() if name not in held}
        return Updated(replace(log, channels=left), tuple(restarts), _said(held, len(log), list(held)))
    slow = [name for name, found in held.items() if len(found) < _AS_OFTEN * len(clock)]
    t = log["t"] if "t" in log else np.asarray(log.sample_time * np.arange(len(log)), dtype=np.float64)
    channels = {name: x[clock] for name, x in log.channels.items() if name not in slow}
    channels |= {name: np.interp(t[clock], t[held[name]], log[name][held[name]]) for name in held if name in channels}
    channels |= {"t": t[clock]} | ({"u": _mean_u(log, t, clock)} if "u" in log else {})
    step = float(np.median(np.diff(t[clock])))
    thinned = replace(log, channels=channels, sample_time=step, u_hold="held")
    return Updated(thinned, tuple(np.searchsorted(clock, begins[1:]).tolist()), _said(held, len(log), slow, step))


def _come_with(x: Array, rows: _Rows) -> bool:
    """Whether the values of a channel change in these rows for the most part; in steady motion its steps are alike, as
    those of an encoder that stands between two counts."""
    changes = np.flatnonzero(np.diff(x)) + 1
    return bool(changes.size) and float(np.mean(np.isin(changes, rows))) > _TOGETHER


def _said(held: dict[str, _Rows], rows: int, out: Sequence[str], step: float = 0.0) -> str:
    names = " and ".join(held)
    each = rows / max(len(found) for found in held.values())
    what = f"{names} {'repeat' if len(held) > 1 else 'repeats'} each value for {each:.3g} rows while the axis moves"
    if not step:
        return f"{what}: {'they are' if len(out) > 1 else 'it is'} left out"
    beside = f"; {' and '.join(out)}, of which there are fewer, is left out" if out else ""
    return f"{what}: only rows with new ones are taken, {step * 1e3:.3g} ms apart{beside}"


def _new_rows(x: Array, begins: _Rows) -> _Rows | None:
    """Rows in which a channel says something new, with those between at its own pace where it may have stood still;
    None where it is read in every row. begins : first rows of the pieces."""
    first = np.union1d(np.flatnonzero(np.diff(x)) + 1, begins)
    jumps, lasted = np.abs(np.diff(x[first])), np.diff(first)
    least = ROUNDING * float(np.ptp(x)) if x.size else 0.0
    if not np.any(jumps > least):
        return None
    moved = jumps >= _MOVED * float(np.min(jumps[jumps > least]))
    moving = lasted[1:][moved[:-1] & moved[1:]]  # of values between two that are farther off than a step
    chance = _BY_CHANCE * len(moving) + _CLEAR * math.sqrt(_BY_CHANCE * (1.0 - _BY_CHANCE) * len(moving))
    if not np.count_nonzero(moving > 1) > chance:
        return None
    pace = max(round(float(np.median(moving))), 1)
    ends = np.append(first[1:], x.size)
    long = ends - first > pace
    beside = [np.arange(a + pace, b - pace // 2, pace) for a, b in zip(first[long], ends[long], strict=True)]
    return np.union1d(first, np.concatenate([np.zeros(0, dtype=np.int64), *beside]).astype(np.int64))


def _mean_u(log: Log, t: Array, rows: _Rows) -> Array:
    """u from each of these rows to the next, mean by time, shape (rows,)."""
    steps = np.diff(t, append=t[-1] + log.sample_time)
    after = np.append(log["u"][1:], log["u"][-1])
    level = log["u"] if log.u_hold == "held" else 0.5 * (log["u"] + after)
    return np.asarray(np.add.reduceat(level * steps, rows) / np.add.reduceat(steps, rows))


#: Noise of a speed is read from this share of half the sample rate on, and is that of a difference by so many nats.
_NOISE_FROM, _NATS = 0.25, 10.0
#: Metadata of a log whose position is the sum of its speed.
SUMMED = "position_summed"


def summed(log: Log, restarts: tuple[int, ...] = ()) -> Updated:
    """The log with the position of which its speed is the difference, where it has no other and the speed's noise is
    that of a difference: by the likelihood (Whittle) of its spectrum, white or proportional to 2 - 2 cos w T."""
    if "velocity" not in log or "position" in log or "d_hat" in log:
        return Updated(log, restarts)
    v = log["velocity"]
    angle = np.pi * np.arange(1, v.size // 2) / (v.size // 2)
    power = np.abs(np.fft.rfft(np.diff(v, prepend=v[:1]) * np.hanning(v.size)))[1 : angle.size + 1] ** 2
    above = (angle > _NOISE_FROM * np.pi) & (power > 0.0)
    if not np.any(above):
        return Updated(log, restarts)
    of_one = 2.0 - 2.0 * np.cos(angle[above])
    white, differenced = (float(np.log(np.mean(power[above] / of_one**n))) for n in (1, 2))
    if not np.count_nonzero(above) * (white - differenced - float(np.mean(np.log(of_one)))) > _NATS:
        return Updated(log, restarts)
    channels = {name: x for name, x in log.channels.items() if name != "velocity"}
    channels["position"] = np.cumsum(v) * log.sample_time
    said = "velocity has the noise of a difference of positions: their sum is taken, its zero is not known"
    made = replace(log, channels=channels, metadata={**log.metadata, SUMMED: "velocity"})
    return Updated(made, restarts, said)
