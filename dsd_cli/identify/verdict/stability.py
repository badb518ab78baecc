"""Sensitivity of the verdict: the set that was found, asked again of half of the data, and in half and twice the band.

Nothing is searched from scratch: what is asked is which members of the set are still needed, and whether another effect
takes the place of one. Where nothing is missing it is whether anything is found.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace
from typing import Any

from dsd_cli.effects import get_effect, kind_of
from dsd_cli.errors import DsdError
from dsd_cli.identify.fit.driven_load import with_driven_load
from dsd_cli.identify.fit.problem import Settings, pose
from dsd_cli.identify.fit.solve import Fit
from dsd_cli.identify.fit.values import terms_of
from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.recordings.excerpts import excerpts, with_levels
from dsd_cli.identify.recordings.recording import Recording
from dsd_cli.identify.results import DELAY, INERTIA, NONE, UNKNOWN, Diagnosis, Variant
from dsd_cli.identify.search.sets import Search
from dsd_cli.plant.model import PlantModel
from dsd_cli.signals.log import Log


def with_stability(
    found: Diagnosis, recordings: Sequence[Recording], model: PlantModel, settings: Settings
) -> Diagnosis:
    """The diagnosis with its variants; a verdict that changes in one of them is at most 90 % sure, in each of three or
    more half.

    A verdict that is no surer than that is left as it is: nothing could change it. So are "unknown" and wrong values of
    the model: a search alone does not identify them; nor does a search in the band identify what the response above it
    shows. Single events are in one part of the data and not in the other: they are never surer.
    """
    if found.verdict in (UNKNOWN, INERTIA, DELAY) or found.verdict in model.effects:
        return found
    if found.probability <= POLICY.surest_in_doubt:
        return found
    if found.verdict != NONE and get_effect(found.verdict).listed:
        return no_surer(found, POLICY.surest_in_doubt, (found.verdict,))
    if any(c.seen for c in found.ranking if c.effect == found.verdict):
        return found
    recordings = with_levels(recordings, [one.deviations for one in found.levels])
    recordings = with_driven_load(recordings, found.whole_model or found.model)  # as it was found
    asked = [
        ("the first half of the data", _half(recordings, 0), settings),
        ("the second half", _half(recordings, 1), settings),
        ("half the band", recordings, replace(settings, band=0.5)),
        ("twice the band", recordings, replace(settings, band=2.0)),
    ]
    if found.band_hz * 2.0 > POLICY.highest_share / recordings[0].sample_time:
        asked.pop()
    variants = tuple(v for what, some, how in asked if (v := _variant(found, what, some, model, how)) is not None)
    if all(one.same for one in variants):
        return replace(found, stability=variants)
    none = len(variants) > 2 and not any(one.same for one in variants)
    surest = POLICY.surest_in_doubt * (POLICY.even if none else 1.0)
    return no_surer(replace(found, stability=variants), surest, (found.verdict,))


def no_surer(found: Diagnosis, most: float, effects: Collection[str] | None = None) -> Diagnosis:
    """No probability of these effects above that, of all of them if None: not as the verdict, nor in the set that was
    found, nor in the ranking."""

    def less(one: Any) -> Any:
        named = effects is None or one.effect in effects
        return replace(one, probability=min(one.probability, most)) if named else one

    ranking, missing = (tuple(map(less, one)) for one in (found.ranking, found.missing))
    said = effects is None or found.verdict in effects
    sure, more = min(found.probability, most) if said else found.probability, found.unexplained
    if found.verdict == NONE:
        more = replace(more, probability=max(more.probability, 1.0 - sure))
    return replace(found, probability=sure, ranking=ranking, missing=missing, unexplained=more)


def _variant(
    found: Diagnosis, what: str, recordings: Sequence[Recording], model: PlantModel, settings: Settings
) -> Variant | None:
    """None where the part is too short for a fit."""
    try:
        search = Search(pose(excerpts(recordings), model, settings, near=found.model.delay))
    except DsdError:
        return None
    whole = search.run(search.refit) if found.verdict == NONE else _still(search, found.whole_model or found.model)
    there = [t.id for t in search.added(whole.terms)]
    if found.verdict == NONE:
        return Variant(what, there[0] if there else NONE, not there)
    winner = next(c for c in found.ranking if c.effect == found.verdict)
    same = any(name in (found.verdict, *winner.indistinguishable_from) for name in there)
    new_first = min(there, key=lambda name: name in found.found, default=NONE)  # it took the place
    return Variant(what, found.verdict if same else new_first, same)


def _still(search: Search, whole: PlantModel) -> Fit:
    """Of the effects of a model those that are needed here, or what takes their place."""
    allowed = {kind_of(name) for name in (*search.allowed, *(t.id for t in search.base))}
    terms = tuple(t for t in terms_of(whole) if kind_of(t.id) in allowed)
    fit = search.refined(search.fit(terms, round(whole.delay / search.solver.bank.tap_time)))
    return search.swapped(search.without_needless(fit))


def _half(recordings: Sequence[Recording], which: int) -> list[Recording]:
    """Of every piece the first or the second half."""

    def part(piece: Log) -> Log:
        middle = len(piece) // 2
        kept = slice(None, middle) if which == 0 else slice(middle, None)
        return replace(piece, channels={name: x[kept] for name, x in piece.channels.items()})

    return [replace(one, pieces=tuple(map(part, one.pieces))) for one in recordings]
