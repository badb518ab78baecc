"""Stage 1 of the NumPy kernel: z per group and y, sample by sample or block by block, on either clock.

docs/how/architecture.md derives the recursions. Prediction here is `plant.prediction` for many delays at once, carried
from block to block; a test holds the two equal.
"""

from __future__ import annotations

from collections import deque
from math import isfinite
from typing import Any

import numpy as np

from dsd_cli.detect.coloured import Whitened
from dsd_cli.detect.spec import KernelSpec
from dsd_cli.plant.prediction import combine
from dsd_cli.signals.log import Array


def make_prediction(spec: KernelSpec) -> Any:
    """The recursion for the clock of `spec`; whitened where the noise of the sensor is known."""
    prediction = TimedPrediction(spec) if spec.timed else RegularPrediction(spec)
    found = spec.whitening
    return prediction if found is None else Whitened(prediction, found)


class RegularPrediction:
    """A regular clock: taps on the history of u."""

    def __init__(self, spec: KernelSpec) -> None:
        self._spec = spec
        self._taps = spec.taps()
        self._pole, self._warmup = spec.pole, spec.warmup_rows
        self._lag = 1 if spec.settings.observer_filter else 0
        self._keep = max(n for n, _ in self._taps) + 2 + self._lag
        self._newest = -1 - self._lag
        self._places = [(self._newest - n, 1.0 - f, f) for n, f in self._taps]
        self._whole = [self._newest - n for n, f in self._taps] if not any(f for _, f in self._taps) else None
        self._plain = spec.aperture == 1 and len(spec.grid.combinations) == 1
        self._past: Array | None = None  # the last samples of u, shape (keep,)
        self._line: deque[float] | None = None  # the same, while `step` has it
        self._k = 0
        self._groups = len(self._taps) * len(spec.grid.combinations)
        self._z: Any = np.zeros(self._groups)  # a list while `step` has it
        self._raw: Any = np.zeros(self._groups)
        self._w, self._u_mean = 0.0, 0.0

    def step(self, u: float, d_hat: float) -> tuple[float, list[float], bool]:
        """(y, z, warm) of one sample without effects: `run` on plain floats, the same operations in the same order."""
        if self._line is None:
            if self._past is None or not self._plain:
                ys, zs, warm = self.run(np.array([u]), np.array([d_hat]), None, None, None, None)
                return float(ys[0]), zs[0].tolist(), bool(warm)
            self._line = deque(self._past.tolist(), maxlen=self._keep)
            self._z = np.asarray(self._z).tolist()
        line, pole, gain = self._line, self._pole, 1.0 - self._pole
        line.append(u if isfinite(u) else line[-1])  # sample k - j is line[-1 - j] now
        # what only an aperture of 2 looks back at (_raw, _u_mean) stays as it is
        self._w = gain * line[self._newest] + pole * self._w
        if self._whole is not None:  # 1 x + 0 y is x
            self._z = [gain * line[at] + pole * z for at, z in zip(self._whole, self._z, strict=True)]
        else:
            self._z = [
                gain * (near * line[at] + far * line[at - 1]) + pole * z
                for (at, near, far), z in zip(self._places, self._z, strict=True)
            ]
        self._k += 1
        y = self._w + self._spec.sign * (d_hat if isfinite(d_hat) else 0.0)
        return y, self._z, self._k > self._warmup

    def run(self, u: Any, d: Any, t: Any, force: Any, budget: Any, sign: Any) -> tuple[Array, Array, int]:
        """(y of shape (n,), z of shape (n, groups), number of rows at the end that are past the warm-up)."""
        n, k = len(u), self._k
        if self._line is not None:  # `step` was here
            self._past, self._line = np.array(self._line), None
        u = self._held(u)
        if self._past is None:
            self._past = np.full(self._keep, u[0])
        history = np.concatenate([self._past, u])
        self._past = history[n:]
        last = history[self._keep - self._lag : self._keep - self._lag + n]
        raw = np.empty((n, self._groups))
        combos = len(self._spec.grid.combinations)
        for g, (whole, fraction) in enumerate(self._taps):
            at = self._keep - self._lag - whole
            mean = (1.0 - fraction) * history[at : at + n] + fraction * history[at - 1 : at - 1 + n]
            for e in range(combos):
                raw[:, g * combos + e] = mean if force is None else _net_force(mean, force[:, e], budget[:, e], sign)
        w, z = self._filtered(last, raw, k)
        self._k += n
        y = w + self._spec.sign * np.where(np.isfinite(d), d, 0.0)
        return y, z, int(np.clip(self._k - self._spec.warmup_rows, 0, n))

    def _held(self, u: Array) -> Array:
        """u with missing values held at the last one."""
        bad = ~np.isfinite(u)
        if not bad.any():
            return u
        before = 0.0 if self._past is None else self._past[-1]
        index = np.where(bad, 0, np.arange(1, len(u) + 1))
        return np.concatenate([[before], u])[np.maximum.accumulate(index)]

    def _filtered(self, last: Array, raw: Array, k: int) -> tuple[Array, Array]:
        columns = np.column_stack([last, raw])
        before = np.concatenate([[self._u_mean], self._raw])
        self._u_mean, self._raw = float(columns[-1, 0]), columns[-1, 1:].copy()
        if self._spec.aperture == 2:
            shifted = np.vstack([before, columns[:-1]])
            first = max(0, 2 - k)  # the first two samples have no two intervals before them
            columns = np.vstack([columns[:first], 0.5 * columns[first:] + (1.0 - 0.5) * shifted[first:]])
        state = np.concatenate([[self._w], self._z])
        out = _recursion(columns, self._pole, state, start=k == 0)
        self._w, self._z = float(out[-1, 0]), out[-1, 1:].copy()
        return out[:, 0], out[:, 1:]


def _net_force(drive: Array, force: Array, budget: Array, sign: Array) -> Array:
    """`combine`, but 0 where the speed turns (sign is infinite): `Session` took these intervals out of d_hat."""
    turns = np.isinf(sign)
    return np.where(turns, 0.0, combine(drive, force, budget, np.where(turns, 0.0, sign)))


def _recursion(x: Array, pole: float, state: Array, start: bool) -> Array:
    """y_k = (1-p) x_k + p y_k-1 along axis 0; the first sample of a log is taken as it is."""
    if pole == 0.0:
        return x
    if len(x) == 1:
        return x if start else (1.0 - pole) * x + pole * state
    from scipy.signal import lfilter  # slow to import, and only needed without a compiled kernel

    head = x[:1] if start else (1.0 - pole) * x[:1] + pole * state
    tail, _ = lfilter([1.0 - pole], [1.0, -pole], x[1:], axis=0, zi=pole * head)
    return np.vstack([head, tail])


class TimedPrediction:
    """An irregular clock: means over the true intervals, u held between stamps."""

    def __init__(self, spec: KernelSpec) -> None:
        self._spec = spec
        self._t: list[float] = []
        self._u: list[float] = []
        self._pointer = [0] * len(spec.grid.delays)
        groups = len(spec.grid.delays) * len(spec.grid.combinations)
        self._z, self._raw = np.zeros(groups), np.zeros(groups)
        self._w, self._u_mean, self._interval = 0.0, 0.0, spec.sample_time
        self._warm = False

    def run(self, u: Any, d: Any, t: Any, force: Any, budget: Any, sign: Any) -> tuple[Array, Array, int]:
        """As `RegularPrediction.run`, with the stamps t of shape (n,)."""
        n = len(u)
        y, z, warm = np.empty(n), np.empty((n, self._z.size)), 0
        for i in range(n):
            self._t.append(float(t[i]))
            self._u.append(float(u[i]) if np.isfinite(u[i]) else (self._u[-1] if self._u else 0.0))
            forces = None if force is None else (force[i], budget[i], sign[i])
            self._advance(forces)
            y[i] = self._w + self._spec.sign * (d[i] if np.isfinite(d[i]) else 0.0)
            z[i] = self._z
            warm += self._is_warm()
        self._forget()
        return y, z, warm

    def _forget(self) -> None:
        """Drop the history that no delay reaches any more."""
        old = min(self._pointer) - 4
        if self._warm and old > 4096:
            del self._t[:old], self._u[:old]
            self._pointer = [pointer - old for pointer in self._pointer]

    def _is_warm(self) -> bool:
        k = len(self._t) - 1
        if not self._warm and k >= self._spec.warmup_rows:
            self._warm = self._t[k - self._spec.aperture] - self._t[0] >= self._spec.warmup_time
        return self._warm

    def _mean(self, g: int, begin: float, end: float, last: int) -> float:
        """Mean of u(t - L) over [begin, end)."""
        delay = self._spec.grid.delays[g]
        a, b, total, j = begin - delay, end - delay, 0.0, self._pointer[g]
        position = a
        while j < last and self._t[j + 1] <= b:
            if self._t[j + 1] > position:
                total += self._u[j] * (self._t[j + 1] - position)
                position = self._t[j + 1]
            j += 1
        total += self._u[j] * (b - position)
        self._pointer[g] = j
        return total / (b - a)

    def _advance(self, forces: Any) -> None:
        spec, k = self._spec, len(self._t) - 1
        last = k - 1 if spec.settings.observer_filter else k
        length = self._t[k] - self._t[k - 1] if k else spec.sample_time
        filtered = spec.settings.observer_filter and k > 0 and spec.time_constant > 0.0
        pole = float(np.exp(-length / spec.time_constant)) if filtered else 0.0
        begin = self._t[max(last, 0)]
        means = [self._mean(g, begin, begin + length, last) if k else self._u[0] for g in range(len(spec.grid.delays))]
        mean_u, combos = self._u[max(last, 0)], len(spec.grid.combinations)
        raw = np.repeat(np.array(means), combos)
        if forces is not None:
            force, budget, sign = (np.tile(np.atleast_1d(a), len(means)) for a in forces)
            raw = _net_force(raw, force, budget, np.broadcast_to(sign[:1], raw.shape))
        own_u, own_raw = mean_u, raw
        if spec.aperture == 2 and k > 1:
            share = length / (length + self._interval)
            mean_u = share * mean_u + (1.0 - share) * self._u_mean
            raw = share * raw + (1.0 - share) * self._raw
        self._u_mean, self._raw, self._interval = own_u, own_raw, length
        self._w = (1.0 - pole) * mean_u + pole * self._w
        self._z = (1.0 - pole) * raw + pole * self._z
