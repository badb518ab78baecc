"""The candidate states: every combination of delays, effect values and inertias."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from dsd_cli.errors import UsageError
from dsd_cli.signals.log import Array


@dataclass(frozen=True)
class Grid:
    """G delays x further effect axes x H inertias; the inertia is the innermost index, the delay the outermost.

    Attributes
    ----------
    delays : s, shape (G,).
    inertias : kg m2 or kg, shape (H,).
    effects : "effect.parameter" -> candidate values.

    Raises
    ------
    UsageError : an axis without a value, with one twice, a negative delay, or an inertia that is not positive.
    """

    delays: tuple[float, ...]
    inertias: tuple[float, ...]
    effects: Mapping[str, tuple[float, ...]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name, values in {"delays": self.delays, "inertias": self.inertias, **self.effects}.items():
            if not values or len(set(values)) < len(values) or not np.isfinite(values).all():
                raise UsageError(f"candidates of {name}: {_listed(values) or 'none'}", "give each value once")
        if min(self.delays) < 0.0 or min(self.inertias) <= 0.0:
            raise UsageError("candidates out of range", "delays must be 0 or more, inertias above 0")

    def __len__(self) -> int:
        return len(self.delays) * len(self.combinations) * len(self.inertias)

    @cached_property
    def combinations(self) -> list[dict[str, float]]:
        """The combinations of effect values, in the order of the states; [{}] without effect axes."""
        return [dict(zip(self.effects, values, strict=True)) for values in itertools.product(*self.effects.values())]

    @cached_property
    def axes(self) -> dict[str, Array]:
        """Name of the axis -> its value at every state, shape (states,)."""
        columns = list(itertools.product(self.delays, self.combinations, self.inertias))
        axes = {
            "delay": np.array([delay for delay, _, _ in columns]),
            "inertia": np.array([inertia for _, _, inertia in columns]),
        }
        for name in self.effects:
            axes[name] = np.array([values[name] for _, values, _ in columns])
        return axes

    def axis_indices(self) -> Array:
        """For the axes with more than one value: the index of each state's value, shape (axes, states)."""
        rows = [np.unique(values, return_inverse=True)[1] for values in self.axes.values()]
        rows = [row for row in rows if row.max(initial=0) > 0]
        return np.array(rows, dtype=np.float64).reshape(len(rows), len(self))

    def index(self, delay: float | None = None, inertia: float | None = None) -> int:
        """The first state with these values (None: any).

        Raises
        ------
        UsageError : a value that is not on the grid.
        """
        match = np.ones(len(self), dtype=bool)
        for name, value, allowed in (("delay", delay, self.delays), ("inertia", inertia, self.inertias)):
            if value is None:
                continue
            close = np.isclose(self.axes[name], value, rtol=1e-9, atol=1e-12)
            if not close.any():
                raise UsageError(f"no state has {name} {value:g}", "candidates are " + _listed(allowed))
            match &= close
        return int(np.flatnonzero(match)[0])


def _listed(values: Sequence[float]) -> str:
    return ", ".join(f"{value:g}" for value in values)
