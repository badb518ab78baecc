"""The answer of `dsd plan`: plain data, rendered elsewhere."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from dsd_cli.design.limits import Limits
from dsd_cli.signals.log import Array
from dsd_cli.signals.units import Units


@dataclass(frozen=True)
class PlannedPair:
    """Two explanations; nats by which the logs prefer a to b, and by which logs and plan will prefer the true one: the
    smaller of both ways, the least and the most of it over the plants that were simulated, and if a, or b, is true; NaN
    where the other may be as good, having all of its effects."""

    a: str
    b: str
    nats_before: float
    nats_expected: float
    nats_if_a: float = math.nan
    nats_if_b: float = math.nan
    nats_low: float = math.nan
    nats_high: float = math.nan


@dataclass(frozen=True)
class PlannedValue:
    """A value with its standard error by the logs, and by logs and plan."""

    name: str
    value: float
    unit: str
    std_error_before: float
    std_error_expected: float


@dataclass(frozen=True)
class Impossible:
    """What no motion within the limits identifies, and what would."""

    what: str
    remedy: str


@dataclass(frozen=True)
class Motion:
    """A reference every `step` s: position, velocity, acceleration (SI) and u that it should need; shape (n,) each."""

    step: float
    position: Array
    velocity: Array
    acceleration: Array
    u: Array

    @property
    def seconds(self) -> float:
        """Length."""
        return self.step * (len(self.position) - 1)


@dataclass(frozen=True)
class Stage:
    """A part of the motion: kind, from and to s, and what to set on a drive that has a generator alone."""

    kind: str
    start: float
    end: float
    values: Mapping[str, Sequence[float]]


@dataclass(frozen=True)
class Plan:
    """The motion that identifies what the logs leave open.

    motion : None where nothing is left to be identified by one. stages : what it is made of. reached : largest size
    of what is limited, over all plants that were simulated. not_counted : explanations that break a limit on every
    motion, which were not. cost : (s, smallest nats) of shorter and longer motions.
    """

    logs: tuple[str, ...]
    verdict: str
    motion: Motion | None
    stages: tuple[Stage, ...]
    pairs: tuple[PlannedPair, ...]
    values: tuple[PlannedValue, ...]
    limits: Limits
    impossible: tuple[Impossible, ...] = ()
    reached: Mapping[str, float] = field(default_factory=dict)
    cost: tuple[tuple[float, float], ...] = ()
    not_counted: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    units: Units = field(default_factory=Units)
    band_hz: float = 0.0
