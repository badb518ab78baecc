"""A controller that takes up what a detector believes of the plant, and goes back to the nominal law without it."""

from __future__ import annotations

from typing import Protocol

from dsd_cli.plant.controllers import Controller, ControllerSettings, Measured
from dsd_cli.plant.model import ObserverSettings
from dsd_cli.plant.predictor import Believed, StatePredictor


class Feedback(Protocol):
    """What lets the controller know which plant it has; times in s."""

    @property
    def longest_delay(self) -> float: ...

    @property
    def ramp(self) -> float: ...

    def step(self, u: float, d_hat: float) -> Believed | None:
        """What to believe from the next sample on, after this one; None: nothing is known, or no longer."""


class AdaptiveController:
    """The nominal law (`Controller`) until a plant is believed; then the same PD with that inertia and delay.

    - gains, that of the integral too, times J/Jn, as the coefficient diagram method would design them for J;
    - position and velocity one delay ahead (`StatePredictor`) in place of the measured ones, or of those that the
      network disturbance observer corrects;
    - with kind = "observer", d_hat less what the believed inertia and delay explain, (J/Jn)(d_hat + Q u) - Q u(t - L):
      the force that is left is compensated, and taken as constant over L in the prediction.

    A change of the law is bumpless: the jump of u that it would make is added, and fades linearly over `ramp`.

    Parameters
    ----------
    observer : Jn and tau behind d_hat (eq. 13's sign is expected in `Measured`).
    longest_delay : the longest that will be believed, s.
    ramp : s; 0 switches at once.
    """

    def __init__(
        self,
        settings: ControllerSettings,
        observer: ObserverSettings,
        sample_time: float,
        longest_delay: float,
        ramp: float = 0.2,
    ) -> None:
        self.settings = settings
        self.believed: Believed | None = None
        self._nominal = Controller(settings, observer.nominal_inertia, sample_time)
        self._inertia = observer.nominal_inertia
        self._predictor = StatePredictor(sample_time, longest_delay)
        self._pole = observer.pole(sample_time)
        self._fade = sample_time / ramp if ramp > 0.0 else 1.0
        self._bump, self._left, self._changed = 0.0, 0.0, False
        self._u, self._seen_u, self._seen_arrived = 0.0, 0.0, 0.0  # the last u; Q of u, and of u(t - L)

    def adopt(self, model: Believed | None) -> None:
        """From the next sample on that is the plant; None: the nominal law."""
        if model == self.believed:
            return
        self.believed, self._changed = model, True
        if model is not None:
            self._predictor.believe(model)

    def step(self, m: Measured) -> float:
        """u of this sample."""
        self._seen_u += (1.0 - self._pole) * (self._u - self._seen_u)
        self._seen_arrived += (1.0 - self._pole) * (self._predictor.arrived() - self._seen_arrived)
        u, ratio = self._nominal.law(m), 1.0  # always: its integrals are those of the whole past
        if self.believed is not None:
            u, ratio = self._adapted(m, self.believed), self.believed.inertia / self._inertia
        u = self._nominal.completed(u, m, ratio)
        if self._changed:
            self._bump, self._left, self._changed = self._u - u, 1.0, False
        self._left = max(self._left - self._fade, 0.0)
        limit = self.settings.limit
        self._u = min(max(u + self._left * self._bump, -limit), limit)
        self._predictor.sent(self._u)
        return self._u

    def _adapted(self, m: Measured, believed: Believed) -> float:
        ratio, force = believed.inertia / self._inertia, 0.0
        if self.settings.kind == "observer":
            force = ratio * (m.d_hat + self._seen_u) - self._seen_arrived
        position, velocity = self._predictor.ahead(m.position, m.velocity, force)
        kp, kd = self.settings.gains
        rate = m.rate if self.settings.derivative == "error" else 0.0
        return ratio * (kp * (m.reference - position) + kd * (rate - velocity)) - force
