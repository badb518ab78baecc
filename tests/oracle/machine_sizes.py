"""How large each hidden effect must be to have a wanted share of the drive; taken from the reference motion.

The reference stands in for the motion: what the loop makes of it differs a little, and so does the share.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tests.oracle.machine_laws import Values
from tests.oracle.machine_motion import Motion, reference
from tests.oracle.machines import low_pass, rms

Array = NDArray[np.float64]
Rng = np.random.Generator


@dataclass(frozen=True)
class Run:
    """What the magnitudes are taken from: the reference and the drive it needs (N m) with the base effects."""

    q: Array
    v: Array
    u: Array
    step: float  # s between these samples
    motion: Motion
    inertia: float
    duration: float
    seed: int

    @property
    def drive(self) -> float:
        return rms(self.u)


def plan_of(motion: Motion, inertia: float, duration: float, seed: int) -> Run:
    step = 0.002
    q, v, a = reference(motion, np.arange(0.0, duration, step), duration, seed)
    return Run(q, v, inertia * a, step, motion, inertia, duration, seed)


#: id -> the other parameters and the shape whose rms is one; the named amplitude is then scaled to the wanted rms.
Shape = Callable[[Run, Rng], tuple[str, Values, Array]]


def _plain(key: str, shape: Callable[[Run], Array]) -> Shape:
    return lambda run, rng: (key, {}, shape(run))


def _stribeck(run: Run, rng: Rng) -> tuple[str, Values, Array]:
    velocity = rng.uniform(0.03, 0.1) * run.motion.speed
    return "excess", {"velocity": velocity}, np.exp(-((run.v / velocity) ** 2)) * np.sign(run.v)


def _gravity(run: Run, rng: Rng) -> tuple[str, Values, Array]:
    phase = rng.uniform(-np.pi, np.pi)
    return "amplitude", {"phase": phase}, np.sin(run.q + phase)


def _cogging(run: Run, rng: Rng) -> tuple[str, Values, Array]:
    """At least eight periods are passed, and none so fast that the observer's filter swallows it."""
    fewest = int(np.ceil(8 * 2 * np.pi / np.ptp(run.q)))
    most = int(30 * 2 * np.pi / run.motion.speed)
    periods, phase = float(rng.integers(fewest, max(fewest, most) + 1)), rng.uniform(-np.pi, np.pi)
    return "amplitude", {"periods": periods, "phase": phase}, np.sin(periods * run.q + phase)


def _periodic(run: Run, rng: Rng) -> tuple[str, Values, Array]:
    values = {"frequency": rng.uniform(1.0, 12.0), "phase": rng.uniform(-np.pi, np.pi)}
    return "amplitude", values, np.full_like(run.q, np.sqrt(0.5))


def _position_friction(run: Run, rng: Rng) -> tuple[str, Values, Array]:
    values = {"depth": 0.8, "periods": 1.0, "phase": rng.uniform(-np.pi, np.pi)}
    return "level", values, (1.0 + 0.8 * np.sin(run.q + values["phase"])) * np.sign(run.v)


SHAPES: dict[str, Shape] = {
    "viscous_friction": _plain("coefficient", lambda run: run.v),
    "viscous_asymmetry": _plain("coefficient", lambda run: run.v),
    "quadratic_drag": _plain("coefficient", lambda run: run.v * np.abs(run.v)),
    "coulomb_friction": _plain("level", lambda run: np.sign(run.v)),
    "stribeck_friction": _stribeck,
    "presliding_friction": _plain("level", lambda run: np.sign(run.v)),
    "load_friction": _plain("coefficient", lambda run: run.u),
    "constant_load": _plain("force", lambda run: np.ones_like(run.q)),
    "gravity": _gravity,
    "stiffness": _plain("coefficient", lambda run: run.q),
    "cubic_stiffness": _plain("coefficient", lambda run: run.q**3),
    "cogging": _cogging,
    "periodic_disturbance": _periodic,
    "position_friction": _position_friction,
    "random_load": _plain("rms", lambda run: np.ones_like(run.q)),
    "speed_position_force": _plain("coefficient", lambda run: run.q * run.v),
}


def size(name: str, share: float, run: Run, rng: Rng) -> Values:
    """Parameters of an effect whose rms is `share` of the drive's."""
    if name in SHAPES:
        key, values, shape = SHAPES[name](run, rng)
        values = {key: share * run.drive / rms(shape)} | values
    else:
        values = SPECIAL[name](share, run, rng)
    if name == "presliding_friction":
        values["stiffness"] = values["level"] / float(np.exp(rng.uniform(np.log(0.005), np.log(0.05))))
    if name == "constant_load":
        values["force"] *= float(rng.choice([-1.0, 1.0]))
    return {key: float(value) if np.isscalar(value) else value for key, value in values.items()}


def _until(change: Callable[[float], float], share: float, low: float, high: float) -> float:
    """The value between `low` and `high` whose change is `share`; the change grows from low to high."""
    for _ in range(40):
        middle = np.sqrt(low * high)
        low, high = (middle, high) if change(middle) < share else (low, middle)
    return float(np.sqrt(low * high))


def _dead_zone(share: float, run: Run, rng: Rng) -> Values:
    """The change is the width wherever the loop pushes through it, less where the command stays inside."""
    return {"width": 1.1 * share * run.drive}


def _saturation(share: float, run: Run, rng: Rng) -> Values:
    """By rms, but the limit must be hit neither never nor always: a limited axis catches up later, at the limit."""
    sizes = np.abs(run.u)
    peak = float(sizes.max())
    part = _until(lambda c: rms(np.maximum(sizes - peak / c, 0.0)) / run.drive, share, 1.001, 10.0)
    return {"limit": float(np.clip(peak / part, np.quantile(sizes, 0.9), np.quantile(sizes, 0.985)))}


def _lag(share: float, run: Run, rng: Rng) -> Values:
    def change(tau: float) -> float:
        return rms(run.u[:, None] - low_pass(run.u[:, None], np.exp(-run.step / np.array([tau])))) / run.drive

    return {"time_constant": _until(change, share, 2e-4, 0.03)}


def _backlash(share: float, run: Run, rng: Rng) -> Values:
    """Gaps of a milliradian as worn gears have; the load's share makes the size, and even a tiny gap lets it ring.

    A load that flies through a wide gap lands at a time that nobody can foretell: no law fits such a log.
    """
    crossing = 0.006 + 0.012 * share
    load_share = np.clip(rng.uniform(0.8, 1.2) * (0.05 + 0.9 * share), 0.08, 0.5)
    stiffness = run.inertia * load_share * (2 * np.pi * rng.uniform(25.0, 60.0)) ** 2
    gap = 0.5 * run.motion.acceleration * 0.5 * crossing**2
    return {"gap": gap, "load_share": load_share, "stiffness": stiffness}


def _flexible(share: float, run: Run, rng: Rng) -> Values:
    """A heavy load on a soft spring is plain, a light one on a stiff spring is faint."""
    load_share = np.clip(0.15 + 0.7 * share, 0.2, 0.5)
    frequency = np.clip(rng.uniform(0.7, 1.4) * 10.0 * (0.3 / share) ** 0.6, 5.0, 60.0)
    return {"frequency": frequency, "load_share": load_share, "damping": rng.uniform(0.03, 0.1)}


def _events(share: float, run: Run, rng: Rng) -> Values:
    count = int(rng.integers(2, 5))
    lengths = rng.uniform(0.03, 0.08, count) * run.duration
    starts = (np.arange(count) + rng.uniform(0.2, 0.6, count)) / count * run.duration
    force = share * run.drive / np.sqrt(lengths.sum() / run.duration)
    signs = rng.choice([-1.0, 1.0], count) * rng.uniform(0.8, 1.2, count)
    rows = zip(starts.tolist(), (starts + lengths).tolist(), (force * signs).tolist(), strict=True)
    return {"events": [{"start": s, "end": e, "force": f} for s, e, f in rows]}


def _growing(shape: Callable[[Run], Array]) -> Callable[[float, Run, Rng], Values]:
    """From 0.2 to 1.8 of the mean level over the log."""

    def size(share: float, run: Run, rng: Rng) -> Values:
        level = share * run.drive / rms(shape(run))
        return {"start": 0.2 * level, "rate": 1.6 * level / run.duration}

    return size


SPECIAL: dict[str, Callable[[float, Run, Rng], Any]] = {
    "dead_zone": _dead_zone,
    "saturation": _saturation,
    "actuator_lag": _lag,
    "backlash": _backlash,
    "flexible_coupling": _flexible,
    "external_force": _events,
    "growing_friction": _growing(lambda run: np.sign(run.v)),
    "growing_viscosity": _growing(lambda run: run.v),
    "inertia": lambda share, run, rng: {},
    "delay": lambda share, run, rng: {},
}
