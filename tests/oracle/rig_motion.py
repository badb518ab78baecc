"""What the axes of the outside rig are told to do: references of position or speed, and injected commands."""

from dataclasses import dataclass

import numpy as np
from scipy import signal

from tests.oracle.rig_cases import Array

GRID = 1e-3  # s, of references before they are taken at the stamps
Rng = np.random.Generator

#: Kinds of motion and how often each is drawn, per loop.
_CHANCES = {
    "position": {"steps": 0.25, "s_curve": 0.2, "sweep": 0.1, "multisine": 0.15, "triangle": 0.1, "programme": 0.2},
    "velocity": {"levels": 0.25, "speed_steps": 0.2, "s_curve": 0.2, "multisine": 0.2, "sweep": 0.15},
    "injected": {"prbs": 0.35, "multisine": 0.35, "noise": 0.3},
}
#: Kinds that show an effect: quick ones for a second mass, peaks of the command for a limit, and so on.
_QUICK = {"steps", "s_curve", "programme", "levels", "speed_steps", "prbs", "noise"}
_PEAKS = {"steps", "s_curve", "levels", "speed_steps", "multisine", "noise"}
_ROUND = {"s_curve", "multisine", "sweep", "programme", "levels", "noise"}
_MANY_LEVELS = {"steps", "s_curve", "sweep", "multisine", "triangle", "programme", "levels", "speed_steps", "noise"}


def draw_kind(rng: Rng, loop: str, what: tuple[str, ...], strength: str) -> str:
    """A kind of motion that can show what is hidden."""
    chances = dict(_CHANCES.get(loop, _CHANCES["injected"]))
    for effect in what:
        fit = _SHOWN_BY.get(effect)
        if effect == "saturation" and strength != "plain":
            fit = _ROUND
        chances = {k: c for k, c in chances.items() if fit is None or k in fit}
    return str(rng.choice(list(chances), p=np.array(list(chances.values())) / sum(chances.values())))


_SHOWN_BY = {
    "flexible_coupling": _QUICK,
    "backlash": _QUICK,
    "saturation": _PEAKS,
    "dead_zone": _MANY_LEVELS,
    "load_friction": _MANY_LEVELS,
}


@dataclass(frozen=True)
class Reference:
    """Position, speed and acceleration wanted, each of shape (n,), at the stamps."""

    kind: str
    q: Array
    v: Array
    a: Array


def reference(kind: str, rng: Rng, stamps: Array, travel: float, bandwidth: float) -> Reference:
    """travel : rad to either side. bandwidth : rad/s of the loop that is to follow."""
    grid = np.arange(stamps[0], stamps[-1] + 2.0 * GRID, GRID)
    q = _position(kind, rng, grid, travel, bandwidth)
    if kind == "speed_steps":
        v = np.gradient(q, GRID)
        held = v[np.searchsorted(grid, stamps + 1e-9, side="right") - 1]
        return Reference(kind, np.interp(stamps, grid, q), held, np.zeros_like(held))
    if kind == "steps":
        held = q[np.searchsorted(grid, stamps + 1e-9, side="right") - 1]
        return Reference(kind, held, np.zeros_like(held), np.zeros_like(held))
    v = np.gradient(q, GRID)
    a = np.gradient(v, GRID)
    return Reference(kind, *(np.interp(stamps, grid, x) for x in (q, v, a)))


def _position(kind: str, rng: Rng, grid: Array, travel: float, bandwidth: float) -> Array:
    makers = {"s_curve": _s_curve, "sweep": _sweep, "steps": _steps, "multisine": _multisine, "triangle": _triangle}
    if kind in ("levels", "speed_steps"):
        return _levels(rng, grid, travel, bandwidth, smooth=kind == "levels")
    if kind != "programme":
        return makers[kind](rng, grid, travel, bandwidth)
    first, second = rng.permutation(["s_curve", "sweep", "multisine", "triangle"])[:2]
    a, b = (makers[k](rng, grid, travel, bandwidth) for k in (first, second))
    change = grid[0] + rng.uniform(0.4, 0.6) * (grid[-1] - grid[0])
    x = np.clip((grid - change) / 1.5, 0.0, 1.0)
    fade = x * x * x * (10.0 - 15.0 * x + 6.0 * x * x)
    return a + fade * (b - a)


def _targets(rng: Rng, travel: float, last: float) -> float:
    """The next end point, at least a fifth of the whole travel away."""
    while True:
        target = float(rng.uniform(-travel, travel))
        if abs(target - last) > 0.4 * travel:
            return target


def _s_curve(rng: Rng, grid: Array, travel: float, bandwidth: float) -> Array:
    """Jerk-limited moves of random length and pace, with rests."""
    q, t, at = np.zeros_like(grid), grid[0] + rng.uniform(0.1, 0.6), 0.0
    while t < grid[-1]:
        target = _targets(rng, travel, at)
        quickest = max(3.5 / bandwidth, abs(target - at) / (0.35 * travel * bandwidth))
        takes = quickest * rng.choice([1.0, 1.2, 1.8, 3.0])
        x = np.clip((grid - t) / takes, 0.0, 1.0)
        q += (target - at) * x * x * x * (10.0 - 15.0 * x + 6.0 * x * x)
        t, at = t + takes + rng.choice([0.0, 0.1, 0.25, 0.6]), target
    return q


def _sweep(rng: Rng, grid: Array, travel: float, bandwidth: float) -> Array:
    """A logarithmic sweep up and down again, its speed levelling off."""
    low, high = rng.uniform(0.08, 0.15), 0.8 * bandwidth / (2.0 * np.pi)
    x = 2.0 * (grid - grid[0]) / (grid[-1] - grid[0])
    frequency = low * (high / low) ** np.where(x < 1.0, x, 2.0 - x)
    angle = 2.0 * np.pi * np.cumsum(frequency) * GRID + rng.uniform(0.0, 2.0 * np.pi)
    corner = rng.uniform(0.25, 0.4)
    size = travel / (1.0 + (frequency / corner) ** 2) ** 0.55
    return size * np.sin(angle) * np.clip((grid - grid[0]) / 0.8, 0.0, 1.0) ** 2


def _steps(rng: Rng, grid: Array, travel: float, bandwidth: float) -> Array:
    q, t, at = np.zeros_like(grid), grid[0] + rng.uniform(0.1, 0.5), 0.0
    while t < grid[-1]:
        at = _targets(rng, travel, at)
        q[grid >= t] = at
        t += rng.uniform(6.0, 16.0) / bandwidth
    return q


def _multisine(rng: Rng, grid: Array, travel: float, bandwidth: float) -> Array:
    count = int(rng.integers(5, 10))
    frequencies = np.geomspace(0.07, 0.45 * bandwidth / (2.0 * np.pi), count) * rng.uniform(0.92, 1.08, count)
    sizes = frequencies ** -rng.uniform(0.5, 1.0)
    phases = rng.uniform(0.0, 2.0 * np.pi, count)
    q = sum(a * np.sin(2.0 * np.pi * f * grid + p) for a, f, p in zip(sizes, frequencies, phases, strict=True))
    return q * travel / np.max(np.abs(q)) * np.clip((grid - grid[0]) / 0.8, 0.0, 1.0) ** 2


def _triangle(rng: Rng, grid: Array, travel: float, bandwidth: float) -> Array:
    """Moves at constant, often slow, speeds with rests between; corners rounded as a drive does."""
    q, t, at = np.zeros_like(grid), grid[0] + rng.uniform(0.1, 0.5), 0.0
    top = 0.3 * travel * bandwidth
    while t < grid[-1]:
        target = _targets(rng, travel, at)
        takes = abs(target - at) / (top * rng.choice([0.2, 0.35, 0.6, 1.0]))
        q += (target - at) * np.clip((grid - t) / takes, 0.0, 1.0)
        t, at = t + takes + rng.choice([0.0, 0.15, 0.4]), target
    width = max(int(0.8 / bandwidth / GRID), 5)
    window = np.convolve(np.ones(width) / width, np.ones(width) / width)
    return np.convolve(np.pad(q, len(window) // 2, mode="edge"), window, mode="valid")[: len(grid)]


def _levels(rng: Rng, grid: Array, travel: float, bandwidth: float, smooth: bool) -> Array:
    """Levels of speed, with ramps if smooth, turned back when the axis has gone far enough."""
    top = 0.35 * travel * bandwidth
    v, t, q = np.zeros_like(grid), grid[0] + rng.uniform(0.1, 0.4), 0.0
    while t < grid[-1]:
        size = top * rng.choice([0.0, 0.1, 0.3, 0.6, 1.0])
        way = -np.sign(q) if abs(q) > 1.5 * travel else rng.choice([-1.0, 1.0])
        lasts = rng.uniform(0.25, 0.9)
        v[(grid >= t) & (grid < t + lasts)] = way * size
        q, t = q + way * size * lasts, t + lasts
    width = max(int(rng.uniform(1.0, 3.0) / bandwidth / GRID), 5)
    for _ in range(2 if smooth else 0):
        v = np.convolve(v, np.ones(width) / width, mode="same")
    return np.cumsum(v) * GRID


def injection(kind: str, rng: Rng, stamps: Array) -> Array:
    """A command of rms 1 at the stamps, without mean."""
    grid = np.arange(stamps[0], stamps[-1] + 2.0 * GRID, GRID)
    if kind == "prbs":
        clock = rng.uniform(0.04, 0.16)
        bits = rng.choice([-1.0, 1.0], int((grid[-1] - grid[0]) / clock) + 2)
        u = bits[((grid - grid[0]) / clock).astype(int)]
    elif kind == "multisine":
        count = int(rng.integers(8, 25))
        frequencies = np.geomspace(0.15, rng.uniform(4.0, 9.0), count) * rng.uniform(0.95, 1.05, count)
        phases = rng.uniform(0.0, 2.0 * np.pi, count)
        u = sum(np.sin(2.0 * np.pi * f * grid + p) for f, p in zip(frequencies, phases, strict=True))
    else:
        band = signal.butter(2, [0.15, rng.uniform(3.0, 8.0)], "bandpass", fs=1.0 / GRID, output="sos")
        u = signal.sosfilt(band, rng.standard_normal(len(grid)))
    u = u - np.mean(u)
    held = u[np.searchsorted(grid, stamps + 1e-9, side="right") - 1]
    return held / np.sqrt(np.mean(held**2))
