"""What logs leave open of the values of a fit: the other likely ones, and those that go with one that is known."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from dsd_cli.design.rows import shapes_of
from dsd_cli.identify.fit.bank import FIXED, SHARE
from dsd_cli.identify.fit.bank import INERTIA as AT_INERTIA
from dsd_cli.identify.fit.covariance import information
from dsd_cli.identify.fit.solve import Fit
from dsd_cli.identify.fit.values import Fitted, flat
from dsd_cli.identify.search.sets import Search
from dsd_cli.signals.log import Array

#: Standard errors to what may be; share by which a value changes at most; share of the most that the logs say in any
#: direction that is nothing.
FARTHEST, WIDEST, _NOTHING = 2.0, 0.5, 1e-10


@dataclass(frozen=True)
class Left:
    """What logs leave open of coefficients and logarithms of shapes: normal around a change, shape (m,), of the fit."""

    covariance: Array
    mean: Array

    @classmethod
    def by(cls, search: Search, values: Fitted) -> Left:
        """Of these values. Where effects only add up, as friction and a load in moves one way, the logs say nothing of
        what one of them has more and the other less: no inverse of what they say has that direction, and without it one
        that is known would take the other along the wrong way. So far it is open: as much as the largest force of the
        balance would be twice."""
        fit, found = values.fit, values.covariance
        normal = information(fit, search.solver).normal
        there = np.flatnonzero(np.diag(normal) > 0.0)  # on others nothing depends
        size = np.sqrt(np.diag(normal)[there])
        told, vectors = np.linalg.eigh(normal[np.ix_(there, there)] / np.outer(size, size))
        open_ = np.zeros((len(found), len(there)))
        open_[there] = vectors * (told <= _NOTHING * told.max(initial=0.0)) / size[:, None]
        linear = there < len(fit.total)
        most = float(np.max(np.abs(fit.total[there[linear]]) * size[linear], initial=0.0))
        left = cls(found + most**2 * open_ @ open_.T, np.zeros(len(found)))
        for name in search.solver.known.fixed.keys() & flat(values.model).keys():
            left = left.where(slope_of(search, fit, name, len(found)), 0.0)
        return left

    def where(self, row: Array, value: float) -> Left:
        """Given that row @ change is this; as it is where that is no matter of these unknowns."""
        along = self.covariance @ row
        variance, off = float(row @ along), value - float(row @ self.mean)
        if not variance > 0.0:
            return self
        return Left(self.covariance - np.outer(along, along) / variance, self.mean + along * (off / variance))

    def may_be(self, row: Array, value: float) -> bool:
        """Whether row @ change may be this, by what the logs leave open."""
        off = value - float(row @ self.mean)
        return off**2 <= FARTHEST**2 * float(row @ self.covariance @ row)

    def within(self, change: Array, fit: Fit) -> Array:
        """The likeliest change beside one of which each part is no more than a share of the value."""
        most = most_of(fit, len(change))
        covariance = self.covariance
        for _ in range(len(change)):
            beyond = np.abs(change) - most
            i = int(np.argmax(beyond / np.maximum(most, 1e-300)))
            if not (beyond[i] > 0.0 and (along := covariance[:, i])[i] > 0.0):
                break
            change = change + along * ((math.copysign(most[i], change[i]) - change[i]) / along[i])
            covariance = covariance - np.outer(along, along) / along[i]
        return np.clip(change, -most, most)


def most_of(fit: Fit, size: int) -> Array:
    """By how much coefficients (all of an effect by a share of its size) and logarithms of shapes may change."""
    parts = np.split(fit.total[FIXED:], np.cumsum(fit.widths)[:-1]) if fit.widths else []
    sizes = [np.abs(fit.total[:FIXED]), *(np.full(len(c), np.linalg.norm(c)) for c in parts)]
    most = WIDEST * np.concatenate([*sizes, np.ones(size - len(fit.total))])
    most[SHARE] = 1.0
    return np.asarray(most)


def changed(fit: Fit, change: Array) -> Fit:
    """A fit with other coefficients, and logarithms of shapes."""
    linear = len(fit.total)
    terms = list(fit.terms)
    for (i, name, value), step in zip(shapes_of(fit.terms), change[linear:], strict=True):
        terms[i] = type(terms[i]).of(terms[i].id, {**terms[i].shape, name: value * math.exp(step)})
    return replace(fit, total=fit.total + change[:linear], terms=tuple(terms))


def slope_of(search: Search, fit: Fit, name: str, size: int) -> Array:
    """Of a value over coefficients and logarithms of shapes, numerical, shape (m,)."""
    total = np.abs(fit.total)
    steps = np.concatenate([1e-4 * np.maximum(total, 1e-3 * total[AT_INERTIA]), np.full(size, 1e-4)])[:size]
    steps[SHARE] = 1e-3
    found = np.zeros(size)
    for i, step in enumerate(steps):
        if not step > 0.0:  # a coefficient of 0 beside an inertia of 0
            continue
        change = np.zeros(size)
        change[i] = step
        less, here, more = (flat(search.problem.scale.model(changed(fit, x * change)))[name] for x in (-1.0, 0.0, 1.0))
        found[i] = max(more - here, here - less, key=abs) / step  # at a bound, as friction of 0, it moves one way
    return found
