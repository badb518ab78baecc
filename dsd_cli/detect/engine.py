"""The online detector: one sample, an array, or chunks of any size, with the same bits."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsd_cli.detect.grid import Grid
from dsd_cli.detect.kernel import Backend, make_kernel
from dsd_cli.detect.settings import OFFLINE, DetectorSettings
from dsd_cli.detect.spec import KernelSpec
from dsd_cli.errors import UsageError
from dsd_cli.signals.log import Array

if TYPE_CHECKING:
    from dsd_cli.detect.profile.changes import Change
    from dsd_cli.detect.profile.kernel import ProfileKernel
    from dsd_cli.detect.recursions import Decisions, Recursion


_new = tuple.__new__

#: Samples of history that a kernel may hold.
MOST_ROWS = 1e8


class Label(NamedTuple):
    """The state chosen at one sample."""

    state: int
    delay: float
    inertia: float
    log_likelihood: float
    probability: float
    confident: bool


class Forces(NamedTuple):
    """Forces of the model's effects in the interval that ends at each sample.

    applied, budget : shape (n, combinations of effect values), unit of u.
    sign : mean sign of the velocity, shape (n,); NaN at rest, infinite where the speed turns (it says nothing).
    """

    applied: Array
    budget: Array
    sign: Array


@dataclass(frozen=True)
class Labels:
    """The states chosen for n samples; every array has shape (n,).

    `log_likelihood` (of the chosen state, eq. 15) and `probability` are NaN where nothing could be judged (warm-up,
    missing sample); `confident` is False there. `estimates` is what method "profile" adds, () elsewhere.
    """

    grid: Grid
    state: NDArray[Any]
    log_likelihood: Array
    probability: Array
    confident: NDArray[Any]
    estimates: tuple[NDArray[Any], ...] = ()

    @property
    def delay(self) -> Array:
        """Delay of the chosen state, s."""
        return self.grid.axes["delay"][self.state]

    @property
    def inertia(self) -> Array:
        """Inertia of the chosen state."""
        return self.grid.axes["inertia"][self.state]


@dataclass(frozen=True)
class Measurement:
    """How d_hat was measured.

    Attributes
    ----------
    nominal_inertia : Jn of the observer.
    time_constant : tau of Q, s.
    sign : -1 where the log's d_hat has the opposite sign.
    aperture : 1, or 2 where d_hat was computed from position alone (it then averages two intervals).
    timed : every sample comes with a stamp, the clock is irregular.
    """

    sample_time: float
    nominal_inertia: float = 1.0
    time_constant: float = 0.01
    sign: int = 1
    aperture: int = 1
    timed: bool = False


class Engine:
    """Disturbance State Distinction, eq. 4-9 and 14-19.

    Parameters
    ----------
    grid : the candidate states.
    settings : tuning.
    measurement : sample time and observer behind d_hat.
    backend : "compiled" or "numpy"; None takes the fastest there is.

    Raises
    ------
    UsageError : a transition matrix that does not fit the grid; a window, or a history, that does not fit into memory.
    """

    def __init__(
        self, grid: Grid, settings: DetectorSettings, measurement: Measurement, backend: Backend | None = None
    ) -> None:
        if settings.transition.matrix is not None:
            settings.transition.log_matrix(len(grid))  # refuse a wrong matrix before any data is read
        self.grid, self.settings, self.measurement = grid, settings, measurement
        window = settings.effective_window
        if window * len(grid) > 1e8:
            raise UsageError(f"a window of {window} over {len(grid)} states needs too much memory", "reduce either")
        if settings.method == "average" and settings.average * len(grid) > 1e8:
            raise UsageError(
                f"an average of {settings.average} over {len(grid)} states needs too much memory", "reduce either"
            )
        self.spec = spec = KernelSpec(
            grid=grid,
            settings=replace(
                settings, window=window, observer_filter=settings.observer_filter and settings.output == "d_hat"
            ),
            alphas=measurement.nominal_inertia / np.array(grid.inertias),
            sample_time=measurement.sample_time,
            time_constant=measurement.time_constant,
            sign=float(measurement.sign),
            aperture=measurement.aperture,
            timed=measurement.timed,
        )
        if spec.warmup_time / spec.sample_time > MOST_ROWS:
            raise UsageError(
                f"the longest delay and five time constants are {spec.warmup_time:g} s, "
                f"{spec.warmup_time / spec.sample_time:.3g} samples",
                "no label could be given; is the unit of the time column right?",
            )
        self._floor = spec.log_likelihood_floor
        self._profile = self._make_profile()
        self._rows = 0
        self._kernel = make_kernel(spec, backend)
        self._delays, self._inertias = (grid.axes[name].tolist() for name in ("delay", "inertia"))
        self._recursion = self._make_recursion()
        self._step = self._kernel.step
        self._steps = settings.method == "dsd" and not measurement.timed and not grid.effects

    def _make_profile(self) -> ProfileKernel | None:
        if self.settings.method != "profile":
            return None
        from dsd_cli.detect.profile.kernel import ProfileKernel

        return ProfileKernel(self.spec)

    def _make_recursion(self) -> Recursion | None:
        if self.settings.method not in ("average", "imm", "combination"):
            return None
        from dsd_cli.detect import recursions

        if self.settings.method == "combination":
            from dsd_cli.detect.combination import Combined

            values = (self.grid.axes["delay"], self.grid.axes["inertia"])
            return Combined(self.settings, self.grid.axis_indices(), len(self.grid), self._floor, values)
        method = recursions.Averaged if self.settings.method == "average" else recursions.Mixed
        return method(self.settings, self.grid.axis_indices(), len(self.grid), self._floor)

    def restart(self) -> None:
        """Forget the history (a gap, a new recording); the last label stands until there is new evidence."""
        self._kernel.restart()
        if self._profile is not None:
            self._profile.restart()
        if self._recursion is not None:
            self._recursion.restart()

    @property
    def changes(self) -> list[Change]:
        """Changes of delay, inertia or effect values found so far (method "profile"); times as t, or in samples."""
        return [] if self._profile is None else self._profile.changes

    def step(self, u: float, d_hat: float) -> Label:
        """Take one sample of a regular clock, for a model without effects.

        Raises
        ------
        UsageError : a method that needs the whole log.
        """
        if not self._steps:
            return self._step_by_run(u, d_hat)
        state, ll, probability, confident = self._step(u, d_hat)
        # tuple.__new__ fills the named tuple in half the time of its own constructor
        return _new(Label, (state, self._delays[state], self._inertias[state], ll, probability, confident))

    def _step_by_run(self, u: float, d_hat: float) -> Label:
        if self.settings.method in OFFLINE:
            raise UsageError(
                f"method '{self.settings.method}' needs the whole log", "use dsd, average, imm or profile online"
            )
        labels = self.run(np.array([u]), np.array([d_hat]))
        state, ll = int(labels.state[0]), float(labels.log_likelihood[0])
        probability, confident = float(labels.probability[0]), bool(labels.confident[0])
        return Label(state, self._delays[state], self._inertias[state], ll, probability, confident)

    def run(
        self,
        u: Array,
        d_hat: Array | None = None,
        *,
        t: Array | None = None,
        forces: Forces | None = None,
        model: Array | None = None,
    ) -> Labels:
        """Take many samples: u and d_hat of shape (n,), or one array of shape (n, 2).

        `t` is needed on an irregular clock, `forces` where the model has effects. With the methods viterbi and
        smooth one call takes the whole log. `model`, shape (n, 1 + groups), is filled with y (NaN where nothing is
        judged) and z of every delay and combination of effect values; method "profile" leaves it as it is.
        """
        u = np.asarray(u, dtype=np.float64)
        if d_hat is None:
            u, d_hat = u[:, 0], u[:, 1]
        u, d_hat = np.ascontiguousarray(u), np.ascontiguousarray(d_hat, dtype=np.float64)
        if self.measurement.timed and t is None:
            raise UsageError("an irregular clock needs the stamps", "give t")
        if self.grid.effects and forces is None:
            raise UsageError("the grid has effect axes", "give the forces of every combination of their values")
        stamps = np.ascontiguousarray(t, dtype=np.float64) if self.measurement.timed else None
        if self._profile is not None:
            clock = self._rows + np.arange(float(len(u))) if t is None else np.asarray(t, dtype=np.float64)
            self._rows += len(u)
            return Labels(self.grid, *self._profile.run(clock, u, d_hat, stamps, *(forces or ())))
        n = len(u)
        matrix = None if self.settings.method == "dsd" else np.empty((n, len(self.grid)))
        state, confident = np.empty(n, dtype=np.int32), np.empty(n, dtype=np.uint8)
        ll, probability = np.empty(n), np.empty(n)
        force = (None, None, None) if forces is None else tuple(np.ascontiguousarray(a) for a in forces)
        self._kernel.run(u, d_hat, stamps, *force, matrix, state, ll, probability, confident, model)
        if matrix is not None:
            return Labels(self.grid, *self._from_likelihoods(matrix, confident))
        return Labels(self.grid, state, ll, probability, confident.view(np.bool_))

    def _from_likelihoods(self, matrix: Array, status: NDArray[Any]) -> Decisions:
        if self._recursion is not None:
            return self._recursion.feed(matrix, status)
        from dsd_cli.detect.recursions import whole_log

        return whole_log(self.settings, self.grid.axis_indices(), self._floor, matrix, status)
