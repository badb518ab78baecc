"""The candidate functions that the peers get: the residual of the believed model, and columns named after effects.

What is laid out by hand here the tool searches by itself: Stribeck speeds, cogging periods, widths, limits, lags. Where
a person would know the value (periods of the motor, frequency of a disturbance) the true one is among them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from bench.hidden_cases import prepared
from dsd_cli.plant.prediction import predict_d_hat
from tests.oracle.machines import Case, Recording, mean_drive

Array = NDArray[np.float64]
FIRST = 100  # rows at the start that rest on what was before the log


@dataclass(frozen=True)
class Column:
    """One candidate function: of which effect, in which group of columns that only make sense together."""

    effect: str
    group: str
    rows: Array


@dataclass(frozen=True)
class Problem:
    """y = columns @ coefficients, N m; rows at rest and before `FIRST` are left out. `base`: effects believed."""

    y: Array
    columns: tuple[Column, ...]
    base: tuple[str, ...]

    @property
    def matrix(self) -> Array:
        return np.stack([c.rows for c in self.columns], axis=1)

    def linear(self) -> Problem:
        """Without the columns that need a searched shape."""
        return Problem(self.y, tuple(c for c in self.columns if not c.group.startswith("shape")), self.base)


@dataclass(frozen=True)
class Channels:
    """Motion and command of one log, and how a column of samples becomes one of Q's outputs."""

    q: Array
    v: Array
    u: Array
    t: Array
    top: float
    rest: float
    step: float
    pole: float
    delay: float

    def drive(self, u: Array, delay: float) -> Array:
        """Mean over the interval that ends at each row of the command, `delay` late."""
        return np.concatenate([[0.0], mean_drive(u[:, None], np.array([delay]), self.step)[:-1, 0]])

    def mean(self, x: Array) -> Array:
        """Mean over the interval that ends at each row."""
        return np.concatenate([[x[0]], 0.5 * (x[1:] + x[:-1])])

    def observed(self, x: Array) -> Array:
        return np.asarray(lfilter([1.0 - self.pole], [1.0, -self.pole], x))

    @property
    def way(self) -> Array:
        return np.sign(self.v) * (np.abs(self.v) > self.rest)


def problem(found: Recording) -> Problem:
    """Residual of the believed model in force, and every column, both through the observer's filter."""
    recording, model, observer = prepared(found)
    piece, case = recording.pieces[0], found.truth
    y = model.inertia / observer.nominal_inertia * (piece["d_hat"] - predict_d_hat(model, piece, observer))
    c = _channels(piece.channels, recording.rest_speed, case)
    usable = (np.abs(c.v) > c.rest) & (np.arange(len(y)) >= FIRST)
    columns = []
    for effect, group, rows in (*_linear(c), *_shaped(c, case)):
        kept = c.observed(rows)[usable]
        size = float(np.sqrt(np.mean(kept**2)))
        if size > 1e-9:
            columns.append(Column(effect, group, kept / size))
    return Problem(y[usable], tuple(columns), tuple(model.effects))


def _channels(x: dict[str, Array], rest: float, case: Case) -> Channels:
    step = case.sample_time
    pole = float(np.exp(-step / case.observer_time_constant))
    top = float(np.abs(x["velocity"]).max())
    return Channels(x["position"], x["velocity"], x["u"], x["t"], top, rest, step, pole, case.believed_delay)


Named = Iterator[tuple[str, str, Array]]


def motion_laws(q: Array, v: Array, way: Array) -> Named:
    """(effect, group, force) of the laws that are linear in their values and need only the motion."""
    yield "viscous_friction", "v", v
    yield "viscous_asymmetry", "abs v", np.abs(v)
    yield "quadratic_drag", "v abs v", v * np.abs(v)
    yield "coulomb_friction", "sgn v", way
    yield "constant_load", "1", np.ones_like(v)
    yield "stiffness", "q", q
    yield "cubic_stiffness", "q3", q**3
    yield "gravity", "sin q", np.sin(q)
    yield "gravity", "sin q", np.cos(q)


def _linear(c: Channels) -> Named:
    for effect, group, x in motion_laws(c.q, c.v, c.way):
        yield effect, group, c.mean(x)
    yield "load_friction", "abs u sgn v", np.abs(c.drive(c.u, c.delay)) * c.mean(c.way)
    yield "inertia", "u", c.drive(c.u, c.delay)
    for late in (1, 4):
        yield "delay", f"u {late}", c.drive(c.u, c.delay + late * c.step) - c.drive(c.u, c.delay)


def _shaped(c: Channels, case: Case) -> Named:
    hidden = dict(case.hidden)
    rng = np.random.default_rng([case.seed, 77])  # beside the true value stand others, so that it betrays nothing
    for speed in c.top * np.array([0.02, 0.04, 0.07, 0.12]):
        yield "stribeck_friction", f"shape stribeck {speed:.3g}", c.mean(np.exp(-((c.v / speed) ** 2)) * c.way)
    for reach in (0.005, 0.016, 0.05):
        yield "presliding_friction", f"shape dahl {reach}", c.mean(_dahl(c.q, reach))
    fewest = int(np.ceil(8 * 2 * np.pi / np.ptp(c.q)))
    periods = rng.choice(np.arange(fewest, fewest + 40), 3, replace=False).astype(float)
    periods[0] = hidden.get("cogging", {}).get("periods", periods[0])
    for n in periods:
        for wave in (np.sin, np.cos):
            yield "cogging", f"shape cogging {n:g}", c.mean(wave(n * c.q))
    frequencies = rng.uniform(1.0, 12.0, 3)
    frequencies[0] = hidden.get("periodic_disturbance", {}).get("frequency", frequencies[0])
    for f in frequencies:
        for wave in (np.sin, np.cos):
            yield "periodic_disturbance", f"shape periodic {f:.3g}", c.mean(wave(2 * np.pi * f * c.t))
    yield from _input_shapes(c)
    yield from _structure_shapes(c)
    for k, start in enumerate(np.arange(0.0, c.t[-1], 0.5)):
        inside = (c.t >= start) & (c.t < start + 0.5)
        yield "external_force", f"shape pulse {k}", inside.astype(float)


def _input_shapes(c: Channels) -> Named:
    drive = float(np.sqrt(np.mean(c.u**2)))

    def late(effect: str, group: str, change: Callable[[Array], Array]) -> tuple[str, str, Array]:
        return effect, f"shape {group}", c.drive(change(c.u) - c.u, c.delay)

    for width in drive * np.array([0.05, 0.15, 0.4, 0.7]):
        yield late(
            "dead_zone", f"dead zone {width:.3g}", lambda u, w=width: np.sign(u) * np.maximum(np.abs(u) - w, 0.0)
        )
    for quantile in (0.9, 0.92, 0.94, 0.96, 0.975, 0.985):
        limit = float(np.quantile(np.abs(c.u), quantile))
        yield late("saturation", f"limit {limit:.3g}", lambda u, m=limit: np.clip(u, -m, m))
    for tau in (0.001, 0.003, 0.008, 0.02):
        pole = np.exp(-c.step / tau)
        yield late("actuator_lag", f"lag {tau}", lambda u, p=pole: lfilter([1.0 - p], [1.0, -p], u))


def _structure_shapes(c: Channels) -> Named:
    turned = np.diff(c.way, prepend=c.way[:1])
    for tau in (0.005, 0.015):
        pole = np.exp(-c.step / tau)
        yield "backlash", f"shape reversal {tau}", np.asarray(lfilter([1.0], [1.0, -pole], turned))
    u = c.drive(c.u, c.delay)
    for f in (6.0, 9.0, 13.0, 19.0, 28.0, 41.0, 60.0):  # the load's motion: a resonance with the usual damping
        w, damping = 2 * np.pi * f * c.step, 0.06
        radius = np.exp(-damping * w)
        poles = [1.0, -2.0 * radius * np.cos(w), radius**2]
        for k, lag in enumerate(([0.0, 1.0], [1.0, -1.0])):
            yield "flexible_coupling", f"shape resonance {f:g}", np.asarray(lfilter(lag, poles, u)) * w ** (2 - k)


def _dahl(q: Array, reach: float) -> Array:
    """Dahl's deflection over its largest value."""
    z, out = 0.0, np.zeros_like(q)
    for k, step in enumerate(np.diff(q, prepend=q[:1]) / reach):
        way = 1.0 if step > 0 else -1.0
        z = way + (z - way) * np.exp(-abs(step))
        out[k] = z
    return out
