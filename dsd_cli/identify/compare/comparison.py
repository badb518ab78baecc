"""How well one model predicts, and where it fails: the answer of `dsd compare`."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

from dsd_cli.identify.compare.dependence import Dependence, dependence
from dsd_cli.identify.compare.evaluation import Accuracy, Evaluation, ForceView, accuracy, evaluate, force_view
from dsd_cli.identify.compare.regimes import Where, where
from dsd_cli.identify.compare.residuals import LARGE, ResidualTests, residual_tests
from dsd_cli.identify.recordings.recording import Recording
from dsd_cli.plant.model import ObserverSettings, PlantModel
from dsd_cli.signals.units import Units

#: Fewest lags of the residual's correlations.
LAGS = 100
#: What the residual is, if it depends on no channel.
BIAS, MEMORY, COMMAND, NOISE, SHORT, EXACT = "bias", "memory", "command", "noise", "short", "exact"
#: Below this share of d_hat the error is rounding.
_ROUNDING = 1e-9
#: A dependence on the direction stands for one on the velocity unless the speed explains so much more.
_MORE_BY_SPEED = 0.02


@dataclass(frozen=True)
class LogAccuracy:
    """One log of several."""

    log: str
    accuracy: Accuracy


@dataclass(frozen=True)
class Comparison:
    """One model on one or more logs.

    Attributes
    ----------
    accuracy : over all logs; `by_log` for each. force : the balance of forces over all logs.
    holdout : accuracy on the log set aside, None without one.
    skipped : samples at the start of stretches that depend on unlogged u (`lead` s); excluded.
    conclusion : channel on which the error depends most ("direction", "velocity x position"), or one of `BIAS`
        (a constant), `MEMORY` (its own past), `COMMAND` (u, but not as a function of it: dynamics), `NOISE`, `EXACT`
        (rounding); `SHORT` where the log cannot tell.
    provenance : channel -> where it is from, of the first log.
    """

    logs: tuple[str, ...]
    sample_time: float
    accuracy: Accuracy
    force: ForceView
    by_log: tuple[LogAccuracy, ...]
    holdout: LogAccuracy | None
    skipped: int
    lead: float
    residual: ResidualTests
    where: Where
    dependence: tuple[Dependence, ...]
    conclusion: str
    model: PlantModel
    provenance: Mapping[str, str] = field(default_factory=dict)
    missing: Mapping[str, str] = field(default_factory=dict)
    units: Units = field(default_factory=Units)


def compare(
    recordings: Sequence[Recording],
    model: PlantModel,
    observer: ObserverSettings,
    window: int = LAGS,
    holdout: Recording | None = None,
    progress: Callable[[str, float], None] = lambda _what, _share: None,
) -> tuple[Comparison, Evaluation]:
    """The comparison, and the series that it was made of (for a plot).

    Parameters
    ----------
    window : samples over which the rig's detector averages: how far the tests look, and the gap to held-out blocks.
    progress : called with what is being done and the share that is done.

    Raises
    ------
    DataError : see `evaluate`.
    """
    progress("predicting", 0.0)
    evaluation = evaluate(recordings, model, observer)
    aside = None
    if holdout is not None:
        aside = LogAccuracy(holdout.name, accuracy(evaluate([holdout], model, observer)))
    errors, commands = zip(*((s.errors, s.judged(s.log["u"])) for s in evaluation.stretches), strict=True)
    tests = residual_tests(errors, commands, evaluation.sample_time, max(LAGS, window))
    progress("on what the error depends", 0.05)
    total, found = accuracy(evaluation), dependence(evaluation, window)
    progress("weighing the balance of forces", 0.4)
    names = tuple(dict.fromkeys(s.name for s in evaluation.stretches))
    comparison = Comparison(
        logs=tuple(r.name for r in recordings),
        sample_time=evaluation.sample_time,
        accuracy=total,
        force=force_view(recordings, model, holdout),
        by_log=tuple(LogAccuracy(name, accuracy(evaluation.of(name))) for name in names),
        holdout=aside,
        skipped=evaluation.skipped,
        lead=evaluation.lead,
        residual=tests,
        where=where(evaluation),
        dependence=found,
        conclusion=_conclusion(total, tests, found),
        model=model,
        provenance=dict(recordings[0].provenance),
        missing=dict(recordings[0].missing),
    )
    return comparison, evaluation


def _conclusion(total: Accuracy, tests: ResidualTests, found: Sequence[Dependence]) -> str:
    """The channel that explains most, if that is enough of the whole error; then a constant; then the tests."""
    if total.rmse == 0.0 or (total.fit_percent or 0.0) >= 100.0 * (1.0 - _ROUNDING):
        return EXACT
    if found and found[0].explains * (1.0 - total.bias_share) >= LARGE:
        shares = {d.on: d.explains for d in found}
        if found[0].on == "velocity" and shares["direction"] >= found[0].explains - _MORE_BY_SPEED:
            return "direction"
        return found[0].on
    if total.bias_share >= LARGE:
        return BIAS
    if not found:
        return SHORT
    if tests.follows_u:
        return COMMAND
    return MEMORY if tests.remembers else NOISE
