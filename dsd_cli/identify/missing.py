"""The two answers of a diagnosis: what is missing, and is that all?"""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class Missing:
    """An effect that belongs to what the model as given lacks. probability : that it does, whatever else is missing."""

    effect: str
    probability: float


@dataclass(frozen=True)
class Unexplained:
    """What the effects that were found leave of u beyond the sensor's noise.

    share_of_u : its rms over that of u, within the band; if unknown, no less than is explained of it. probability :
    that anything is there. on : channels on which it depends, as far as that is known.
    """

    share_of_u: float = math.nan
    probability: float = math.nan
    on: tuple[str, ...] = ()
