"""Parts of a motion: each begins and ends at rest at one position, and is scaled down until it is within the limits.

A part is a kind and a few numbers in [0, 1]; where the limits lie decides what these mean. What each kind shows:
harmonics the inertia and whatever is smooth (eight at most, Swevers et al. 1997); moves with dwells what acts at rest
and over the place; stairs of constant speeds both ways friction over the speed; creeping its rise at low speed;
reversals play and presliding; a chirp a second mass, and a lag against a delay.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from dsd_cli.design.limits import Limits, noise_of_u, or_reached, slowed
from dsd_cli.design.rows import planning_step
from dsd_cli.identify.fit.equations import Equations
from dsd_cli.identify.recordings.recording import Recording
from dsd_cli.signals.log import Array
from dsd_cli.signals.runs import runs

#: Share of a limit that the reference may use: the axis does not follow it exactly.
ROOM = 0.9
#: Shares of a part at either end in which harmonics, reversals and chirps may fade.
FADES = (0.15, 0.3, 0.5)
_MOST_HARMONICS = 8


@dataclass(frozen=True)
class MotionSegment:
    """kind : of `KINDS`. seconds : its length. values : of shape (4,), in [0, 1]. scale : of its size."""

    kind: str
    seconds: float
    values: tuple[float, ...]
    scale: float = 1.0

    def samples(self, step: float) -> int:
        """Steps of so many s that it lasts."""
        return max(round(self.seconds / step), 8)


@dataclass(frozen=True)
class Room:
    """Limits that a reference keeps, the end of the band in Hz, s between samples, and what logs reached beyond."""

    limits: Limits
    band_hz: float
    step: float
    reached: Limits | None = None

    @classmethod
    def within(cls, limits: Limits, known: Equations, recordings: Sequence[Recording], seconds: float) -> Room:
        """Of these limits for so many s, less the noise that u has in the logs."""
        left = replace(limits, u=max(limits.u - noise_of_u(known, seconds), 0.0))
        return cls(left, known.band.hz, planning_step(known.band), or_reached(slowed(left, ROOM), recordings))

    @property
    def half(self) -> float:
        """Way to the nearer end of the range; to the farther one where the start is at an end."""
        x = self.limits
        return min(x.high - x.start, x.start - x.low) or max(x.high - x.start, x.start - x.low)

    @property
    def quickest(self) -> float:
        """s of the acceleration's rise to its limit."""
        return self.limits.acceleration / self.limits.jerk


def position_of(part: MotionSegment, room: Room) -> Array:
    """Position of a part, shape (n,), from rest at the start to rest there."""
    return room.limits.start + part.scale * _largest(part, room)[0]


def _largest(part: MotionSegment, room: Room) -> tuple[Array, float]:
    """(way of the part at full scale, share in which it fades): of several shares the one with which the limits let
    it move most, as a rise that is quick for its size takes all of a jerk for itself."""
    t = room.step * np.arange(part.samples(room.step) + 1, dtype=np.float64)
    way = KINDS[part.kind](t, np.array(part.values), room)
    shares = FADES if part.kind in _FADING else (0.0,)
    ways = [_as_far_as_allowed(way * _fade(len(way), share) if share else way, room) for share in shares]
    return max(zip(ways, shares, strict=True), key=lambda one: float(one[0] @ one[0]))


def _as_far_as_allowed(way: Array, room: Room) -> Array:
    limits = room.limits
    up, down = limits.high - limits.start, limits.start - limits.low
    uses = [float(way.max()) / up if up > 0.0 else (np.inf if way.max() > 0.0 else 0.0)]
    uses.append(float(-way.min()) / down if down > 0.0 else (np.inf if way.min() < 0.0 else 0.0))
    if not all(np.isfinite(uses)):  # the start is at an end: to the one side alone
        way = math.copysign(1.0, up - down) * way**2 / max(float(np.abs(way).max()), 1e-300)
        uses = [float(np.abs(way).max()) / max(up, down)]
    sizes = (limits.velocity, limits.acceleration, limits.jerk)
    slopes = (np.diff(way, k) / room.step**k for k in (1, 2, 3))
    uses += [float(np.abs(x).max()) / size for x, size in zip(slopes, sizes, strict=True)]
    return np.asarray(min(1.0, ROOM / max(*uses, 1e-300)) * way)


def _fade(count: int, share: float) -> Array:
    """From 0 to 1 and back, with two smooth derivatives at either end."""
    x = np.linspace(0.0, 1.0 / share, count)
    x = np.clip(np.minimum(x, x[::-1]), 0.0, 1.0)
    return np.asarray(x**3 * (10.0 - 15.0 * x + 6.0 * x * x))


def _lines(last: float, values: Array, room: Room) -> tuple[Array, Array, Array]:
    """(Hz, sizes, phases) of harmonics over `last` s."""
    low = 1.0 / last
    high = low * (max(room.band_hz / 2.0, 1.5 * low) / low) ** values[0]
    count = 2 + round(float(values[3]) * (_MOST_HARMONICS - 2))
    frequencies = np.unique(np.maximum(np.round(np.geomspace(low, high, count) / low), 1.0)) * low
    sizes = frequencies ** -(0.3 + 1.7 * values[1])
    index = np.arange(len(frequencies))
    phases = -np.pi * index * (index + 1) * (0.3 + values[2]) / len(index)  # Schroeder's, more or less
    return frequencies, sizes, phases


def _harmonics(t: Array, values: Array, room: Room) -> Array:
    """values : highest frequency, how amplitudes fall with it, phases, number."""
    frequencies, sizes, phases = _lines(float(t[-1]), values, room)
    return np.asarray(sizes @ np.sin(2.0 * np.pi * np.outer(frequencies, t) + phases[:, None]))


def _swept(last: float, values: Array, room: Room) -> tuple[float, float]:
    """First and last frequency of a chirp, Hz."""
    top = min(room.band_hz, 0.2 / room.step)
    low = min(max(1.0 / last, 0.1) * 4.0 ** float(values[0]), 0.5 * top)
    return low, low * (top / low) ** (0.3 + 0.7 * float(values[1]))


def _chirp(t: Array, values: Array, room: Room) -> Array:
    """values : first and last frequency, size; the size falls as the limits ask."""
    low, high = _swept(float(t[-1]), values, room)
    frequency = low * (high / low) ** (t / t[-1])
    angle, x = 2.0 * np.pi * np.cumsum(frequency) * room.step, room.limits
    w = 2.0 * np.pi * frequency
    size = 1.0 / (1.0 / room.half + w / x.velocity + w**2 / x.acceleration + w**3 / x.jerk)
    return np.asarray((0.1 + 0.9 * values[2]) * size * np.sin(angle))


def _visits(t: Array, places: Array, speeds: Array, dwell: float, room: Room) -> Array:
    """Moves from place to place (the first and the last is 0) with trapezoidal, rounded speed, resting in between."""
    a = 0.8 * ROOM * room.limits.acceleration
    ways = np.diff(places)
    tops = _tops(ways, speeds, a)
    v, at = np.zeros(len(t)), room.quickest
    for way, top in zip(ways, tops, strict=True):
        lasts = abs(way) / top + top / a
        since = t - at
        shape = np.maximum(np.minimum(np.minimum(since, lasts - since) * a, top), 0.0)
        covered = float(shape.sum()) * room.step  # exactly the way, however coarse the samples are
        v += way / max(covered, 1e-300) * shape if covered > 0.5 * abs(way) else 0.0
        at += lasts + dwell + 2.0 * room.quickest
    width = max(2 * round(0.5 * room.quickest / room.step) + 1, 3)
    return np.asarray(np.cumsum(np.convolve(v, np.ones(width) / width, "same")) * room.step)


def _tops(ways: Array, speeds: Array, a: float) -> Array:
    """Speed that each move reaches."""
    return np.asarray(np.minimum(np.maximum(speeds, 1e-9), np.sqrt(np.abs(ways) * a) + 1e-300))


def _fitted(t: Array, places: Array, speeds: Array, dwell: float, room: Room) -> Array:
    """The visits, nearer to each other until all of them take no longer than there is time, and repeated while there
    is."""
    a = 0.8 * ROOM * room.limits.acceleration
    left = t[-1] - 2.0 * room.quickest
    for shrink in 0.8 ** np.arange(30):
        ways = np.abs(np.diff(places)) * shrink
        tops = _tops(ways, speeds, a)
        takes = float(np.sum(ways / tops + tops / a) + len(ways) * (shrink * dwell + 2.0 * room.quickest))
        if takes <= left:
            times = max(int(left / takes), 1)
            visited = np.concatenate([places[:1], *([shrink * places[1:]] * times)])
            return _visits(t, visited, np.tile(speeds, times), shrink * dwell, room)
    return np.zeros(len(t))


def _moves(t: Array, values: Array, room: Room) -> Array:
    """values : way, speed, dwell, number of stops on the way."""
    half = room.half * (0.2 + 0.8 * values[0])
    out = np.linspace(0.0, half, 2 + round(3 * float(values[3])))
    places = np.concatenate([out, out[-2::-1], -out[1:], -out[-2::-1]])
    speed = ROOM * room.limits.velocity * 10.0 ** (values[1] - 1.0)
    return _fitted(t, places, np.full(len(places) - 1, speed), 0.02 + 0.4 * values[2] * t[-1] / len(places), room)


def _stairs(t: Array, values: Array, room: Room) -> Array:
    """values : way, top speed, ratio of neighbouring speeds, number of speeds."""
    half = room.half * (0.1 + 0.9 * values[0])
    count = 2 + round(3 * float(values[3]))
    speeds = ROOM * room.limits.velocity * 10.0 ** (values[1] - 1.0) * (0.2 + 0.5 * values[2]) ** np.arange(count)
    places = np.concatenate([[0.0], *([half * s, 0.0, -half * s, 0.0] for s in (speeds / speeds[0]) ** 0.7)])
    return _fitted(t, places, np.repeat(speeds, 4), 0.0, room)


def _creep(t: Array, values: Array, room: Room) -> Array:
    """values : speed, ratio of the two speeds, way against what the time allows."""
    slow = ROOM * room.limits.velocity * 10.0 ** (-3.0 + 2.0 * values[0])
    speeds = slow * np.array([1.0, 1.0 + 4.0 * values[1]])
    way = min(room.half, 0.1 * t[-1] * slow * (0.3 + 0.7 * values[2]))
    places = np.concatenate([[0.0], *([way * s, -way * s, 0.0] for s in (1.0, 1.0))])
    return _fitted(t, places, np.repeat(speeds, 3), 0.0, room)


def _reversals(t: Array, values: Array, room: Room) -> Array:
    """values : first size, last size, frequency."""
    first = room.half * 10.0 ** (-2.0 + 1.5 * values[0])
    last = first * 10.0 ** (-1.5 * values[1])
    x = room.limits
    reach = math.sqrt(x.acceleration / first) / (2.0 * np.pi)
    frequency = max(min(reach, 0.5 * room.band_hz) * 10.0 ** (values[2] - 1.0), 2.0 / t[-1])
    return np.asarray(first * (last / first) ** (t / t[-1]) * np.sin(2.0 * np.pi * frequency * t))


def generator_values(part: MotionSegment, room: Room) -> dict[str, list[float]]:
    """What to set on a drive that has a generator alone: Hz, s, and sizes, ways and speeds in SI.

    Of harmonics each line; of a chirp both frequencies; of reversals the size of each; else each move, in order.
    """
    position, values = position_of(part, room), np.array(part.values)
    way = position - room.limits.start
    last = room.step * (len(way) - 1)
    if part.kind == "harmonics":
        frequencies, sizes, phases = _lines(last, values, room)
        share = _largest(part, room)[1]
        raw = _harmonics(room.step * np.arange(len(way), dtype=np.float64), values, room) * _fade(len(way), share)
        size = float(way @ raw) / max(float(raw @ raw), 1e-300)
        return {
            "frequency_hz": frequencies.tolist(),
            "amplitude": (size * sizes).tolist(),
            "phase_rad": (phases + 0.0).tolist(),
            "fade_s": [share * last],
        }
    if part.kind == "chirp":
        return {"frequency_hz": list(_swept(last, values, room)), "amplitude": [float(np.abs(way).max())]}
    if part.kind == "reversals":
        inner = way[1:-1]
        peaks = np.flatnonzero((np.abs(inner) >= np.abs(way[:-2])) & (np.abs(inner) > np.abs(way[2:]))) + 1
        return {"amplitude": np.abs(way[peaks]).tolist(), "frequency_hz": [0.5 * len(peaks) / last]}
    moving = np.abs(np.diff(way)) > 1e-9 * max(float(np.ptp(way)), 1e-300)
    spans = [(a, b) for a, b in runs(moving)]
    speeds = [float(np.abs(np.diff(way[a : b + 1])).max()) / room.step for a, b in spans]
    return {"distance": [float(way[b] - way[a]) for a, b in spans], "speed": speeds}


#: Kind -> (t, values, room) -> way from the start, shape (n,), before it fades; who does.
KINDS: dict[str, Callable[[Array, Array, Room], Array]] = {
    "harmonics": _harmonics,
    "moves": _moves,
    "stairs": _stairs,
    "creep": _creep,
    "reversals": _reversals,
    "chirp": _chirp,
}
_FADING = ("harmonics", "reversals", "chirp")
