"""A load that more than the balance of forces shows: its response above the band, or its contacts."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from dsd_cli.identify.policy import POLICY
from dsd_cli.plant.model import PlantModel

#: The effects that a response shows.
COUPLING, PLAY = "flexible_coupling", "backlash"


@dataclass(frozen=True)
class Seen:
    """An effect that the response shows for certain.

    values : {parameter: (value, standard error)}. rivals : what explains the response as well.
    nats : gained over a rigid axis and over one behind a lag.
    fall : share of the whitened output error that it takes off. highest_hz : up to which frequency was looked.
    resonance_hz : of motor against load.
    model : what it is of, with all other effects that were found, and their values beside it.
    off : where contacts show it, how far they lie off the flanks, as a share of the play; else NaN. errors : of the
        model's inertia and delay, which they show as well.
    """

    effect: str
    values: dict[str, tuple[float, float]]
    rivals: tuple[str, ...]
    nats: float
    fall: float
    highest_hz: float
    resonance_hz: float
    model: PlantModel
    off: float = math.nan
    errors: Mapping[str, float] = field(default_factory=dict)


def is_a_load(share: float) -> bool:
    """Whether some of the inertia swings, and some does not."""
    return POLICY.response_share < share < 1.0 - POLICY.response_share
