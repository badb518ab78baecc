"""The detector of method "profile": windows of samples to fits, fits to labels; blocks of any size, the same bits."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsd_cli.detect.grid import Grid
from dsd_cli.detect.numpy_prediction import make_prediction
from dsd_cli.detect.profile.cells import Axis, Estimates, held, settled
from dsd_cli.detect.profile.changes import Change, ChangeTest, Evidence, Found, Side
from dsd_cli.detect.profile.colour import Colour
from dsd_cli.detect.profile.lattice import make_lattice
from dsd_cli.detect.profile.likelihood import Fit, Sums, fit
from dsd_cli.detect.profile.windowed import WindowedSums
from dsd_cli.detect.spec import KernelSpec
from dsd_cli.errors import UsageError
from dsd_cli.signals.log import Array

#: Numbers that one pass may hold in an array.
BLOCK = 1 << 18
#: Samples that a window needs, for two parameters and a residual.
LEAST_WINDOW = 10


class Profiled(NamedTuple):
    """What the detector says of n samples, each of shape (n,); `estimates` beside what every method gives."""

    state: NDArray[np.int32]
    log_likelihood: Array
    probability: Array
    confident: NDArray[np.bool_]
    estimates: Estimates


class ProfileKernel:
    """Profile likelihood over a window.

    Raises
    ------
    UsageError : a window too short, delays too far apart, or too much memory.
    """

    def __init__(self, spec: KernelSpec) -> None:
        grid, window = spec.grid, spec.settings.window
        self._lattice = lattice = make_lattice(grid, spec.sample_time)
        fine = Grid(tuple(lattice.delays.tolist()), grid.inertias[:1], grid.effects)
        self._spec, self._fine = spec, replace(spec, grid=fine, alphas=np.asarray(spec.alphas)[:1])
        self._shape = (lattice.delays.size, len(grid.combinations))
        self._width = 2 + self._shape[1] * (3 * lattice.delays.size - 1)
        if window < LEAST_WINDOW:
            raise UsageError(f'method "profile" with a window of {window}', f"it needs {LEAST_WINDOW} samples or more")
        if window * self._width > 1e8:
            raise UsageError(
                f"a window of {window} over {lattice.delays.size:,} delays needs too much memory", "reduce either"
            )
        self._known_alpha = float(spec.alphas[0]) if len(spec.alphas) == 1 else None
        self._delay_axis, self._alpha_axis = Axis(np.array(grid.delays)), Axis(np.asarray(spec.alphas, dtype=float))
        combos, inertias = len(grid.combinations), len(grid.inertias)
        group, inertia = divmod(spec.settings.initial, inertias)
        delay, self._combination = divmod(group, combos)
        self._ranks = [
            int(np.flatnonzero(self._delay_axis.order == delay)[0]),
            int(np.flatnonzero(self._alpha_axis.order == inertia)[0]),
        ]
        self._last = [np.nan] * 4
        self._changes = ChangeTest(spec.settings, self._shape, self._width, self._known_alpha, spec.pole)
        self.restart()

    def restart(self) -> None:
        """Forget the window; labels and estimates stand until there is new evidence."""
        self._prediction = make_prediction(self._fine)
        self._sums = WindowedSums(self._spec.settings.window, self._width)
        self._colour = Colour(self._spec.settings.window, self._shape)
        self._changes.restart()
        self._seen = 0

    def run(
        self,
        clock: Array,
        u: Array,
        d_hat: Array,
        t: Array | None,
        force: Any = None,
        budget: Any = None,
        sign: Any = None,
    ) -> Profiled:
        """The next n samples; arguments of shape (n,), forces of shape (n, combinations).

        `clock` : stamps to name changes by; `t` : stamps of an irregular clock.
        """
        rows = max(1, BLOCK // self._width)
        inputs = (clock, u, d_hat, t, force, budget, sign)
        return _joined(
            [
                self._pass(*(None if a is None else a[begin : begin + rows] for a in inputs))
                for begin in range(0, max(len(u), 1), rows)
            ]
        )

    def _pass(self, clock: Any, u: Any, d_hat: Any, *others: Any) -> Profiled:
        if len(u) == 0:
            return self._nothing(0)
        y, z, warm = self._prediction.run(u, d_hat, *others)
        cold = len(y) - warm
        before = self._nothing(cold)
        if warm == 0:
            return before
        missing = ~(np.isfinite(u) & np.isfinite(d_hat))[cold:]
        found = self._judge(clock[cold:], y[cold:], z[cold:].reshape(warm, *self._shape), missing)
        return _joined([before, found]) if cold else found

    def _nothing(self, n: int) -> Profiled:
        """Rows of the warm-up: what stood before them stands."""
        no = np.zeros(n, dtype=np.bool_)
        columns: list[Any] = [*(np.full(n, value) for value in self._last), no, no]
        state = np.full(n, self._states(self._ranks, self._combination), dtype=np.int32)
        return Profiled(state, np.full(n, np.nan), np.full(n, np.nan), no, Estimates(*columns))

    def _states(self, ranks: list[Any], combination: Any) -> Any:
        """Index on the grid of these ranks of delay and alpha."""
        delay, alpha = ranks
        combos, inertias = self._shape[1], len(self._spec.grid.inertias)
        return (self._delay_axis.order[delay] * combos + combination) * inertias + self._alpha_axis.order[alpha]

    @property
    def changes(self) -> list[Change]:
        """The changes found so far."""
        return [self._named(found) for found in self._changes.changes]

    def _named(self, found: Found) -> Change:
        """Lags and alphas as delays and inertias."""
        jn = self._fine.grid.inertias[0] * float(self._fine.alphas[0])
        sides = [
            Side(float(self._delay(side.lag)), jn / side.alpha if side.alpha > 0.0 else np.inf, side.combination)
            for side in (found.before, found.after)
        ]
        return Change(found.time, found.low, found.high, found.detected, found.nats, *sides)

    # -- one pass --------------------------------------------------------------------------------------------------

    def _judge(self, clock: Array, y: Array, z: Array, missing: NDArray[np.bool_]) -> Profiled:
        settings, spec = self._spec.settings, self._spec
        summed = self._sums.feed(self._products(y, z, missing))
        self._colour.feed(y, z, missing)
        sums = self._as_sums(summed)
        found = fit(sums, settings.rho, settings.confidence, self._known_alpha, self._colour.excess)
        self._changes.feed(Evidence(clock, y, z, missing, summed, found), self._as_sums)
        full = self._seen + np.arange(1, len(y) + 1) >= settings.window
        self._seen += len(y)
        log_likelihood = spec.log_likelihood_constant - found.square / (2.0 * settings.rho**2)
        explained = full & (log_likelihood >= spec.log_likelihood_floor) & ~missing
        delay, inertia = self._delay_sure(found) & explained, self._inertia_sure(found) & explained
        ranks, sure, combination = self._label(found, delay, inertia, explained)
        probability = self._probability(found, ranks)
        log_likelihood[missing], probability[missing] = np.nan, np.nan
        state = self._states(ranks, combination).astype(np.int32)
        return Profiled(state, log_likelihood, probability, sure, self._estimates(found, delay, inertia))

    def _products(self, y: Array, z: Array, missing: NDArray[np.bool_]) -> Array:
        """What is summed over the window, shape (n, width); a missing sample adds nothing."""
        n, (delays, combos) = len(y), self._shape
        products = np.empty((n, self._width))
        products[:, 0], products[:, 1] = y * y, 1.0
        wide = delays * combos
        products[:, 2 : 2 + wide] = (z * z).reshape(n, -1)
        products[:, 2 + wide : 2 + 2 * wide] = (z * y[:, None, None]).reshape(n, -1)
        products[:, 2 + 2 * wide :] = (z[:, 1:] * z[:, :-1]).reshape(n, -1)
        products[missing] = 0.0
        return products

    def _as_sums(self, sums: Array) -> Sums:
        """The same columns by name."""
        n, (delays, combos) = len(sums), self._shape
        wide = delays * combos
        zz, zy = (sums[:, 2 + i * wide : 2 + (i + 1) * wide].reshape(n, delays, combos) for i in (0, 1))
        return Sums(sums[:, 0], sums[:, 1], zz, zy, sums[:, 2 + 2 * wide :].reshape(n, delays - 1, combos))

    def _delay(self, lag: Any) -> Any:
        return self._lattice.delays[0] + lag * self._lattice.step

    def _delay_sure(self, found: Fit) -> NDArray[Any]:
        """The possible delays are within one spacing of the candidates, and not at an end that may hide others."""
        low, high = found.lag_range
        sure = (high - low) * self._lattice.step < self._lattice.spacing
        if self._lattice.open_below:
            sure &= low > 0.0
        if self._lattice.open_above:
            sure &= high < self._lattice.delays.size - 1
        return np.asarray(sure)

    def _inertia_sure(self, found: Fit) -> NDArray[Any]:
        """The possible inertias are within one spacing, and not for the only reason that the delays are bounded."""
        low, high = found.alpha_range
        with np.errstate(over="ignore"):
            width = high - low
        return np.asarray(
            (low > 0.0) & np.isfinite(found.alpha_std) & (width < self._alpha_axis.spacing_at(found.alpha))
        )

    def _label(
        self, found: Fit, delay: NDArray[np.bool_], inertia: NDArray[np.bool_], explained: NDArray[np.bool_]
    ) -> tuple[list[NDArray[np.intp]], NDArray[np.bool_], NDArray[np.intp]]:
        """Ranks of delay and alpha, whether both are confident, and the combination of effect values."""
        ranks, sure = [], delay & inertia & ~found.other_combination
        of_delay = (self._delay_axis, [self._delay(lag) for lag in (*found.lag_range, found.lag)], delay)
        of_alpha = (self._alpha_axis, [*found.alpha_range, found.alpha], inertia)
        for i, (axis, values, founded) in enumerate((of_delay, of_alpha)):
            low, high, nearest = (axis.cell(value) for value in values)
            rank = settled(low, high, nearest, founded, self._ranks[i])
            self._ranks[i] = int(rank[-1])
            sure &= (low == high) & (rank == nearest)
            ranks.append(rank)
        decided = held(found.combination, explained & ~found.other_combination, self._combination).astype(np.intp)
        self._combination = int(decided[-1])
        return ranks, sure, decided

    def _estimates(self, found: Fit, delay: NDArray[np.bool_], inertia: NDArray[np.bool_]) -> Estimates:
        """Held where not founded."""
        jn = self._fine.grid.inertias[0] * self._fine.alphas[0]
        with np.errstate(divide="ignore", invalid="ignore"):
            values = jn / found.alpha
            inertia_std = values * found.alpha_std / found.alpha
        now = (self._delay(found.lag), found.lag_std * self._lattice.step, values, inertia_std)
        flags = (delay, delay, inertia, inertia)
        columns: list[Any] = [held(*three) for three in zip(now, flags, self._last, strict=True)]
        self._last = [float(column[-1]) for column in columns]
        return Estimates(*columns, *[delay, inertia])

    def _probability(self, found: Fit, ranks: list[NDArray[np.intp]]) -> Array:
        """Share of the likelihood that falls into the label's cell: over the delays, times that over alpha."""
        from scipy.special import ndtr  # late: slow to import

        weights = np.exp(found.excess.min(axis=1, keepdims=True) - found.excess)
        mine = self._delay_axis.cell(self._lattice.delays)[None, :] == ranks[0][:, None]
        delay = (weights * mine).sum(axis=1) / weights.sum(axis=1)
        low, high = self._alpha_axis.borders(ranks[1])
        reach = 2.0 * np.sqrt(2.0 * self._spec.settings.confidence)
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            wide = np.subtract(*found.alpha_range[::-1]) / reach  # where no finite one is known
            std = np.where(np.isfinite(found.alpha_std), found.alpha_std, wide)
            inertia = ndtr((high - found.alpha) / std) - ndtr((low - found.alpha) / std)
        inertia = np.where(std > 0.0, inertia, (low <= found.alpha) & (found.alpha <= high))
        return np.nan_to_num(delay * inertia)


def _joined(parts: list[Profiled]) -> Profiled:
    columns: list[Any] = [np.concatenate(column) for column in zip(*(part[:4] for part in parts), strict=True)]
    estimates: list[Any] = [np.concatenate(column) for column in zip(*(part.estimates for part in parts), strict=True)]
    return Profiled(*columns, *[Estimates(*estimates)])
