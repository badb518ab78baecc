"""A mass on a hardening spring with damping under a multisine, in open loop; nothing of the project is imported.

    J q'' = u - b q' - k q - k2 q^2 - k3 q^3

Classical Runge-Kutta steps, a quarter of a sample each; u is continuous and only sampled, or held between samples.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

T, PARTS = 1e-3, 4


class Resonator(NamedTuple):
    """Values in the units of u, rad and s; noise : of the position."""

    inertia: float = 5e-6
    damping: float = 2e-4
    stiffness: float = 0.3
    cubic: float = 4.0
    noise: float = 1e-5
    quadratic: float = 0.0


AXIS = Resonator()


def swung(seed: int, held: bool, axis: Resonator = AXIS, rows: int = 6000) -> dict[str, NDArray[np.float64]]:
    """t, u and position as they are logged; u is late by nothing."""
    rng = np.random.default_rng(seed)
    tones, phases = rng.uniform(1.0, 0.25 / T, 60), rng.uniform(0.0, 2.0 * math.pi, 60)
    h, halves = T / PARTS, np.arange(2 * PARTS * rows + 1)
    at = (halves // (2 * PARTS) * T) if held else halves * (0.5 * T / PARTS)
    drive = 0.004 * np.sin(2.0 * math.pi * np.outer(at, tones) + phases).sum(axis=1)
    u, q, v, place = drive.tolist(), 0.0, 0.0, []

    def a(q: float, v: float, u: float) -> float:
        return (u - axis.damping * v - axis.stiffness * q - axis.quadratic * q * q - axis.cubic * q**3) / axis.inertia

    for n in range(PARTS * rows):
        if n % PARTS == 0:
            place.append(q)
        begin, middle, end = (u[2 * n],) * 3 if held else u[2 * n : 2 * n + 3]
        a1 = a(q, v, begin)
        a2 = a(q + 0.5 * h * v, v + 0.5 * h * a1, middle)
        a3 = a(q + 0.5 * h * (v + 0.5 * h * a1), v + 0.5 * h * a2, middle)
        a4 = a(q + h * (v + 0.5 * h * a2), v + h * a3, end)
        q, v = q + h * v + h * h / 6.0 * (a1 + a2 + a3), v + h / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4)
    noise = axis.noise * rng.standard_normal(rows)
    return {"t": np.arange(rows) * T, "u": drive[: -1 : 2 * PARTS], "position": np.array(place) + noise}
