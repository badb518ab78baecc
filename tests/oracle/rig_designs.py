"""A machine, its loop, its sensors and what it is told to do, drawn for one case before anything is hidden in it."""

import zlib
from dataclasses import dataclass, replace

import numpy as np
from scipy import signal

from tests.oracle import rig_motion
from tests.oracle.rig_cases import Array, RigCase
from tests.oracle.rig_sensors import SENSINGS, Gains, Sensing, Servo, Wanted, stamps
from tests.oracle.rig_sizes import STRUCTURES

SETTLE = 1.5  # s of running before the log begins
Rng = np.random.Generator


def generator(case: RigCase, about: str, attempt: int) -> Rng:
    """Random numbers that depend on nothing but the case, what they are for, and which attempt it is."""
    key = f"{case.what}|{case.loop}|{case.strength}|{about}"
    return np.random.default_rng([case.seed, attempt, zlib.crc32(key.encode())])


@dataclass(frozen=True)
class Design:
    """inertia kg m2, delay s; `logged` says whether the reference is in the log."""

    sensing: Sensing
    t: Array
    inertia: float
    delay: float
    gains: Gains
    wanted: Wanted
    start: float
    kind: str
    speed_noise: float
    white: Array
    logged: bool

    def servo(self) -> Servo:
        """A loop that has not run yet."""
        noise = None if self.sensing.speed_noise is None else self.speed_noise * self.white
        return Servo(self.gains, self.wanted, self.t, self.sensing.counts, noise)

    def with_trim(self, trim: float) -> "Design":
        return replace(self, gains=replace(self.gains, trim=trim))


def design(case: RigCase, attempt: int) -> Design:
    """All of it at random; machines of one seed are alike for every sensing."""
    sensing = SENSINGS[case.sensing]
    rng, seen = generator(case, "machine", attempt), generator(case, case.sensing, attempt)
    t = stamps(sensing, case.sample_time, -SETTLE, case.duration, seen)
    inertia = float(np.exp(rng.uniform(np.log(1e-3), np.log(0.5))))
    delay = float(rng.uniform(0.0, 0.025)) if case.delay is None else case.delay
    lag = delay + float(np.mean(np.diff(t))) + 0.004
    bandwidth = rng.uniform(0.22, 0.42) / lag
    if set(case.what) & set(STRUCTURES):
        bandwidth *= rng.uniform(0.35, 0.7)
    bandwidth = float(np.clip(bandwidth, 3.0, 40.0))
    travel = float(rng.uniform(0.9, 2.4))
    own = {"position": _position, "velocity": _velocity, "weak": _injected, "open": _injected}[case.loop]
    gains, wanted, kind = own(case, rng, t, inertia, bandwidth, travel)
    gains = replace(gains, speed_filter=_speed_filter(sensing, seen))
    logged = case.loop in ("position", "velocity") and bool(seen.random() < 0.5)
    white = seen.standard_normal(len(t))
    start = float(wanted.q[0])
    return Design(sensing, t, inertia, delay, gains, wanted, start, kind, 0.0, white, logged)


def _speed_filter(sensing: Sensing, rng: Rng) -> float:
    """s; the coarser the encoder, the slower."""
    if sensing.speed_noise is not None:
        return float(rng.uniform(0.002, 0.005)) if sensing.speed_noise[1] > 5e-3 else float(rng.choice([0.0, 0.001]))
    slow = {1024: (0.008, 0.015), 4096: (0.004, 0.008), 8192: (0.004, 0.008), 40_000: (0.0015, 0.004)}
    return float(rng.uniform(*slow[sensing.counts]))


def _position(
    case: RigCase, rng: Rng, t: Array, inertia: float, bandwidth: float, travel: float
) -> tuple[Gains, Wanted, str]:
    """PD or PID; steps may kick the command through its D term, smooth references may be fed forward."""
    kind = rig_motion.draw_kind(rng, "position", case.what, case.strength)
    wanted = rig_motion.reference(kind, rng, t, travel, bandwidth)
    kd = inertia * bandwidth
    kp = kd * bandwidth * rng.uniform(0.2, 0.33)
    ki = kp * bandwidth * rng.uniform(0.02, 0.07) * (rng.random() < 0.6)
    if kind == "steps":
        added = kp * _kicks(rng, wanted.q, 8.0, 24.0)
    else:
        added = inertia * rng.uniform(0.6, 1.1) * wanted.a * (rng.random() < 0.7)
    return Gains(kp, kd, ki), Wanted(wanted.q, wanted.v, added), kind


def _velocity(
    case: RigCase, rng: Rng, t: Array, inertia: float, bandwidth: float, travel: float
) -> tuple[Gains, Wanted, str]:
    """PI on the speed."""
    kind = rig_motion.draw_kind(rng, "velocity", case.what, case.strength)
    wanted = rig_motion.reference(kind, rng, t, travel, bandwidth)
    kd = inertia * bandwidth
    if kind == "speed_steps":
        added = kd * _kicks(rng, wanted.v, 10.0, 30.0)
    else:
        added = inertia * rng.uniform(0.6, 1.1) * wanted.a * (rng.random() < 0.4)
    return Gains(0.0, kd, 0.0, kiv=kd * bandwidth * rng.uniform(0.12, 0.25)), Wanted(wanted.q, wanted.v, added), kind


def _kicks(rng: Rng, wanted: Array, least: float, most: float) -> Array:
    """One row per step of the reference, in units of the step; two logs in three have them."""
    return (rng.random() < 0.67) * rng.uniform(least, most) * np.diff(wanted, prepend=wanted[0])


def _injected(
    case: RigCase, rng: Rng, t: Array, inertia: float, bandwidth: float, travel: float
) -> tuple[Gains, Wanted, str]:
    """A command from outside, and a loop that does no more than bring the axis back."""
    kind = rig_motion.draw_kind(rng, case.loop, case.what, case.strength)
    shape = rig_motion.injection(kind, rng, t)
    slow = bandwidth * rng.uniform(0.15, 0.3) if case.loop == "weak" else rng.uniform(0.7, 1.3)
    kp, kd = inertia * 0.4 * slow**2, inertia * slow
    ki = kp * slow * 0.05
    axis = ([1.0, 0.0], [1.0, slow, 0.4 * slow**2, 0.02 * slow**3])
    (b,), a, _ = signal.cont2discrete(axis, float(np.mean(np.diff(t))))
    swing = signal.lfilter(b, a, shape)
    reached = float(np.sqrt(np.mean(swing**2)))
    added = shape * inertia * rng.uniform(0.5, 0.8) * travel / reached
    return Gains(kp, kd, ki), Wanted(np.zeros_like(t), np.zeros_like(t), added), kind
