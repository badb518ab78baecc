"""A simulated plant beside a log: what it did, and whether it ran away."""

from __future__ import annotations

import numpy as np

from dsd_cli.errors import DataError
from dsd_cli.plant.motion import Plant
from dsd_cli.signals.log import Array, Log

#: Channels of a simulation.
CHANNELS = ("position", "velocity")
#: A simulated channel this many times beyond the range of the logged one has diverged.
_DIVERGED = 1e6


class Watch:
    """What a simulated plant did, and whether it ran away."""

    def __init__(self, piece: Log) -> None:
        self.name = piece.source
        first = (float(piece["position"][0]) if "position" in piece else 0.0, float(piece["velocity"][0]))
        self.rows = [first]
        spans = [float(np.abs(piece[name]).max()) for name in CHANNELS if name in piece]
        self.limit = _DIVERGED * max(max(spans), 1e-9)

    def guarded(self, plant: Plant, t: float, u: float, duration: float) -> None:
        """Advance; a force that overflows has diverged."""
        try:
            plant.advance(t, u, duration)
        except (OverflowError, ZeroDivisionError, ValueError):
            raise self.diverged(t) from None

    def note(self, plant: Plant, t: float) -> None:
        """One more row."""
        if not (abs(plant.position) <= self.limit and abs(plant.velocity) <= self.limit):
            raise self.diverged(t)
        self.rows.append((plant.position, plant.velocity))

    def diverged(self, t: float) -> DataError:
        """The error."""
        return DataError(
            f"{self.name}: the simulated axis runs away: at t = {t:g} s it is {_DIVERGED:g} times beyond the log",
            "the model is unstable: check the signs of its effects, the gains, and the sample time",
        )

    def channels(self) -> dict[str, Array]:
        """By name, shape (n,)."""
        position, velocity = np.array(self.rows).T
        return {"position": position, "velocity": velocity}
