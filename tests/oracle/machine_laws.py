"""The forces of the oracle's machines, one line per law, over lanes (one lane = one machine); NumPy only."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Values = dict[str, Any]


@dataclass
class Moment:
    """What a law may look at within one fine step."""

    q: Array  # rad
    v: Array  # rad/s
    u: Array  # N m, the command that acts now
    t: float  # s since the first row of the log
    sample: int  # row counted from the beginning of the run


#: Laws that add a force whatever the motion is (N m; positive accelerates).
FORCES: dict[str, Callable[[Values, Moment], Array]] = {
    "viscous_friction": lambda p, m: -p["coefficient"] * m.v,
    "viscous_asymmetry": lambda p, m: -p["coefficient"] * np.abs(m.v),
    "quadratic_drag": lambda p, m: -p["coefficient"] * np.abs(m.v) * m.v,
    "constant_load": lambda p, m: p["force"],
    "gravity": lambda p, m: -p["amplitude"] * np.sin(m.q + p["phase"]),
    "stiffness": lambda p, m: -p["coefficient"] * m.q,
    "cubic_stiffness": lambda p, m: -p["coefficient"] * m.q * m.q * m.q,
    "cogging": lambda p, m: p["amplitude"] * np.sin(p["periods"] * m.q + p["phase"]),
    "external_force": lambda p, m: np.sum(((m.t >= p["start"]) & (m.t < p["end"])) * p["force"], axis=0),
    "periodic_disturbance": lambda p, m: p["amplitude"] * np.sin(2 * np.pi * p["frequency"] * m.t + p["phase"]),
    # Strangers: true machines have them, no library does.
    "growing_viscosity": lambda p, m: -(p["start"] + p["rate"] * max(m.t, 0.0)) * m.v,
    "random_load": lambda p, m: p["path"][m.sample],
    "speed_position_force": lambda p, m: -p["coefficient"] * m.v * m.q,
}

#: Laws that only set how much the one rubbing contact can resist (N m, never negative); the plant owns the direction.
LEVELS: dict[str, Callable[[Values, Moment], Array]] = {
    "coulomb_friction": lambda p, m: p["level"],
    "stribeck_friction": lambda p, m: p["excess"] * np.exp(-((m.v / p["velocity"]) ** 2)),
    "load_friction": lambda p, m: p["coefficient"] * np.abs(m.u),
    "growing_friction": lambda p, m: p["start"] + p["rate"] * max(m.t, 0.0),
    "position_friction": lambda p, m: p["level"] * (1.0 + p["depth"] * np.sin(p["periods"] * m.q + p["phase"])),
}

INPUTS = ("dead_zone", "saturation", "actuator_lag")
STRUCTURES = ("backlash", "flexible_coupling")
PLANT_VALUES = ("inertia", "delay")
STRANGERS = ("growing_friction", "growing_viscosity", "position_friction", "random_load", "speed_position_force")
EFFECTS = (
    *(name for name in (*FORCES, *LEVELS) if name not in STRANGERS),
    "presliding_friction",
    *INPUTS,
    *STRUCTURES,
    *PLANT_VALUES,
)
NEUTRAL = {"velocity": 1.0, "limit": np.inf}  # what a lane without the effect gets; elsewhere 0 switches it off


def gather(name: str, lanes: Sequence[dict[str, Values]]) -> Values:
    """The effect's parameters as arrays over lanes, neutral where a lane does not have it."""
    if name == "external_force":
        return _events([lane.get(name, {}).get("events", []) for lane in lanes])
    keys = dict.fromkeys(key for lane in lanes for key in lane.get(name, {}))
    return {key: np.array([lane.get(name, {}).get(key, NEUTRAL.get(key, 0.0)) for lane in lanes]) for key in keys}


def _events(lanes: Sequence[list[dict[str, float]]]) -> Values:
    most = max(len(events) for events in lanes)
    table = np.zeros((3, most, len(lanes)))
    for i, events in enumerate(lanes):
        for j, event in enumerate(events):
            table[:, j, i] = event["start"], event["end"], event["force"]
    return {"start": table[0], "end": table[1], "force": table[2]}


def random_walk(rms: float, times: Array, seed: int) -> Array:
    """A load that walks at random from t = 0 on, scaled so that its rms over the log is `rms`."""
    steps = np.random.default_rng([seed, 13]).normal(size=len(times)) * (times > 0.0)
    walk = np.cumsum(steps)
    return walk * rms / np.sqrt(np.mean(walk[times >= 0.0] ** 2))
