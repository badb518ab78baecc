"""Play identified sample by sample: a motor alone, or pressed to its load on either flank.

A load that rattles cannot be simulated for long, for each impact magnifies an error. But two masses keep their
momentum, whatever happens between them. With d = motor less load, s the load's share and F all forces from outside,

    J q = (double integral of F) + s J d,    |d| = gap / 2 + depth wherever they touch,    depth = J_l a_l / k,

and in between the motor is alone, (1 - s) J a = F. So where something pushes the motor that is not in F, its sign names
the flank, and there s d is known but for three numbers: linear least squares over the contacts gives J, s gap, s / k,
and what delay and coefficients in F are off by. Rows well within the play then give (1 - s) J.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsd_cli.identify.fit.pushes import Pushes, centred
from dsd_cli.identify.policy import POLICY
from dsd_cli.signals.log import Array
from dsd_cli.signals.spread import robust_deviation

#: Inertias of a motor alone that are tried, shares of the one of both.
_STARTS = np.geomspace(0.1, 0.95, 14)
#: Standard deviations of a window beyond which something pushes.
_PUSHED = 4.0
#: Share of half a gap within which a motor is alone.
_WITHIN = 0.9
#: Less than one, of counts that are whole numbers but for rounding.
_NONE = 0.5
#: Changes of the flank, and samples in contact for each unknown, below which nothing is identified; most samples.
_FEWEST, _EACH, _MOST = 8, 3, 2000
#: Motors that settle, in so many rounds of contacts and motor; rounds of the weights of contacts.
_SETTLED, _SETTLES, _WEIGHTS = 2, 3, 5
#: Samples beyond its window up to which a contact is an impact, of which the middle counts.
_BRIEF = 8
#: Times the least scatter, up to which a play counts for the values and their errors.
_NEARLY = 2.0


class Contacts(NamedTuple):
    """A motor and a load that touch at times.

    motor, inertia : of the motor alone, of both. reach, soft : s gap and s / k with their standard errors. scatter :
    by how much contacts lie off the flanks, and anything beyond them. changes : of the columns behind F. flanks : of
    every sample, -1 or 1, 0 in between. apart : s d. width : of the windows.
    """

    motor: float
    inertia: float
    reach: tuple[float, float]
    soft: tuple[float, float]
    scatter: float
    changes: Array
    flanks: list[NDArray[np.int_]]
    apart: list[Array]
    width: int

    @property
    def share(self) -> float:
        """The load's, of the inertia."""
        return 1.0 - self.motor / self.inertia

    @property
    def gap(self) -> float:
        """Total play."""
        return self.reach[0] / self.share

    @property
    def off(self) -> float:
        """`scatter` as a share of the play."""
        return self.scatter / self.reach[0] if self.reach[0] > 0.0 else math.inf

    @property
    def touching(self) -> list[NDArray[np.bool_]]:
        """Whether a sample is within a window of a contact, or may be: not well within the play."""
        pairs = zip(self.flanks, self._within, strict=True)
        return [~_eroded((x == 0) & within, self.width) for x, within in pairs]

    @property
    def _within(self) -> list[NDArray[np.bool_]]:
        """Whether the motor is well within the play, by its momentum."""
        least = 0.5 * _WITHIN * self.reach[0]
        return [np.abs(d) < least for d in self.apart]

    def pushed_alone(self, pushes: Pushes) -> float:
        """What pushes a motor well within the play, beyond noise, as a share of what does in contact.

        Masses that do not touch do not push each other: of play it is next to nothing, and of a force that is missing,
        whose pushes were taken for contacts, nearly as much. Infinite where the motor is hardly ever there.
        """
        pushed = self._between(pushes)
        inside = np.concatenate([x[_eroded(y, self.width)] for x, y in zip(pushed, self._within, strict=True)])
        touching = np.concatenate([x[y != 0] for x, y in zip(pushed, self.flanks, strict=True)])
        if len(inside) < _FEWEST * self.width:
            return math.inf
        beyond = max(float(np.mean(inside**2)) - (self.motor * pushes.spreads[self.width]) ** 2, 0.0)
        return math.sqrt(beyond / float(np.mean(touching**2)))

    def _between(self, pushes: Pushes) -> list[Array]:
        """Force on the motor that is not in F, mean of a window, by stretch."""
        nets = zip(pushes.net(self.changes), pushes.acceleration, strict=True)
        return [pushes.smooth(f - self.motor * a, self.width) for f, a in nets]

    def alone(self, pushes: Pushes) -> list[Array]:
        """Weight of each sample, 1 where the motor is alone, well within the play, by stretch.

        At a contact the balance says what is between the masses, and nothing of what else is missing. Where the motor
        is decides, not what is left of the balance: a force that is missing would choose its rows. Weights fade in and
        out over a window: cut at once, noise of a position would be an impulse at each end.
        """
        return [pushes.smooth(_eroded(x, 2 * self.width).astype(np.float64), self.width) for x in self._within]


def contacts_of(pushes: Pushes, inertia: float) -> list[Contacts]:
    """The play of each window whose contacts lie on the flanks about as well as those of the best one, the first.

    inertia : of both masses, roughly.
    """
    found: list[Contacts] = []
    for width in pushes.widths(inertia):
        none = np.zeros(len(pushes.forces) - 1)
        first = [touched(pushes, share * inertia, none, width, True) for share in _STARTS.tolist()]
        near = sorted((c for c in first if c is not None), key=lambda c: c.off)[:_SETTLED]
        settled = [_settled(pushes, x, resting) for x in near for resting in (False, True)]
        found += [c for c in settled if c is not None and c.pushed_alone(pushes) < POLICY.play_alone]
    found.sort(key=lambda c: c.off)
    return [c for c in found if c.off <= _NEARLY * found[0].off]


def contacts_with(pushes: Pushes, motor: float, inertia: float, gap: float) -> Contacts | None:
    """The contacts of a motor, both masses and a gap of these sizes; None where the log shows others, or none."""
    none = np.zeros(len(pushes.forces) - 1)
    tried = [touched(pushes, motor, none, w, resting) for w in pushes.widths(inertia) for resting in (False, True)]
    found = [c for c in tried if c is not None and motor < c.inertia and c.off < POLICY.play_off]
    given = (gap, inertia, motor)
    alike = [c for c in found if all(map(_alike, (c.gap, c.inertia, _alone(pushes, c)), given, [c.off] * len(given)))]
    return min(alike, key=lambda c: c.off, default=None)


def _alike(value: float, given: float, error: float) -> bool:
    """Whether two values differ by less than that relative error explains."""
    return abs(value - given) < POLICY.contradicting_deviations * error * value


def _eroded(marks: NDArray[np.bool_], width: int) -> NDArray[np.bool_]:
    """Those with no other within so many samples."""
    return centred((~marks).astype(np.float64), np.ones(2 * width + 1)) < _NONE


def _settled(pushes: Pushes, found: Contacts, resting: bool) -> Contacts | None:
    """Motor and contacts in turn."""
    for _ in range(_SETTLES):
        motor = _alone(pushes, found)
        again = touched(pushes, motor, found.changes, found.width, resting) if motor < found.inertia else None
        if again is None or not motor < again.inertia:
            return None
        found = again
    return found


def _alone(pushes: Pushes, found: Contacts) -> float:
    """Inertia of the motor, by the windows that touch nothing."""
    top = bottom = 0.0
    for f, a, touching in zip(pushes.net(found.changes), pushes.acceleration, found.touching, strict=True):
        f, a = (pushes.smooth(x, found.width)[~touching] for x in (f, a))
        top, bottom = top + float(f @ f), bottom + float(f @ a)
    return top / bottom if bottom > 0.0 else math.inf


def touched(pushes: Pushes, motor: float, changes: Array, width: int, resting: bool) -> Contacts | None:
    """The contacts of a motor of that inertia, by least squares of the momentum; None where there are too few.

    resting : only contacts that outlast a window show their depth; an impact is over before.
    """
    most, nets = _PUSHED * motor * pushes.spreads[width], pushes.net(changes)
    between = [pushes.smooth(f - motor * a, width) for f, a in zip(nets, pushes.acceleration, strict=True)]
    flanks = [(np.sign(x) * (np.abs(x) > most)).astype(int) for x in between]
    instants = [_instants(x, width) for x in flanks]
    unknown = 3 + len(changes) + sum(pushes.counts)
    thin = max(-(-sum(len(rows) for rows, _ in instants) // max(_MOST, 2 * _EACH * unknown)), 1)

    def at(parts: Sequence[Array]) -> Array:
        return np.concatenate([x[rows[::thin]] for x, (rows, _) in zip(parts, instants, strict=True)])

    sides, lasting = at(flanks), np.concatenate([x[::thin] for _, x in instants])
    driven, more = pushes.moved[1], pushes.moved[2:]
    depth = at(between) * (lasting if resting else 1.0)
    if np.sum(sides[1:] != sides[:-1]) < _FEWEST or len(sides) < _EACH * unknown:
        return None
    slow_at = np.concatenate([pushes.drift(i, rows[::thin]) for i, (rows, _) in enumerate(instants)])
    columns = np.column_stack([at(driven), 0.5 * sides, depth, *(at(x) for x in more), slow_at])
    theta, errors, scatter = _robust(columns, at(pushes.moved[0]))
    if not (theta[0] > 0.0 and theta[1] > 0.0):
        return None
    own, slow = theta[3 : 3 + len(more)], theta[3 + len(more) :]
    apart = [
        q - pushes.drifted(i, slow) - theta[0] * f - sum(c * x for c, x in zip(own, rest, strict=True))
        for i, (q, f, *rest) in enumerate(zip(pushes.moved[0], driven, *more, strict=True))
    ]
    least = [np.minimum(np.abs(d), np.abs(d - theta[2] * x)) for d, x in zip(apart, between, strict=True)]
    deep = np.maximum(np.concatenate(least) - 0.5 * theta[1], 0.0)
    scatter = math.hypot(scatter, math.sqrt(np.mean(deep**2)))
    reach, soft = zip(theta[1:3].tolist(), errors[1:3].tolist(), strict=True)
    return Contacts(motor, 1.0 / float(theta[0]), reach, soft, scatter, own / theta[0], flanks, apart, width)


def _instants(flank: NDArray[np.int_], width: int) -> tuple[NDArray[np.int_], Array]:
    """(samples in contact, 1 where it outlasts a window): the middle of each short contact, and samples of the others,
    so far apart that they are independent."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], flank, [0]])))
    found, lasting = [np.arange(0)], [np.zeros(0)]
    for a, b in zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True):
        if flank[a]:
            short = b - a <= 2 * width + _BRIEF
            rows = np.array([(a + b - 1) // 2]) if short else np.arange(a + width, b - width, max(width, 4))
            found.append(rows)
            lasting.append(np.full(len(rows), 0.0 if short else 1.0))
    return np.concatenate(found), np.concatenate(lasting)


def _robust(columns: Array, target: Array) -> tuple[Array, Array, float]:
    """(coefficients, standard errors, spread of what is left) by least squares that spare far rows."""
    size = np.linalg.norm(columns, axis=0)
    size[size == 0.0] = 1.0
    scaled, weight = columns / size, np.ones(len(target))
    for _ in range(_WEIGHTS):
        w = scaled * weight[:, None]
        inverse = np.linalg.pinv(w.T @ scaled, rcond=1e-13)
        theta = inverse @ (w.T @ target)
        rest = target - scaled @ theta
        spread = max(robust_deviation(rest), 1e-300)
        weight = 1.0 / (1.0 + (rest / (2.0 * spread)) ** 2)
    return theta / size, spread * np.sqrt(np.abs(np.diag(inverse))) / size, spread
