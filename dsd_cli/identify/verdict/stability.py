"""Sensitivity of the verdict: the search again on half of the data, and on half and twice the band.

Only the search is repeated, not the whole verdict: what is compared is which effects are found.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from dsd_cli.errors import DsdError
from dsd_cli.identify.fit.problem import Settings, pose
from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.recordings.excerpts import excerpts
from dsd_cli.identify.recordings.levels import with_levels
from dsd_cli.identify.recordings.recording import Recording
from dsd_cli.identify.results import DELAY, INERTIA, NONE, UNKNOWN, Diagnosis, Variant
from dsd_cli.identify.search.sets import Search
from dsd_cli.plant.model import PlantModel
from dsd_cli.signals.log import Log


def with_stability(
    found: Diagnosis, recordings: Sequence[Recording], model: PlantModel, settings: Settings
) -> Diagnosis:
    """The diagnosis with its variants; a verdict that changes in one of them is at most 90 % sure.

    A verdict that is no surer than that is left as it is: four searches, as dear as the diagnosis, could not change
    it. So are "unknown" and wrong values of the model: a search alone does not identify them; nor does a search in the
    band identify what the response above it shows.
    """
    if found.verdict in (UNKNOWN, INERTIA, DELAY) or found.verdict in model.effects:
        return found
    if found.probability <= POLICY.surest_unstable:
        return found
    if any(c.seen for c in found.ranking if c.effect == found.verdict):
        return found
    recordings = with_levels(recordings, [one.deviations for one in found.levels])
    asked = [
        ("the first half of the data", _half(recordings, 0), settings),
        ("the second half", _half(recordings, 1), settings),
        ("half the band", recordings, replace(settings, band=POLICY.narrower_band)),
        ("twice the band", recordings, replace(settings, band=POLICY.wider_band)),
    ]
    if found.band_hz * POLICY.wider_band > POLICY.highest_share / recordings[0].sample_time:
        asked.pop()
    variants = tuple(v for what, some, how in asked if (v := _variant(found, what, some, model, how)) is not None)
    if all(one.same for one in variants):
        return replace(found, stability=variants)
    return replace(found, stability=variants, probability=min(found.probability, POLICY.surest_unstable))


def _variant(
    found: Diagnosis, what: str, recordings: Sequence[Recording], model: PlantModel, settings: Settings
) -> Variant | None:
    """None where the part is too short for a fit."""
    try:
        search = Search(pose(excerpts(recordings), model, settings))
    except DsdError:
        return None
    whole = search.run(search.refit)
    there = [t.id for t in search.added(whole.terms)]
    if found.verdict == NONE:
        return Variant(what, there[0] if there else NONE, not there)
    alone = {o.effect: o.evidence for o in search.options(search.refit)}
    named = max(there, key=lambda name: alone.get(name, float("-inf")), default=NONE)
    winner = next(c for c in found.ranking if c.effect == found.verdict)
    same = found.verdict in there or named in winner.indistinguishable_from
    return Variant(what, found.verdict if same else named, same)


def _half(recordings: Sequence[Recording], which: int) -> list[Recording]:
    """Of every piece the first or the second half."""
    halves = []
    for recording in recordings:
        pieces = tuple(_part(piece, which) for piece in recording.pieces)
        halves.append(replace(recording, pieces=pieces))
    return halves


def _part(piece: Log, which: int) -> Log:
    middle = len(piece) // 2
    kept = slice(None, middle) if which == 0 else slice(middle, None)
    return replace(piece, channels={name: x[kept] for name, x in piece.channels.items()})
