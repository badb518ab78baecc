"""The estimation problem: force balance, held-out blocks, noise model, candidate effects."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from dsd_cli.effects import Ranges, Role, get_effect
from dsd_cli.errors import DataError
from dsd_cli.identify.fit.band import nearest_bands, telling_length
from dsd_cli.identify.fit.bank import Bank, Term, Terms, has_friction
from dsd_cli.identify.fit.blocks import Blocks, lay_blocks
from dsd_cli.identify.fit.direction import best_delay, inverse_is_evidence, shown_by_no_motion
from dsd_cli.identify.fit.driven_load import both_driven, by_contacts, with_driven_load
from dsd_cli.identify.fit.equations import Equations, equations_of
from dsd_cli.identify.fit.errors import Errors, Noise, measured, sensor_variance
from dsd_cli.identify.fit.row_weights import Weighed, at_least_squares, inflation, weighed
from dsd_cli.identify.fit.solve import Fit, Solver
from dsd_cli.identify.fit.testability import Settings, candidates_of, check_recordings, check_used, ranges, told_by
from dsd_cli.identify.fit.values import Fitted, Scale, fitted_values, terms_of, whole_inertia
from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.recordings.recording import Recording
from dsd_cli.identify.results import Score
from dsd_cli.plant.model import PlantModel
from dsd_cli.signals.once import once
from dsd_cli.signals.spread import rms


@dataclass(frozen=True)
class Problem:
    """Everything that a search for missing effects looks at.

    base, before : effects that the model has, which stay; less those of a set that the climb has taken a part of.
    candidates, untestable : effects that may be added; effect -> why it cannot be tested on these recordings.
    solver, errors : on whitened rows; in the unit of u. most_tap, tap : steps of delay at most; those of the last fit.
    """

    recordings: tuple[Recording, ...]
    holdout: tuple[Recording, ...]
    model: PlantModel
    base: Terms
    before: Terms
    candidates: tuple[str, ...]
    untestable: dict[str, str]
    solver: Solver
    errors: Errors
    noise: Noise
    most_tap: int
    tap: int

    @property
    def equations(self) -> Equations:
        """Whitened ones."""
        return self.solver.bank.equations

    @property
    def blocks(self) -> Blocks:
        """Held-out blocks."""
        return self.solver.blocks

    @cached_property
    def scale(self) -> Scale:
        """From coefficients to values. A given inertia that is not found stays until J a is as large as the noise."""
        solver, least = self.solver, 0.0 if self.solver.inverse else POLICY.least_inertia * self.solver.inertia
        given, rows, accelerates = self.model.inertia, self.noise.rows, self.errors.accelerates
        if solver.inverse and rows is not None and accelerates > 0.0:
            given = min(given, rms(rows) / accelerates)
        return Scale(solver.bank.tap_time, self.model.rest_speed, solver.known, given, least)

    @cached_property
    def ranges(self) -> Ranges:
        """What the recordings exercise."""
        return ranges(self.equations)

    @property
    def beside(self) -> Terms:
        """Effects fitted while the delay is searched: the base, and candidates that are functions of the motion."""
        return (*self.base, *functions_of_motion(self.candidates))

    @property
    def floor(self) -> float:
        """rms of r that the sensor alone leaves in the band, for the inertia that was fitted, unit of u."""
        return self.solver.inertia * math.sqrt(sensor_variance(self.errors.equations, sure=False))

    @property
    def least_missing(self) -> float:
        """rms of r from which on something is missing, if unknown; unit of u."""
        return math.hypot(POLICY.floor_factor * self.floor, POLICY.floor_excess * self.errors.force)

    def reconstructed(self, channel: str) -> bool:
        """Whether that channel of any recording is put together from u and d_hat, so that it drifts."""
        return _drifts(self.recordings, channel)

    def practical(self, before: Fit, after: Fit) -> bool:
        """Whether the held-out error falls by an amount that is of use."""
        was, now = self.errors.rmse(before), self.errors.rmse(after)
        much = was**2 - now**2 > (POLICY.much_force * self.errors.force) ** 2
        return much or self.falls(was, now, before, after)

    def falls(self, was: float, now: float, *fits: Fit) -> bool:
        """Whether a held-out error falls by a share of itself that is of use, and by a force that is, beside `fits`."""
        fall, least = was**2 - now**2, max(self.least_of_use(fit) for fit in fits)
        return fall > (1.0 - (1.0 - POLICY.least_fall) ** 2) * was**2 and fall > least**2

    def least_of_use(self, fit: Fit) -> float:
        """rms of the least force that is of use to explain beside a fit, unit of u: turns are known in part."""
        rubs = has_friction(fit.terms) or any(t.effect.memory and t.effect.role is Role.APPLIED for t in fit.terms)
        return (POLICY.least_unknown if rubs else POLICY.least_force) * self.errors.force

    def score(self, fit: Fit) -> Score:
        """Errors of a fit, unit of u."""
        return self.errors.of_fit(fit, self.scale)

    @once
    def values(self, fit: Fit, returned: bool = True, as_found: bool = False, rests: bool = True) -> Fitted:
        """Values of a fit with errors, from rows where friction's direction is sure: these count what is left as
        correlated, noise `returned` by a controller, what `rests` leave open; `as_found` : shapes stay."""
        found, known = at_least_squares(weighed(fit, self.solver, self.errors.bank), as_found)
        known = known if returned else replace(known, returned=0.0)
        left, noise = found.variance, self._noise_in(found)
        beyond = left if found.leaning else left - noise if left > POLICY.incomplete * noise else 0.0
        floor = left * inflation(found.residual) + beyond * POLICY.correlated_rows
        fitted = fitted_values(found.fit, found.solver, self.scale, floor, known, complete=beyond == 0.0)
        zero = not self.reconstructed("position")
        return told_by(self.errors.bank, fitted, self.beside, self.solver.known, zero=zero, rests=rests)

    def _noise_in(self, found: Weighed) -> float:
        """Variance of a whitened row that no function of single channels explains, in the rows that this fit trusts."""
        if self.noise.rows is None or len(self.noise.rows) != len(found.residual):
            return self.noise.variance
        return found.variance_of(found.solver.bank.equations.whitened(self.noise.rows))

    def errors_for(self, model: PlantModel, recordings: Sequence[Recording]) -> Errors:
        """Errors on these recordings, or on others each in the nearest band, a load driven by this model if it has one.

        Raises DataError where they are too short.
        """
        driven, own = with_driven_load(recordings, model), self.equations
        same = [r.name for r in recordings] == [r.name for r in self.recordings]
        equations = equations_of(driven, own.startup, own.bands if same else nearest_bands(own.bands, driven))
        if not equations.stretches:
            raise DataError(f"{recordings[0].name}: too short to be judged", "hold out a longer log")
        return Errors(Bank(equations), lay_blocks(equations.lengths, POLICY.gap_rows, recordings[0].name))

    def measured_again(self, fit: Fit) -> Problem:
        """The same problem with the noise estimated from the residual of this fit: missing effects are no noise."""
        return replace(_with_noise(self, fit), tap=fit.tap)


def pose(
    recordings: Sequence[Recording],
    model: PlantModel,
    settings: Settings,
    holdout: Sequence[Recording] = (),
    near: float | None = None,
) -> Problem:
    """The problem which of the candidates the model lacks; `near` : about the delay, s, where a fit found one.

    Raises DataError (too short, no motion, a channel that the model's own effects need is missing), UsageError
    (recordings with different sample times, a candidate that does not exist).
    """
    check_recordings((*recordings, *holdout), model)
    known = settings.known
    model = known.applied(model)
    recordings, holdout = both_driven(recordings, holdout, model)
    known = known.holding_effects(model, [r.pushed[0] for r in recordings if r.pushed and by_contacts([r])])
    candidates, untestable = candidates_of(recordings, holdout, model, settings)
    base, step = terms_of(model), recordings[0].sample_time
    telling = telling_length([([p["acceleration"] for p in r.pieces], r.sensor.noise) for r in recordings])
    longest = POLICY.longest_delay_share * telling * step
    longest = min(longest, POLICY.longest_delay, max(0.5 * max(r.cycle for r in recordings), 2.0 * model.delay))
    beside = (*base, *functions_of_motion(candidates))
    bank, most_tap = _bank(recordings, longest, settings.band)
    solver = Solver(bank, lay_blocks(bank.equations.lengths, 1, recordings[0].name), known=known)
    about = None if near is None else round(near / bank.tap_time)
    every, _ = candidates_of(recordings, holdout, model, replace(settings, effects=None))
    all_beside, tap = (*base, *functions_of_motion(every)), min(round(model.delay / bank.tap_time), most_tap)
    drowned = settings.inverse is None and inverse_is_evidence(solver, all_beside, model.inertia, tap)
    if inverse := (settings.inverse or drowned) and not _drifts(recordings):
        solver = Solver(bank, solver.blocks, known=known, inverse=True)
        untestable |= shown_by_no_motion(candidates, bank.equations)
        candidates = tuple(name for name in candidates if name not in untestable)
    # inverse: a friction that hardly changes is as well explained by a u of seconds ago
    found = 0.0 if inverse else best_delay(solver, beside, most_tap, about, believed=model.delay) * bank.tap_time
    wanted = min(max(POLICY.least_delay_range, 2.0 * found, 2.0 * model.delay), longest)
    given = model.inertia if inverse else 0.0
    solver, most_tap, fit = _laid_out(
        recordings, wanted, base, beside, replace(settings, known=known), found, believed=model.delay, given=given
    )
    errors = Errors(solver.bank, solver.blocks, _aside(holdout, solver.bank.equations))
    problem = Problem(
        tuple(recordings),
        tuple(holdout),
        model,
        base,
        tuple(t for t in base if t.id not in settings.begun_with),
        candidates,
        untestable,
        solver,
        errors,
        Noise(1.0, 1.0),
        most_tap,
        fit.tap,
    )
    return _with_noise(problem, fit)


def asked_of_all(problem: Problem, recordings: Sequence[Recording], holdout: Sequence[Recording], fit: Fit) -> Problem:
    """The problem that was posed on excerpts, posed on all rows of the recordings.

    fit : of the excerpts. The noise keeps its spectrum there; its variance grows if the fit leaves more in all rows.
    """
    few = problem.equations
    recordings, holdout = (with_driven_load(some, problem.model, few.counting < 1.0) for some in (recordings, holdout))
    equations = equations_of(recordings, few.startup, few.bands)
    plain = Bank(equations, variance=sensor_variance(equations))
    blocks = lay_blocks(equations.lengths, POLICY.gap_rows, recordings[0].name)
    whitened = equations.with_whitening(*few.whitening)
    share = sensor_variance(whitened) / max(sensor_variance(few), 1e-300)  # each log's part of the rows is another
    white = Bank(whitened, plain, share * problem.solver.bank.variance)
    left = problem.solver.on(white, blocks=blocks).squares(fit.terms, fit.tap) / blocks.rows
    ratio = left / max(fit.squares / problem.blocks.rows, 1e-300)
    noise = replace(problem.noise, variance=max(ratio, 1.0) * problem.noise.variance)
    solver = problem.solver.on(white, noise.variance * noise.inflation, blocks=blocks)
    errors = Errors(plain, blocks, _aside(holdout, equations))
    return replace(problem, recordings=tuple(recordings), solver=solver, errors=errors, noise=noise)


def _drifts(recordings: Sequence[Recording], channel: str = "velocity") -> bool:
    """Whether that channel of any recording is put together from u and d_hat."""
    return any("reconstructed" in r.provenance.get(channel, "") for r in recordings)


def _aside(holdout: Sequence[Recording], equations: Equations) -> Equations | None:
    """Equations of recordings that no fit sees, in the same band."""
    if not holdout:
        return None
    aside = equations_of(holdout, equations.startup, nearest_bands(equations.bands, holdout))
    if not aside.stretches:
        raise DataError(f"{holdout[0].name}: too short to be judged", "hold out a longer log")
    return aside


def functions_of_motion(candidates: Sequence[str]) -> Terms:
    """Candidates without a shape that look at the motion alone: while one of them is missing, u looks late."""
    effects = ((name, get_effect(name)) for name in candidates)
    return tuple(
        Term.of(name, {})
        for name, e in effects
        if e.role in (Role.APPLIED, Role.FRICTION) and not (e.searched or e.memory or "u" in e.needs or e.listed)
    )


def _bank(recordings: Sequence[Recording], longest: float, widened: float) -> tuple[Bank, int]:
    """(rows that are not whitened, most steps of delay) for delays of up to `longest` s."""
    startup = math.ceil(longest / recordings[0].sample_time) + 3
    equations = equations_of(recordings, startup, widened=widened)
    check_used(recordings, equations)
    bank = Bank(equations, variance=sensor_variance(equations))
    return bank, max(int(longest / bank.tap_time) - 1, 1)


def _laid_out(
    recordings: Sequence[Recording],
    longest: float,
    base: Terms,
    beside: Terms,
    settings: Settings,
    found: float,
    *,
    believed: float,
    given: float,
) -> tuple[Solver, int, Fit]:
    """(solver on rows that are not whitened, most steps of delay, first fit) for delays of up to `longest` s.

    found : the best delay on fewer rows; believed : that of the model, s. given : the inertia that the user believes,
    where the inverse form is evidence: beside functions of the motion it is known as well as it can be; else 0.

    J0 gives what is left of the motion the unit of u. A weight or friction that the model lacks swamps J beside its own
    effects alone, and then whatever is left is a small force: functions of the motion take that away. Without any it is
    rms u over rms a: between the inertias of the inverse and of the forward form of a mass.
    """
    bank, most_tap = _bank(recordings, longest, settings.band)
    blocks = lay_blocks(bank.equations.lengths, POLICY.gap_rows, recordings[0].name)
    solver = Solver(bank, blocks, known=settings.known, inverse=given > 0.0)
    tap = best_delay(solver, beside, most_tap, round(found / bank.tap_time), believed=believed)
    inertia = max(whole_inertia(solver.fit(terms, tap)) for terms in ((beside,) if solver.inverse else (base, beside)))
    between = float(np.linalg.norm(bank.drive((), 0))) / max(float(np.linalg.norm(bank.acceleration)), 1e-300)
    solver = Solver(bank, blocks, inertia or given or between, settings.known, inverse=solver.inverse)
    return solver, most_tap, solver.fit(base, tap)


def _with_noise(problem: Problem, fit: Fit) -> Problem:
    """Rows whitened by the noise that no function of single channels explains beside the fit."""
    solver, noise = measured(problem.errors.bank, problem.solver, fit)
    return replace(problem, solver=solver, noise=noise)
