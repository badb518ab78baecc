"""Sensors, servo loops and the observer of the outside rig. A loop sees nothing but what its sensors say."""

import math
from dataclasses import dataclass

import numpy as np

from tests.oracle.rig_cases import Array


@dataclass(frozen=True)
class Sensing:
    """counts per turn; speed_noise (least, most): share of the usual speed; jitter of the stamps; what is logged."""

    counts: int
    speed_noise: tuple[float, float] | None
    logs: tuple[str, ...]
    jitter: bool = False
    rate: int = 1  # sample times of the case per row


_BOTH = ("u", "velocity", "position")
SENSINGS = {
    "speed40k": Sensing(40_000, (5e-4, 1.5e-3), _BOTH),
    "speedloud": Sensing(40_000, (8e-3, 2e-2), _BOTH),
    "enc40k": Sensing(40_000, None, ("u", "position")),
    "enc4096": Sensing(4096, None, ("u", "position")),
    "enc1024": Sensing(1024, None, ("u", "position")),
    "enc8192jitter500": Sensing(8192, None, ("u", "position"), jitter=True, rate=2),
    "udhat": Sensing(40_000, (5e-4, 1.5e-3), ("u", "d_hat")),
}


def stamps(sensing: Sensing, sample_time: float, first: float, last: float, rng: np.random.Generator) -> Array:
    """From `first` < 0 to `last`, s; one of them is 0 exactly, where the log begins."""
    period = sample_time * sensing.rate
    before, after = math.ceil(-first / period), round(last / period)
    if not sensing.jitter:
        return period * np.arange(-before, after)
    wobble = rng.uniform(0.10, 0.30)
    intervals = period * np.clip(1.0 + wobble * rng.standard_normal(before + after - 1), 0.25, 1.9)
    t = np.concatenate([[0.0], np.cumsum(intervals)])
    return t - t[before]


@dataclass(frozen=True)
class Gains:
    """Of u = kp e + kd e' + integral(ki e + kiv e') + feedforward + injection.

    speed_filter : s, of the measured speed. trim : the integral at the start, unit of u.
    """

    kp: float
    kd: float
    ki: float = 0.0
    kiv: float = 0.0
    speed_filter: float = 0.0
    trim: float = 0.0


@dataclass(frozen=True)
class Wanted:
    """Per stamp: position and speed wanted, and what is added to u."""

    q: Array
    v: Array
    added: Array


class Servo:
    """The loop; `seen_q` and `seen_v` are what its sensors said at each stamp (rad, rad/s)."""

    def __init__(self, gains: Gains, wanted: Wanted, t: Array, counts: int, speed_noise: Array | None) -> None:
        self.gains, self.step = gains, 2.0 * math.pi / counts
        self.wanted = list(zip(wanted.q.tolist(), wanted.v.tolist(), wanted.added.tolist(), strict=True))
        self.intervals = np.diff(t, prepend=2.0 * t[0] - t[1]).tolist()
        self.noise = None if speed_noise is None else speed_noise.tolist()
        self.seen_q: list[float] = []
        self.seen_v: list[float] = []
        self.integral, self.speed = gains.trim, 0.0

    def __call__(self, k: int, q: float, v: float) -> float:
        gains, interval = self.gains, self.intervals[k]
        q = round(q / self.step) * self.step
        if self.noise is not None:
            speed = v + self.noise[k]
        else:
            speed = (q - self.seen_q[-1]) / interval if k else 0.0
        self.seen_q.append(q)
        self.seen_v.append(speed)
        keep = math.exp(-interval / gains.speed_filter) if gains.speed_filter > 0.0 else 0.0
        self.speed = keep * self.speed + (1.0 - keep) * speed
        wanted_q, wanted_v, added = self.wanted[k]
        error, error_v = wanted_q - q, wanted_v - self.speed
        self.integral += interval * (gains.ki * error + gains.kiv * error_v)
        return gains.kp * error + gains.kd * error_v + self.integral + added


def observe(t: Array, u: Array, v: Array, nominal_inertia: float, time_constant: float) -> Array:
    """d_hat of shape (n,), unit of u: the observer from speed, at rest before the first row.

    d_k = p d_(k-1) + (1 - p) [Jn (v_k - v_(k-1)) / T - u_(k-1)], p = exp(-T / tau).
    """
    intervals = np.diff(t)
    keep = np.exp(-intervals / time_constant) if time_constant > 0.0 else np.zeros_like(intervals)
    raw = nominal_inertia * np.diff(v) / intervals - u[:-1]
    d = np.zeros_like(v)
    for k, (p, x) in enumerate(zip(keep.tolist(), raw.tolist(), strict=True)):
        d[k + 1] = p * d[k] + (1.0 - p) * x
    return d
