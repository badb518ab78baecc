"""What stands between command and axis, and what hangs on the axis: actuators, second masses, inner states; SI.

COMMANDS : values -> what the actuator makes of the command. LOADS : values, J -> a second mass.
MEMORIES : values -> friction with an inner state.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

from tests.oracle.rig_cases import Values

#: Damping ratio of a contact with play: the catalogue's.
CONTACT_DAMPING = 0.3


class Direct:
    """The actuator gives what it is told. `value(start, u, s)` is its output s seconds after the command u came."""

    moving = False  # whether the output changes while the command is held

    def begin(self, u: float, interval: float) -> float:
        """The command as the actuator takes it; `interval` is how long the last one was held, s."""
        return u

    def value(self, start: float, u: float, s: float) -> float:
        return u


class DeadZone(Direct):
    def __init__(self, p: Values) -> None:
        self.width = p["width"]

    def begin(self, u: float, interval: float) -> float:
        return u - min(max(u, -self.width), self.width)


class Saturation(Direct):
    def __init__(self, p: Values) -> None:
        self.limit = p["limit"]

    def begin(self, u: float, interval: float) -> float:
        return min(max(u, -self.limit), self.limit)


class GainAsymmetry(Direct):
    def __init__(self, p: Values) -> None:
        self.share = p["share"]

    def begin(self, u: float, interval: float) -> float:
        return u + self.share * abs(u)


class GainDrift(Direct):
    """A winding that warms with u^2 and gives less force the warmer it is."""

    def __init__(self, p: Values) -> None:
        self.loss, self.square, self.slow = p["loss"], p["mean_square"], p["time_constant"]
        self.heat, self.last = 0.0, 0.0

    def begin(self, u: float, interval: float) -> float:
        self.heat += (interval / self.slow) * (self.last * self.last / self.square - self.heat)
        self.last = u
        return u * (1.0 - self.loss * min(self.heat, 1.5))


class Lag(Direct):
    moving = True

    def __init__(self, p: Values) -> None:
        self.time_constant = p["time_constant"]

    def value(self, start: float, u: float, s: float) -> float:
        return u + (start - u) * math.exp(-s / self.time_constant)


class SlewLimit(Direct):
    moving = True

    def __init__(self, p: Values) -> None:
        self.rate = p["rate"]

    def value(self, start: float, u: float, s: float) -> float:
        most = self.rate * s
        return start + min(max(u - start, -most), most)


COMMANDS: dict[str, Callable[[Values], Direct]] = {
    "dead_zone": DeadZone,
    "saturation": Saturation,
    "actuator_lag": Lag,
    "gain_asymmetry": GainAsymmetry,
    "gain_drift": GainDrift,
    "slew_limit": SlewLimit,
}


@dataclass(frozen=True)
class Load:
    """A second mass: its share of J, and its acceleration from (motor less load, its rate)."""

    share: float
    pull: Callable[[float, float], float]


def _coupled(p: Values, inertia: float) -> Load:
    rate = 2.0 * math.pi * p["frequency"] * math.sqrt(1.0 - p["load_share"])
    square, drag = rate * rate, 2.0 * p["damping"] * rate
    return Load(p["load_share"], lambda apart, closing: square * apart + drag * closing)


def _loose(p: Values, inertia: float) -> Load:
    square = p["stiffness"] / (p["load_share"] * inertia)
    drag, half = 2.0 * CONTACT_DAMPING * math.sqrt(square), 0.5 * p["gap"]

    def pull(apart: float, closing: float) -> float:
        depth = abs(apart) - half
        if depth < 0.0:
            return 0.0
        toward = closing if apart > 0.0 else -closing
        return math.copysign(max(square * depth + drag * toward, 0.0), apart)

    return Load(p["load_share"], pull)


LOADS: dict[str, Callable[[Values, float], Load]] = {"flexible_coupling": _coupled, "backlash": _loose}


def dahl(p: Values) -> tuple[Callable[[float, float], float], float]:
    """(z' as a function of z and v, sigma); the force is -sigma z."""
    sigma, level = p["stiffness"], p["level"]
    return (lambda z, v: v - abs(v) * sigma * z / level), sigma


MEMORIES = {"presliding_friction": dahl}
