"""Force and acceleration at the full rate, whitened causally, for questions above the band of the balance.

There the question is asked as an output error: u and the known forces are exact, the noise is in the acceleration
alone. The noise is whitened causally: u depends on the noise of earlier samples through the controller, and a filter
without phase would mix both.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from dsd_cli.effects import Role
from dsd_cli.effects.memory import one_pole
from dsd_cli.identify.fit.bank import INERTIA, SHARE, drive, has_friction, inputs_of, of_single_logs, raw_columns
from dsd_cli.identify.fit.row_weights import autocorrelation, inflation, linear_prediction
from dsd_cli.identify.fit.solve import Fit
from dsd_cli.identify.fit.stretches import Stretch
from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.search.sets import Search
from dsd_cli.signals.log import Array

#: s that a response needs to forget what was before a stretch, and the share of a stretch that it may take at most.
_FORGOTTEN, _MOST_FORGOTTEN = 0.3, 0.2
#: Lags over which a residual's correlation is summed; rows below which nothing is asked.
_LAGS, _FEWEST = 200, 1000
#: Blocks that have to agree.
BLOCKS = 40
#: s of the past from which noise of any spectrum is predicted; ridge of its correlation, as a share of the variance.
_PREDICTED, _RIDGE = 0.025, 1e-6
#: Rows for each value of such a prediction.
_PER_LAG = 20
#: Frequencies that are looked at for a line, per bin of the spectrum.
_FINER = 8


@dataclass(frozen=True)
class Signals:
    """Net force and acceleration of some stretches at the full rate; lists hold one array of shape (n,) per stretch.

    force, shift : F = u(t - L) + forces per interval, and its change over a sample of delay; unit of u.
    given : per coefficient of the other effects, what F loses with it. target : whitened J a, kept rows of all
        stretches. inertia : that J.
    kept : rows that count. white : the causal filter. step : s. held : there is friction.
    """

    stretches: tuple[Stretch, ...]
    force: list[Array]
    shift: list[Array]
    given: list[list[Array]]
    target: Array
    inertia: float
    kept: list[NDArray[np.bool_]]
    white: Callable[[Array], Array]
    step: float
    held: bool

    @property
    def sliding(self) -> NDArray[np.bool_]:
        """Rows, shape (n,), without stops and turns, if they are many: where friction jolts, high up as well."""
        sure = [s.surely_sliding | (not self.held) for s in self.stretches]
        doubt, one = (self.rows([np.where(x, there, 1.0) for x in sure]) for there in (0.0, 1.0))
        found = doubt <= POLICY.unsure_share * one
        return found if found.mean() > POLICY.sure_part else found | True

    def rows(self, parts: Sequence[Array]) -> Array:
        """Per interval -> as the acceleration averages it, whitened, kept rows of all stretches."""
        pairs = zip(self.stretches, parts, self.kept, strict=True)
        return np.concatenate([self.white(s.averaged(x, False))[k] for s, x, k in pairs])


def delay_of(search: Search, fit: Fit) -> float:
    """The delay of a fit, s."""
    return (fit.tap + min(max(float(fit.total[SHARE]), 0.0), 1.0)) * search.solver.bank.tap_time


def signals_of(search: Search, fit: Fit, delay: float, fewest: int = _FEWEST) -> Signals | None:
    """The signals beside the effects of a fit, u that late (s); None where too few rows are left."""
    equations = search.problem.errors.bank.equations.in_full()
    step, noise = equations.sample_time, equations.recordings[0].sensor.noise
    held, inputs = has_friction(fit.terms), inputs_of(fit.terms)
    u, before, after = (drive(equations, inputs, d) for d in (delay, max(delay - step, 0.0), delay + step))
    for _, taken in of_single_logs(equations, delay):
        u = [x - force for x, force in zip(u, taken, strict=True)]
    columns = {t: raw_columns(equations, t, delay) for t in fit.terms if t.effect.role is not Role.INPUT}
    others = [x for t, c in columns.items() if t.effect.role is not Role.STRUCTURE for x in c]
    given: list[list[Array]] = [[] for _ in others]
    force, shift, kept = [], [], []
    for i, s in enumerate(equations.stretches):
        net = u[i]
        for t, by_coefficient in columns.items():
            net = net - sum(c * x[i] for c, x in zip(fit.coefficients(t), by_coefficient, strict=True))
        free = s.free if held else np.ones(len(net))
        force.append(np.nan_to_num(net) * free)
        for x, by_stretch in zip(given, others, strict=True):
            x.append(by_stretch[i] * free)
        shift.append(np.nan_to_num(0.5 * (before[i] - after[i])) * free)
        rows = np.arange(len(net))
        kept.append((rows >= equations.startup + min(_FORGOTTEN / step, _MOST_FORGOTTEN * len(rows))) & (free > 0.0))
    inertia = float(fit.total[INERTIA])
    white = _whitener(noise.kind, noise.pole, math.exp(-2.0 * math.pi * equations.band.hz * step))
    if sum(int(k.sum()) for k in kept) < fewest or not inertia > 0.0:  # u turned round leaves no inertia
        return None
    target = _target(equations.stretches, kept, white, inertia)
    return Signals(equations.stretches, force, shift, given, target, inertia, kept, white, step, held)


def softened(signals: Signals, hz: float) -> Signals:
    """The same with less of what lies above that frequency."""
    keep = math.exp(-2.0 * math.pi * hz * signals.step)

    def white(x: Array) -> Array:
        return one_pole(np.full(len(x), keep), (1.0 - keep) * signals.white(x), 0.0)

    target = _target(signals.stretches, signals.kept, white, signals.inertia)
    return replace(signals, white=white, target=target)


def _target(
    stretches: Sequence[Stretch], kept: Sequence[NDArray[np.bool_]], white: Callable[[Array], Array], inertia: float
) -> Array:
    return np.concatenate([inertia * white(s.acceleration)[k] for s, k in zip(stretches, kept, strict=True)])


def _whitener(kind: str, pole: float, keep: float) -> Callable[[Array], Array]:
    """Undoes the differences that made the noise of a sensor blue, down to the band of the balance.

    kind, pole : of the sensor's noise. keep : pole that ends the integration.
    """
    poles = {"position": (keep, keep), "velocity": (keep,), "d_hat": (pole,)}[kind]

    def white(x: Array) -> Array:
        for p in poles:
            x = one_pole(np.full(len(x), p), x, 0.0)
        return x

    return white


def strongest_line(signals: Signals, rest: Array, lowest: float = 0.0) -> float:
    """The strongest line, Hz, from `lowest` on, in the spectrum of `rest`, kept rows of shape (n,)."""
    size = _FINER * (1 << (max(len(k) for k in signals.kept) - 1).bit_length())
    ends = np.cumsum([int(k.sum()) for k in signals.kept])[:-1]
    power = np.zeros(size // 2 + 1)
    for k, part in zip(signals.kept, np.split(rest, ends), strict=True):
        whole = np.zeros(len(k))
        whole[k] = part
        power += np.abs(np.fft.rfft(whole, size)) ** 2
    power[: math.ceil(lowest * size * signals.step)] = 0.0
    return int(np.argmax(power)) / (size * signals.step)


def without_line(signals: Signals, hz: float) -> Callable[[Array], Array]:
    """Takes out of rows, shape (n, ...), a line, stretch by stretch.

    What pushes the axis at one frequency is fed back into u, and a lightly damped load would explain it.
    """
    angle = 2.0 * np.pi * hz * signals.step
    ends = np.cumsum([int(k.sum()) for k in signals.kept])[:-1]
    bases = []
    for k in signals.kept:
        n = np.flatnonzero(k)
        tone = np.exp(1j * angle * n)
        drift = n / max(len(k), 1) * tone  # the frequency lies between two that were looked at
        bases.append(np.linalg.qr(np.stack([tone.real, tone.imag, drift.real, drift.imag], axis=1))[0])

    def calm(rows: Array) -> Array:
        parts = zip(np.split(rows, ends), bases, strict=True)
        return np.concatenate([part - basis @ (basis.T @ part) for part, basis in parts])

    return calm


def innovations(rest: Array, step: float, counted: NDArray[np.bool_] | None = None) -> Callable[[Array], Array]:
    """The filter that takes out of rows, shape (n, ...), what the past of `rest`, shape (n,), predicts of it; `counted`
    ones alone, shape (n,), come out.

    At constant speed an encoder's error is a tone, which a controller feeds back into u: this noise is far from white,
    and a lightly damped load would explain it. Each speed has its own tones: each part of the rows has its own filter.
    """
    order = max(int(_PREDICTED / step), 1)
    pieces = max(len(rest) // (_PER_LAG * order), 1)
    edges = np.linspace(order, len(rest), pieces + 1).astype(int).tolist()
    parts = [(a - order, b, _taps(rest[a - order : b], order)) for a, b in itertools.pairwise(edges)]

    def fresh(rows: Array) -> Array:
        # to the last bit `scipy.signal.lfilter`, whose import takes a third of a second
        found = [np.apply_along_axis(np.convolve, 0, rows[a:b], taps, "valid") for a, b, taps in parts]
        return np.concatenate(found)[... if counted is None else counted[order:]]

    return fresh


def _taps(rest: Array, order: int) -> Array:
    """Of the filter that predicts, with 1 in front."""
    correlation = autocorrelation(rest, order + 1)
    correlation[1:] /= 1.0 + _RIDGE
    return np.append(1.0, -linear_prediction(correlation)[0])


def left(columns: Array, target: Array) -> Array:
    """What a least-squares fit of columns, shape (n, p), leaves, shape (n,)."""
    return np.asarray(target - columns @ coefficients(columns, target))


def coefficients(columns: Array, target: Array) -> Array:
    """Least squares, shape (p,)."""
    gram = columns.T @ columns
    size = np.maximum(np.sqrt(gram.diagonal()), 1e-300)
    return np.asarray(np.linalg.lstsq(gram / size / size[:, None], columns.T @ target / size, rcond=1e-12)[0] / size)


def correlation_time(rest: Array) -> float:
    """Integrated autocorrelation time, rows."""
    return inflation(rest, _LAGS)


def variance_of(rest: Array) -> float:
    """Of a row, times the integrated autocorrelation time."""
    return float(np.mean(rest**2)) * correlation_time(rest)


def gains(worse: Array, better: Array) -> Array:
    """Nats per block that one residual gains over another, shape (BLOCKS,); blocks hold equal parts of what
    distinguishes them, so that one quick move counts as much as a long record of slow ones."""
    told = np.cumsum((worse - better) ** 2)
    edges = np.searchsorted(told, np.linspace(0.0, float(told[-1]), BLOCKS + 1)[1:-1])
    nats = (worse**2 - better**2) / max(2.0 * variance_of(better), 1e-300)
    return np.array([part.sum() for part in np.split(nats, edges)])


def enough(by_block: Array) -> bool:
    """Whether that many nats are certain: also without the best block."""
    return float(by_block.sum() - by_block.max()) > POLICY.response_nats
