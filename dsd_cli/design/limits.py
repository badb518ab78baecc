"""What a motion may reach, and by how much one goes beyond it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from dsd_cli.errors import DataError, UsageError
from dsd_cli.identify.fit.equations import Equations
from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.recordings.recording import Recording
from dsd_cli.signals.answers import largest_answer
from dsd_cli.signals.encoder import encoder_step
from dsd_cli.signals.log import Array
from dsd_cli.signals.spread import robust_deviation

#: Limits by name; position has two ends.
NAMES = ("position", "velocity", "acceleration", "jerk", "u")
#: Periods of the band's end in which the acceleration may go from 0 to its limit, where nobody gave a jerk.
_RISE = 0.5
#: Quantile of what a log reached: single samples are noise.
_REACHED = 0.999
#: Times what the logs reached, from where on a limit leaves room for what they have not seen.
_FAR = 2.0


class TooNarrowError(DataError):
    """What explains the logs does not keep the limits, and need not: the logs reached more than they allow."""


@dataclass(frozen=True)
class Limits:
    """Of the motion (SI) and of the command (unit of u).

    low, high : ends of the position. velocity, acceleration, jerk, u : largest size. start : where the motion begins
    and ends, at rest. given : names of those that the user gave; the others are what the logs reached.
    """

    low: float
    high: float
    velocity: float
    acceleration: float
    jerk: float
    u: float
    start: float
    given: tuple[str, ...] = ()

    @property
    def sizes(self) -> Mapping[str, float]:
        """Largest size by name, but for the position."""
        return {name: getattr(self, name) for name in NAMES[1:]}

    def exceeded(self, q: Array, v: Array, a: Array, u: Array) -> dict[str, float]:
        """Name -> share of the limit (of the range, for the position) by which arrays of shape (n,) go beyond it."""
        span = self.high - self.low
        beyond = {"position": max(self.low - float(q.min()), float(q.max()) - self.high) / span}
        for name, x in (("velocity", v), ("acceleration", a), ("u", u)):
            beyond[name] = float(np.abs(x).max()) / getattr(self, name) - 1.0
        return {name: by for name, by in beyond.items() if by > 0.0}


def limits_of(
    recordings: Sequence[Recording], given: Mapping[str, tuple[float, float]], start: float, band_hz: float
) -> Limits:
    """What the logs reached, with what the user gave in its place.

    given : name -> (low, high); start : NaN for the middle of the range.

    Raises
    ------
    UsageError : a limit that leaves no room. DataError : a limit of the position is needed, the logs have none.
    """
    low, high = given.get("position", (math.nan, math.nan))
    if "position" not in given:
        low, high = _visited(recordings)
        if math.isnan(low):
            raise DataError("the logs have no position that does not drift", "give --limit position=LOW:HIGH")
    if not low < high:
        raise UsageError(f"limit position = {low:g}:{high:g}", "the first must be below the second")
    sizes = {name: given[name][1] for name in NAMES[1:] if name in given}
    for name, size in sizes.items():
        if not size > 0.0:
            raise UsageError(f"limit {name} = {size:g}", "must be above 0")
    sizes = {**_reached(recordings), **sizes}
    sizes.setdefault("jerk", sizes["acceleration"] * band_hz / _RISE)
    start = 0.5 * (low + high) if math.isnan(start) else start
    if not low <= start <= high:
        raise UsageError(f"plan.start = {start:g}", f"must be within the position's limits, {low:g} to {high:g}")
    return Limits(low, high, **sizes, start=start, given=tuple(given))


def unvisited(limits: Limits, recordings: Sequence[Recording]) -> tuple[str, ...]:
    """Of position and velocity those whose limits are far from what the logs reached: nobody knows what acts there."""
    low, high = _visited(recordings)
    room = {"position": limits.high - limits.low > _FAR * (high - low)}
    room["velocity"] = limits.velocity > _FAR * _reached(recordings)["velocity"]
    return tuple(name for name, far in room.items() if far)


def or_reached(limits: Limits, recordings: Sequence[Recording]) -> Limits:
    """The same, or as far as the logs reached where that is more; of the position it is their way that counts."""
    way = 0.5 * float(np.nan_to_num(np.diff(_visited(recordings))[0]))
    sizes = {name: max(x, getattr(limits, name)) for name, x in _reached(recordings).items()}
    return replace(limits, low=min(limits.low, limits.start - way), high=max(limits.high, limits.start + way), **sizes)


def _visited(recordings: Sequence[Recording]) -> tuple[float, float]:
    """Ends of the position in the logs, NaN where they have none."""
    places = [p["position"] for r in recordings for p in r.pieces if "position" in p]
    ends = [(float(q.min()), float(q.max())) for q in places]
    return (min(a for a, _ in ends), max(b for _, b in ends)) if ends else (math.nan, math.nan)


def _reached(recordings: Sequence[Recording]) -> dict[str, float]:
    """Largest speed, acceleration (as smooth as the speed is) and u of the logs."""
    found = {"velocity": 0.0, "acceleration": 0.0, "u": 0.0}
    for piece in (p for r in recordings for p in r.pieces if "velocity" in p):
        width = max(round(POLICY.least_band_hz**-1 / 20.0 / piece.sample_time), 1)
        smooth = np.convolve(np.gradient(piece["velocity"], piece.sample_time), np.ones(width) / width, "same")
        for name, x in (("velocity", piece["velocity"]), ("acceleration", smooth), ("u", piece["u"])):
            found[name] = max(found[name], float(np.quantile(np.abs(x), _REACHED)))
    return found


def slowed(limits: Limits, share: float) -> Limits:
    """The same with this share of all sizes; of the way to an end, half of the rest is left."""
    velocity, acceleration, jerk, u = (share * size for size in limits.sizes.values())
    low, high = (x + 0.5 * (1.0 - share) * (limits.start - x) for x in (limits.low, limits.high))
    return replace(limits, low=low, high=high, velocity=velocity, acceleration=acceleration, jerk=jerk, u=u)


def used(limits: Limits, q: Array, v: Array, u: Array) -> Limits:
    """As wide as a motion makes use of them; arrays of shape (n,)."""
    velocity, most = (float(np.abs(x).max()) for x in (v, u))
    return replace(limits, low=float(q.min()), high=float(q.max()), velocity=velocity, u=most)


def noise_of_u(known: Equations, seconds: float) -> float:
    """What noise adds to u in so many s, unit of u: the controller's answer to that of the sensor, above the band, as
    large as the largest of so many samples is expected to be (normal: sqrt(2 ln n) deviations), but no larger than it
    was in the logs: the answer to counts has an end. By its median in the logs, so that jumps of u, as under relays,
    are none. Where counts pass so seldom that most samples hear none, it is the answer to one."""
    most = math.sqrt(2.0 * math.log(max(seconds / known.sample_time, 2.0)))
    size = 0.0
    for stretch, band in zip(known.stretches, known.bands_of_stretches, strict=True):
        u = stretch.log["u"]
        rest = u[band.half : len(u) - band.half] - np.convolve(u, band.taps, "valid")
        count = encoder_step(stretch.log["position"]) if "position" in stretch.log else 0.0
        counted = largest_answer(u, stretch.log["position"] / count) if count > 0.0 else 0.0
        size = max(size, counted, min(most * robust_deviation(rest), float(np.abs(rest).max())))
    return size
