"""Drift of a reconstructed motion, estimated from forces that depend on position and speed.

Where only u and d_hat are logged, white noise on d_hat makes a random walk of the integrated speed. Gravity, springs
and cogging come back at the same place, so a set of effects tells where the axis truly was. The drift of the speed is
a line between knots; its steps from knot to knot have the variance of that random walk, so that no more is explained by
drift than the noise of d_hat allows.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from dsd_cli.identify.fit.bank import FIXED, Bank, columns_of, holds
from dsd_cli.identify.fit.equations import Stretch, direction
from dsd_cli.identify.fit.problem import Problem
from dsd_cli.identify.fit.solve import Fit
from dsd_cli.identify.recordings.recording import Recording
from dsd_cli.plant.forces import IntervalChannels
from dsd_cli.signals.log import Array, Log, with_channels

#: s from knot to knot, but for so many knots at most, and how far the motion is moved to see what that does, as a
#: share of what it wanders in 1 s.
KNOT, MOST_KNOTS, MOVED = 1.0, 60, 0.1
#: Weight of the drift itself beside that of its steps: at the start it is hardly known.
LEVEL = 1e-4


def without_drift(problem: Problem, fit: Fit) -> tuple[Recording, ...]:
    """The recordings with the drift of their reconstructed motion, as this fit estimates it, removed."""
    drifts = {id(s.log): _drift(problem, fit, i) for i, s in enumerate(problem.equations.stretches)}
    moved = []
    for recording in problem.recordings:
        pieces = [_moved(p, drifts[id(p)]) if id(p) in drifts else p for p in recording.pieces]
        moved.append(replace(recording, pieces=tuple(pieces)) if recording.walk > 0.0 else recording)
    return tuple(moved)


def _drift(problem: Problem, fit: Fit, index: int) -> Array:
    """What is to be added to the speed of a stretch, shape (n,): most likely given the noise, and the walk."""
    equations, stretch = problem.equations, problem.equations.stretches[index]
    recording = next(r for r in equations.recordings if any(stretch.log is p for p in r.pieces))
    walk, noise = recording.walk, stretch.log["speed_noise"]
    if not walk > 0.0:
        return np.zeros(len(stretch.log))
    units, knot = _units(stretch)
    size = max(MOVED * walk, recording.speed_noise)
    x = np.stack([equations.whitened(_change(problem.errors.bank, fit, index, x * size, noise)) for x in units]) / size
    left = fit.forward @ np.stack(problem.solver.bank.design(fit.terms, fit.tap).rows)
    steps = np.diff(np.eye(len(units)), axis=0)
    prior = (steps.T @ steps + LEVEL * np.eye(len(units))) / (walk**2 * knot)
    variance = problem.noise.variance * problem.noise.inflation
    return np.asarray(np.linalg.solve(x @ x.T / variance + prior, -(x @ left) / variance) @ units)


def _units(stretch: Stretch) -> tuple[Array, float]:
    """(hats over time, shape (k, n); s from knot to knot)."""
    t = stretch.log["t"]
    count = min(max(round((t[-1] - t[0]) / KNOT), 1), MOST_KNOTS)
    knots = np.linspace(t[0], t[-1], count + 1)
    return np.stack([np.interp(t, knots, e) for e in np.eye(count + 1)]), float(knots[1] - knots[0])


def _change(plain: Bank, fit: Fit, index: int, speed: Array, noise: Array) -> Array:
    """By what the residual (forward form) changes with that drift of one stretch's speed; rows in the unit of u."""
    equations = plain.equations
    stretch = equations.stretches[index]
    place = np.cumsum(speed) * equations.sample_time
    moved = replace(
        stretch,
        middle=_shifted(stretch.middle, speed, place),
        mean=_shifted(stretch.mean, speed, place),
        sign=np.where(stretch.free > 0.0, direction(stretch.log["velocity"] + speed, noise), 0.0),
    )
    stretches = tuple(moved if i == index else s for i, s in enumerate(equations.stretches))
    other = replace(equations, stretches=stretches)
    held, delay = holds(fit.terms), fit.tap * plain.tap_time
    total = np.zeros(sum(equations.lengths))
    at = 1 + FIXED
    for term, width in zip(fit.terms, fit.widths, strict=True):
        if width:
            now = columns_of(other, term, delay, held)
            before = plain.columns(term, fit.tap, True, held)
            for weight, a, b in zip(fit.forward[at : at + width], now, before, strict=True):
                total += weight * (a - b)
        at += width
    return total


def _shifted(motion: IntervalChannels, speed: Array, place: Array) -> IntervalChannels:
    return motion._replace(velocity=motion.velocity + speed, position=motion.position + place)


def _moved(piece: Log, speed: Array) -> Log:
    place = np.cumsum(speed) * piece.sample_time
    channels = {"velocity": piece["velocity"] + speed}
    if "position" in piece:
        channels["position"] = piece["position"] + place
    return with_channels(piece, **channels)
