"""The law that the catalogue lacks: which channels, its curve, its formula, and by how much the error falls."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace

from dsd_cli.identify.final_fit import Ended, ended
from dsd_cli.identify.fit.driven_load import with_driven_load
from dsd_cli.identify.fit.problem import Problem, pose
from dsd_cli.identify.fit.testability import Settings
from dsd_cli.identify.fit.values import flat
from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.recordings.excerpts import excerpts
from dsd_cli.identify.recordings.recording import Recording
from dsd_cli.identify.results import INERTIA, Score, Step, StepKind
from dsd_cli.identify.search.sets import Search
from dsd_cli.identify.search.task import Progress
from dsd_cli.identify.verdict.discrepancy import noise_of_u
from dsd_cli.learn.choose import OF_SENSOR, Choice, choose, left_of, sensed, surely_left
from dsd_cli.learn.curves import curves_of, effects_of, gain, views_of, with_scale_in
from dsd_cli.learn.forgetting import UNKNOWN, forgetting, is_hysteresis
from dsd_cli.learn.formulate import formula_of
from dsd_cli.learn.judge import Judge, LawFit
from dsd_cli.learn.results import LEARNT, NOT_OF_MOTION, NOTHING, Learnt, Tie
from dsd_cli.learn.rows import Balance, balance_of
from dsd_cli.learn.words import of_laws, separating
from dsd_cli.plant.model import PlantModel


def learn(
    recordings: Sequence[Recording],
    model: PlantModel,
    settings: Settings | None = None,
    holdout: Sequence[Recording] = (),
    progress: Progress = lambda _what, _share: None,
    stand_ins: Sequence[str] = (),
) -> Learnt:
    """What the model lacks, as a law of the channels, if there is one; else why not.

    Parameters
    ----------
    recordings : of one machine. model : what it is believed to be; its values are fitted along.
    holdout : recordings that no fit sees; the held-out errors are then theirs.
    stand_ins : effects of the model that are taken back where they are needless beside the law.

    Raises
    ------
    DataError : the recordings are too short, the axis does not move, or a needed channel is missing.
    UsageError : recordings of different rates.
    """
    settings = settings or Settings()
    progress("preparing", 0.0)
    model = settings.known.applied(model)
    problem = pose(excerpts(with_driven_load(recordings, model)), model, settings)
    progress("which channels", 0.1)
    chosen = choose(balance_of(problem), lambda share: progress("which channels", 0.1 + 0.5 * share))
    progress("fitting the law", 0.7)
    whole = scores = Scores(recordings, holdout, model, settings)
    if chosen.refused or not chosen.fit.laws[0].family.of_motion:
        return _nothing(chosen, whole)
    if whole.without <= sensed(whole.problem, chosen.fit.forward):
        return _nothing(replace(chosen, refused=OF_SENSOR), whole)
    if is_hysteresis(chosen.fit) and chosen.judge.balance.problem is not problem:
        scores = Scores(forgetting(recordings, problem), forgetting(holdout, problem), model, settings)
    found = _learnt(chosen, scores, stand_ins)
    leaves = found.after.rmse if scores is whole else whole.left_by(found.model).rmse
    if not leaves <= (1.0 - POLICY.unknown_fall) * whole.without:
        # few blocks, a delay that suits it alone, or rows in which hysteresis has forgotten, make any law look good
        why = f"with a law in it the model leaves {leaves:.4g} of the log where it leaves {whole.without:.4g} without"
        found = _nothing(replace(chosen, refused=why), whole)
    progress("done", 1.0)
    return found


class Scores:
    """Errors of models on all rows of the recordings, in one band, and on those held out."""

    def __init__(
        self, recordings: Sequence[Recording], holdout: Sequence[Recording], model: PlantModel, settings: Settings
    ) -> None:
        self.recordings, self.holdout, self.model, self.settings = recordings, holdout, model, settings
        self.problem = self.of(model)
        self.given = self.problem.errors.of_model(self.problem.model)
        self.search = Search(self.problem)
        self.refitted = self.problem.score(self.search.refit)
        self.without = min(self.given.rmse, self.refitted.rmse)

    def left_by(self, model: PlantModel) -> Score:
        """What a model leaves, not held out."""
        return self.problem.errors_for(model, self.recordings).of_model(model)

    def of(self, model: PlantModel) -> Problem:
        """A model and nothing to add to it."""
        return pose(self.recordings, model, replace(self.settings, effects=()), self.holdout)

    def fixed(self, model: PlantModel, held: Sequence[str]) -> dict[str, float]:
        """Values that a fit beside the law holds: the inertia, or all of an effect, and what is known."""
        found = {name: value for name, value in flat(model).items() if name.partition(".")[0] in held}
        return {**found, **self.settings.known.fixed}

    def with_law(self, model: PlantModel, held: Mapping[str, float], stand_ins: Sequence[str]) -> Iterator[Ended]:
        """A model with the law in it, then one less for every stand-in that is needless beside it."""
        stay = {name.partition(".")[0] for name in held}
        own = {name: values for name, values in model.effects.items() if name not in set(stand_ins) - stay}
        settings = replace(self.settings, known=replace(self.settings.known, fixed=held))
        return ended(self.recordings, replace(model, effects=own), model, settings, self.holdout)

    def rung(self, end: Ended, heldout: float, tabled: Collection[str]) -> Step:
        """A rung of the ladder, its tables with the scale in. heldout : of the law, on the folds that chose it."""
        model = end.model.changed(effects={name: with_scale_in(end.model.effects[name]) for name in tabled})
        score = self.left_by(model)
        if self.holdout:
            heldout = self.problem.errors_for(model, self.holdout).of_model(model).rmse
        values = {name: one for name, one in end.values.items() if name.partition(".")[0] not in tabled}
        kind: StepKind = "taken back" if end.without else "learnt"
        return Step(1, end.without, replace(score, heldout_rmse=heldout), values, model, kind)


def _learnt(chosen: Choice, scores: Scores, stand_ins: Sequence[str]) -> Learnt:
    fit, judge, formula = chosen.fit, chosen.judge, formula_of(chosen)
    curves = effects_of(fit, scores.problem.model)
    by_formula = {} if formula is None else dict(formula.effects)
    laws = by_formula or curves
    fit = formula.fit if formula is not None and by_formula else fit
    tabled = [name for name, values in laws.items() if "scale" in values]
    begun = scores.problem.model.changed(inertia=_inertia(fit, judge.balance), effects=laws)
    none = {f"{name}.{key}": value for name, one in laws.items() for key, value in one.items() if value == 0.0}
    held = {**scores.fixed(begun, _held(fit, judge.balance, laws)), **none}
    rungs, gone = list[Step](), list[str]()
    for end in scores.with_law(begun, held, stand_ins):
        gone += [end.without] if end.without else []
        rungs.append(scores.rung(end, _heldout(judge, fit, gone), tabled))
    rungs[0] = replace(rungs[0], effect=next(iter(laws)))
    last, problem = rungs[-1], scores.of(rungs[-1].model)
    families = [law.family for law in chosen.fit.laws]
    return Learnt(
        logs=tuple(r.name for r in scores.recordings),
        verdict=LEARNT,
        family=of_laws(chosen.fit),
        channels=formula.on
        if formula is not None and by_formula
        else tuple(dict.fromkeys(name for family in families for name in family.on)),
        curves=curves_of(chosen.fit, judge, list(curves), chosen.finer),
        formula=None if formula is None else formula.formula,
        score=scores.given,
        refitted=_held_out(scores.refitted, chosen, chosen.base, scores.holdout),
        after=last.score,
        model=last.model,
        estimates=last.estimates,
        ceiling=chosen.rmse(chosen.richest),
        band_hz=problem.equations.band.hz,
        floor=problem.floor,
        ties=tuple(_tie(chosen, one) for one in chosen.tied),
        notes=_notes(problem, last.score.heldout_rmse, is_hysteresis(chosen.fit)),
        views=views_of(chosen.fit, judge),
        held_out=tuple(r.name for r in scores.holdout),
        rungs=tuple(rungs),
        held=held,
    )


def _heldout(judge: Judge, fit: LawFit, gone: Collection[str]) -> float:
    """Held-out error of the laws beside the model without these effects, fitted anew in every fold."""
    if gone:
        judge = Judge(judge.balance.without(gone))
        fit = judge.fit(fit.laws)
    return left_of(judge, fit)


def _inertia(fit: LawFit, balance: Balance) -> float:
    """J beside the law."""
    found = balance.inertia / gain(fit) if fit.forward or 0 in fit.held else float(fit.total[0])
    return found if found > 0.0 else balance.inertia


def _held(fit: LawFit, balance: Balance, laws: Iterable[str]) -> list[str]:
    """What the law has as well; beside a law of u the inertia and the law itself: u would explain u."""
    if fit.forward:
        return [INERTIA, *laws]
    return [INERTIA if i == 0 else balance.names[i - 1] for i in fit.held]


def _held_out(score: Score, chosen: Choice, fit: LawFit, holdout: Sequence[Recording]) -> Score:
    """Held-out errors before and after are of the same rows and folds, unless logs are held out."""
    return score if holdout else replace(score, heldout_rmse=chosen.rmse(fit))


def _tie(chosen: Choice, other: LawFit) -> Tie:
    families = [law.family for law in other.laws]
    own = [law.family for law in chosen.best.laws]
    return Tie(of_laws(other), families[-1].on, chosen.rmse(other), separating(own[-1], families[-1]))


def _notes(problem: Problem, heldout: float, springs: bool) -> tuple[str, ...]:
    """springs : whether the law has some that slip."""
    notes, search = [], Search(problem)
    if heldout > problem.least_missing and not noise_of_u(search, search.refit):
        share = 100.0 * heldout / max(problem.errors.force, 1e-300)
        notes.append(f"{share:.1f} % of u stays unexplained beside the law, more than the sensor leaves")
    if springs and (known := problem.errors.equations.counting) < 1.0:
        notes.append(f"{100.0 * (1.0 - known):.0f} % of the log is not judged: {UNKNOWN}")
    return tuple(notes)


def _off(scores: Scores) -> tuple[str, ...]:
    """That the values of the model are off, where a fit of them leaves clearly less: no law is asked for that."""
    given, fitted, force = scores.given.rmse, scores.refitted.rmse, max(scores.problem.errors.force, 1e-300)
    if not scores.problem.falls(given, fitted, scores.search.refit):
        return ()
    shares = f"as given it leaves {100.0 * given / force:.3g} % of u, fitted to the log {100.0 * fitted / force:.3g} %"
    return (f"values of [model] are off: {shares}; dsd improve fits them",)


def _nothing(chosen: Choice, scores: Scores) -> Learnt:
    """No law, and why."""
    problem, holdout = scores.problem, scores.holdout
    refitted = _held_out(scores.refitted, chosen, chosen.base, holdout)
    left = min(surely_left(chosen.judge, chosen.base), scores.without)
    verdict, why, least = NOTHING, chosen.refused, problem.least_missing
    share = f"{100.0 * left / max(problem.errors.force, 1e-300):.3g} % of u"
    if not chosen.refused:
        verdict, why = NOT_OF_MOTION, "what is left is a force over time, not over the motion"
    elif noise_of_u(scores.search, scores.search.refit):
        why = f"what is left, {share}, is white, and u has as much above the band: noise of u"
    elif left > least and not chosen.undecided:
        verdict, why = NOT_OF_MOTION, f"{share} is left on blocks that no fit saw: {why}"
    elif not chosen.undecided:  # whether so little is something is for the search to say
        noise = left <= sensed(problem, of_u=False)
        little = "may be the sensor's noise" if noise else "is more than the sensor's noise, but too little to matter"
        why = f"what is left below {problem.equations.band.hz:.1f} Hz, {share}, {little}"
    return Learnt(
        logs=tuple(r.name for r in scores.recordings),
        verdict=verdict,
        family="",
        channels=(),
        curves=(),
        formula=None,
        score=scores.given,
        refitted=refitted,
        after=refitted,
        model=problem.model,
        estimates=problem.values(scores.search.refit).estimates,
        ceiling=chosen.rmse(chosen.richest),
        band_hz=problem.equations.band.hz,
        floor=problem.floor,
        why=why,
        notes=_off(scores),
        held_out=tuple(r.name for r in holdout),
    )
