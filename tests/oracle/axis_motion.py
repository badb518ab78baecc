"""What axes are told to do outside of laboratories: moves with rests, crawls, cycles, one direction; rad at stamps."""

import numpy as np

from tests.oracle.rig_cases import Array

Rng = np.random.Generator


def eased(t: Array) -> Array:
    """From rest at the first stamp, within 0.8 s."""
    x = np.clip((t - t[0]) / 0.8, 0.0, 1.0)
    return x * x * x * (10.0 - 15.0 * x + 6.0 * x * x)


def smooth(rng: Rng, t: Array, travel: float, top_hz: float) -> Array:
    """A handful of slow sines that never repeat, `travel` rad to either side."""
    hz = np.geomspace(0.04, top_hz, 6) * rng.uniform(0.85, 1.15, 6)
    sizes, phases = hz ** -rng.uniform(0.6, 1.2), rng.uniform(0.0, 2.0 * np.pi, 6)
    q = sum(a * np.sin(2.0 * np.pi * f * t + p) for a, f, p in zip(sizes, hz, phases, strict=True))
    return travel * eased(t) * q / np.max(np.abs(q))


def cycle(rng: Rng, t: Array, travel: float, hz: float) -> Array:
    """One sine, or a short Fourier series, again and again: as robots are told for their identification."""
    count = int(rng.choice([1, 2, 4]))
    sizes = [1.0, *(rng.uniform(0.1, 0.4, count - 1) / np.arange(2, count + 1))]
    phases = rng.uniform(0.0, 2.0 * np.pi, count)
    q = sum(a * np.sin(2.0 * np.pi * hz * (i + 1) * t + p) for i, (a, p) in enumerate(zip(sizes, phases, strict=True)))
    return travel * eased(t) * q / np.max(np.abs(q))


def moves(rng: Rng, t: Array, travel: float, top: float) -> Array:
    """Point to point with a bounded jerk at up to `top` rad/s, and rests between."""
    q, at, now = np.zeros_like(t), 0.0, t[0] + 0.2
    while now < t[-1]:
        to = float(rng.uniform(-travel, travel))
        if abs(to - at) < 0.3 * travel:
            continue
        takes = 1.875 * abs(to - at) / (top * rng.uniform(0.35, 1.0))
        x = np.clip((t - now) / takes, 0.0, 1.0)
        q += (to - at) * x * x * x * (10.0 - 15.0 * x + 6.0 * x * x)
        now, at = now + takes + rng.choice([0.1, 0.3, 0.6]), to
    return q


def crawl(rng: Rng, t: Array, speed: float) -> Array:
    """At one slow speed to one side, and back, with ramps of 0.2 s."""
    half = 0.5 * (t[0] + t[-1]) + rng.uniform(-0.1, 0.1) * (t[-1] - t[0])
    v = np.where(t < half, speed, -speed * rng.uniform(0.8, 1.2))
    step = float(np.mean(np.diff(t)))
    window = np.hanning(max(int(0.2 / step), 3) + 2)
    v = np.convolve(np.where(t < t[0] + 0.2, 0.0, v), window / window.sum(), mode="same")
    return np.cumsum(v) * step


def one_way(rng: Rng, t: Array, speed: float) -> Array:
    """Always forward, between a fifth and twice that speed, in slow waves and ramps between levels."""
    step = float(np.mean(np.diff(t)))
    v, now = np.full_like(t, speed), t[0]
    while now < t[-1]:
        lasts = rng.uniform(0.4, 1.5)
        v[(t >= now) & (t < now + lasts)] = speed * rng.uniform(0.25, 1.9)
        now += lasts
    window = np.hanning(int(rng.uniform(0.15, 0.4) / step) + 2)
    for _ in range(2):
        v = np.convolve(np.pad(v, len(window), mode="edge"), window / window.sum(), mode="same")[
            len(window) : -len(window)
        ]
    return np.cumsum(v * eased(t)) * step
