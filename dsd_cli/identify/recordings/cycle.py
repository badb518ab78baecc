"""Whether a motion repeats itself, as a machine's does that makes one part after the other."""

from __future__ import annotations

import math

import numpy as np

from dsd_cli.identify.policy import POLICY
from dsd_cli.signals.log import Array

#: Samples of the speed that are compared; longer logs are averaged down to so many.
_SAMPLES = 20_000


def cycle_of(speed: Array, sample_time: float) -> float:
    """s after which a speed is about the same again, throughout; by its correlation with itself at each lag.

    Infinite where the motion does not repeat itself. What is a cycle later is the same again: so such a motion
    identifies no delay beyond it, and no line in time at one of its harmonics from a force that depends on the motion.
    """
    speed = _sized(speed)
    step = -(-len(speed) // _SAMPLES)
    speed = speed[: len(speed) // step * step].reshape(-1, step).mean(axis=1)
    most = int(len(speed) / POLICY.least_cycles)
    if most < 2 or not np.any(speed):
        return math.inf
    spectrum = np.fft.rfft(speed, 2 * len(speed))
    sums = np.fft.irfft(spectrum * np.conj(spectrum))[: most + 1]
    power = np.concatenate([[0.0], np.cumsum(speed**2)])
    ends = np.sqrt(power[-1 : -most - 2 : -1] * (power[-1] - power[: most + 1]))  # rms of both parts that are compared
    alike = sums / np.maximum(ends, 1e-300)
    gone = np.flatnonzero(alike < POLICY.cycle_left)
    if not gone.size:
        return math.inf
    later = alike[gone[0] :]
    again = later >= max(POLICY.cycle_alike, float(later.max()) - (1.0 - POLICY.cycle_alike))
    if not again.any():
        return math.inf
    first = int(np.argmax(again))
    last = first + int(np.argmin(np.append(again[first:], False)))
    return float(gone[0] + first + int(np.argmax(later[first:last]))) * step * sample_time


def repeats_after(x: Array, sample_time: float) -> float:
    """s after which a signal is about the same again, or about the same with the other sign; infinite: it is never."""
    cycle = cycle_of(x, sample_time)
    half = round(0.5 * cycle / sample_time) if math.isfinite(cycle) else 0
    if not half:
        return cycle
    later, before = _sized(x)[half:], _sized(x)[:-half]
    turned = float(np.dot(later, before)) <= -POLICY.cycle_alike * float(np.linalg.norm(later) * np.linalg.norm(before))
    return 0.5 * cycle if turned else cycle


def _sized(x: Array) -> Array:
    """With 1 for its largest, whose squares are numbers."""
    return x / max(float(np.abs(x).max(initial=0.0)), 1e-300)
