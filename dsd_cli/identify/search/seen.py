"""A load that more than the balance of forces shows: its response above the band, or its contacts.

Values of a play out of its contacts, and how sure they are.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from dsd_cli.identify.fit.contacts import Contacts, contacts_of
from dsd_cli.identify.fit.driven_load import one_sensor, pushes_of
from dsd_cli.identify.fit.pushes import Pushes
from dsd_cli.identify.fit.values import terms_of
from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.results import DELAY, INERTIA
from dsd_cli.identify.search.sets import Search
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


class IdentifiedPlay(NamedTuple):
    """A play with its values.

    values : {parameter of the effect: (value, standard error)}. inertia : of motor and load. early : s by which u acts
    earlier than it was taken to; with their standard errors. resonance_hz : of motor against load in contact. off : see
    `Contacts`.
    """

    values: dict[str, tuple[float, float]]
    inertia: tuple[float, float]
    early: tuple[float, float]
    resonance_hz: float
    off: float


def seen_by_contacts(search: Search) -> Seen | None:
    """The play that the contacts of motor and load show; None where they show none for certain."""
    model, equations = search.problem.model, search.problem.errors.bank.equations
    if not one_sensor(equations):
        return None
    play = identified_play(pushes_of(equations, model, terms_of(model)), model.inertia)
    resolved = search.ranges.resolution / POLICY.resolved_deviations
    if play is None or not (is_a_load(play.values["load_share"][0]) and play.values["gap"][0] > resolved):
        return None
    values = {name: value for name, (value, _) in play.values.items()}
    there = model.changed(max(model.delay - play.early[0], 0.0), play.inertia[0], {PLAY: values})
    errors = {DELAY: play.early[1], INERTIA: play.inertia[1]}
    return Seen(PLAY, play.values, (), math.nan, math.nan, math.nan, play.resonance_hz, there, play.off, errors)


def same_play(values: Mapping[str, float], touching: Seen) -> bool:
    """Whether a play with these values has the gap and the share that contacts show."""
    pairs = ((values[name], *touching.values[name]) for name in ("gap", "load_share"))
    return all(abs(x - value) < POLICY.contradicting_deviations * error for x, value, error in pairs)


def identified_play(pushes: Pushes, inertia: float) -> IdentifiedPlay | None:
    """The play that contacts show for certain; None where they show none. inertia : of both masses, roughly."""
    near = contacts_of(pushes, inertia)
    if not near or near[0].off > POLICY.play_off:
        return None
    ordered = sorted(near, key=lambda c: c.gap)
    middle = min(ordered[(len(near) - 1) // 2 : len(near) // 2 + 1], key=lambda c: c.off)
    gap = middle.gap, math.hypot(middle.reach[1] / middle.share, _scatter(middle, near, lambda c: c.gap))
    share = middle.share, _scatter(middle, near, lambda c: c.share)
    if any(x < POLICY.value_deviations * error for x, error in (gap, share)):
        return None
    k = _stiffness(middle, near, pushes.step, pushes.two_intervals)
    values = {"gap": gap, "load_share": share, "stiffness": k}
    hz = _free_rate(middle, k[0]) / (2.0 * math.pi)
    both = middle.inertia, _scatter(middle, near, lambda c: c.inertia)
    early, error = float(middle.changes[0]), _scatter(middle, near, lambda c: float(c.changes[0]))
    return IdentifiedPlay(values, both, (pushes.step * early, pushes.step * error), hz, near[0].off)


def _scatter(found: Contacts, near: Sequence[Contacts], of: Callable[[Contacts], float]) -> float:
    """What contacts leave open of a value: how far they are off the flanks, or by what plays nearly as good differ."""
    others = [abs(of(c) - of(found)) for c in near if c is not found]
    return max(found.off * abs(of(found)), float(np.median(others)) if others else 0.0)


def _free_rate(found: Contacts, stiffness: float) -> float:
    """rad/s of motor against load in contact."""
    return math.sqrt(stiffness / (found.inertia * found.share * (1.0 - found.share)))


def _stiffness(found: Contacts, near: Sequence[Contacts], step: float, two_intervals: bool) -> tuple[float, float]:
    """(k, standard error); of a contact that is over within a window, no softer than this and no more is known."""
    soft, error = found.soft
    fastest = 2.0 * math.pi * POLICY.response_highest_share / step
    most = fastest**2 * found.inertia * found.share * (1.0 - found.share)
    if not soft > POLICY.told_deviations * error > 0.0:
        return most, most
    k = min(found.share / soft, most)
    window = (2 * found.width - 1 if two_intervals else found.width) * step
    if math.pi / _free_rate(found, k) < window:
        return k, k
    return k, k * max(error, _scatter(found, near, lambda c: c.soft[0])) / soft
