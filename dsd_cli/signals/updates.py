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
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from dsd_cli.signals.encoder import encoder_step
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
#: Values come with another channel if more do than by chance, by this share of the way from there to all.
_TOGETHER = 0.5
#: Rows that a value stays in the mean, below which only some values stay at all.
_MOST_TWICE = 1.5
_SENSORS = ("position", "velocity", "d_hat")

_Rows = NDArray[np.int64]


@dataclass(frozen=True)
class Updated:
    """A log of the rows in which its sensors say something new.

    log : u is its mean from each row to the next.
    restarts : its samples that do not continue the one before.
    what : what its sensors do; "" where the log is as it was. done : what has been done about it.
    """

    log: Log
    restarts: tuple[int, ...]
    what: str = ""
    done: str = ""

    @property
    def said(self) -> str:
        """One sentence; "" where the log is as it was."""
        return self.what and f"{self.what}: {self.done}"


def updated(log: Log, restarts: Sequence[int] = ()) -> Updated:
    """The log by its sensors' own clock: that of the sensor which says something new most often.

    A speed that comes half as often as the position, or less, is left out beside it; such a position is carried from
    one of its values to the next by the speed, for its zero is its own.

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
    clock = np.arange(len(log), dtype=np.int64) if live else clock
    slow = [name for name, found in held.items() if len(found) < _AS_OFTEN * len(clock)]
    t = log["t"] if "t" in log else np.asarray(log.sample_time * np.arange(len(log)), dtype=np.float64)
    whole = dict(log.channels) | {n: _between(log[n], found, t, begins) for n, found in held.items() if n not in slow}
    if carried := [name for name in slow if name == "position" and "velocity" in whole and "velocity" not in slow]:
        way = np.cumsum(whole["velocity"] * np.diff(t, prepend=t[:1]))
        whole["position"] = way + _between(log["position"] - way, held["position"], t, begins)
    out = [name for name in slow if name not in carried]
    if live:
        channels = {name: x for name, x in whole.items() if name not in out}
        return Updated(replace(log, channels=channels), tuple(restarts), *_said(held, len(log), out, carried))
    clock = _from_news_on(clock, begins)
    channels = {name: x[clock] for name, x in whole.items() if name not in out}
    channels |= {"t": t[clock]} | ({"u": _mean_u(log, t, clock, begins)} if "u" in log else {})
    apart = np.diff(t[clock])
    step = float(np.median(apart[apart > 0.0])) if np.any(apart > 0.0) else log.sample_time  # stamps may begin again
    thinned = replace(log, channels=channels, sample_time=step, u_hold="held")
    found = tuple(np.searchsorted(clock, begins[1:]).tolist())
    return Updated(thinned, found, *_said(held, len(log), out, carried, step))


def _from_news_on(clock: _Rows, begins: _Rows) -> _Rows:
    """Without the first row of a piece where the next value comes sooner than usual: its own was read before it."""
    apart = np.diff(clock)
    usual = float(np.median(apart)) if apart.size else 0.0
    at = np.searchsorted(clock, begins)
    early = at[(at < apart.size) & ~np.isin(at + 1, at)]
    return np.delete(clock, early[apart[early] < usual])


def _between(x: Array, rows: _Rows, t: Array, begins: _Rows) -> Array:
    """A channel at every row from its values in some, piece by piece: stamps of the next may begin again."""
    found = np.empty(x.size)
    for a, b in pairwise([*begins.tolist(), x.size]):
        inside = rows[(rows >= a) & (rows < b)]
        found[a:b] = np.interp(t[a:b], t[inside], x[inside])
    return found


def _come_with(x: Array, rows: _Rows) -> bool:
    """Whether the values of a channel change in these rows for the most part; in steady motion its steps are alike, as
    those of an encoder that stands between two counts."""
    changes = np.flatnonzero(np.diff(x)) + 1
    by_chance = len(rows) / x.size
    return bool(changes.size) and float(np.mean(np.isin(changes, rows))) > by_chance + _TOGETHER * (1.0 - by_chance)


def _said(
    held: dict[str, _Rows], rows: int, out: Sequence[str], carried: Sequence[str], step: float = 0.0
) -> tuple[str, str]:
    """What the sensors do, and what has been done about it."""
    each, some = rows / max(len(found) for found in held.values()), len(held) > 1
    what = f"each value for {each:.3g} rows" if each >= _MOST_TWICE else "some of the values"
    between = set(held) - {*out, *carried}
    done = [f"only rows with new ones are taken, {step * 1e3:.3g} ms apart"] if step else []
    done += ["they are put between their neighbours"] if between and not step else []
    done += [f"{name} goes as the speed between its values" for name in carried]
    done += [f"{name} is left out" for name in out]
    return f"{' and '.join(held)} {'repeat' if some else 'repeats'} {what} while the axis moves", ", ".join(done)


def _new_rows(x: Array, begins: _Rows) -> _Rows | None:
    """Rows in which a channel says something new, with those between at its own pace where it may have stood still;
    None where it is read in every row. begins : first rows of the pieces."""
    first = _either(np.flatnonzero(np.diff(x)) + 1, begins)
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
    return _either(first, *beside)


def _either(*rows: _Rows) -> _Rows:
    """Rows that are in one of these, in order."""
    found = np.zeros(1 + max(int(some.max(initial=0)) for some in rows), dtype=bool)
    for some in rows:
        found[some] = True
    return np.flatnonzero(found)


def _mean_u(log: Log, t: Array, rows: _Rows, begins: _Rows) -> Array:
    """u from each of these rows to the next, mean by time, shape (rows,)."""
    steps = np.diff(t, append=t[-1] + log.sample_time)
    steps[begins[1:] - 1] = log.sample_time  # from the last row of a piece none leads to the next
    after = np.append(log["u"][1:], log["u"][-1])
    level = log["u"] if log.u_hold == "held" else 0.5 * (log["u"] + after)
    each = _either(rows, begins)  # what comes before the first of these rows in its piece is of none
    mean = np.add.reduceat(level * steps, each) / np.add.reduceat(steps, each)
    return np.asarray(mean[np.searchsorted(each, rows)])


#: A clock of u shows by so many different values, and as good as all come in step.
_TICKS, _IN_STEP = 16, 0.98


def rows_of_u(u: Array) -> int:
    """For how many rows u keeps each value, where that is a clock of its own; 1 where not, as of the steps of a test.

    A drive that holds it so and a logger that reads it so leave the same log: read so, each value but the first is old,
    by (n - 1) / 2 rows in the mean, and a delay that is identified is shorter by that.
    """
    there = np.flatnonzero(np.isfinite(u))
    new = there[1:][np.diff(u[there]) != 0.0]
    if np.unique(u[new]).size < _TICKS:
        return 1
    apart = np.diff(new)
    each = max(int(np.median(apart)), 1)  # a row that was lost makes some shorter
    in_step = np.mean(apart % each == 0) > _IN_STEP and np.mean(apart == each) > _AS_OFTEN
    return each if in_step else 1


#: Noise of a speed is read from this share of half the sample rate on, and is that of a difference by so many nats.
_NOISE_FROM, _NATS = 0.25, 10.0
#: Stamps are even to this share of a sample.
_UNEVEN = 0.1
#: Metadata of a log whose position is the sum of its speed.
SUMMED = "position_summed"


def summed(log: Log, restarts: tuple[int, ...] = ()) -> Updated:
    """The log with the position of which its speed is the difference, where it has no other and the speed's noise is
    that of a difference: by the likelihood (Whittle) of its spectrum, white or proportional to 2 - 2 cos w T."""
    if "velocity" not in log or "position" in log or "d_hat" in log:
        return Updated(log, restarts)
    v = log["velocity"]
    if not encoder_step(v) > 0.0 or ("t" in log and np.ptp(np.diff(log["t"])) > _UNEVEN * log.sample_time):
        return Updated(log, restarts)
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
    made = replace(log, channels=channels, metadata={**log.metadata, SUMMED: "velocity"})
    what = "velocity has the noise of a difference of positions"
    return Updated(made, restarts, what, "their sum is taken, its zero is not known")
