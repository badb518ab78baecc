"""Machines of the outside rig whose model lacks nothing: effects of the catalogue that the model has, some of them not
quite as large as they are."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

from tests.oracle.rig_strange import StrangeLog
from tests.oracle.rig_strange_laws import Law

#: Of its true size, that the model believes a force to have.
_BELIEVED = 0.8


def _none(s: Any, t: float, q: float, v: float, u: float) -> float:
    return 0.0


#: Name -> the law, and what a model has of it.
_KNOWN: dict[str, tuple[Law, Callable[[Any], dict[str, dict[str, float]]]]] = {
    "nothing": (Law("", lambda s: {}, _none), lambda s: {}),
    "gravity": (
        Law("", lambda s: {"phi": s.between(-1.5, 1.5)}, lambda s, t, q, v, u: -s.size * math.sin(q + s.phi)),
        lambda s: {"gravity": {"amplitude": _BELIEVED * s["size"], "phase": s["phi"]}},
    ),
    "cogging": (
        Law("", lambda s: {"phi": s.between(-1.5, 1.5)}, lambda s, t, q, v, u: 0.5 * s.size * math.sin(9 * q + s.phi)),
        lambda s: {"cogging": {"amplitude": 0.5 * _BELIEVED * s["size"], "periods": 9.0, "phase": s["phi"]}},
    ),
    "spring": (
        Law("", lambda s: {}, lambda s, t, q, v, u: -s.size * q),
        lambda s: {"stiffness": {"coefficient": _BELIEVED * s["size"]}},
    ),
    "offset": (
        Law("", lambda s: {}, lambda s, t, q, v, u: 0.5 * s.size),
        lambda s: {"constant_load": {"force": 0.5 * _BELIEVED * s["size"]}},
    ),
    "drag": (
        Law("", lambda s: {}, lambda s, t, q, v, u: -0.1 * s.size * abs(v) * v),
        lambda s: {"quadratic_drag": {"coefficient": 0.1 * _BELIEVED * s["size"]}},
    ),
    "stribeck": (
        Law("", lambda s: {"vs": s.between(0.2, 0.8)}, _none,
            friction=lambda s, t, q, v, u: s.size * math.exp(-((v / s.vs) ** 2))),
        lambda s: {"stribeck_friction": {"excess": _BELIEVED * s["size"], "velocity": s["vs"]}},
    ),
}  # fmt: skip
#: Laws of machines that the model explains.
COMPLETE: Mapping[str, Law] = {name: law for name, (law, _) in _KNOWN.items()}


def known_of(log: StrangeLog) -> dict[str, dict[str, float]]:
    """Effects of the law of a log that the model has; none where it is one of no catalogue."""
    return _KNOWN[log.law][1](log.drawn) if log.law in _KNOWN else {}
