"""How well one model predicts, and where it fails: the answer of `dsd compare`."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

from dsd_cli.identify.compare.balance import Balance, ForceView, Left, balance_of, left_of_d_hat, left_of_forces
from dsd_cli.identify.compare.dependence import Dependence, dependence
from dsd_cli.identify.compare.evaluation import Accuracy, Evaluation, accuracy, evaluate
from dsd_cli.identify.compare.regimes import Where, where
from dsd_cli.identify.compare.residuals import LARGE, ResidualTests, residual_tests
from dsd_cli.identify.recordings.recording import Recording
from dsd_cli.plant.model import ObserverSettings, PlantModel
from dsd_cli.signals.rounding import ROUNDING
from dsd_cli.signals.units import Units

#: Fewest lags of the residual's correlations.
LAGS = 100
#: What the residual is, if it depends on no channel.
BIAS, MEMORY, COMMAND, NOISE, SHORT, EXACT = "bias", "memory", "command", "noise", "short", "exact"
NO_BALANCE = "no balance"
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

    accuracy : over all logs; `by_log` for each. force : the balance of forces over all logs.
    holdout : accuracy on the log set aside, None without one.
    skipped : samples at the start of stretches that depend on unlogged u (`lead` s); excluded.
    where, dependence, bias_share : of what is left of the balance of forces in its band (`where_of` "force"); where
        there is none, `where` and `bias_share` are of "d_hat" (`force.missing` says why), and there is no dependence.
    residual : tests on d_hat.
    conclusion : channel on which the error depends most ("direction", "velocity x position"), or one of `BIAS`
        (a constant), `MEMORY` (its own past), `COMMAND` (u, but not as a function of it: dynamics), `NOISE`, `EXACT`
        (rounding); `SHORT` where the log is too short to say, `NO_BALANCE` where no force is seen.
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
    bias_share: float
    where_of: str
    conclusion: str
    model: PlantModel
    provenance: Mapping[str, str] = field(default_factory=dict)
    missing: Mapping[str, str] = field(default_factory=dict)
    units: Units = field(default_factory=Units)


@dataclass(frozen=True)
class Series:
    """What a comparison was made of, for its picture; `balance` : None where there is none. `aside` : held out."""

    evaluation: Evaluation
    balance: Balance | None
    aside: Evaluation | None = None


def compare(
    recordings: Sequence[Recording],
    model: PlantModel,
    observer: ObserverSettings,
    window: int = LAGS,
    holdout: Recording | None = None,
    progress: Callable[[str, float], None] = lambda _what, _share: None,
) -> tuple[Comparison, Series]:
    """The comparison, and the series that it was made of.

    window : samples over which the rig's detector averages: how far the tests of d_hat look.
    progress : called with what is being done and the share that is done.

    Raises DataError : see `evaluate`.
    """
    progress("predicting", 0.0)
    evaluation = evaluate(recordings, model, observer)
    apart = None if holdout is None else evaluate([holdout], model, observer)
    errors, commands = zip(*((s.errors, s.judged(s.log["u"])) for s in evaluation.stretches), strict=True)
    tests = residual_tests(errors, commands, evaluation.sample_time, max(LAGS, window))
    progress("weighing the balance of forces", 0.1)
    balance = balance_of(recordings, model)
    progress("on what the error depends", 0.4)
    total, left = accuracy(evaluation), left_of_d_hat(evaluation)
    force, found = ForceView(None, None, balance if isinstance(balance, str) else ""), tuple[Dependence, ...]()
    if isinstance(balance, Balance):
        force, found, left = balance.view(holdout), dependence(balance), left_of_forces(balance, observer.time_constant)
    names = tuple(dict.fromkeys(s.name for s in evaluation.stretches))
    comparison = Comparison(
        logs=tuple(r.name for r in recordings),
        sample_time=evaluation.sample_time,
        accuracy=total,
        force=force,
        by_log=tuple(LogAccuracy(name, accuracy(evaluation.of(name))) for name in names),
        holdout=None if holdout is None or apart is None else LogAccuracy(holdout.name, accuracy(apart)),
        skipped=evaluation.skipped,
        lead=evaluation.lead,
        residual=tests,
        where=where(left),
        dependence=found,
        bias_share=left.bias_share,
        where_of="force" if isinstance(balance, Balance) else "d_hat",
        conclusion=_conclusion(total, left, tests, found, isinstance(balance, Balance)),
        model=model,
        provenance=dict(recordings[0].provenance),
        missing=dict(recordings[0].missing),
    )
    return comparison, Series(evaluation, balance if isinstance(balance, Balance) else None, apart)


def _conclusion(total: Accuracy, left: Left, tests: ResidualTests, found: Sequence[Dependence], balanced: bool) -> str:
    """The channel that explains most, if that is enough of the whole error; then a constant; then the tests."""
    if total.rmse == 0.0 or (total.fit_percent or 0.0) / 100.0 >= 1.0 - ROUNDING:
        return EXACT
    if found and found[0].explains * (1.0 - left.bias_share) >= LARGE:
        shares = {d.on: d.explains for d in found}
        if found[0].on == "velocity" and shares["direction"] >= found[0].explains - _MORE_BY_SPEED:
            return "direction"
        return found[0].on
    if left.bias_share >= LARGE:
        return BIAS
    if not found:
        return SHORT if balanced else NO_BALANCE
    if tests.follows_u:
        return COMMAND
    return MEMORY if tests.remembers else NOISE
