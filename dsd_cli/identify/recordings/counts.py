"""The noise that an encoder's counts are: white only where the axis crosses them at rates that sweep.

At a speed of n counts a sample the error of rounding is a saw-tooth of one tooth per count, sampled: its harmonic k, of
power (step / (pi k))^2 / 2, stands at |k n - round(k n)| / T Hz. At a whole number of counts a sample, or a simple
fraction, as round speeds and rates make it, these are slow beats, and forces within the band; at rest there is no noise
at all. So the motion itself, rounded again from other beginnings, says where that noise stands.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.recordings.sensor import Sensor
from dsd_cli.identify.recordings.spectrum import FEWEST_SEGMENTS, SEGMENT, Density, bend, density
from dsd_cli.signals.encoder import exact_step
from dsd_cli.signals.log import Array, Log

#: Beginnings from which the motion is rounded; rounds in which the sensor's own noise is found; seed.
_BEGINNINGS, _ROUNDS, _SEED = (0.0, 0.25, 0.5, 0.75), 2, 20261128
#: Samples of a block, enough for segments of full length, and samples that are rounded of a long log, about.
_BLOCK, _SAMPLES = (FEWEST_SEGMENTS + 1) * SEGMENT // 2, 50_000


def with_counts(sensor: Sensor, pieces: Sequence[Log]) -> Sensor:
    """The sensor with the noise that its counts are in this motion; pieces with "velocity".

    What a log shows above the motion beyond that is white noise of the position, which smears the counts.
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
