"""The interface that every effect file fills.

The force law of an effect is `sum(coefficient_i * column_i)`: the simulator evaluates the columns at one instant,
prediction and identification evaluate the same function over a whole log, so the two cannot drift apart.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import Enum
from typing import Any, NamedTuple

import numpy as np


class Role(Enum):
    """How the plant uses the columns of an effect.

    APPLIED : force on the plant is coefficients x columns.
    FRICTION : coefficients x columns is a non-negative *budget*; the plant owns sign and sticking.
    INPUT : changes u before the delay.
    STRUCTURE : adds a mass.
    """

    APPLIED = "applied"
    FRICTION = "friction"
    INPUT = "input"
    STRUCTURE = "structure"


class Channels(NamedTuple):
    """What an effect may look at; each a float (simulator) or an array of shape (n,) (prediction).

    t in s, u in the user's unit, velocity and position in SI units.
    """

    t: Any
    u: Any
    velocity: Any
    position: Any


@dataclass(frozen=True)
class Parameter:
    """One value of an effect.

    `unit` uses `{u}` for the unit of u, `{v}` for velocity's and `{q}` for position's.
    A `linear` parameter multiplies one column, in the order of declaration; the others shape the columns.
    """

    name: str
    unit: str
    meaning: str
    lower: float = -np.inf
    upper: float = np.inf
    linear: bool = True


@dataclass(frozen=True)
class Effect:
    """One physical effect: what it is, what it needs, and the one function giving its unit-force columns.

    Attributes
    ----------
    id : the name used in `dsd.toml` and on the command line.
    law : the formula, as text.
    needs : channels of `Channels` that must be in the log.
    pattern : the residual pattern that betrays it.
    columns : (channels, shape parameters by name) -> one column per linear parameter.
    """

    id: str
    role: Role
    law: str
    summary: str
    pattern: str
    parameters: tuple[Parameter, ...]
    needs: tuple[str, ...]
    columns: Callable[[Channels, Mapping[str, float]], tuple[Any, ...]]

    def force(self, channels: Channels, values: Mapping[str, float]) -> Any:
        """Coefficients x columns: a force (APPLIED) or a budget (FRICTION), in the unit of u."""
        columns = self.columns(channels, values)
        coefficients = [values[p.name] for p in self.parameters if p.linear]
        return sum((c * column for c, column in zip(coefficients, columns, strict=True)), 0.0)
