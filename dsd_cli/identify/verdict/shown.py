"""A load that the response shows above the band of the balance becomes the answer, with the values told there."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from dsd_cli.identify.fit.asked import Settings
from dsd_cli.identify.fit.solve import Fit
from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.recordings.recording import Recording
from dsd_cli.identify.search.long_logs import searched, searched_with
from dsd_cli.identify.search.response import COUPLING, PLAY, Seen, response_of
from dsd_cli.identify.search.sets import Search
from dsd_cli.plant.model import PlantModel

#: Effects that a response can show.
SHOWN = (COUPLING, PLAY)
Report = Callable[[str, float], None]


@dataclass(frozen=True)
class Shown:
    """A search that knows what the response shows.

    seen : the load that is the answer; None where it is in the model, or others come first. settings : with its values.
    """

    search: Search
    whole: Fit
    settings: Settings
    seen: Seen | None


def with_response(
    search: Search,
    whole: Fit,
    recordings: Sequence[Recording],
    model: PlantModel,
    settings: Settings,
    holdout: Sequence[Recording],
    doubtful: bool,
    report: Report,
) -> Shown:
    """The search as it is, or with the load that only the response tells.

    Where the balance finds the load itself, and its resonance lies within the band, nothing changes. Effects that are
    found beside the load come first: it is the answer once nothing else is missing.
    """
    unchanged = Shown(search, whole, settings, None)
    asked = [name for name in SHOWN if name in search.allowed or name in model.effects]
    if not asked or any(settings.known.concerns(name) for name in SHOWN):
        return unchanged
    report("the response above the band", 0.7)
    found = {t.id for t in whole.terms}
    seen = response_of(search, whole, asked, doubtful or PLAY in found)
    in_band = seen is not None and seen.resonance_hz < POLICY.response_in_band * search.equations.band.hz
    if seen is None or (in_band and seen.effect in found):
        return unchanged
    known = replace(settings, known=settings.known.seeing(seen.effect, seen.values))
    values = {name: value for name, (value, _) in seen.values.items()}
    there = model.changed(None, None, {seen.effect: values})
    beside, all_of_it = searched(recordings, there, known, holdout, report)
    if seen.effect in model.effects:
        return Shown(beside, all_of_it, known, None)
    others = tuple(t.id for t in beside.added(all_of_it.terms))
    if others:
        first = replace(settings, effects=others)
        return Shown(*searched(recordings, model, first, holdout, report), first, None)
    return Shown(*searched_with(recordings, there, model, known, holdout), known, seen)


def told_by_response(search: Search, effect_id: str, settings: Settings) -> Settings | None:
    """Settings with the values of an effect that only the response tells; None where the balance itself tells them."""
    if effect_id not in SHOWN or settings.known.concerns(effect_id):
        return None
    seen = response_of(search, search.refit, (effect_id,), doubtful=True)
    if seen is None or seen.resonance_hz < POLICY.response_in_band * search.equations.band.hz:
        return None
    return replace(settings, known=settings.known.seeing(effect_id, seen.values))


def note_on(seen: Seen, band_hz: float) -> str:
    """How it was seen, for people."""
    place = "above" if seen.resonance_hz > band_hz else "in"
    return (
        f"seen in the response of the acceleration to u up to {seen.highest_hz:.3g} Hz: motor against load swing at"
        f" {seen.resonance_hz:.3g} Hz, {place} the band of the balance; it takes {100.0 * seen.fall:.2g} % off the"
        f" output error ({seen.nats:.3g} nats)"
    )
