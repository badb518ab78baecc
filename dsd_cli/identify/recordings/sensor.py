"""What the acceleration is measured by (position, velocity or d_hat), and its noise that a controller puts into u.

A controller that answers the speed with a gain D answers its noise as well. Within the loop that part of u is T r, with
r = -J n'' what the noise n of the position leaves of a row, and T the gain of the closed loop; so du/dt has i w T r. No
frequency has more of w |T| than D / J, and T is about 1 at most where the loop follows: du/dt times r is at most
min(D / J, w) r^2 in a row, w the end of the band. Where the motion gives du/dt little else, r goes with du/dt, in all
blocks alike. D is seen above the motion, where noise is all that the sensor has.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from dsd_cli.errors import DataError
from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.recordings.smoothing import SAMPLED_U, noise_of
from dsd_cli.identify.recordings.spectrum import (
    FEWEST_SEGMENTS,
    SEGMENT,
    Density,
    SensorKind,
    SensorNoise,
    bend,
    density,
    last_angle,
    sensor_noise,
)
from dsd_cli.plant.filtering import SETTLED
from dsd_cli.plant.model import ObserverSettings
from dsd_cli.plant.observer import observe_log
from dsd_cli.plant.prediction import Frame
from dsd_cli.signals.encoder import exact_step
from dsd_cli.signals.log import Array, Log, with_channels

#: Sensors are compared at this share of the sample rate, or at this frequency (Hz) if that is lower.
COMPARED_SHARE, COMPARED_HZ = 0.1, 30.0
#: A position is preferred while its noise density is below so many times that of the best: speeds and disturbances
#: that a drive logs have passed filters that nobody wrote down.
PREFERENCE = {"position": 10.0, "velocity": 2.0, "d_hat": 1.0}


@dataclass(frozen=True)
class Sensor:
    """Where the acceleration of a recording is from.

    noise : of the acceleration, by frequency.
    sure : the part of it that is no motion: what most samples show, too. Jolts reach as far up as noise does.
    two_intervals : each value is a mean over both intervals beside its sample, weighted by a hat (a second difference
        of the position); else over the interval that ends there.
    counts : of a position in counts the noise that these are in this motion; None else. It says how little a log can
        leave; for the band and the weights of rows noise is what stands above the motion.
    """

    noise: SensorNoise
    sure: SensorNoise
    two_intervals: bool
    counts: SensorNoise | None = None

    @property
    def kind(self) -> SensorKind:
        """The channel."""
        return self.noise.kind


def with_acceleration(pieces: Sequence[Log], observer: ObserverSettings) -> tuple[list[Log], Sensor]:
    """The pieces (regular, with d_hat) with "acceleration" by the best sensor that they have, and that sensor."""
    pole = observer.pole(pieces[0].sample_time)
    found: list[tuple[float, list[Array], Sensor]] = []
    angle = np.array([2.0 * np.pi * min(COMPARED_SHARE, COMPARED_HZ * pieces[0].sample_time)])
    ends = last_angle(density([piece["u"] for piece in pieces]))
    for kind in _kinds(pieces[0]):
        measured = [_acceleration(piece, kind, observer) for piece in pieces]
        noise = sensor_noise(kind, measured, pole, [piece["white"] for piece in pieces if "white" in piece], ends)
        sure = noise._replace(scale=min(noise.scale, max(_of_samples(piece, kind, observer) for piece in pieces)))
        two = kind == "position" or (kind == "d_hat" and pieces[0].d_hat_source == "position")
        worth = float(noise.density(angle)[0]) / PREFERENCE[kind]
        found.append((worth, measured, Sensor(noise, sure, two)))
    _, measured, sensor = min(found, key=lambda f: f[0])
    return [with_channels(p, acceleration=a) for p, a in zip(pieces, measured, strict=True)], sensor


def _of_samples(piece: Log, kind: SensorKind, observer: ObserverSettings) -> float:
    """Scale of the noise by the high differences of most samples, (rad/s2)^2 or (m/s2)^2."""
    size = noise_of(piece[kind]) / (noise_of(piece["white"]) if "white" in piece else 1.0)
    step = piece.sample_time
    return (size / {"position": step**2, "velocity": step, "d_hat": observer.nominal_inertia}[kind]) ** 2


def _kinds(piece: Log) -> list[SensorKind]:
    kinds: list[SensorKind] = [kind for kind in ("position", "velocity") if kind in piece]
    return [*kinds, "d_hat"] if piece.d_hat_source == "logged" or not kinds else kinds


def _acceleration(piece: Log, kind: SensorKind, observer: ObserverSettings) -> Array:
    """rad/s2 or m/s2, shape (n,); the ends, which have no neighbour, repeat the next value."""
    step = piece.sample_time
    if kind == "position":
        return np.pad(np.diff(piece["position"], 2) / step**2, 1, mode="edge")
    if kind == "velocity":
        return np.pad(np.diff(piece["velocity"]) / step, (1, 0), mode="edge")
    seen = net_force(piece, observer) / observer.nominal_inertia
    if piece.d_hat_source == "position":  # the observer knows it one sample after the middle of its two intervals
        return np.pad(seen[1:], (0, 1), mode="edge")
    return np.pad(seen[1:], (1, 0), mode="edge")


def net_force(piece: Log, observer: ObserverSettings) -> Array:
    """Jn a, mean over the interval that ends at each sample of a regular clock, from d_hat and u: Q undone, shape (n,).

    Where d_hat averages two intervals (from position) so does this. The first sample is 0.
    """
    frame = Frame(piece)
    d_hat = piece["d_hat"]
    pole = observer.pole(piece.sample_time)
    raw = np.zeros(len(d_hat))
    raw[1:] = (d_hat[1:] - pole * d_hat[:-1]) / (1.0 - pole)
    u = frame.seen(frame.mean_u(piece[SAMPLED_U if SAMPLED_U in piece else "u"], 0.0), None)
    total = raw + u
    total[0] = 0.0
    return np.asarray(total)


def check_signs(pieces: Sequence[Log], observer: ObserverSettings, name: str) -> None:
    """A logged d_hat must be Q { Jn a } - Q u with the a of the logged motion.

    Raises
    ------
    DataError : a sign is wrong, as far as noise lets it be seen.
    """
    if not any(channel in pieces[0] for channel in ("velocity", "position")):
        return
    d_hat, force, drive = (np.concatenate(parts) for parts in zip(*(_sides(p, observer) for p in pieces), strict=True))
    x = np.stack([force, drive])
    (g, h), *_ = np.linalg.lstsq(x.T, d_hat, rcond=None)
    variance = POLICY.correlated_samples * float(np.mean((d_hat - g * force - h * drive) ** 2))
    errors = np.sqrt(np.maximum(variance * np.diag(np.linalg.pinv(x @ x.T)), 1e-300))
    if (g > 0.0 > h) or min(abs(g) / errors[0], abs(h) / errors[1]) < POLICY.clear_signs:
        return
    if g < 0.0 < h:
        raise DataError(f"{name}: d_hat has the other sign than its velocity or position", "set observer.sign")
    wrong, key = ("velocity or position", "velocity_scale, position_scale") if g < 0.0 else ("u", "u_sign")
    raise DataError(
        f"{name}: {wrong} has the other sign than the other channels", f"turn the sign of {wrong} in [signals]: {key}"
    )


def _sides(piece: Log, observer: ObserverSettings) -> tuple[Array, Array, Array]:
    """(d_hat, Q { Jn a } from the motion, Q u), without the samples in which they settle."""
    motion = {name: x for name, x in piece.channels.items() if name != "d_hat"}
    if piece.d_hat_source == "position" and "position" in motion:
        motion.pop("velocity", None)
    bare = replace(piece, channels=motion, d_hat_source="logged")
    observed = observe_log(bare, observer)
    frame = Frame(observed)
    drive = frame.seen(frame.mean_u(piece["u"], 0.0), observer)
    first = min(int(SETTLED * observer.time_constant / piece.sample_time) + 3, len(piece) // 2)
    return piece["d_hat"][first:], (observed["d_hat"] + drive)[first:], drive[first:]


#: Samples of a segment.
_SEGMENT = 256


class FeedbackNoise(NamedTuple):
    """How u answers the speed: sums over segments of u V* (complex) and V V*, by frequency above the motion."""

    both: Array
    speed: Array


def feedback_noise_of(u: Array, acceleration: Array, sample_time: float) -> FeedbackNoise:
    """Of one stretch; the speed is what the measured acceleration is the change of."""
    size = min(_SEGMENT, len(u) // 2 * 2)
    angle = 2.0 * np.pi * np.arange(size // 2 + 1) / size
    above = angle >= POLICY.noise_from_share * np.pi
    window = np.hanning(size + 1)[:-1]
    pieces = [np.lib.stride_tricks.sliding_window_view(x, size)[:: size // 2] for x in (u, acceleration)]
    drive, change = (np.fft.rfft((p - p.mean(axis=1, keepdims=True)) * window, axis=1)[:, above] for p in pieces)
    speed = change * (0.5 * sample_time / np.sin(0.5 * angle[above]))
    return FeedbackNoise(np.sum(drive * speed.conj(), axis=0), np.sum(np.abs(speed) ** 2, axis=0))


def rate(answers: Sequence[FeedbackNoise], inertia: float) -> float:
    """D / J in rad/s; 0 where the sensor has nothing above the motion."""
    most = max(len(a.speed) for a in answers)  # stretches shorter than a segment have fewer frequencies
    both, speed = (np.sum(x, axis=0) for x in zip(*(a for a in answers if len(a.speed) == most), strict=True))
    power = float(speed.sum())
    if not (power > 0.0 and inertia > 0.0):
        return 0.0
    return math.sqrt(float(np.sum(np.abs(both) ** 2 / np.maximum(speed, 1e-300))) / power) / inertia


#: Beginnings from which the motion is rounded; rounds in which the sensor's own noise is found; seed.
_BEGINNINGS, _ROUNDS, _SEED = (0.0, 0.25, 0.5, 0.75), 2, 20261128
#: Samples of a block, enough for segments of full length, and samples that are rounded of a long log, about.
_BLOCK, _SAMPLES = (FEWEST_SEGMENTS + 1) * SEGMENT // 2, 50_000


def with_counts(sensor: Sensor, pieces: Sequence[Log]) -> Sensor:
    """The sensor with the noise that its counts are in this motion; pieces with "velocity".

    At a speed of n counts a sample the error of rounding is a saw-tooth of one tooth per count, sampled: its harmonic
    k, of power (step / (pi k))^2 / 2, stands at |k n - round(k n)| / T Hz. At a whole number of counts a sample, or a
    simple fraction, as round speeds and rates make it, these are slow beats, and forces within the band; at rest there
    is no noise at all. So the motion itself, rounded again from other beginnings, says where that noise stands. What a
    log shows above the motion beyond that is white noise of the position, which smears the counts.
    """
    if sensor.kind != "position" or sensor.noise.end < math.pi or any("white" in p for p in pieces):
        return sensor
    step = exact_step([p["position"] for p in pieces])
    if not step > 0.0:
        return sensor
    interval, white = pieces[0].sample_time, 0.0
    ways = _some_of([np.cumsum(p["velocity"]) * (interval / step) for p in pieces])
    found, unit = density([p["acceleration"] for p in pieces]), step**2 / 12.0 / interval**4
    seen = found.power / (unit * bend(found.angle) ** 2)
    above = found.angle >= POLICY.noise_from_share * math.pi
    counted = rounding(ways)
    for _ in range(_ROUNDS):
        white = float(np.median(np.maximum(seen - counted.at(found.angle) + white, 0.0)[above]))
        counted = rounding(ways, math.sqrt(white / 12.0))
    level = max(float(counted.power.mean()), 1e-300)
    power = tuple((counted.power / level).tolist())
    return replace(sensor, counts=sensor.noise._replace(scale=unit * level, counted=power))


def rounding(ways: Sequence[Array], smear: float = 0.0) -> Density:
    """Density of the error of what is read in whole numbers, in units of 1/12, mean over any beginning.

    ways : stretches of a motion in counts, shape (n,) each. smear : standard deviation of the sensor's own noise.
    """
    random, errors = np.random.default_rng(_SEED), list[Array]()
    for begin in _BEGINNINGS:
        errors += [np.round(way + begin + smear * random.normal(size=len(way))) - way for way in ways]
    found = density(errors)
    return found._replace(power=12.0 * found.power)


def errors_of(log: Log, sensor: Sensor) -> list[Array]:
    """Errors of the acceleration that counts are in this motion, read from each beginning, of shape (n,); 0 without."""
    if sensor.counts is None or not (step := exact_step([log["position"]])) > 0.0:
        return [np.zeros(len(log))] * len(_BEGINNINGS)
    unit, way = step / log.sample_time**2, np.cumsum(log["velocity"]) * (log.sample_time / step)
    return [unit * np.pad(np.diff(np.round(way + b) - way, 2), 1, mode="edge") for b in _BEGINNINGS]


def _some_of(ways: Sequence[Array]) -> list[Array]:
    """Blocks of the stretches, all of a log that is not long, else some drawn, for a motion may repeat itself."""
    blocks = [way[i : i + _BLOCK] for way in ways for i in range(0, len(way), _BLOCK)]
    every = max(sum(map(len, ways)) // _SAMPLES, 1)
    drawn = np.random.default_rng(_SEED).choice(len(blocks), len(blocks) // every, replace=False)
    return [blocks[i] for i in sorted(drawn)] if every > 1 else blocks
