"""How well one model predicts, where it fails, and on what the residual depends: the answer of `dsd compare`.

On a channel it depends by as much as a free-form function of it explains on held-out blocks: of the residual of the
balance of forces, in the band; functions and blocks are those of `fit.freeform`. A share above zero is one that held:
the function was fitted elsewhere in the log.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations

import numpy as np

from dsd_cli.identify.compare.balance import (
    Balance,
    ForceView,
    Left,
    acceleration,
    balance_of,
    left_of_d_hat,
    left_of_forces,
)
from dsd_cli.identify.compare.evaluation import Accuracy, Evaluation, accuracy, evaluate
from dsd_cli.identify.compare.regimes import Where, where
from dsd_cli.identify.compare.residuals import LARGE, ResidualTests, residual_tests
from dsd_cli.identify.fit.bank import drive, inputs_of
from dsd_cli.identify.fit.basis import basis
from dsd_cli.identify.fit.blocks import Blocks, grams, lay_blocks, losses, solve
from dsd_cli.identify.fit.equations import Equations
from dsd_cli.identify.fit.freeform import BENDS, HATS, HATS_IN_PAIR, Piece, piece_of
from dsd_cli.identify.fit.values import terms_of
from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.recordings.recording import Recording
from dsd_cli.plant.model import ObserverSettings, PlantModel
from dsd_cli.signals.log import Array
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


#: Hats for what repeats along the position.
FINE_HATS = 48
#: The time is cut into held-out blocks itself: its hats must be wider than these.
TIME_HATS = 5
#: A pair is named if it explains so much more than either channel alone.
PAIR_GAIN = 0.05
#: Penalty on the size of the function, as a share of the mean information on a hat.
_SIZE = 1e-6
#: Held-out blocks at most: long ones, for a function of two channels must be met in the others.
MOST_BLOCKS = 20
#: Of fewer rows that count nothing is said.
FEWEST_ROWS = 60


@dataclass(frozen=True)
class Dependence:
    """`explains`: share of the residual's variance, on held-out blocks, that a function of the channels `on` takes."""

    channels: tuple[str, ...]
    explains: float

    @property
    def on(self) -> str:
        """`velocity`, or `velocity x position` for a pair."""
        return " x ".join(self.channels)


@dataclass(frozen=True)
class Channels:
    """What free-form functions look at: velocity, position, u (delayed), acceleration, time of every stretch."""

    equations: Equations
    pieces: tuple[Piece, ...]

    @property
    def names(self) -> list[str]:
        """Those that all stretches have, and that vary."""
        found = ("velocity", "position", "u", "acceleration", "time")
        return [n for n in found if all(n in p.values and np.ptp(p.values[n]) > 0.0 for p in self.pieces)]

    def columns(self, channels: Sequence[str], hats: int | None = None) -> tuple[list[Array], Array]:
        """Hats of one channel (of `names`, or "direction" for sgn v alone), or of two together (tensor product), as
        rows, and the penalty on their bends; `hats` : per channel."""
        count = hats or (HATS if len(channels) == 1 else HATS_IN_PAIR)
        counts = [min(count, TIME_HATS) if c == "time" else count for c in channels]
        units, penalty = basis(self.pieces, channels, counts)
        every = ([one.column(i) for one in units] for i in range(units[0].size))
        return [self.equations.acting(x, smooth=False, held=True)[self.equations.kept] for x in every], penalty


def channels_of(equations: Equations, model: PlantModel) -> Channels:
    """Of every stretch, per interval; the acceleration as wide as a period of the band's end."""
    pieces = []
    for stretch, u in zip(equations.stretches, drive(equations, inputs_of(terms_of(model)), model.delay), strict=True):
        piece = piece_of(stretch, u)
        slope = acceleration(stretch.log, 0.5 / equations.band.hz)
        pieces.append(Piece({**piece.values, "acceleration": slope}, piece.sign))
    return Channels(equations, tuple(pieces))


def explained_share(
    residual: Array, columns: Sequence[Array], penalty: Array, blocks: Blocks, least: float = 0.0
) -> float:
    """Share of the residual's variance about its mean that the columns explain on blocks that the fit did not see: at
    most 1, below 0 where the fit only harms.

    least : rms of a residual that matters; of one below it the share is that of `least`.
    """
    before, found = (grams([residual, *rows], blocks) for rows in ([np.ones(len(residual))], columns))
    around_mean = float(losses(solve(before.fitted), before, blocks).sum())
    theta = np.stack([_solved(gram, penalty) for gram in found.fitted])
    left = float(losses(theta, found, blocks).sum())
    whole = max(around_mean, len(residual) * least**2)
    return (around_mean - left) / whole if whole > 0.0 else 0.0


def _solved(gram: Array, penalty: Array) -> Array:
    """Weights of the hats: those over places that the axis hardly met bend with the others."""
    inner = gram[1:, 1:]
    ridge = float(np.trace(inner)) / len(inner) * (BENDS * penalty + _SIZE * np.eye(len(inner)))
    return np.asarray(np.linalg.solve(inner + ridge + 1e-300 * np.eye(len(inner)), gram[1:, 0]))


def dependence(balance: Balance) -> tuple[Dependence, ...]:
    """Every channel, and pairs that explain more than theirs; largest share first, none below 0; () if too short."""
    errors = balance.excerpt
    residual, channels = errors.rows_of_model(balance.model), channels_of(errors.equations, balance.model)
    lengths = [int(kept.sum()) for kept in errors.equations.by_stretch(errors.equations.kept)]
    if len(residual) < FEWEST_ROWS:
        return ()
    blocks = lay_blocks(lengths, POLICY.gap_rows, balance.problem.recordings[0].name, MOST_BLOCKS)

    def share(*on: str, hats: int | None = None) -> float:
        return explained_share(residual, *channels.columns(on, hats), blocks, balance.least)

    alone = {name: share(name) for name in ("direction", *channels.names)}
    if "position" in alone:
        alone["position"] = max(alone["position"], share("position", hats=FINE_HATS))
    found = [Dependence((name,), max(value, 0.0)) for name, value in alone.items()]
    if max(alone.values()) < 1.0 - PAIR_GAIN:
        found += _pairs(alone, channels.names, share)
    return tuple(sorted(found, key=lambda d: -d.explains))


def _pairs(alone: dict[str, float], names: Sequence[str], share: Callable[..., float]) -> list[Dependence]:
    """Pairs that explain more than either channel; not u with the acceleration, of which any r is a function."""
    pairs = [pair for pair in combinations(names, 2) if pair != ("u", "acceleration")]
    found = [Dependence(pair, share(*pair)) for pair in pairs]
    return [d for d in found if d.explains >= max(*(alone[name] for name in d.channels), 0.0) + PAIR_GAIN]
