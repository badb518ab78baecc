"""Where a reconstructed motion truly was, estimated from forces that depend on position and speed.

The drift of the speed is a line between knots; its steps from knot to knot have the variance of the random walk that
the noise of d_hat makes of it. The coefficients of the effects are free beside it: a shift of the position must not be
paid for by a drift.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property

import numpy as np

from dsd_cli.effects import Role
from dsd_cli.identify.fit.bank import FIXED, INERTIA, Term, columns_of, has_friction
from dsd_cli.identify.fit.problem import Problem
from dsd_cli.identify.fit.solve import Fit
from dsd_cli.identify.fit.stretches import Stretch, direction
from dsd_cli.identify.recordings.recording import Recording
from dsd_cli.signals.log import Array, Log, with_channels

#: s from knot to knot, but for so many knots at most, and the step of its numerical slopes, as a
#: share of what it wanders in 1 s.
KNOT, MOST_KNOTS, MOVED = 1.0, 60, 0.1
#: Prior weight of the level of the drift over that of its steps: the speed at the start is hardly known.
LEVEL = 1e-4
#: Step lengths of the line search: forces are not linear in the position.
SHARES = (1.0, 0.5, 0.25)
#: Zeros and constant speeds that are tried, each side of none, and how far they reach, in ranges of the motion: over
#: the whole recording, for a speed.
ZEROS, SPEEDS, FAR, CREEP = 6, 4, 1.0, 0.6


def without_drift(problem: Problem, fit: Fit, recordings: Sequence[Recording]) -> tuple[Recording, ...]:
    """The recordings of a problem with the drift of their motion, as this fit estimates it, removed.

    recordings : the same with their motion as it was reconstructed, from which the true one wanders.
    """
    return _each(problem, [(path, *path.step()) for path in _paths(problem, fit, recordings)])


@dataclass(frozen=True)
class Placed:
    """Recordings with the zero of the position and the constant speed that suit a fit best.

    left, before : squares of all rows in units of their variance, and of the walk, there and on the motion as it was.
    """

    left: float
    before: float
    recordings: tuple[Recording, ...]


def placed(problem: Problem, fit: Fit, recordings: Sequence[Recording]) -> Placed:
    """The recordings of a problem moved so; `recordings` : as for `without_drift`."""
    found = [(path, path.best_start()) for path in _paths(problem, fit, recordings)]
    left = sum(path.cost(start) for path, start in found)
    before = sum(path.cost(0.0 * start) for path, start in found)
    return Placed(left, before, _each(problem, [(path, *path.split(start)) for path, start in found]))


def _each(problem: Problem, found: Sequence[tuple[_Path, Array, float]]) -> tuple[Recording, ...]:
    """The recordings with what was found for each of their pieces."""
    moved = {id(path.piece): _moved(path.piece, speed, zero) for path, speed, zero in found}
    pieces = [tuple(moved.get(id(p), p) for p in r.pieces) for r in problem.recordings]
    return tuple(replace(r, pieces=p) for r, p in zip(problem.recordings, pieces, strict=True))


def _paths(problem: Problem, fit: Fit, recordings: Sequence[Recording]) -> Iterator[_Path]:
    """Every piece whose motion may wander, with its equations."""
    index = {id(s.log): i for i, s in enumerate(problem.equations.stretches)}
    for now, plain in zip(problem.recordings, recordings, strict=True):
        for piece, before in zip(now.pieces, plain.pieces, strict=True):
            if now.walk > 0.0 and id(piece) in index:
                yield _Path(problem, fit, index[id(piece)], piece, before, now.walk)


@dataclass(frozen=True)
class _Path:
    """A piece and what its motion has to do with the residual of a fit.

    piece, plain : as the problem has it, and as it was reconstructed. walk : rad/s in the square root of a second.
    """

    problem: Problem
    fit: Fit
    index: int
    piece: Log
    plain: Log
    walk: float

    @cached_property
    def position(self) -> Array:
        """rad; where it would drift too far to be one, what the speed adds up to gives the size of the motion."""
        there = "position" in self.piece
        return self.piece["position"] if there else np.cumsum(self.piece["velocity"]) * self.piece.sample_time

    @cached_property
    def span(self) -> float:
        """Of the position."""
        return float(np.ptp(self.position))

    @cached_property
    def knots(self) -> Array:
        """s, shape (k,)."""
        t = self.piece["t"]
        count = min(max(round((t[-1] - t[0]) / KNOT), 1), MOST_KNOTS)
        return np.linspace(t[0], t[-1], count + 1)

    @cached_property
    def units(self) -> Array:
        """Hats over time, shape (k, n)."""
        return np.stack([np.interp(self.piece["t"], self.knots, unit) for unit in np.eye(len(self.knots))])

    @cached_property
    def variance(self) -> float:
        """Of a row, per nat."""
        return self.problem.noise.variance * self.problem.noise.inflation

    @cached_property
    def prior(self) -> Array:
        """Inverse covariance of a random walk at the knots, and of a zero, shape (k + 1, k + 1)."""
        steps = np.diff(np.eye(len(self.knots), len(self.knots) + 1), axis=0)
        known = steps.T @ steps
        known[range(len(self.knots)), range(len(self.knots))] += LEVEL
        known /= self.walk**2 * float(self.knots[1] - self.knots[0])
        known[-1, -1] = 1.0 / self.span**2
        return np.asarray(known)

    @cached_property
    def so_far(self) -> Array:
        """By what the motion was moved already: at the knots, and its zero; shape (k + 1,)."""
        moved = self.piece["velocity"] - self.plain["velocity"]
        zero = self.piece["position"][0] - self.plain["position"][0] if "position" in self.piece else 0.0
        return np.append(np.interp(self.knots, self.piece["t"], moved), zero)

    @cached_property
    def rows(self) -> Array:
        """Drive, acceleration, delay and columns, whitened; shape (p, N)."""
        return np.stack(self.problem.solver.bank.rows(self.fit.terms, self.fit.tap))

    def moved(self, speed: Array, zero: float) -> Array:
        """The whitened columns on a motion that is moved by that."""
        equations, here = self.problem.errors.bank.equations, list(self.rows[1 + FIXED :])
        held, delay = has_friction(self.fit.terms), self.fit.tap * self.problem.errors.bank.tap_time
        stretches = list(equations.stretches)
        stretches[self.index] = _elsewhere(stretches[self.index], speed, zero, equations.sample_time, held)
        there = replace(equations, stretches=tuple(stretches))
        for term in self.fit.terms:
            if depends_on_path(term):
                at = self.fit.columns_of(term)
                found = columns_of(there, term, delay, held)
                here[at.start - FIXED : at.stop - FIXED] = [self.problem.equations.whitened(x) for x in found]
        return np.stack(here) if here else np.zeros((0, self.rows.shape[1]))

    def cost(self, change: Array) -> float:
        """Squares that are left with all coefficients free, and the walk's, in units of a row's variance."""
        target = self.rows[1 + INERTIA]
        x = np.concatenate(
            [self.rows[[0, *range(2 + INERTIA, 1 + FIXED)]], self.moved(change[:-1] @ self.units, change[-1])]
        )
        weights = np.linalg.lstsq(x.T, target, rcond=None)[0]
        left = self.problem.solver.inertia * (target - weights @ x)
        so_far = self.so_far + change
        return float(left @ left) / self.variance + float(so_far @ self.prior @ so_far)

    def step(self) -> tuple[Array, float]:
        """What is to be added to the speed, shape (n,), and to the position: most likely given noise and walk."""
        speed = MOVED * max(self.walk, float(np.median(self.piece["speed_noise"])))
        sizes = np.append(np.full(len(self.knots), speed), MOVED * float(np.std(self.position)))
        here = self.rows[1 + FIXED :]
        theta = self.fit.forward[1 + FIXED :]
        x = np.stack([theta @ (self.moved(*self.split(change)) - here) for change in np.diag(sizes)]) / sizes[:, None]
        free = np.linalg.qr(np.delete(self.rows, 1 + INERTIA, axis=0).T)[0]
        left = self.fit.forward @ self.rows
        x, left = x - (x @ free) @ free.T, left - free @ (free.T @ left)
        normal = x @ x.T / self.variance + self.prior
        whole = np.linalg.solve(normal, -(x @ left) / self.variance - self.prior @ self.so_far)
        tried = [share * whole for share in SHARES]
        best = min((np.zeros_like(whole), *tried), key=self.cost)
        return self.split(best)

    def best_start(self) -> Array:
        """A constant speed and a zero, those of least squares, from coarse to fine; shape (k + 1,)."""
        lasting = float(self.piece["t"][-1] - self.piece["t"][0])
        creep, far = CREEP * self.span / lasting, FAR * self.span
        speeds, zeros = (np.linspace(-x, x, 2 * n + 1) for x, n in ((creep, SPEEDS), (far, ZEROS)))
        cost = cache(lambda at: self.cost(self._constant(*at)))
        best = min(((s, z) for s in speeds.tolist() for z in zeros.tolist()), key=cost)
        for finer in (0.5, 0.25, 0.125, 0.0625):
            around = [
                (best[0] + i * finer * creep / SPEEDS, best[1] + j * finer * far / ZEROS)
                for i in (-1, 0, 1)
                for j in (-1, 0, 1)
            ]
            best = min(around, key=cost)
        return self._constant(*best)

    def _constant(self, speed: float, zero: float) -> Array:
        middle = 0.5 * speed * float(self.piece["t"][-1] - self.piece["t"][0])
        return np.append(np.full(len(self.knots), speed), zero - middle)

    def split(self, change: Array) -> tuple[Array, float]:
        """(the speed at every sample, shape (n,); the zero)."""
        return np.asarray(change[:-1] @ self.units), float(change[-1])


def depends_on_path(term: Term) -> bool:
    """Whether the effect is a force at a place or a speed; a load is driven by accelerations or by the force."""
    return term.effect.role is not Role.STRUCTURE and bool({"velocity", "position"} & set(term.effect.needs))


def _elsewhere(stretch: Stretch, speed: Array, zero: float, step: float, friction: bool) -> Stretch:
    """With another motion, shape (n,) and rad; its direction only where friction asks for it."""
    place, sign = zero + np.cumsum(speed) * step, stretch.sign
    if friction:
        moving = direction(stretch.log["velocity"] + speed, stretch.log["speed_noise"])
        sign = np.where(stretch.free > 0.0, moving, 0.0)
    both = (stretch.middle, stretch.mean)
    middle, mean = (x._replace(velocity=x.velocity + speed, position=x.position + place) for x in both)
    return replace(stretch, middle=middle, mean=mean, sign=sign)


def _moved(piece: Log, speed: Array, zero: float) -> Log:
    channels = {"velocity": piece["velocity"] + speed}
    if "position" in piece:
        channels["position"] = piece["position"] + zero + np.cumsum(speed) * piece.sample_time
    return with_channels(piece, **channels)
