"""A session that remembers what a picture of it shows, in memory that does not grow with the log."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from dsd_cli.detect.coloured import SensorNoise
from dsd_cli.detect.engine import Labels
from dsd_cli.detect.kernel import Kernel, likelihoods, make_kernel
from dsd_cli.detect.numpy_prediction import make_prediction
from dsd_cli.detect.plan import Plan
from dsd_cli.detect.rows import Inputs, Rows
from dsd_cli.detect.session import Session
from dsd_cli.detect.spec import WARMUP, KernelSpec
from dsd_cli.detect.tracks import Means, Onward, Track
from dsd_cli.signals.cleaning import Cleaner, Piece
from dsd_cli.signals.log import Array

#: Likelihoods that are held at once.
_AT_ONCE = 4_000_000


@dataclass(frozen=True)
class Seen:
    """What `WatchedSession` saw; times are stamps, s, going on where another recording begins anew.

    Attributes
    ----------
    lines : name -> (times, values) with a NaN where time does not go on: u, d_hat, predicted (d_hat of the state
        chosen), unexplained (the difference), and per axis of the grid its label; `true_<axis>` where the log knows it;
        `<axis>_estimate` of method "profile", with `<axis>_low` and `<axis>_high` two standard deviations off.
    confident : (times, share of confident labels). likelihoods : (times, probability of each state), shape (m, states),
        the states taken for equally likely before; NaN in the warm-up.
    restarts : where another recording begins.
    """

    lines: Mapping[str, tuple[Array, Array]]
    confident: tuple[Array, Array]
    likelihoods: tuple[Array, Array]
    restarts: tuple[float, ...]

    def since(self, origin: float) -> Seen:
        """The same with stamps counted from there."""
        lines = {name: (t - origin, x) for name, (t, x) in self.lines.items()}
        (sure_t, sure), (likely_t, likely) = self.confident, self.likelihoods
        again = tuple(at - origin for at in self.restarts)
        return Seen(lines, (sure_t - origin, sure), (likely_t - origin, likely), again)


class WatchedSession(Session):
    """Labels as `Session` does; `seen` gives what a picture needs."""

    def __init__(self, plan: Plan, cleaner: Cleaner) -> None:
        super().__init__(plan, cleaner)
        self._tracks: dict[str, Track] = {}
        self._confident, self._likelihoods = Means(1), Means(len(plan.grid))
        self._kernel: Kernel | None = None
        self._prediction: Any = None
        self._raw: list[tuple[Array, Array]] = []
        self._of_rows, self._of_samples = Onward(), Onward()

    def seen(self) -> Seen:
        """All so far."""
        lines = {name: track.line() for name, track in self._tracks.items()}
        at, share = self._confident.columns()
        return Seen(lines, (at, share[:, 0]), self._likelihoods.columns(), tuple(self._of_samples.restarts))

    def watch(self, rows: Rows, truth: Mapping[str, Array]) -> None:
        """Labels of the next rows, as they go to the user, and the truth columns of these rows."""
        stamped = np.isfinite(np.asarray(rows.t, dtype=np.float64))
        t = self._of_rows.placed(rows.t[stamped])
        columns = {name: values[rows.state] for name, values in self.plan.grid.axes.items()} | dict(truth)
        for name, value, spread in zip(("delay", "inertia"), rows.estimates[:4:2], rows.estimates[1:4:2], strict=False):
            columns |= {
                f"{name}_estimate": value,
                f"{name}_low": value - 2 * spread,
                f"{name}_high": value + 2 * spread,
            }
        for name, column in columns.items():
            self._track(name).add(t, column[stamped])
        self._confident.add(t, rows.confident[stamped, None].astype(np.float64))

    # -- what goes into the engine ---------------------------------------------------------------------------------

    def _restart(self) -> None:
        super()._restart()
        self._prediction = None
        if self._kernel is not None:
            self._kernel.restart()
        for track in self._tracks.values():
            track.interrupt()

    def _inputs(self, piece: Piece) -> Inputs:
        inputs = super()._inputs(piece)
        friction = self._friction
        turned = np.zeros(inputs.u.size)
        if inputs.forces is not None and friction is not None and friction.turning.any():
            turned = self.plan.observer.sign * friction.turning
        self._raw.append((piece.values["u"], turned))
        return inputs

    def _run_inputs(self, inputs: Inputs) -> Labels:
        labels = super()._run_inputs(inputs)
        command, turned = (np.concatenate(parts) for parts in zip(*self._raw, strict=True))
        self._raw = []
        size = max(_AT_ONCE // len(self.plan.grid), 256)
        for begin in range(0, inputs.u.size, size):
            part = slice(begin, begin + size)
            self._note(_cut(inputs, part), labels.state[part], command[part], turned[part])
        return labels

    def _note(self, inputs: Inputs, state: Array, command: Array, turned: Array) -> None:
        """Of the next samples; `command` : u as it was logged, `turned` : what was taken out of d_hat."""
        t = self._of_samples.placed(inputs.t)
        buffers = (inputs.u, inputs.d_hat, inputs.t if self._spec.timed else None, *(inputs.forces or (None,) * 3))
        self._track("u").add(t, command)
        self._track("d_hat").add(t, inputs.d_hat + turned)
        residual = self._residual(buffers, state)
        self._track("predicted").add(t, inputs.d_hat + turned - residual)
        self._track("unexplained").add(t, residual)
        self._likelihoods.add(t, self._probabilities(buffers))

    @property
    def _spec(self) -> KernelSpec:
        return self._engine_now().spec

    def _residual(self, buffers: tuple[Any, ...], state: Array) -> Array:
        """d_hat less that of the state chosen, without what makes the noise white; NaN in the warm-up."""
        spec = self._spec
        if self._prediction is None:
            self._prediction = make_prediction(
                replace(spec, settings=replace(spec.settings, sensor_noise=SensorNoise()))
            )
        y, z, warm = self._prediction.run(*buffers)
        group, inertia = np.divmod(state, len(spec.alphas))
        residual = spec.sign * (y - spec.alphas[inertia] * z[np.arange(len(y)), group])
        residual[: len(y) - warm] = np.nan
        return np.asarray(residual)

    def _probabilities(self, buffers: tuple[Any, ...]) -> Array:
        """Of each state from its likelihood over the window (eq. 15), shape (n, states)."""
        if self._kernel is None:
            self._kernel = make_kernel(self._spec, self.plan.backend)
        found, status = likelihoods(self._kernel, self._spec, buffers)
        found[status == WARMUP] = np.nan
        with np.errstate(invalid="ignore"):
            found = np.exp(found - found.max(axis=1, keepdims=True))
            return np.asarray(found / found.sum(axis=1, keepdims=True))

    def _track(self, name: str) -> Track:
        return self._tracks.setdefault(name, Track())


def _cut(inputs: Inputs, part: slice) -> Inputs:
    forces = inputs.forces
    if forces is not None:
        forces = type(forces)(*(column[part] for column in forces))
    return Inputs(inputs.u[part], inputs.d_hat[part], inputs.t[part], forces)
