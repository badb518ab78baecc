"""Recordings made ready for questions: equations, held-out blocks, the noise, and the model's own values fitted."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from dsd_cli.effects import catalogue, get_effect
from dsd_cli.errors import DataError, UsageError
from dsd_cli.identify.fit.bank import Bank, Term, Terms, ranges
from dsd_cli.identify.fit.blocks import lay_blocks
from dsd_cli.identify.fit.heldout import PlainErrors
from dsd_cli.identify.fit.noise import structured_share, whitening_filter
from dsd_cli.identify.fit.rows import Equations
from dsd_cli.identify.fit.scores import Judge
from dsd_cli.identify.fit.solve import Fit, Solver
from dsd_cli.identify.fit.values import Fitted, Scale, fitted_values
from dsd_cli.identify.recordings.recording import Recording, shifted
from dsd_cli.identify.results import Score
from dsd_cli.identify.search.sets import Noise, Search
from dsd_cli.identify.verdict.freeform import FreeformFits, rich_residual
from dsd_cli.plant.model import ObserverSettings, PlantModel
from dsd_cli.signals.log import Array

#: Samples of delay that are tried at least, the share of the longest stretch that they may take, and the longest in s.
LEAST_DELAYS, MOST_OF_STRETCH, LONGEST_DELAY = 30, 0.2, 1.0
#: A step matters in practice if it takes this share off the held-out error, and explains so much of the net force; or
#: if it explains much of the net force, however loud the measurement noise.
LEAST_FALL, LEAST_FORCE, MUCH_FORCE = 0.015, 0.003, 0.015
#: A fit leaves much if its squares are this many times what functions of single channels leave.
MUCH_LEFT = 1.3
#: Lags over which the correlation of whitened rows is summed.
LAGS = 60
#: Rounds in which the shapes of the model's own effects are searched, and the gain below which they are found.
MOST_REFINEMENTS, STALLED = 6, 1e-3
#: Motion below this share of the largest position or speed is rounding.
ROUNDING = 1e-7
#: Below this share of usable rows there is nothing to learn: the axis stands.
LEAST_MOVING = 0.02


@dataclass(frozen=True)
class Settings:
    """window : samples, of the rig's detector; blocks are at least so far apart. effects : candidates; None is all."""

    window: int = 100
    effects: tuple[str, ...] | None = None


class Examination:
    """Everything that a diagnosis asks of some recordings and a model.

    Raises
    ------
    DataError : too short, no motion, or a channel that the model's own effects need is missing.
    UsageError : recordings with different sample times, a candidate that does not exist.
    """

    def __init__(
        self,
        recordings: Sequence[Recording],
        model: PlantModel,
        observer: ObserverSettings,
        settings: Settings,
        holdout: Sequence[Recording] = (),
    ) -> None:
        _check((*recordings, *holdout), model)
        self.model, self.observer = model, replace(observer, sign=1)
        recordings = [_without_load(r, model, self.observer) for r in recordings]
        self.recordings, self.holdout = tuple(recordings), tuple(holdout)
        sample_time = recordings[0].sample_time
        self.scale = Scale(self.observer, sample_time, model.rest_speed)
        self.base: Terms = tuple(_term(name, values, model.inertia) for name, values in model.effects.items())
        self.candidates, self.untestable = self._candidates(settings)
        self._lay_out(settings, max(LEAST_DELAYS, math.ceil(2.0 * model.delay / sample_time) + 10))
        self.noise = self._whitened(self._first_fit())
        self.bank = Bank(self.equations)
        self.plain = PlainErrors(self.equations, self.blocks)
        self.judge = Judge(self.equations, self.blocks, holdout)

    def _lay_out(self, settings: Settings, wanted: int) -> None:
        """Equations and blocks for delays of up to `wanted` samples; of more, while the longest is the best."""
        longest = int(MOST_OF_STRETCH * max(len(p) for r in self.recordings for p in r.pieces))
        settling = math.ceil(5.0 * self.observer.time_constant / self.scale.sample_time)
        while True:
            self.most_tap = min(wanted, longest)
            startup = min(max(self.most_tap, settling), longest) + 3
            self.equations = Equations(self.recordings, self.observer, startup)
            self._check_used()
            self.gap = max(settings.window, self.most_tap if self.model.delay > 0.0 else 0, 1)
            gap, name = -(-self.gap // self.equations.thinning), self.recordings[0].name
            self.blocks = lay_blocks(self.equations.lengths, gap, name)
            if self.most_tap >= min(longest, int(LONGEST_DELAY / self.scale.sample_time)):
                return
            if self._first_fit().tap < self.most_tap - 3:
                return
            wanted = 2 * self.most_tap

    @cached_property
    def search(self) -> Search:
        """Over the candidates, from the model's own effects."""
        return Search(self.bank, self.blocks, self.base, self.candidates, self.noise, self.practical, self.most_tap)

    @cached_property
    def refit(self) -> Fit:
        """The model's own effects with all values free."""
        solver = Solver(self.bank, self.blocks)
        fit = solver.best(self.base, self._delays(solver))
        for _ in range(MOST_REFINEMENTS):
            better = self.search.refined(fit)
            if better.squares > (1.0 - STALLED) * fit.squares:
                return better
            fit = better
        return fit

    def practical(self, before: Fit, after: Fit) -> bool:
        """Whether the held-out error falls by an amount that is of use."""
        was, now = self.plain.rmse(before), self.plain.rmse(after)
        fall, force = was**2 - now**2, self.plain.force**2
        seen = fall > (1.0 - (1.0 - LEAST_FALL) ** 2) * was**2 and fall > LEAST_FORCE**2 * force
        return seen or fall > MUCH_FORCE**2 * force

    def score(self, fit: Fit) -> Score:
        """Errors of a fit by the prediction itself."""
        folds = [self.scale.model(fit, fold) for fold in range(self.blocks.folds)]
        return self.judge.fitted(folds, self.scale.model(fit))

    def values(self, fit: Fit) -> Fitted:
        """Values of a fit with standard errors; what is left beyond noise counts as correlated over `LAGS` rows."""
        beyond = max(fit.squares / int(self.equations.kept.sum()) - self.noise.variance, 0.0)
        floor = self.noise.variance * self.noise.inflation + beyond * LAGS
        return fitted_values(fit, self.bank, self.blocks, self.scale, floor)

    def freeform(self, fit: Fit, whitened: bool = True) -> FreeformFits:
        """Free-form functions beside a fit; not `whitened`: in the unit of u."""
        equations = self.equations if whitened else self.equations.unwhitened()
        return FreeformFits(equations, self.blocks, fit, self.scale.model(fit))

    def structured(self, fit: Fit) -> float:
        """Share of the power of a fit's residual that is no measuring noise by its spectrum."""
        return structured_share(self.by_stretch(self.plain.residual(fit, held_out=False)))

    def by_stretch(self, plain_rows: Array) -> list[Array]:
        """Rows that are not thinned, as one array per stretch."""
        edges = np.cumsum([len(s.log) - self.equations.startup for s in self.equations.stretches])[:-1]
        return list(np.split(plain_rows, edges))

    def _first_fit(self) -> Fit:
        solver = Solver(Bank(self.equations), self.blocks)
        return solver.best(self.base, self._delays(solver))

    def _delays(self, solver: Solver) -> list[int]:
        """Whole-sample delays around the best, found from coarse to fine."""
        step = max(1, self.most_tap // 40)
        tried = range(0, self.most_tap, step)
        while True:
            best = min(tried, key=lambda n: solver.squares(self.base, n, keep=False))
            if step == 1:
                return [best]
            tried = range(max(best - step, 0), min(best + step + 1, self.most_tap), max(step // 4, 1))
            step = max(step // 4, 1)

    def _whitened(self, first: Fit) -> Noise:
        """Whitens the rows by the noise that no function of single channels explains."""
        residual = rich_residual(FreeformFits(self.equations, self.blocks, first, self.scale.model(first)))
        kept = self.equations.kept
        edges = np.cumsum(self.equations.lengths)[:-1]
        self.equations.whiten(whitening_filter(np.split(residual * kept, edges)))
        white = rich_residual(FreeformFits(self.equations, self.blocks, first, self.scale.model(first))) * kept
        return Noise(float(np.sum(white**2) / kept.sum()), _inflation(white))

    def _candidates(self, settings: Settings) -> tuple[tuple[str, ...], dict[str, str]]:
        wanted = settings.effects if settings.effects is not None else tuple(catalogue())
        missing = {channel: why for r in (*self.recordings, *self.holdout) for channel, why in r.missing.items()}
        testable, untestable = [], {}
        for name in wanted:
            reason = next((missing[c] for c in get_effect(name).needs if c in missing), "")
            if name == "external_force" and len(self.recordings) > 1:
                reason = "a push belongs to one log; diagnose the logs one by one"
            if name == "constant_load" and any(_speed_open(r, self.model) for r in self.recordings):
                reason = "the log has no speed, and a constant added to the reconstructed one looks just like a load"
            if reason:
                untestable[name] = reason
            elif name not in self.model.effects:
                testable.append(name)
        return tuple(testable), untestable

    def _moves(self) -> bool:
        """Whether position and speed change by more than rounding."""
        for piece in (s.log for s in self.equations.stretches):
            if "velocity" in piece and float(np.abs(piece["velocity"]).max()) > 0.0:
                place = piece["position"] if "position" in piece else np.cumsum(piece["velocity"])
                if float(np.ptp(place)) > ROUNDING * max(float(np.abs(place).max()), 1e-300):
                    return True
        return False

    def _check_used(self) -> None:
        name = self.recordings[0].name
        short = [
            r.name for r in self.recordings if not any(p is s.log for p in r.pieces for s in self.equations.stretches)
        ]
        if short and self.equations.stretches:
            raise DataError(
                f"{short[0]}: no stretch is longer than {2 * self.equations.startup} samples", "leave it out"
            )
        if not self.equations.stretches:
            raise DataError(f"{name}: no stretch is long enough", "a longer log, or a smaller model.delay")
        if float(np.mean(self.equations.kept)) < LEAST_MOVING or not self._moves():
            raise DataError(f"{name}: the axis does not move", "a log with moves in both directions is needed")
        if not ranges(self.equations).drive > 0.0:
            raise DataError(f"{name}: u is 0 throughout", "set signals.u to the column with the control input")


def _check(recordings: Sequence[Recording], model: PlantModel) -> None:
    first = recordings[0]
    for other in recordings[1:]:
        if abs(other.sample_time - first.sample_time) > 0.1 * first.sample_time:
            raise UsageError(
                f"{other.name}: {other.sample_time:g} s between samples, {first.name} has {first.sample_time:g} s",
                "fit logs of one rate together",
            )
    for recording in recordings:
        for channel, effect in model.needs().items():
            if channel in recording.missing:
                raise DataError(f"{recording.name}: effect {effect} needs {channel}", recording.missing[channel])


def _term(name: str, values: object, inertia: float) -> Term:
    return Term.of(name, get_effect(name).to_columns(values, inertia)[1])  # type: ignore[arg-type]


def _inflation(white: Array) -> float:
    """Rows that count as one: 1 + 2 sum of the autocorrelation, over the lags that slow columns see."""
    x, n = white, len(white)
    lags = min(LAGS, n // 4)
    products = np.array([np.dot(x[: n - k], x[k:]) for k in range(lags)])
    return float(max(1.0, 1.0 + 2.0 * np.sum(products[1:]) / max(products[0], 1e-300)))


def _speed_open(recording: Recording, model: PlantModel) -> bool:
    """Whether a constant of the speed acts like a constant load: with damping, where the speed was reconstructed."""
    return "reconstructed" in recording.provenance.get("velocity", "") and _DAMPING in model.effects


_DAMPING = "viscous_friction"


def _without_load(recording: Recording, model: PlantModel, observer: ObserverSettings) -> Recording:
    """The reconstructed speed such that the model's damping needs no constant load beside it.

    Only where such a load explains what there is to explain: if another effect is missing, the load stands in for it.
    """
    if not _speed_open(recording, model):
        return recording
    for _ in range(2):
        equations = Equations([recording], observer, LEAST_DELAYS + 3)
        damping, load = Term(_DAMPING), Term("constant_load")
        blocks = lay_blocks(equations.lengths, 1, recording.name)
        fit = Solver(Bank(equations), blocks).best((damping, load), range(LEAST_DELAYS))
        least = float(np.sum(rich_residual(FreeformFits(equations, blocks, fit, PlantModel())) ** 2))
        coefficient = float(fit.coefficients(damping)[0])
        if fit.squares > MUCH_LEFT * least or not coefficient > 0.0:
            return recording
        recording = shifted(recording, -float(fit.coefficients(load)[0]) / coefficient)
    return recording
