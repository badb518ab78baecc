"""Values of the effects that the outside rig hides, as families of one size that is fitted to the drive."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from tests.oracle.rig_cases import RIPPLES, Values
from tests.oracle.rig_run import Motion

Rng = np.random.Generator
Family = Callable[[float], Values]


@dataclass(frozen=True)
class Sized:
    """values(size) are the effect's parameters; the rms of its force grows about like size."""

    effect: str
    size: float
    values: Family
    most: float = np.inf
    least: float = 0.0

    def scaled(self, factor: float) -> "Sized":
        return replace(self, size=float(np.clip(self.size * factor, self.least, self.most)))


@dataclass(frozen=True)
class Seen:
    """What an axis did while nothing was hidden, over the log."""

    low: float  # rad
    high: float
    speed: float  # rad/s, rms
    top: float  # rad/s, 99 % quantile
    drive: float  # N m, rms of u
    levels: np.ndarray  # N m, |u| in order
    duration: float  # s
    inertia: float  # kg m2

    @classmethod
    def of(cls, motion: Motion, inertia: float) -> "Seen":
        log = motion.t >= 0.0
        q, v, u = motion.q[log], motion.v[log], motion.u[log]
        return cls(
            *map(float, np.quantile(q, [0.005, 0.995])),
            float(np.sqrt(np.mean(v**2))),
            float(np.quantile(np.abs(v), 0.99)),
            float(np.sqrt(np.mean(u**2))),
            np.sort(np.abs(u)),
            float(motion.t[-1]),
            inertia,
        )

    @property
    def travel(self) -> float:
        return self.high - self.low


def draw(effect: str, rng: Rng, seen: Seen) -> Sized:
    """A family of random shape; its size is a first guess."""
    if effect in _SCALED:
        name, fixed = _SCALED[effect]
        sign = float(rng.choice([-1.0, 1.0])) if effect in _EITHER_SIGN else 1.0
        others = fixed(rng, seen)
        return Sized(effect, 1.0, lambda s: {**others, name: sign * s}, most=_MOST.get(effect, np.inf))
    return _OTHERS[effect](rng, seen)


def _nothing(rng: Rng, seen: Seen) -> Values:
    return {}


def _phase(rng: Rng, seen: Seen) -> Values:
    return {"phase": float(rng.uniform(-np.pi, np.pi))}


def _cogging(rng: Rng, seen: Seen) -> Values:
    least = max(8.8 * 2.0 * np.pi / seen.travel, 6.0)
    most = max(min(60.0, 2.0 * np.pi * 25.0 / seen.speed), 1.05 * least)
    periods = float(np.exp(rng.uniform(np.log(least), np.log(most))))
    return {"periods": float(np.ceil(periods)) if rng.random() < 0.5 else periods, **_phase(rng, seen)}


def _line(rng: Rng, seen: Seen) -> Values:
    return {"frequency": float(np.exp(rng.uniform(np.log(0.7), np.log(14.0)))), **_phase(rng, seen)}


def _slow(rng: Rng, seen: Seen) -> Values:
    return {"velocity": float(rng.uniform(0.08, 0.2) * seen.top)}


def _placed(rng: Rng, seen: Seen) -> Values:
    periods = 2.0 * np.pi * rng.uniform(0.8, 2.5) / seen.travel
    return {"depth": float(rng.uniform(0.6, 0.95)), "periods": float(periods), **_phase(rng, seen)}


def _critical(rng: Rng, seen: Seen) -> Values:
    return {"speed": float(rng.uniform(0.2, 0.4) * seen.top)}


def _stop(rng: Rng, seen: Seen) -> Values:
    return {"position": float(seen.high - rng.uniform(0.08, 0.22) * seen.travel)}


def _plays(rng: Rng, seen: Seen) -> Values:
    return {"widths": [float(seen.travel * share * rng.uniform(0.8, 1.25)) for share in (0.03, 0.1, 0.25)]}


def _heat(rng: Rng, seen: Seen) -> Values:
    return {"mean_square": seen.drive**2, "time_constant": float(seen.duration * rng.uniform(0.15, 0.4))}


#: Effects whose force is proportional to one parameter: its name, and what draws the others.
_SCALED: dict[str, tuple[str, Callable[[Rng, Seen], Values]]] = {
    "viscous_friction": ("coefficient", _nothing),
    "coulomb_friction": ("level", _nothing),
    "stribeck_friction": ("excess", _slow),
    "viscous_asymmetry": ("coefficient", _nothing),
    "quadratic_drag": ("coefficient", _nothing),
    "load_friction": ("coefficient", _nothing),
    "constant_load": ("force", _nothing),
    "gravity": ("amplitude", _phase),
    "stiffness": ("coefficient", _nothing),
    "cubic_stiffness": ("coefficient", _nothing),
    "cogging": ("amplitude", _cogging),
    "periodic_disturbance": ("amplitude", _line),
    "dead_zone": ("width", _nothing),
    "root_drag": ("coefficient", _nothing),
    "friction_over_position": ("level", _placed),
    "eddy_brake": ("peak", _critical),
    "end_stop": ("stiffness", _stop),
    "play_hysteresis": ("stiffness", _plays),
    "gain_drift": ("loss", _heat),
    "gain_asymmetry": ("share", _nothing),
    "swinging_inertia": ("share", _phase),
}
_EITHER_SIGN = {"viscous_asymmetry", "constant_load", "gain_asymmetry"}
_MOST = {"load_friction": 0.6, "gain_drift": 0.6, "gain_asymmetry": 0.6, "swinging_inertia": 0.7}


def _dahl(rng: Rng, seen: Seen) -> Sized:
    distance = rng.uniform(0.015, 0.07) * seen.travel
    return Sized("presliding_friction", 1.0, lambda s: {"level": s, "stiffness": s / distance})


def _pushes(rng: Rng, seen: Seen) -> Sized:
    """Two to five pushes that do not overlap, away from both ends."""
    count = int(rng.integers(2, 6))
    places = (np.arange(count) + rng.uniform(0.15, 0.6, count)) * (0.94 * seen.duration / count) + 0.03 * seen.duration
    lengths = np.minimum(rng.uniform(0.2, 1.6, count), 0.4 * seen.duration / count)
    forces = rng.choice([-1.0, 1.0], count) * rng.uniform(0.5, 1.0, count)

    def values(size: float) -> Values:
        return {
            "events": [
                {"start": float(s), "end": float(s + d), "force": float(size * f)}
                for s, d, f in zip(places, lengths, forces, strict=True)
            ]
        }

    return Sized("external_force", 1.0, values)


def _lag(rng: Rng, seen: Seen) -> Sized:
    return Sized("actuator_lag", 0.03, lambda s: {"time_constant": s}, most=0.3, least=0.003)


def _saturation(rng: Rng, seen: Seen) -> Sized:
    """Size is the inverse of the limit in units of the rms."""
    return Sized("saturation", 1.0, lambda s: {"limit": seen.drive / s})


def _coupling(rng: Rng, seen: Seen) -> Sized:
    """Size is 100 / f^2, the softer the more force; where f would leave 8 to 60 Hz the load's share changes instead."""
    share, damping = float(rng.uniform(0.2, 0.5)), float(np.exp(rng.uniform(np.log(0.02), np.log(0.12))))

    def values(size: float) -> Values:
        soft = float(np.clip(size, 100.0 / 59.0**2, 100.0 / 8.2**2))
        load = float(np.clip(share * size / soft, 0.03, 0.7))
        return {"frequency": float(np.sqrt(100.0 / soft)), "load_share": load, "damping": damping}

    return Sized("flexible_coupling", 100.0 / float(rng.uniform(9.0, 30.0)) ** 2, values, most=5.0, least=0.002)


def _backlash(rng: Rng, seen: Seen) -> Sized:
    """Size is the load's share of J."""
    gap = float(np.exp(rng.uniform(np.log(0.002), np.log(0.03)))) * seen.travel
    rate = 2.0 * np.pi * float(np.exp(rng.uniform(np.log(15.0), np.log(60.0))))
    return Sized(
        "backlash",
        0.4,
        lambda s: {"gap": gap, "load_share": s, "stiffness": float(s * seen.inertia * rate**2)},
        most=0.7,
        least=0.02,
    )


def _walk(rng: Rng, seen: Seen) -> Sized:
    spacing = float(rng.uniform(0.02, 0.08))
    walk = np.cumsum(rng.standard_normal(int(seen.duration / spacing) + 2))
    walk /= np.sqrt(np.mean(walk**2))
    return Sized("random_walk_load", 1.0, lambda s: {"spacing": spacing, "nodes": [float(s * x) for x in walk]})


def _growing(rng: Rng, seen: Seen) -> Sized:
    first = float(rng.uniform(0.1, 0.4))
    return Sized(
        "friction_growing_with_time",
        1.0,
        lambda s: {"first": first * s, "last": s, "duration": seen.duration},
    )


def _slew(rng: Rng, seen: Seen) -> Sized:
    """Size is the time that the actuator needs for the rms of the command."""
    return Sized("slew_limit", 0.02, lambda s: {"rate": seen.drive / s}, least=1e-4)


def _ripple(count: int) -> Callable[[Rng, Seen], Sized]:
    """So many lines, no two within two periods over the travel; the least a third of the largest. One time in two the
    second is the octave of the first, if there is room."""

    def drawn(rng: Rng, seen: Seen) -> Sized:
        bin_ = 2.0 * np.pi / seen.travel
        least, most = 3.5 * bin_, max(2.0 * np.pi * 15.0 / seen.speed, (4.0 + 2.5 * count) * bin_)
        periods: list[float] = []
        while len(periods) < count:
            n = float(np.exp(rng.uniform(np.log(least), np.log(most))))
            if len(periods) == 1 and rng.random() < 0.5 and 2.0 * periods[0] < most:
                n = 2.0 * periods[0]
            if all(abs(n - other) > 2.0 * bin_ for other in periods):
                periods.append(n)
        shares = [1.0, *np.exp(rng.uniform(np.log(1.0 / 3.0), 0.0, count - 1)).tolist()]
        phases = rng.uniform(-np.pi, np.pi, count).tolist()

        def values(size: float) -> Values:
            lines = zip(shares, periods, phases, strict=True)
            return {"lines": [{"amplitude": size * a, "periods": n, "phase": phase} for a, n, phase in lines]}

        return Sized(next(name for name, n in RIPPLES.items() if n == count), 1.0, values)

    return drawn


_OTHERS: dict[str, Callable[[Rng, Seen], Sized]] = {
    **{name: _ripple(count) for name, count in RIPPLES.items()},
    "presliding_friction": _dahl,
    "external_force": _pushes,
    "actuator_lag": _lag,
    "saturation": _saturation,
    "flexible_coupling": _coupling,
    "backlash": _backlash,
    "random_walk_load": _walk,
    "friction_growing_with_time": _growing,
    "slew_limit": _slew,
}
