"""Whether the model's own values are wrong: inertia and delay, freed one at a time, and all values at once."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

from dsd_cli.effects import delays_command, get_effect
from dsd_cli.identify.fit.bank import Term, has_friction
from dsd_cli.identify.fit.direction import NEEDS_ACCELERATION
from dsd_cli.identify.fit.laws_of_u import ONE_COLUMN
from dsd_cli.identify.fit.row_weights import many_sure
from dsd_cli.identify.fit.solve import Fit
from dsd_cli.identify.fit.values import LEAST_INERTIA, flat, terms_of, units_of
from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.results import DELAY, INERTIA, Candidate, Estimate, Missing, Score
from dsd_cli.identify.search.seen import Seen
from dsd_cli.identify.search.sets import Search
from dsd_cli.identify.search.shapes import refined
from dsd_cli.identify.search.task import Judge
from dsd_cli.identify.verdict.discrepancy import Discrepancy, noise_of_u
from dsd_cli.identify.verdict.probability import changes
from dsd_cli.identify.verdict.resonance import Resonance, note_on
from dsd_cli.plant.model import PlantModel
from dsd_cli.signals.golden import golden_section
from dsd_cli.signals.spread import rms

HALF_A_SAMPLE = "a u that was sampled, taken as held, is half a sample of delay, {:.3g} ms: is signals.u_hold right?"
#: Golden section steps.
STEPS = 30


@dataclass(frozen=True)
class ParameterCheck:
    """score : of the model as given. refitted : with all its values fitted. wrong : the value that is off, or "".

    said : what of it the zero of a reconstructed position explains.
    """

    score: Score
    refitted: Score
    candidates: tuple[Candidate, ...]
    wrong: str
    probability: float
    said: tuple[str, ...] = ()

    def beside_unknown(self, beyond: Discrepancy, surest: float) -> tuple[ParameterCheck, tuple[Missing, ...]]:
        """(this, as sure beside what is unknown, the value that is wrong if it takes most of the error): as sure as its
        share of that, for the unknown may have bent it. No inertia beside u times a function: then no one is right."""
        share = 1.0 - (self.refitted.heldout_rmse / max(self.score.heldout_rmse, 1e-300)) ** 2
        sure, varies = min(share * self.probability, surest), self.wrong == INERTIA and beyond.of_gain
        if varies or share < POLICY.share_of_possible or sure < POLICY.even:  # 0 where none is wrong
            return self, ()
        own = tuple(replace(c, probability=sure) if c.effect == self.wrong else c for c in self.candidates)
        return replace(self, candidates=own, probability=sure), (Missing(self.wrong, sure),)


def own_values(search: Search, shown: Resonance | None = None, *, missing: bool = False) -> ParameterCheck:
    """Scores of the model as given and refitted, and the ranked candidates "inertia" and "delay", and first the effect
    of the model whose values are wrong.

    shown : of a load, which may show beyond doubt that the model has other values of it. missing : whether an effect
        is, which bends the values that the model has: none of them is called wrong for it.
    """
    if shown is None or (shown.given is None and shown.other is None):
        return _fitted_values(search, missing=missing)
    if shown.other is not None:
        return _contradicted(search, _fitted_values(search), shown.other, shown.wrong)
    errors, bare = search.problem.errors, shown.given or search
    fitted = bare.problem.scale.model(bare.refit)
    return replace(
        _fitted_values(bare), score=errors.of_model(search.problem.model), refitted=errors.of_model(fitted), wrong=""
    )


def _contradicted(search: Search, found: ParameterCheck, seen: Seen, wrong: str) -> ParameterCheck:
    """What was seen says that an effect of the model, or its inertia, has other values."""
    score = search.problem.errors_for(seen.model, search.problem.recordings).of_model(seen.model)
    errors, units = (score.rmse, found.score.heldout_rmse, score.heldout_rmse), units_of(terms_of(seen.model))
    pairs = {f"{seen.effect}.{name}": pair for name, pair in seen.values.items()}
    pairs |= {INERTIA: (seen.model.inertia, seen.errors.get(INERTIA, math.nan))}
    values = {n.rpartition(".")[2]: Estimate(*pairs[n], units[n][0]) for n in pairs if n.partition(".")[0] == wrong}
    note = note_on(seen, search.equations.band.hz)
    first = Candidate(wrong, *errors, POLICY.surest, values, note=note, model=seen.model, score=score)
    rest = tuple(replace(c, probability=0.0) for c in found.candidates if c.effect != wrong)
    return replace(found, candidates=(first, *rest), wrong=wrong, probability=POLICY.surest)


def _fitted_values(search: Search, *, missing: bool = False) -> ParameterCheck:
    problem, refit = search.problem, search.refit
    score, refitted = problem.errors.of_model(problem.model), problem.score(refit)
    believed, said = _at_the_logs_zero(search)
    given = problem.errors.of_model(believed) if said else score
    fitted = problem.values(refit, returned=not _beyond_noise(search, believed), rests=False)
    values = fitted.estimates
    alone = (_alone(search, believed, n, given, values[n]) for n in (INERTIA, DELAY) if not values[n].held)
    candidates = tuple(sorted(alone, key=lambda c: c.rmse_after))
    between = search.solver.bank.tap_time if noise_of_u(search, refit) else 0.0
    off = dict(_deviations(believed, values, between))
    sure = max(off.items(), key=lambda pair: pair[1], default=("", 0.0))
    if sure[0] in (INERTIA, DELAY):  # of both the one that explains more alone: late friction looks like an inertia
        sure_of = [(c.effect, off.get(c.effect, 0.0)) for c in candidates]
        sure = next((one for one in sure_of if one[1] >= POLICY.value_deviations), sure)
    if not problem.falls(given.heldout_rmse, refitted.heldout_rmse, refit) or sure[1] < POLICY.value_deviations:
        return ParameterCheck(score, refitted, candidates, "", 0.0, said)
    wrong = sure[0].split(".")[0]
    lags = [n for n in search.allowed if delays_command(n)] if wrong == DELAY else []
    if late := tuple(name for name in lags if _explains_the_delay(search, name)):
        candidates = tuple(replace(c, indistinguishable_from=late if c.effect == DELAY else ()) for c in candidates)
    sure_of_it = min(1.0 - math.erfc(sure[1] / math.sqrt(2.0)), POLICY.surest)
    held, step = any(s.stepping for s in problem.equations.stretches), problem.equations.sample_time
    if wrong == DELAY and held and 2.0 * abs(values[DELAY].value - believed.delay) < step:
        sure_of_it, said = min(sure_of_it, POLICY.even), (*said, HALF_A_SAMPLE.format(500.0 * step))
    if wrong not in (INERTIA, DELAY):
        candidates = (_all_of_an_effect(search, wrong, score, refitted), *candidates)
    if others := () if missing or wrong == DELAY else _instead_of(search, wrong):
        sure_of_it /= 1 + len(others)
        candidates = tuple(replace(c, indistinguishable_from=others * (c.effect == wrong)) for c in candidates)
    sure_of_it *= not missing
    candidates = tuple(replace(c, probability=sure_of_it if c.effect == wrong else 0.0) for c in candidates)
    return ParameterCheck(score, refitted, candidates, wrong, sure_of_it, said)


def _at_the_logs_zero(search: Search) -> tuple[PlantModel, tuple[str, ...]]:
    """(the model as given, its phases over the position those of the log where its zero is not known, what is said).

    Where the position was put together from u and d_hat, a phase in the log's own zero is nothing against the model's.
    """
    problem = search.problem
    if not problem.reconstructed("position"):
        return problem.model, ()
    refitted = problem.scale.model(search.refit).effects
    effects, said = {name: dict(values) for name, values in problem.model.effects.items()}, []
    for name in effects:
        effect = get_effect(name)
        for p in effect.parameters if tuple(effect.needs) == ("position",) else ():
            if p.whole_turn and name in refitted:
                effects[name][p.name] = refitted[name][p.name]
                said.append(f"{name}.{p.name}")
    why = f"{' and '.join(said)}: the position was put together from u and d_hat, and its zero is not known"
    return replace(problem.model, effects=effects), (why,) if said else ()


def _beyond_noise(search: Search, believed: PlantModel) -> bool:
    """Whether the model as given leaves more than the sensor's noise where the direction of the motion is sure: with
    the true values noise alone is left, whatever of it a controller has put into u."""
    kept, problem = search.equations.kept, search.problem
    sure = many_sure(search.equations) if has_friction(search.base) else kept
    if sure is None:
        return False
    left = problem.errors.rows_of_model(believed)[sure[kept]]
    return rms(left) > POLICY.floor_factor * problem.floor


def _explains_the_delay(search: Search, effect: str) -> bool:
    """Whether an effect that makes the command late explains the recordings as well as another delay does."""
    believed = round(search.problem.model.delay / search.solver.bank.tap_time)
    terms = [Term.of(effect, shape) for shape in get_effect(effect).starts(search.ranges)]
    taps = [min(max(believed + d, 0), search.problem.most_tap) for d in (-1, 0, 1)]
    tried = [(search.solver.squares((*search.base, t), n, keep=False), t, n) for t in terms for n in taps]
    if not tried:
        return False
    least, term, tap = min(tried, key=lambda found: found[0])
    found, _ = refined(search, (*search.base, term), len(search.base), tap)
    least = min(least, *(search.solver.squares(found, n, keep=False) for n in taps))
    return (least - search.refit.squares) / search.noise.nats < POLICY.least_gain


def _instead_of(search: Search, wrong: str) -> tuple[str, ...]:
    """Effects that, with the inertia or the values of an effect of the model as given, explain the recordings as well,
    and leave what was given nearer: a load, for friction in moves one way; friction by the load, which is a share of
    each force where u always drives."""
    held, given = _holding(search, wrong), search.problem.model.inertia
    least = search.refit.squares + POLICY.least_gain * search.noise.nats

    def off(fit: Fit) -> float:
        return sum(changes(search, fit)) + abs(math.log(search.problem.scale.model(fit).inertia / given))

    as_well = (o for o in held.options(held.refit) if o.fit.squares < least)
    return tuple(o.effect for o in as_well if off(o.fit) <= off(search.refit))


def _holding(search: Search, wrong: str) -> Search:
    """The same with the inertia, or the values of an effect, of the model as given, in the excerpts as well. A share of
    all forces can be tested then, and so can a lag: viscous friction behind it has a part that is an inertia."""
    known, problem = search.solver.known.holding_effects(search.problem.model, [wrong]), search.problem
    why, lags = problem.untestable, filter(delays_command, problem.untestable)
    more = [n for n in why if why[n] == ONE_COLUMN] + [n for n in lags if why[n] == NEEDS_ACCELERATION]
    held = replace(problem, solver=search.solver.knowing(known), candidates=(*problem.candidates, *more))
    return Search(held) if search.excerpt is None else Judge(held, _holding(search.excerpt, wrong))


def _deviations(believed: PlantModel, values: dict[str, Estimate], between: float) -> list[tuple[str, float]]:
    """How many standard errors each value of the model is off. between : s by which the delay is surer than known: half
    way from one step to the next u is the mean of two, and has less noise of its own."""
    given = flat(believed)
    return [
        (name, abs(e.value - given[name]) / math.hypot(e.std_error, between * (name == DELAY)))
        for name, e in values.items()
        if name in given and e.std_error > 0.0
    ]


def _all_of_an_effect(search: Search, effect: str, given: Score, refitted: Score) -> Candidate:
    """An effect that the model has with other values: all values of the model fitted again."""
    known, prefix = search.problem.values(search.refit), f"{effect}."
    own = {name.removeprefix(prefix): e for name, e in known.estimates.items() if name.startswith(prefix)}
    errors = (refitted.rmse, given.heldout_rmse, refitted.heldout_rmse)
    return Candidate(effect, *errors, 0.0, own, model=known.model, score=refitted, all_values=known.estimates)


def _alone(search: Search, model: PlantModel, name: str, given: Score, estimate: Estimate) -> Candidate:
    """The model with only that value changed, at the least error within its bounds."""
    errors = search.problem.errors
    if name == INERTIA:
        centre = math.log(model.inertia)
        reach = 0.7 + (0.0 if estimate.at_bound else abs(math.log(estimate.value / model.inertia)))
        make: Callable[[float], PlantModel] = lambda x: replace(model, inertia=max(math.exp(x), 1e-300))  # noqa: E731
        low, high = centre - reach, centre + reach
        least, most = (math.log(max(bound, LEAST_INERTIA)) for bound in search.solver.known.limits(INERTIA))
    else:
        make = lambda x: replace(model, delay=x)  # noqa: E731
        low, high = 0.0, max(2.0 * model.delay, estimate.value) + 5.0 * search.equations.sample_time
        least, most = search.solver.known.limits(DELAY)
    low, high = (min(max(end, least), most) for end in (low, high))
    x = golden_section(lambda x: errors.of_model(make(x)).rmse, low, high, STEPS)
    changed = make(x)
    score = errors.of_model(changed)
    value = changed.inertia if name == INERTIA else changed.delay
    # the error is that of a fit of all values: it holds for this one alone as far as the two agree
    error = math.hypot(estimate.std_error, value - estimate.value)
    parameters = {name: Estimate(value, error, estimate.unit)}
    return Candidate(name, score.rmse, given.heldout_rmse, score.heldout_rmse, 0.0, parameters, model=changed)
