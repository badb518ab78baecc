"""A load that the response shows above the band of the balance becomes the answer, with the values identified there."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from dsd_cli.identify.fit.bank import Term
from dsd_cli.identify.fit.solve import Fit
from dsd_cli.identify.fit.testability import Settings
from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.results import DELAY, INERTIA
from dsd_cli.identify.search.drift_search import searched
from dsd_cli.identify.search.response import response_of
from dsd_cli.identify.search.seen import COUPLING, PLAY, Seen, same_play
from dsd_cli.identify.search.sets import Search
from dsd_cli.identify.search.task import Task, searched_with
from dsd_cli.plant.model import PlantModel

#: Effects that a response can show.
SHOWN = (COUPLING, PLAY)
RATTLES = (
    "the load may rattle in its play: the residual of the response is not white, and a load that bounces from flank to "
    "flank cannot be simulated well enough to predict it"
)
LINE = (
    "something pushes at {hz:.3g} Hz, above {band:.3g} Hz where the balance of forces ends for this sensor: it cannot "
    "show what (a finer sensor could)"
)
COUNTED = (
    "errors are of the {share:.0f} % of the samples in which the motor is alone in its play: where it touches the load "
    "the force between them is not identifiable"
)


@dataclass(frozen=True)
class Resonance:
    """A search that knows what the response shows.

    seen : the load that is the answer; None where it is in the model, or others come first. settings : with its values.
    rattles, line_hz : see `Response`. other : the play that contacts show where the model has it with
    another value, `wrong`: the effect or "inertia".
    given : where it is not `search`, that of the model without the load: in rows where a motor is alone any model of
    it fits.
    """

    search: Search
    whole: Fit
    settings: Settings
    seen: Seen | None
    rattles: bool = False
    line_hz: float = math.nan
    other: Seen | None = None
    wrong: str = ""
    given: Search | None = None

    @property
    def by_contacts(self) -> bool:
        """Whether motor and load were seen to touch."""
        return self.seen is not None and not math.isnan(self.seen.off)

    @property
    def counted(self) -> tuple[str, ...]:
        """What errors are of, where contacts of a load are known."""
        share = self.search.equations.counting
        return (COUNTED.format(share=100.0 * share),) if share < 1.0 else ()

    @property
    def warnings(self) -> tuple[str, ...]:
        """All that is said of the load, for people."""
        return (*self.counted, *self.said)

    @property
    def said(self) -> tuple[str, ...]:
        """Why the answer may be another, for people."""
        line = LINE.format(hz=self.line_hz, band=self.search.equations.band.hz)
        return (RATTLES,) * self.rattles + (line,) * (not math.isnan(self.line_hz))


def with_response(search: Search, whole: Fit, task: Task, doubtful: bool) -> Resonance:
    """The search as it is, or with the load that only the response identifies.

    Where the balance finds the load itself, its resonance lies within the band and the response knows no better values,
    nothing changes; where the response shows no load, the balance's is dropped. Effects that are found beside the load
    come first: it is the answer once nothing else is missing. Contacts are the answer beside whatever is missing.
    """
    model, settings = task.model, task.settings
    unchanged = Resonance(search, whole, settings, None)
    asked = [name for name in SHOWN if name in search.allowed or name in model.effects]
    if not asked or any(settings.known.concerns(name) for name in SHOWN) or search.equations.counting < 1.0:
        return unchanged
    task.report("the response above the band", 0.7)
    ids = {t.id for t in whole.terms}
    response = response_of(search, whole, asked, doubtful or PLAY in ids)
    if response is None:
        return unchanged
    seen = response.seen
    unchanged = replace(unchanged, rattles=response.rattles, line_hz=response.line_hz)
    if seen is None:
        return _without_load(unchanged, task)
    if not math.isnan(seen.off):
        return _with_contacts(replace(unchanged, rattles=doubtful), seen, task)
    balanced = _in_band(seen, search) and not ids.isdisjoint(SHOWN)
    if balanced and seen.effect in ids and not doubtful:  # what it leaves is hardly more than noise
        return unchanged
    known = replace(settings, known=settings.known.seeing(seen.effect, seen.values, {}))
    values = {name: value for name, (value, _) in seen.values.items()}
    there = model.changed(None, None, {seen.effect: values}) if seen.effect in model.effects else seen.model
    rest = replace(known, effects=tuple(name for name in search.allowed if name not in SHOWN))
    beside, all_of_it = searched(replace(task, model=there, settings=rest))
    if balanced and not _better(unchanged, beside, all_of_it):
        return unchanged
    if seen.effect in model.effects:
        return Resonance(beside, all_of_it, known, None)
    others = _needed(beside, all_of_it, model)
    belongs = {*model.effects, *others, seen.effect}
    found = beside.problem.scale.model(all_of_it)  # its delay, too: a lag among them takes a part of it
    there = replace(found, effects={n: v for n, v in found.effects.items() if n in belongs} | {seen.effect: values})
    search, whole = searched_with(replace(task, settings=known), there)
    return Resonance(search, whole, known, None if others else seen, response.rattles)


def _with_contacts(found: Resonance, seen: Seen, task: Task) -> Resonance:
    """The play that contacts show, if what it leaves in the rows that count then is much less; or that the model's is
    another: no value is changed unsaid."""
    own = task.model.effects.get(seen.effect)
    if own is not None:
        off = abs(task.model.inertia - seen.model.inertia) > POLICY.contradicting_deviations * seen.errors[INERTIA]
        wrong = seen.effect if not same_play(own, seen) else INERTIA if off else ""
        return replace(found, whole=found.search.refit, rattles=False, other=seen, wrong=wrong) if wrong else found
    there = {INERTIA: seen.model.inertia, DELAY: seen.model.delay}
    beside = {name: (there[name], error) for name, error in seen.errors.items()}
    known = replace(found.settings, known=found.settings.known.seeing(seen.effect, seen.values, beside))
    search, whole = searched_with(replace(task, settings=known), seen.model)
    before = found.search.problem.errors.rmse(found.search.refit)
    if not search.problem.errors.rmse(whole) < POLICY.driven_gain * before:
        return found
    return Resonance(search, whole, known, seen, given=found.search)


def _needed(beside: Search, whole: Fit, model: PlantModel) -> tuple[str, ...]:
    """Effects that the model lacks beside a load.

    What was found without the load is in the base of this search, for the load is driven by it: it is asked for anew.
    """

    def needed(term: Term) -> bool:
        return term not in beside.base or beside.matters(beside.without(whole, term), whole)

    lacking = [t for t in whole.terms if t.id not in model.effects and t.id not in SHOWN]
    return tuple(t.id for t in lacking if needed(t))


def _without_load(found: Resonance, task: Task) -> Resonance:
    """A load that the balance found and the response does not show is none where it may have followed the sensor.

    An axis that friction holds now and then has no linear response, and forces that no law describes are in it as well.
    So one stays that takes off more than the sensor leaves, and than is left with it: it might follow any part of that.
    """
    search, whole = found.search, found.whole
    if not any(t.id in SHOWN for t in search.added(whole.terms)):
        return found
    settings = replace(found.settings, effects=tuple(name for name in search.allowed if name not in SHOWN))
    without, best = searched(replace(task, settings=settings))
    rest, rmse = search.fit(best.terms, best.tap), search.problem.errors.rmse
    other = max(rmse(whole), POLICY.floor_factor * search.problem.floor)
    if rmse(rest) ** 2 - rmse(whole) ** 2 > other**2 and search.matters(rest, whole):
        return replace(found, rattles=False)  # it is found; what the response leaves need not be its play
    return replace(found, search=without, whole=best, settings=settings)


def _better(found: Resonance, beside: Search, whole: Fit) -> bool:
    """Whether the values that the response identifies leave less than those of the balance, by what is of use."""
    before, after = found.search.problem.errors.rmse(found.whole), beside.problem.errors.rmse(whole)
    return after < (1.0 - POLICY.least_fall) * before


def _in_band(seen: Seen, search: Search) -> bool:
    """Whether the balance itself can identify this load."""
    return seen.resonance_hz < search.equations.band.hz


def response_settings(search: Search, effect_id: str, settings: Settings) -> Settings | None:
    """Settings with the values of an effect that only the response identifies: above the band of the balance, or beside
    friction that the model lacks, which hides a play from the balance. None where the balance itself does."""
    if effect_id not in SHOWN or settings.known.concerns(effect_id):
        return None
    response = response_of(search, search.refit, (effect_id,), doubtful=True)
    seen = response.seen if response is not None else None
    if seen is None or (_in_band(seen, search) and {*seen.model.effects} <= {*search.problem.model.effects, effect_id}):
        return None
    return replace(settings, known=settings.known.seeing(effect_id, seen.values, {}))


def note_on(seen: Seen, band_hz: float) -> str:
    """How it was seen, for people."""
    if not math.isnan(seen.off):
        return (
            "seen sample by sample, where motor and load touch and where the motor is alone: the contacts lie on both"
            f" flanks of one play to {100.0 * seen.off:.2g} % of it"
        )
    place = "above" if seen.resonance_hz > band_hz else "in"
    return (
        f"seen in the response of the acceleration to u up to {seen.highest_hz:.3g} Hz: motor against load swing at"
        f" {seen.resonance_hz:.3g} Hz, {place} the band of the balance; it takes {100.0 * seen.fall:.2g} % off the"
        f" output error ({seen.nats:.3g} nats)"
    )
