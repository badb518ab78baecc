"""The laws of `rig_strange`: each says what it draws, its force, and which channels it depends on."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class State:
    """What one machine has drawn, and what its law remembers. size : about the force of the law, unit of u."""

    def __init__(self, rng: np.random.Generator, size: float, inertia: float) -> None:
        self.rng, self.size, self.mass = rng, size, inertia

    def __getattr__(self, name: str) -> Any:
        raise AttributeError(name)

    def between(self, low: float, high: float) -> float:
        return float(self.rng.uniform(low, high))


Force = Callable[[Any, float, float, float, float], float]


@dataclass(frozen=True)
class Law:
    """draw : state -> values. on : channels it depends on, "direction" for sgn v. form : id of the closed form, if the
    dictionary of the tool has it. friction : its level. inertia, slope : what it adds to J over q, and the slope of it.
    after : what it remembers of a step, (state, q, v, h)."""

    form: str
    draw: Callable[[State], dict[str, Any]]
    force: Force
    on: tuple[str, ...] = ()
    friction: Force | None = None
    inertia: Callable[[Any, float], float] | None = None
    slope: Callable[[Any, float], float] | None = None
    after: Callable[[Any, float, float, float], None] | None = None


def _none(s: Any, t: float, q: float, v: float, u: float) -> float:
    return 0.0


def _sign(v: float) -> float:
    return 1.0 if v > 0.0 else -1.0 if v < 0.0 else 0.0


def _of_friction(form: str, draw: Callable[[State], dict[str, Any]], level: Force, *on: str) -> Law:
    return Law(form, draw, _none, ("direction", *on), friction=level)


def _bouc_wen(s: Any, q: float, v: float, h: float) -> None:
    s.z += h * (v - 0.5 * abs(v) * s.z * abs(s.z) / s.zy**2 - 0.5 * v * s.z * s.z / s.zy**2)


def _lugre(s: Any, q: float, v: float, h: float) -> None:
    level = s.size * (1.0 + 0.6 * math.exp(-((v / s.vs) ** 2)))
    grow = s.sigma * abs(v) / level
    keep = math.exp(-grow * h)
    s.z = s.z * keep + (_sign(v) * level / s.sigma) * (1.0 - keep)


def _stops(s: Any, q: float, v: float, h: float) -> None:
    moved, s.last = q - s.last, q
    s.z = [min(max(z + moved, -r), r) for z, r in zip(s.z, s.radii, strict=True)]


def _lagged(s: Any, q: float, v: float, h: float) -> None:
    s.z += h / s.tau * (_sign(v) - s.z)


LAWS: dict[str, Law] = {
    "friction_spot": _of_friction(
        "1/lorentz q",
        lambda s: {"q0": s.between(-0.5, 0.5), "w": s.between(0.12, 0.3)},
        lambda s, t, q, v, u: 2.0 * s.size / (1.0 + ((q - s.q0) / s.w) ** 2),
        "position",
    ),
    "friction_wave": _of_friction(
        "1/sine q",
        lambda s: {"n": s.between(2.0, 9.0), "phi": s.between(0.0, 6.0)},
        lambda s, t, q, v, u: s.size * (1.0 + 0.8 * math.sin(s.n * q + s.phi)),
        "position",
    ),
    "friction_grows": _of_friction(
        "1/linear t", lambda s: {}, lambda s, t, q, v, u: 0.1 * s.size * max(t, 0.0), "time"
    ),
    "friction_runs_in": _of_friction(
        "1/decay t",
        lambda s: {"tau": s.between(4.0, 10.0)},
        lambda s, t, q, v, u: 1.6 * s.size * math.exp(-max(t, 0.0) / s.tau),
        "time",
    ),
    "friction_of_preload": _of_friction(
        "1/linear q",
        lambda s: {"k": s.between(0.4, 0.7)},
        lambda s, t, q, v, u: s.size * max(1.0 + s.k * q, 0.0),
        "position",
    ),
    "root_drag": Law(
        "root/", lambda s: {}, lambda s, t, q, v, u: -s.size * _sign(v) * math.sqrt(abs(v)), ("velocity",)
    ),
    "eddy_brake": Law(
        "v/lorentz v",
        lambda s: {"vc": s.between(1.2, 2.5)},
        lambda s, t, q, v, u: -2.5 * s.size * (v / s.vc) / (1.0 + (v / s.vc) ** 2),
        ("velocity",),
    ),
    "exponential_drag": Law(
        "v/decay v",
        lambda s: {"vc": s.between(1.0, 2.5)},
        lambda s, t, q, v, u: -3.5 * s.size * (v / s.vc) * math.exp(-abs(v) / s.vc),
        ("velocity",),
    ),
    "grease": Law(
        "0/tanh v",
        lambda s: {"vc": s.between(0.5, 1.5)},
        lambda s, t, q, v, u: -1.3 * s.size * math.tanh(v / s.vc),
        ("velocity",),
    ),
    "swinging_inertia": Law(
        "a/sine q",
        lambda s: {"n": 2.0, "phi": s.between(0.0, 6.0), "share": s.between(0.25, 0.4)},
        _none,
        ("acceleration", "position"),
        inertia=lambda s, q: s.share * s.mass * math.cos(s.n * q + s.phi),
        slope=lambda s, q: -s.n * s.share * s.mass * math.sin(s.n * q + s.phi),
    ),
    "end_stop": Law(
        "0/hinge q",
        lambda s: {"q0": s.between(0.55, 0.75)},
        lambda s, t, q, v, u: -12.0 * s.size * max(q - s.q0, 0.0),
        ("position",),
    ),
    "cable": Law(
        "0/tanh q",
        lambda s: {"q0": s.between(-0.3, 0.3), "w": s.between(0.1, 0.25)},
        lambda s, t, q, v, u: -1.3 * s.size * math.tanh((q - s.q0) / s.w),
        ("position",),
    ),
    "magnet": Law(
        "0/inverse square q",
        lambda s: {"q0": s.between(1.5, 1.9)},
        lambda s, t, q, v, u: 1.6 * s.size / (q + s.q0) ** 2,
        ("position",),
    ),
    "damper_over_position": Law(
        "v/gauss q",
        lambda s: {"q0": s.between(-0.4, 0.4), "w": s.between(0.2, 0.4)},
        lambda s, t, q, v, u: -1.2 * s.size * v * math.exp(-(((q - s.q0) / s.w) ** 2)),
        ("velocity", "position"),
    ),
    "cross_term": Law(
        "v/linear q",
        lambda s: {},
        lambda s, t, q, v, u: -0.8 * s.size * v * q,
        ("velocity", "position"),
    ),
    "oil_warms_up": Law(
        "v/decay t",
        lambda s: {"tau": s.between(4.0, 10.0)},
        lambda s, t, q, v, u: -1.0 * s.size * v * math.exp(-max(t, 0.0) / s.tau),
        ("velocity", "time"),
    ),
    "torque_ripple": Law(
        "u/sine q",
        lambda s: {"n": s.between(3.0, 10.0), "phi": s.between(0.0, 6.0), "share": s.between(0.25, 0.4)},
        lambda s, t, q, v, u: s.share * u * math.sin(s.n * q + s.phi),
        ("u", "position"),
    ),
    "magnets_warm_up": Law(
        "u/linear t",
        lambda s: {"share": s.between(0.25, 0.4)},
        lambda s, t, q, v, u: -s.share * u * max(t, 0.0) / 20.0,
        ("u", "time"),
    ),
    "gain_by_sign": Law(
        "|u|/",
        lambda s: {"share": s.between(0.15, 0.3)},
        lambda s, t, q, v, u: s.share * abs(u),
        ("u",),
    ),
    "bouc_wen": Law(
        "",
        lambda s: {"z": 0.0, "zy": s.between(0.08, 0.25)},
        lambda s, t, q, v, u: -1.2 * s.size * s.z / s.zy,
        ("memory",),
        after=_bouc_wen,
    ),
    "lugre": Law(
        "",
        lambda s: {"z": 0.0, "vs": s.between(0.3, 0.8), "sigma": s.size / s.between(0.05, 0.15)},
        lambda s, t, q, v, u: -s.sigma * s.z,
        ("memory",),
        after=_lugre,
    ),
    "stops": Law(
        "",
        lambda s: {"z": [0.0, 0.0, 0.0], "last": 0.0, "radii": [0.05, 0.15, s.between(0.3, 0.5)]},
        lambda s, t, q, v, u: -1.8 * s.size * sum(s.z) / sum(s.radii),
        ("memory",),
        after=_stops,
    ),
    "friction_builds_up": Law(
        "",
        lambda s: {"z": 0.0, "tau": s.between(0.05, 0.15)},
        lambda s, t, q, v, u: -1.3 * s.size * s.z,
        ("memory",),
        after=_lagged,
    ),
}
