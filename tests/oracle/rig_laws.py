"""Force laws of the outside rig, one scalar function each; SI, rotary.

APPLIED : values -> (t, q, v) -> force. BUDGETS : values -> (t, q, v, u) -> level of dry friction, >= 0.
"""

import math
from bisect import bisect_right
from collections.abc import Callable
from itertools import pairwise

from tests.oracle.rig_cases import RIPPLES, Values

Law = Callable[[float, float, float], float]
Budget = Callable[[float, float, float, float], float]


def _gravity(p: Values) -> Law:
    g, phase = p["amplitude"], p["phase"]
    return lambda t, q, v: -g * math.sin(q + phase)


def _cogging(p: Values) -> Law:
    a, n, phase = p["amplitude"], p["periods"], p["phase"]
    return lambda t, q, v: a * math.sin(n * q + phase)


def _ripple(p: Values) -> Law:
    lines = [(one["amplitude"], one["periods"], one["phase"]) for one in p["lines"]]
    return lambda t, q, v: sum(a * math.sin(n * q + phase) for a, n, phase in lines)


def _periodic(p: Values) -> Law:
    a, w, phase = p["amplitude"], 2.0 * math.pi * p["frequency"], p["phase"]
    return lambda t, q, v: a * math.sin(w * t + phase)


def _pushes(p: Values) -> Law:
    """Forces of rectangular pulses; the integrator never steps over an edge."""
    events = [(e["start"], e["end"], e["force"]) for e in p["events"]]
    return lambda t, q, v: sum(force for start, end, force in events if start <= t < end)


def _walk(p: Values) -> Law:
    """Linear between nodes that stand `spacing` s apart from t = 0 on; held outside."""
    nodes, spacing = list(p["nodes"]), p["spacing"]
    slopes = [(b - a) / spacing for a, b in pairwise(nodes)]

    def force(t: float, q: float, v: float) -> float:
        i = int(t / spacing)
        if t <= 0.0:
            return nodes[0]
        return nodes[i] + slopes[i] * (t - i * spacing) if i < len(slopes) else nodes[-1]

    return force


def _root(p: Values) -> Law:
    c = p["coefficient"]
    return lambda t, q, v: -math.copysign(c * math.sqrt(abs(v)), v)


def _end_stop(p: Values) -> Law:
    k, edge = p["stiffness"], p["position"]
    return lambda t, q, v: -k * (q - edge) if q > edge else 0.0


def _eddy(p: Values) -> Law:
    """Kloss: rises to `peak` at the critical speed and falls beyond it."""
    peak, critical = p["peak"], p["speed"]
    return lambda t, q, v: -2.0 * peak * (v / critical) / (1.0 + (v / critical) ** 2)


class Play:
    """Springs behind three plays (Prandtl-Ishlinskii): hysteresis over position that never fades with speed."""

    def __init__(self, p: Values) -> None:
        self.stiffness, self.widths = p["stiffness"], list(p["widths"])
        self.followers: list[float] | None = None

    def __call__(self, t: float, q: float, v: float) -> float:
        """What each follower lags behind the axis is the stretch of its spring, never more than its width."""
        if self.followers is None:
            return 0.0
        stretch = 0.0
        for follower, width in zip(self.followers, self.widths, strict=True):
            lag = q - follower
            stretch += width if lag > width else -width if lag < -width else lag
        return -self.stiffness * stretch

    def commit(self, q: float) -> None:
        """The axis has come to q: followers that it has out-run are dragged along."""
        last = self.followers or [q] * len(self.widths)
        self.followers = [min(max(y, q - r), q + r) for y, r in zip(last, self.widths, strict=True)]


APPLIED: dict[str, Callable[[Values], Law]] = {
    "viscous_friction": lambda p: lambda t, q, v, c=p["coefficient"]: -c * v,
    "viscous_asymmetry": lambda p: lambda t, q, v, c=p["coefficient"]: -c * abs(v),
    "quadratic_drag": lambda p: lambda t, q, v, c=p["coefficient"]: -c * abs(v) * v,
    "constant_load": lambda p: lambda t, q, v, f=p["force"]: f,
    "stiffness": lambda p: lambda t, q, v, k=p["coefficient"]: -k * q,
    "cubic_stiffness": lambda p: lambda t, q, v, k=p["coefficient"]: -k * q * q * q,
    "gravity": _gravity,
    "cogging": _cogging,
    **dict.fromkeys(RIPPLES, _ripple),
    "periodic_disturbance": _periodic,
    "external_force": _pushes,
    "random_walk_load": _walk,
    "root_drag": _root,
    "end_stop": _end_stop,
    "eddy_brake": _eddy,
    "play_hysteresis": Play,
}


def _stribeck(p: Values) -> Budget:
    excess, scale = p["excess"], p["velocity"]
    return lambda t, q, v, u: excess * math.exp(-((v / scale) ** 2))


def _growing(p: Values) -> Budget:
    first, last, duration = p["first"], p["last"], p["duration"]
    return lambda t, q, v, u: first + (last - first) * min(max(t / duration, 0.0), 1.0)


def _placed(p: Values) -> Budget:
    level, depth, n, phase = p["level"], p["depth"], p["periods"], p["phase"]
    return lambda t, q, v, u: level * (1.0 + depth * math.sin(n * q + phase))


BUDGETS: dict[str, Callable[[Values], Budget]] = {
    "coulomb_friction": lambda p: lambda t, q, v, u, level=p["level"]: level,
    "stribeck_friction": _stribeck,
    "load_friction": lambda p: lambda t, q, v, u, mu=p["coefficient"]: mu * abs(u),
    "friction_growing_with_time": _growing,
    "friction_over_position": _placed,
}


def edges(effects: dict[str, Values]) -> list[float]:
    """Instants at which a force jumps, in order."""
    events = effects.get("external_force", {}).get("events", ())
    return sorted({e[side] for e in events for side in ("start", "end")})


def next_edge(instants: list[float], t: float) -> float:
    """The first of them after t, or inf."""
    i = bisect_right(instants, t + 1e-9)
    return instants[i] if i < len(instants) else math.inf
