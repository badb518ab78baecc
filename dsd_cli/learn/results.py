"""What `dsd learn` found: plain data, rendered elsewhere."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from dsd_cli.identify.results import Estimate, Estimates, Score, Step
from dsd_cli.plant.model import PlantModel
from dsd_cli.signals.log import Array
from dsd_cli.signals.units import Units

Verdict = Literal["learnt", "none", "not a function of the motion"]
LEARNT: Verdict = "learnt"
NOTHING: Verdict = "none"
NOT_OF_MOTION: Verdict = "not a function of the motion"


@dataclass(frozen=True)
class Curve:
    """A law at its knots, with a band of 95 %.

    effect : of the model, that has it. channels : of its table; "radius" of springs that slip, "time constant" of lags.
    knots : for each channel. values, low, high : at the knots, flat; a band of NaN where the log never was.
    unit : of the values, with {u}, {v}, {q}. factor : what the table is multiplied by.
    """

    effect: str
    channels: tuple[str, ...]
    knots: tuple[tuple[float, ...], ...]
    values: tuple[float, ...]
    low: tuple[float, ...]
    high: tuple[float, ...]
    unit: str
    factor: str = "one"


@dataclass(frozen=True)
class Formula:
    """A law in symbols and words.

    parameters : "<effect>.<parameter>" -> estimate. effects : effect of the catalogue, or of the law file, per term.
    known : whether all of them are of the catalogue. source : text of the law file. heldout_rmse : with it.
    replaces : whether it explains as much as the curve.
    """

    text: str
    words: str
    parameters: Mapping[str, Estimate]
    effects: tuple[str, ...]
    known: bool
    source: str
    heldout_rmse: float
    replaces: bool


@dataclass(frozen=True)
class Tie:
    """Another law that explains the log as well, and the motion that would separate the two."""

    family: str
    channels: tuple[str, ...]
    heldout_rmse: float
    separate: str


@dataclass(frozen=True)
class View:
    """What a picture shows of one law, each of shape (n,), rows that count.

    channel : of its curve; at : its values, direction : sgn v. before, after : the force that is missing without and
    with the law, unit of u. points : the same as `before` in the unit of the curve, NaN where the curve is
    multiplied by about 0.
    """

    channel: str
    at: Array
    direction: Array
    before: Array
    after: Array
    points: Array


@dataclass(frozen=True)
class Learnt:
    """The answer of `dsd learn`.

    channels : that the law depends on; "direction" is sgn v, "memory" the way since the last turns. family : in words.
    curves : one for each part of the law.
    score : of the model as given; refitted : with its own values fitted; after : with the law in it.
    model : with the law; estimates : its values. ceiling : held-out error of the best free-form law of all.
    why : one sentence where nothing is learnt. notes : what else is to be known.
    rungs : of the ladder, the law and the stand-ins that are taken back beside it; none where nothing was learnt.
    held : values that a fit beside the law holds, by name: what the law has as well, and what is known.
    """

    logs: tuple[str, ...]
    verdict: Verdict
    family: str
    channels: tuple[str, ...]
    curves: tuple[Curve, ...]
    formula: Formula | None
    score: Score
    refitted: Score
    after: Score
    model: PlantModel
    estimates: Estimates
    ceiling: float
    band_hz: float
    floor: float
    ties: tuple[Tie, ...] = ()
    why: str = ""
    notes: tuple[str, ...] = ()
    held_out: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    rungs: tuple[Step, ...] = ()
    held: Mapping[str, float] = field(default_factory=dict)
    views: tuple[View, ...] = field(default=(), compare=False, repr=False)
    units: Units = field(default_factory=Units)
