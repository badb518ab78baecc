"""Where the plant will be when the command of now reaches it: measured motion plus what is still on its way."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from dsd_cli.plant.filtering import delay_taps


class Believed(NamedTuple):
    """What a controller believes of its plant: J (unit of nominal_inertia) and L (s)."""

    inertia: float
    delay: float


class StatePredictor:
    """q(t + L) and v(t + L) of J a(t) = u(t - L), exact under the zero-order hold.

        v(t+L) = v(t) + 1/J int u,    q(t+L) = q(t) + L v(t) + 1/J int (time left) u      over the commands in flight

    A finite memory: whatever was believed before is forgotten after L, and at rest (u = 0) the prediction is the
    measurement, whatever J and L are believed to be.

    Parameters
    ----------
    sample_time : T, s.
    longest : the longest delay that will ever be believed, s.
    """

    def __init__(self, sample_time: float, longest: float) -> None:
        self._sample_time = sample_time
        self._length = delay_taps(longest, sample_time)[0] + 3
        self._sent = np.zeros(2 * self._length)  # every command twice, so that the last ones are always one slice
        self._end = self._length
        self.believe(Believed(1.0, 0.0))

    def believe(self, model: Believed) -> None:
        """From now on the plant is that one.

        Raises
        ------
        ValueError : its delay is longer than `longest`.
        """
        whole, fraction = delay_taps(model.delay, self._sample_time)
        if whole + 2 > self._length:
            raise ValueError(f"a delay of {model.delay:g} s is longer than the memory")
        # oldest first: u_{k-1-n} acts for f T yet, then u_{k-n} ... u_{k-1} for T each
        lengths = np.full(whole + 1, self._sample_time)
        lengths[0] *= fraction
        left = model.delay - np.cumsum(lengths)  # from the end of each piece to t + L
        self._inertia, self._delay = model.inertia, model.delay
        self._whole, self._fraction = whole, fraction
        self._velocity = lengths / model.inertia
        self._position = lengths * (left + 0.5 * lengths) / model.inertia

    def sent(self, u: float) -> None:
        """The command of this sample, once it is known."""
        at = self._end - self._length
        self._sent[at] = self._sent[at + self._length] = u
        self._end = self._length + (at + 1) % self._length

    def ahead(self, position: float, velocity: float, force: float = 0.0) -> tuple[float, float]:
        """(q, v) one delay ahead of this sample, before its own command is known, under a constant other force."""
        flying = self._sent[self._end - len(self._velocity) : self._end]
        pushed = self._delay * force / self._inertia
        gained = float(np.dot(self._velocity, flying)) + pushed
        moved = float(np.dot(self._position, flying)) + 0.5 * self._delay * pushed
        return position + self._delay * velocity + moved, velocity + gained

    def arrived(self) -> float:
        """Mean of u(t - L) over the interval that ends at this sample, before its own command is known."""
        newer = self._end - 1 - self._whole
        if self._fraction == 0.0:
            return float(self._sent[newer])
        return float((1.0 - self._fraction) * self._sent[newer] + self._fraction * self._sent[newer - 1])
