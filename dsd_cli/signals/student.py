"""Quantiles of Student's t; own code, for `scipy.special` takes a quarter of a second of CPU to import."""

from __future__ import annotations

import math
from functools import cache

import numpy as np

from dsd_cli.signals.log import Array

#: The limit for many degrees of freedom: 97.5 % of the normal distribution.
NORMAL = 1.959963984540054
_ORDER = 16
#: Newton steps that are enough for all digits.
_STEPS = 8


def student_quantile(freedom: Array) -> Array:
    """97.5 % of t with these degrees of freedom (3 to 1e3), shape (q,).

    With t = sqrt(v) tan(phi) the density is c cos(phi)^(v - 1), c = Gamma((v + 1)/2) / (Gamma(v/2) sqrt(pi)).
    """
    nodes, weights = _gauss()
    nodes = 0.5 * (nodes + 1.0)
    logs = [math.lgamma(0.5 * (v + 1.0)) - math.lgamma(0.5 * v) for v in freedom.tolist()]
    size, power, angle = np.exp(logs) / math.sqrt(math.pi), freedom - 1.0, np.arctan(2.0 / np.sqrt(freedom))
    for _ in range(_STEPS):
        below = 0.5 * angle * (np.cos(angle[:, None] * nodes) ** power[:, None] @ weights)  # from phi = 0
        angle = angle - (below - 0.475 / size) / np.cos(angle) ** power
    return np.asarray(np.sqrt(freedom) * np.tan(angle))


@cache
def _gauss() -> tuple[Array, Array]:
    """Nodes and weights of Gauss and Legendre on [-1, 1], shape (_ORDER,), by the eigenvalues of Golub and Welsch:
    `numpy.polynomial` takes a hundredth of a second to import."""
    k = np.arange(1, _ORDER)
    beside = k / np.sqrt(4.0 * k**2 - 1.0)
    nodes, vectors = np.linalg.eigh(np.diag(beside, 1) + np.diag(beside, -1))
    return np.asarray(nodes), np.asarray(2.0 * vectors[0] ** 2)
