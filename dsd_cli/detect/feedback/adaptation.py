"""Which plant a controller may believe in, sample by sample: a label that stands, and that is still the best."""

from __future__ import annotations

from dataclasses import dataclass

from dsd_cli.detect.engine import Engine
from dsd_cli.detect.feedback.hindsight import Hindsight
from dsd_cli.errors import UsageError
from dsd_cli.plant.predictor import Believed


@dataclass(frozen=True)
class AdaptSettings:
    """Hysteresis of the feedback.

    Attributes
    ----------
    dwell : s that a label must stand confident, without a break, before it is adopted.
    ramp : s over which the controller changes its law.
    """

    dwell: float = 0.1
    ramp: float = 0.2


class Adaptation:
    """Feeds an engine, one sample at a time, and says what the controller is to believe.

    - A label is adopted when it has been confident and the same for `dwell`.
    - What is adopted stays, also while nothing is confident (a quiet loop says nothing).
    - It is given up when it leaves more than twice rho unexplained and another state explains the window of the
      detector much better: at most half of the rms, and the lead that `confident` asks for. A burst of noise, which
      every state explains as badly, is no reason. In its place comes the cautious plant until a label stands again:
      the lightest candidate, which makes the lowest gains, with the delay in the middle. (The nominal law of the
      network observer would not do: it goes by integrals over the whole past, so it drifts where J has changed.)

    Parameters
    ----------
    engine : of a method that decides sample by sample, for a regular clock and a model without effects.

    Raises
    ------
    UsageError : an engine that cannot.
    """

    def __init__(self, engine: Engine, settings: AdaptSettings | None = None) -> None:
        settings = settings or AdaptSettings()
        if engine.measurement.timed or engine.grid.effects:
            raise UsageError("a controller's detector needs a regular clock and no effect axes", "leave them out")
        self.engine = engine
        self.believed: Believed | None = None
        self._dwell = max(1, round(settings.dwell / engine.measurement.sample_time))
        self._ramp = settings.ramp
        self._standing, self._state = 0, -1
        self._hindsight = Hindsight(engine)
        delays = engine.grid.delays
        self._cautious = Believed(min(engine.grid.inertias), min(delays) + 0.5 * (max(delays) - min(delays)))
        self._rho, self._confidence = engine.settings.rho, engine.settings.confidence

    @property
    def longest_delay(self) -> float:
        """The longest delay that may be adopted, s."""
        return max(self.engine.grid.delays)

    @property
    def ramp(self) -> float:
        """s."""
        return self._ramp

    def step(self, u: float, d_hat: float) -> Believed | None:
        """What to believe from the next sample on."""
        label = self.engine.step(u, d_hat)
        squares = self._hindsight.step(u, d_hat)
        if not label.confident or label.state != self._state:
            self._standing = 0
        self._state = label.state
        self._standing += label.confident
        if self._standing >= self._dwell:
            new = Believed(label.inertia, label.delay)
            if new != self.believed:
                self._believe(new)
        elif self.believed not in (None, self._cautious) and self._refuted(squares, label.log_likelihood):
            self._believe(self._cautious)
        return self.believed

    def _believe(self, model: Believed) -> None:
        self.believed = model
        self._hindsight.believe(model)

    def _refuted(self, squares: float, log_likelihood: float) -> bool:
        """Whether the label explains the window much better than what is believed; `squares`: what that leaves."""
        spec = self._hindsight
        best = spec.squares_of(log_likelihood)  # NaN while nothing is judged: never refuted then
        unexplained = squares > 4.0 * self._rho**2 * spec.window
        leads = (squares - best) / (2.0 * self._rho**2) >= self._confidence
        return unexplained and leads and squares >= 4.0 * best
