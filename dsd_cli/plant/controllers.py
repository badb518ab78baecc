"""What computes u: PD with the network disturbance observer (Fig. 5), with the standard one (Fig. 1), alone, or r.

Signs are those of this project: d_hat = Q { Jn a - u }.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Literal, NamedTuple

from dsd_cli.errors import UsageError

Kind = Literal["network_observer", "observer", "pd", "open_loop"]
Derivative = Literal["output", "error"]
KINDS: tuple[Kind, ...] = ("network_observer", "observer", "pd", "open_loop")


class Gains(NamedTuple):
    """PD gains: kp in unit of u per rad or m, kd in unit of u per rad/s or m/s."""

    kp: float
    kd: float


def cdm_gains(time_constant: float = 2.5, nominal_inertia: float = 1.0, gamma: float = 2.5) -> Gains:
    """PD gains for Jn s^2 + Kd s + Kp by the coefficient diagram method (Manabe, 1998).

    tau = Kd/Kp and gamma_1 = Kd^2/(Jn Kp), so Kp = gamma_1 Jn / tau^2, Kd = tau Kp.
    """
    kp = gamma * nominal_inertia / time_constant**2
    return Gains(kp, time_constant * kp)


@dataclass(frozen=True)
class ControllerSettings:
    """Which loop, and its gains.

    Attributes
    ----------
    kind : network_observer (Fig. 5), observer (Fig. 1), pd, open_loop (u = reference).
    gains : PD gains; not used in open loop.
    derivative : "output" is -Kd v, "error" is Kd (r' - v), which kicks at a step of the reference.
    limit : u stays within +-limit.
    integral : gain Ki of the integral of r - q, unit of u per rad s or m s; it waits while u is at its limit.
    """

    kind: Kind = "network_observer"
    gains: Gains = field(default_factory=cdm_gains)
    derivative: Derivative = "output"
    limit: float = math.inf
    integral: float = 0.0

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise UsageError(f"controller.kind = {self.kind}", "must be one of " + ", ".join(KINDS))
        if self.derivative not in ("output", "error"):
            raise UsageError(f"controller.derivative = {self.derivative}", "must be output or error")
        if not self.limit > 0.0:
            raise UsageError(f"controller.limit = {self.limit:g}", "must be above 0")

    def pace(self, inertia: float) -> float:
        """rad/s up to which the loop acts on an axis: where its gains cross over; inf with the standard observer, whose
        Q is the loop, and in open loop, whose u is anything."""
        if self.kind in ("observer", "open_loop"):
            return math.inf
        return max(self.gains.kd / inertia, math.sqrt(max(self.gains.kp, 0.0) / inertia))


class Measured(NamedTuple):
    """One sample of the loop: reference and its rate, measured position and velocity, d_hat of eq. 13's sign, and
    what is added to u."""

    reference: float
    rate: float
    position: float
    velocity: float
    d_hat: float
    feedforward: float = 0.0


class Controller:
    """One `step` per sample.

    The network disturbance observer (Natori and Ohnishi, 2007) feeds back

        v_c = v - d_hat/(Jn s),   q_c = q - d_hat/(Jn s^2),   so   q_c ~ (1-Q) q + Q u/(Jn s^2):

    a Smith predictor that needs no L. In discrete time d_hat_k is the disturbance of the interval that ends at t_k; its
    integrals (rectangles, then trapezoids) then leave exactly the motion of the undelayed nominal plant where Q = 1.
    """

    def __init__(self, settings: ControllerSettings, nominal_inertia: float, sample_time: float) -> None:
        self.settings = settings
        self._step_gain = sample_time / nominal_inertia
        self._sample_time = sample_time
        self._started = False
        self._velocity_lost = 0.0  # d_hat/(Jn s)
        self._position_lost = 0.0  # d_hat/(Jn s^2)
        self._error_sum = 0.0  # (r - q)/s

    def step(self, m: Measured) -> float:
        """u of this sample."""
        return self.completed(self.law(m), m)

    def law(self, m: Measured) -> float:
        """u by gains and observer alone; once a sample."""
        kind = self.settings.kind
        if kind == "open_loop":
            return m.reference
        if kind == "network_observer":
            self._integrate(m.d_hat)
            return self._pd(m, m.position - self._position_lost, m.velocity - self._velocity_lost)
        u = self._pd(m, m.position, m.velocity)
        return u - m.d_hat if kind == "observer" else u

    def completed(self, u: float, m: Measured, scale: float = 1.0) -> float:
        """u of a law with what is added to it and the integral of the error, within the limit; once a sample.

        scale : of the integral's gain, as of the others.
        """
        limit, u = self.settings.limit, u + m.feedforward
        if self.settings.integral > 0.0:
            u += scale * self.settings.integral * self._error_sum
            if abs(u) < limit:
                self._error_sum += self._sample_time * (m.reference - m.position)
        return min(max(u, -limit), limit)

    def _integrate(self, d_hat: float) -> None:
        if not self._started:  # the first d_hat belongs to the time before the loop
            self._started = True
            return
        before = self._velocity_lost
        self._velocity_lost += self._step_gain * d_hat
        self._position_lost += 0.5 * self._sample_time * (before + self._velocity_lost)

    def _pd(self, m: Measured, position: float, velocity: float) -> float:
        kp, kd = self.settings.gains
        rate = m.rate if self.settings.derivative == "error" else 0.0
        return kp * (m.reference - position) + kd * (rate - velocity)
