"""Who made d_hat, of a log that has no motion beside it: how likely each maker is, and what holds whoever it was.

Read by the wrong maker, u + Q^-1 d_hat is Jn a and a part of what u changes in a sample; a delay and smooth functions
of the motion imitate some of that, but the laws that are there do not. So the model with all that was found is fitted
to the log as each maker would have it, in the same rows, and the held-out blocks share the belief as they do between
effects (`verdict.probability`). A value is the mean over the makers, its variance that within and that between them.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from dsd_cli.identify.checks.disturbance import maker_by_motion
from dsd_cli.identify.checks.stretches import cut
from dsd_cli.identify.fit.bank import Terms
from dsd_cli.identify.fit.priors import grade
from dsd_cli.identify.fit.problem import Problem, asked_of_all, pose
from dsd_cli.identify.fit.testability import Settings
from dsd_cli.identify.fit.values import flat
from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.recordings.excerpts import excerpts
from dsd_cli.identify.recordings.recording import Recording, prepare
from dsd_cli.identify.recordings.smoothing import SAMPLED_U
from dsd_cli.identify.results import DELAY, INERTIA, Candidate, Diagnosis, Estimate, Estimates
from dsd_cli.identify.search.sets import Search
from dsd_cli.identify.verdict.belief import belief_by_squares
from dsd_cli.identify.verdict.diagnose import diagnose
from dsd_cli.plant.maker import Maker, remade
from dsd_cli.plant.model import ObserverSettings, PlantModel
from dsd_cli.signals.log import D_HAT_MAKER, DHatSource, Log, with_channels

#: Share of belief of a maker that is ruled out: no verdict is surer than the rest.
RULED_OUT = 1.0 - POLICY.surest

Ask = Callable[[Sequence[Recording], Sequence[Recording]], Diagnosis]


@dataclass(frozen=True)
class OpenLog:
    """Recordings, as they were logged, whose d_hat one of `makers` made, with the model that they are asked about.

    observer : d_hat with the sign of eq. 13. holdout : recordings by the same maker, never fitted.
    """

    recordings: tuple[Recording, ...]
    model: PlantModel
    observer: ObserverSettings
    makers: tuple[Maker, ...]
    settings: Settings = field(default_factory=Settings)
    holdout: tuple[Recording, ...] = ()

    def made(self, maker: Maker) -> tuple[list[Recording], list[Recording]]:
        """(recordings, held-out ones) as that maker would have made them."""
        made, apart = (
            [one if maker.as_here else self._made(one, maker) for one in some]
            for some in (self.recordings, self.holdout)
        )
        return made, apart

    @cached_property
    def parts(self) -> dict[Maker, list[Recording]]:
        """What is searched of them, as each maker would have made it."""
        parts = excerpts(self.recordings)
        return {maker: [self._made(part, maker) for part in parts] for maker in self.makers}

    def _made(self, recording: Recording, maker: Maker) -> Recording:
        pieces = recording.pieces
        logged = {"t": "t", "u": SAMPLED_U if SAMPLED_U in pieces[0] else "u", "d_hat": "d_hat"}
        channels = {name: np.concatenate([p[was] for p in pieces]) for name, was in logged.items()}
        restarts = np.cumsum([len(p) for p in pieces[:-1]], dtype=int).tolist()
        log = replace(pieces[0], channels=channels, source=recording.name)
        return prepare(as_made_by(log, maker, self.observer), self.observer, restarts, self.model.rest_speed)


@dataclass(frozen=True)
class Beliefs:
    """shares : of belief in each maker. values : of a model, fitted to the log as he would have made it."""

    shares: Mapping[Maker, float]
    values: Mapping[Maker, Mapping[str, float]]

    @property
    def best(self) -> Maker:
        """The first of those half as likely as the likeliest, at least: some leave the same, half a sample later."""
        most = max(self.shares.values())
        return next(m for m, share in self.shares.items() if share >= POLICY.even * most)

    def said(self, how: str) -> str:
        """Who the best is, and how d_hat is read therefore."""
        best = self.best
        sure = f"{100.0 * min(self.shares[best], POLICY.surest):.0f} %"
        return f"d_hat looks as if it was made with {best} ({sure}); {how}. If you know it: {' and '.join(best.keys)}"


def as_made_by(log: Log, maker: Maker, observer: ObserverSettings) -> Log:
    """The log with d_hat as this package makes it, where that maker has made it. Needs t, u and d_hat."""
    if maker.as_here:
        return log
    here, _ = remade(log["t"], log["u"], observer.sign * log["d_hat"], maker, observer.time_constant)
    found = with_channels(log, d_hat=observer.sign * here)
    source: DHatSource = "position" if maker.intervals == 2 else "logged"
    return replace(found, d_hat_source=source, metadata={**log.metadata, D_HAT_MAKER: str(maker)})


def of_recording(
    recordings: Sequence[Recording],
    model: PlantModel,
    observer: ObserverSettings,
    makers: Sequence[Maker],
    settings: Settings,
    holdout: Sequence[Recording] = (),
) -> OpenLog | None:
    """None where only one maker may be it, where a motion is logged, or where d_hat is not as it was logged."""
    hows = [one.provenance for one in (*recordings, *holdout)]
    alone = (how.get("d_hat") == "logged" and how.get("velocity", "").startswith("reconstructed") for how in hows)
    if len(makers) < 2 or not all(alone):
        return None
    open_, apart = tuple(recordings), tuple(holdout)
    return OpenLog(open_, model, replace(observer, sign=1), tuple(makers), settings, apart)


def of_log(
    log: Log, restarts: Sequence[int], model: PlantModel, observer: ObserverSettings, makers: Sequence[Maker]
) -> Maker | None:
    """Who made its d_hat: by the motion where that is logged, else the likeliest; None where it does not say.

    Raises DataError : it is too short, or lacks u or d_hat.
    """
    if "velocity" in log or "position" in log:
        found = maker_by_motion(cut(log, restarts), observer, makers)
        return None if found is None else found.maker
    recording = prepare(log, observer, restarts, model.rest_speed)
    return likeliest(OpenLog((recording,), model, replace(observer, sign=1), tuple(makers))).best


def likeliest(asked: OpenLog) -> Beliefs:
    """In the makers, with what is found in the log as the likeliest of them made it.

    Raises DataError : the log is too short, or lacks u or d_hat.
    """
    return _searched(asked, lambda r, _: diagnose(r, asked.model, asked.observer, asked.settings))[1]


def diagnosed(asked: OpenLog, ask: Ask) -> tuple[Diagnosis, list[Recording]]:
    """(the answer whoever made d_hat, the recordings as the likeliest has made them); `ask` has an answer of
    recordings and held-out ones. Raises what that raises."""
    found, beliefs = _searched(asked, ask)
    best = max(found, key=beliefs.shares.__getitem__)
    answer, shares = found[best], {m: max(beliefs.shares[m], 1e-300) for m in found}
    sure = sum(shares[m] * d.probability for m, d in found.items() if d.verdict == answer.verdict)
    over = _OverMakers(beliefs, best, asked.recordings[0].sample_time)
    none_asked = (
        POLICY.even if sum(shares.values()) < RULED_OUT else POLICY.surest
    )  # another made d_hat than those asked of
    sure = min(sure / sum(shares.values()), over.wrong(answer, asked.model), none_asked)
    return over.put(replace(answer, advice=(*_said(beliefs), *answer.advice)), sure), asked.made(best)[0]


def _searched(asked: OpenLog, ask: Ask) -> tuple[dict[Maker, Diagnosis], Beliefs]:
    """(diagnoses of the log as the makers that were the likeliest, what the last one makes of all makers). The first is
    the likeliest beside functions of the motion, which stand for all that is still to be found; another is asked as
    well where what was found rules it out."""
    found = dict[Maker, Diagnosis]()
    beliefs = _beliefs(asked, asked.model, lambda problem: problem.beside)
    while len(found) < 2 and all(beliefs.shares[m] < RULED_OUT for m in found):
        found[beliefs.best] = answer = ask(*asked.made(beliefs.best))
        beliefs = _beliefs(asked, answer.whole_model or answer.refitted_model, lambda problem: problem.base)
    return found, beliefs


def _beliefs(asked: OpenLog, model: PlantModel, terms: Callable[[Problem], Terms]) -> Beliefs:
    """By what each leaves held out, in the rows, band and whitening of one of them."""
    problem = pose(asked.parts[asked.makers[0]], model, asked.settings)
    first = Search(problem).refit
    problems = {m: asked_of_all(problem, made, (), first) for m, made in asked.parts.items()}
    fits = {m: Search(there).fit(terms(problem), first.tap) for m, there in problems.items()}
    shares = belief_by_squares(np.stack([fit.losses for fit in fits.values()]))
    values = {m: flat(there.scale.model(fits[m])) for m, there in problems.items()}
    return Beliefs(dict(zip(fits, shares.tolist(), strict=True)), values)


class _OverMakers:
    """Values as means over the makers: what is within one of them is known of `best`, to it comes what is between."""

    def __init__(self, beliefs: Beliefs, best: Maker, sample_time: float) -> None:
        kept = [m for m, share in beliefs.shares.items() if share > RULED_OUT]
        self._shares = np.array([beliefs.shares[m] for m in kept]) / sum(beliefs.shares[m] for m in kept)
        self._values, self._own = [beliefs.values[m] for m in kept], beliefs.values[best]
        self._sample_time = sample_time

    def value(self, name: str, one: Estimate) -> Estimate:
        """Mean and standard error of a value that `best` has."""
        if one.held or name not in self._own or not math.isfinite(one.std_error):
            return one
        off = np.array([values[name] - self._own[name] for values in self._values])
        if one.unit == "rad":  # phases go round
            off = np.remainder(off + math.pi, 2.0 * math.pi) - math.pi
        mean = float(self._shares @ off)
        value, error = one.value + mean, math.hypot(one.std_error, math.sqrt(self._shares @ (off - mean) ** 2))
        size, step = (1.0 if one.unit == "rad" else abs(value)), (self._sample_time if name == DELAY else math.nan)
        return replace(one, value=value, std_error=error, grade=grade(size, error, step))

    def wrong(self, answer: Diagnosis, model: PlantModel) -> float:
        """How sure a wrong inertia or delay is, with that error; 1 for any other verdict."""
        if answer.verdict not in (INERTIA, DELAY):
            return 1.0
        one = self.value(answer.verdict, answer.refitted_values[answer.verdict])
        off = abs(one.value - {INERTIA: model.inertia, DELAY: model.delay}[answer.verdict])
        return 1.0 - math.erfc(off / max(one.std_error, 1e-300) / math.sqrt(2.0))

    def put(self, answer: Diagnosis, sure: float) -> Diagnosis:
        """The answer with such values, and as sure as that."""
        named = [self._named(c, sure) if c.effect == answer.verdict else c for c in answer.ranking]
        missing = [replace(m, probability=sure) if m.effect == answer.verdict else m for m in answer.missing]
        return replace(
            answer,
            probability=sure,
            ranking=tuple(named),
            missing=tuple(missing),
            estimates=self._all(answer.estimates),
            whole_values=self._all(answer.whole_values),
            refitted_values=self._all(answer.refitted_values),
        )

    def _named(self, one: Candidate, sure: float) -> Candidate:
        prefix = "" if one.effect in (INERTIA, DELAY) else f"{one.effect}."
        return replace(one, probability=sure, parameters=self._all(one.parameters, prefix))

    def _all(self, values: Estimates, prefix: str = "") -> Estimates:
        return {name: self.value(prefix + name, one) for name, one in values.items()}


def _said(beliefs: Beliefs) -> tuple[str, ...]:
    """That another made d_hat."""
    if beliefs.shares.get(Maker(), 0.0) > RULED_OUT:
        return ()
    return (beliefs.said("values are means over all makers, and their errors hold the doubt"),)
