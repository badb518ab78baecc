"""How the coefficients and shapes of a fit scatter: a jackknife over the blocks, under what is known of the values.

What each block pulls at the coefficients, by the fit that did not see it, is what they scatter by: nothing has to be
white, or of one size, within a block; and a block that decides a value by itself makes it uncertain, which a plain
sandwich would not see (CR3 of Bell and McCaffrey, 2002; MacKinnon and White, 1985). Where few blocks identify a
value, its scatter is known from few: the error is then as much larger as Student's t is with that many.

No scatter shows what all blocks share: what noise that a controller has put into u may add to a delay (`returned`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dsd_cli.identify.fit.bank import INERTIA, SHARE, Bank, has_friction, inputs_of
from dsd_cli.identify.fit.blocks import grams, squares, without_noise
from dsd_cli.identify.fit.solve import Fit, Solver
from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.recordings.sensor import rate
from dsd_cli.signals.log import Array
from dsd_cli.signals.passes import mixed
from dsd_cli.signals.student import NORMAL, student_quantile

#: Relative step of numerical derivatives.
STEP = 1e-4
#: Ridge of unknowns scaled to size 1, for the jackknife where one block alone determines an unknown.
_RIDGE = 1e-9
#: Degrees of freedom, at least, of a value that few blocks tell.
_FEWEST = 3.0
#: Singular values below this: the constraint depends linearly on the others.
_RANK = 1e-9
#: Steps of Gauss and Newton at most; the longest, of the logarithm of a shape; a fall of the squares that ends them, as
#: a share of those of one row: a tenth of a standard error.
_ROUNDS, _STRIDE, _SETTLED = 4, 0.1, 0.01


@dataclass(frozen=True)
class Information:
    """What the rows say of coefficients and logarithms of shapes (m unknowns).

    normal : X'X less the sensor's noise, shape (m, m). normals : of each block, shape (B, m, m).
    scores : X'r of each block, shape (B, m).
    shapes : (term, shape name, value) of the unknowns behind the coefficients.
    returned : X'r of the delay's column, at most, by noise of the sensor that a controller has put into u.
    """

    normal: Array
    normals: Array
    scores: Array
    shapes: tuple[tuple[int, str, float], ...]
    returned: float = 0.0

    def covariance(
        self,
        floor: float,
        held: Sequence[Array] = (),
        priors: Sequence[tuple[Array, float]] = (),
        weight: float = 0.0,
        complete: bool = False,
    ) -> Array:
        """Shape (m, m), within what is free; with few blocks the usual one, (H+P)^-1 (floor H + spread) (H+P)^-1.

        floor : variance of a whitened row, inflated for correlation: the usual covariance, where blocks are too few.
        complete : the fit leaves noise alone; else the larger of both counts, for a jackknife knows no lean that all
            blocks share.
        held : slopes of values that do not move, shape (m,) each.
        priors : (slopes of a value, its standard deviation); `weight` is the variance of a row against which the fit
            weighed them.
        """
        size, free, pulled, data, inverse = self._inverse(held, priors, weight)
        scattered = inverse @ (weight**2 * pulled) @ inverse
        usual = floor * inverse @ data @ inverse
        count, unknowns = len(self.scores), free.shape[1]
        if count >= POLICY.blocks_per_unknown * unknowns > 0:
            scatter = self._jackknife(size, free, data + weight * pulled, inverse)
            if complete or np.trace(free @ scatter @ free.T) > np.trace(free @ usual @ free.T):
                usual = scatter
        if self.returned > 0.0:
            leant = inverse @ free[SHARE] * (self.returned / size[SHARE])
            scattered = scattered + np.outer(leant, leant)
        return np.asarray((free @ (usual + scattered) @ free.T) / np.outer(size, size))

    def _jackknife(self, size: Array, free: Array, whole: Array, inverse: Array) -> Array:
        """Scatter of the coefficients (in unknowns of size 1) when each block is left out in turn."""
        count = len(self.scores)
        scores = (self.scores / size) @ free
        normals = np.einsum("ki,bkl,lj->bij", free, self.normals / np.outer(size, size), free)
        left = whole - normals + _RIDGE * np.eye(len(whole))
        moved = np.linalg.solve(left, scores[..., None])[..., 0]
        parts = np.maximum(np.einsum("ki,bij,jk->bk", inverse, normals, inverse), 0.0)
        telling = parts.sum(axis=0) ** 2 / np.maximum(np.sum(parts**2, axis=0), 1e-300)
        # 95 % of Student's t reach further, with so many blocks that identify a value, than of the normal distribution
        moved = moved * student_quantile(np.maximum(telling - 1.0, _FEWEST)) / NORMAL
        return np.asarray(moved.T @ moved * (count - 1) / count)

    def steps(self, free: Sequence[bool]) -> tuple[Array, float]:
        """(by how much the logarithms of the shapes that are free are off their least squares, one each; how far the
        squares fall there): one step of Gauss and Newton, the coefficients solved for along with them."""
        size, normal = _scaled(self.normal)
        open_ = np.concatenate([np.ones(len(size) - len(free)), free])
        slopes = open_ * self.scores.sum(axis=0) / size
        slopes[: len(size) - len(free)] = 0.0
        whole = np.linalg.pinv(np.outer(open_, open_) * normal, rcond=1e-10, hermitian=True)
        return np.asarray((whole @ slopes / size)[len(size) - len(free) :]), float(slopes @ whole @ slopes)

    def share(
        self, row: Array, spread: float, held: Sequence[Array], priors: Sequence[tuple[Array, float]], weight: float
    ) -> float:
        """How much of a value is its prior: 0 where the log alone decides, 1 where it says nothing."""
        size, free, _, _, inverse = self._inverse(held, priors, weight)
        slope = free.T @ (row / size)
        return float(weight / spread**2 * slope @ inverse @ slope)

    def _inverse(
        self, held: Sequence[Array], priors: Sequence[tuple[Array, float]], weight: float
    ) -> tuple[Array, Array, Array, Array, Array]:
        """(sizes of the unknowns; free directions, priors, data, inverse of both: in unknowns of size 1)."""
        size, normal = _scaled(self.normal)
        prior = [row / spread for row, spread in priors] if weight > 0.0 else []
        pulls = np.array(prior).reshape(-1, len(size)) / size
        free = _free(np.array(held).reshape(-1, len(size)) / size, len(size))
        data = _told(np.asarray(free.T @ normal @ free))
        pulled = free.T @ (pulls.T @ pulls) @ free
        return size, free, pulled, data, np.asarray(np.linalg.pinv(data + weight * pulled, rcond=1e-10, hermitian=True))


def _told(data: Array) -> Array:
    """With next to no information in a direction in which the sensor's noise was more than all: not less than none."""
    told, vectors = np.linalg.eigh(data)
    return data if told.min(initial=0.0) > -_RIDGE else (vectors * np.where(told > 0.0, told, _RIDGE)) @ vectors.T


def _scaled(normal: Array) -> tuple[Array, Array]:
    """(sizes of the unknowns; the matrix in unknowns of size 1)."""
    size = np.sqrt(np.maximum(np.diag(normal), 0.0))
    size[size == 0.0] = 1.0  # nothing depends on it, as on the gap of a load whose contacts are known
    return size, normal / np.outer(size, size)


def _free(held: Array, size: int) -> Array:
    """Orthonormal directions in which nothing that is held moves, shape (size, q)."""
    if not len(held):
        return np.eye(size)
    lengths = np.linalg.norm(held, axis=1, keepdims=True)
    _, strengths, basis = np.linalg.svd(held / np.maximum(lengths, 1e-300))
    return np.asarray(basis[int(np.sum(strengths > _RANK)) :].T)


def root_of(covariance: Array) -> Array:
    """R with R R' = the matrix, shape (n, n); what its digits have made negative of its eigenvalues is 0."""
    sizes, vectors = np.linalg.eigh(covariance)
    return np.asarray(vectors * np.sqrt(np.maximum(sizes, 0.0)))


def information(fit: Fit, solver: Solver) -> Information:
    """Out of the rows of a fit, with a numerical slope for every shape."""
    design = solver.bank.design(fit.terms, fit.tap, keep=False)
    rows = list(design.rows)
    shapes = tuple(
        (i, name, value)
        for i, term in enumerate(fit.terms)
        for name, value in term.items
        if isinstance(value, float) and value > 0.0
    )
    weights = np.concatenate([[-1.0], fit.total])
    for i, name, value in shapes:
        ends = []
        for factor in (1.0 + STEP, 1.0 - STEP):
            terms = list(fit.terms)
            terms[i] = type(terms[i]).of(terms[i].id, {**terms[i].shape, name: value * factor})
            ends.append(solver.bank.rows(tuple(terms), fit.tap, keep=False))
        moved = [w * (high - low) for w, high, low in zip(weights, *ends, strict=True) if high is not low]
        rows.append(np.sum(moved, axis=0) / (2.0 * STEP))
    found = grams(rows, solver.blocks)
    normal = without_noise(found.total, np.pad(design.noise, (0, len(shapes))), len(rows[0]))[1:, 1:]
    residual = np.concatenate([[1.0], -fit.total, np.zeros(len(shapes))])
    scores, normals = found.held_out[:, 1:, :] @ residual, found.held_out[:, 1:, 1:]
    kept = 1.0 - _restless(fit, solver.bank, normal, mixed(rows, residual))
    normal[SHARE, SHARE] *= kept
    normals[:, SHARE, SHARE] *= kept
    return Information(normal, normals, scores, shapes, _returned(fit, solver.bank, design.noise))


def converged(fit: Fit, solver: Solver) -> tuple[Fit, Information]:
    """The fit with its shapes where least squares of these rows have them, and what the rows say there.

    A search ends within its last bracket, which may be many standard errors wide, and by the other form. Shapes of
    which something is known stay.
    """
    found, rows = information(fit, solver), solver.bank.equations.counted
    for _ in range(_ROUNDS):
        free = [not solver.known.concerns(fit.terms[i].id) for i, _, _ in found.shapes]
        steps, fall = found.steps(free)
        before = squares(fit.grams.total, fit.total)
        if fall < _SETTLED * before / rows:
            break
        terms = list(fit.terms)
        for (i, name, value), step in zip(found.shapes, np.clip(steps, -_STRIDE, _STRIDE), strict=True):
            terms[i] = type(terms[i]).of(terms[i].id, {**terms[i].shape, name: value * math.exp(step)})
        after = solver.fit(tuple(terms), fit.tap, fit.whole_steps)
        if not squares(after.grams.total, after.total) < before:
            break
        fit, found = after, information(after, solver)
    return fit, found


def _restless(fit: Fit, bank: Bank, normal: Array, left: Array) -> float:
    """Share of what the delay's column has that says nothing of the delay: noise of u, which did not act.

    Of the curvature of the squares over the share, 2 (d'd + r'y''), such noise cancels; d'd alone counts it.
    """
    inputs, held, middle = inputs_of(fit.terms), has_friction(fit.terms), max(round(fit.tap + fit.total[SHARE]), 1)
    early, at, late = (bank.drive(inputs, n, False, held) for n in (middle - 1, middle, middle + 1))
    size, scaled = _scaled(normal)
    whole = np.linalg.pinv(scaled, rcond=1e-10, hermitian=True)
    own = float(left @ (early - 2.0 * at + late)) / float(size[SHARE]) ** 2
    return min(max(-own, 0.0), 0.5 / max(float(whole[SHARE, SHARE]), 1.0))


def _returned(fit: Fit, bank: Bank, noise: Array) -> float:
    """See `Information.returned`; `noise` : that of the columns."""
    equations, inertia = bank.equations, float(fit.total[INERTIA])
    fastest = min(2.0 * np.pi * equations.band.hz, rate([s.answer for s in equations.stretches], inertia))
    left = inertia**2 * float(noise[INERTIA, INERTIA]) * len(bank.acceleration)
    return fastest * bank.tap_time * left
