"""Play between motor and load, in the response of the acceleration to the force.

The motion of motor against load follows from the force alone, and does not drift: so the play is simulated, and only
its output is compared with a noisy sensor. Driven by the measured motion instead, noise would pick the load up.

The time of each contact hangs on every value, so the squares have many valleys. They are wide for the speed, with
amplitude and delay of the motion left free: there the play is looked for first. Then all values are fitted together,
those of the other forces too, which were fitted without the play.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import chain, product

import numpy as np

from dsd_cli.effects.backlash import CONTACT_DAMPING
from dsd_cli.effects.driven import driven_motor
from dsd_cli.effects.memory import Coupling
from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.search.signals import Signals, left, softened, variance_of
from dsd_cli.signals.log import Array
from dsd_cli.signals.spread import rms

#: Hz, above which the acceleration is softened while the play is looked for.
_SOFT = 10.0
#: Grid: own frequencies of the load in Hz (the last: times the sample rate), gaps per travel, shares, and parts.
_LOWEST, _HIGHEST, _FREQUENCIES = 4.0, 0.07, 8
_SMALLEST, _LARGEST, _GAPS = 7e-4, 0.12, 12
_SHARES, _PARTS = (0.12, 0.25, 0.45, 0.65), (0.2, 0.45, 0.7)
#: Starts that are refined, and how far apart they are; edges of the first simplex around a start, and later (log
#: frequency, log gap, logit, part of the friction).
_STARTS, _APART = 3, 0.5
_EDGES, _WIDE = (0.25, 0.25, 0.4, 0.2), (0.3, 0.1, 0.6, 0.2)
#: Share of its gain over a rigid axis by which the best play may lead those that count for its error.
_NEARLY = 0.2
#: Evaluations for a start, for all of its values, and for the best one.
_EVALUATIONS, _TOGETHER, _LAST = 80, 100, 200
#: Share of its squares that a step must take off, for the best one and where others follow.
_FOUND, _NEARLY_FOUND = 1e-8, 1e-5
#: Step of its derivatives, as a share of those, and where its unknowns begin.
_SHARE_OF_SCALE, _FAR = 0.01, 100.0
#: Which of the values are the log gap, the load's part of friction, the log inertia and the delay; that of no gap.
_LOG_GAP, PART, LOG_INERTIA, LATE, _NO_GAP = 1, 3, 4, 5, -60.0
#: Typical size of a step: log frequency, log gap, logit of the share, part of the friction, log inertia, samples of
#: delay, log damping; of other forces, as a share of all forces.
_SCALES, _SCALE_OF_FORCES = (0.1, 0.1, 0.3, 0.1, 0.05, 0.3, 0.3), 0.05
#: Slowest free vibration, times the lowest of the grid, fastest, times the sample rate, and samples of delay that are
#: looked at.
_SLOWEST, _FASTEST, _LATEST = 0.1, 0.25, 8.0
#: Share of the nats that an answer must have, with which a start is refined.
_WORTH_A_FIT = 0.5
#: Of a share: 1e-4 and 1 - 1e-4.
_MOST_LOGIT = 9.2
#: Step of a derivative, and the residual, times the signal, that stands for a load which the sampling cannot resolve.
_STEP, _SENSELESS = 1e-3, 1e3


class Play:
    """Fits of a gap.

    `at` : (log own frequency in Hz, log gap, logit of the share, the load's part of Coulomb friction, log inertia,
    samples of delay, log of the contact's damping over the catalogue's, and of each coefficient of the other forces its
    change, as a share of the net force), shape (7 + p,). With the catalogue's damping in place of its own a gap came
    out 5 to 15 % off; without its friction a load is met elsewhere. friction : of both masses, of coefficients, (p,).
    """

    def __init__(self, signals: Signals, travel: float, friction: Array) -> None:
        self.signals, self.travel, self.friction = signals, travel, friction
        size, *sizes = (rms(np.concatenate(x)) for x in (signals.force, *signals.given))
        self._units = np.array([size / max(x, 1e-300) for x in sizes])
        self._given = [unit * signals.rows(x) for unit, x in zip(self._units, signals.given, strict=True)]

    def starts(self) -> list[Array]:
        """Plays that leave least of the softened acceleration, best first; none where a rigid axis leaves as little."""
        soft = Play(softened(self.signals, _SOFT), self.travel, self.friction)
        shapes, rigid = soft._shapes(), soft._rigid()
        left, _, rest = soft._explained(shapes[0])
        if not float(rigid @ rigid) - left > 2.0 * variance_of(rest) * _WORTH_A_FIT * POLICY.response_nats:
            return []
        return sorted((soft.fitted(soft._at(x), _TOGETHER) for x in shapes), key=soft._squares)

    def best(self, starts: Sequence[Array]) -> tuple[Array, list[Array]]:
        """(the play that leaves least, plays that leave nearly as little), each of shape (7 + p,)."""
        found = [self.fitted(at, _TOGETHER) for at in starts]
        found += [self.fitted(self._at(self._lowest(at[:4], _WIDE)), _TOGETHER) for at in found]
        squares = [self._squares(at) for at in found]
        most = min(squares) + _NEARLY * (float(np.sum(self._rigid() ** 2)) - min(squares))
        near = [at for at, x in zip(found, squares, strict=True) if x <= most]
        return self.fitted(found[int(np.argmin(squares))], _LAST), near

    def fitted(self, at: Array, evaluations: int = _LAST) -> Array:
        """All values from there on, by Levenberg and Marquardt's method, shape (7 + p,); to all digits the best one."""
        from scipy.optimize import least_squares

        limits = {"max_nfev": evaluations, "ftol": _FOUND if evaluations == _LAST else _NEARLY_FOUND}
        scales = np.concatenate([_SCALES, np.full(len(self._units), _SCALE_OF_FORCES)])

        def left(x: Array) -> Array:
            return self.left(at + scales * (x - _FAR))

        with np.errstate(all="ignore"):  # steps are shares of x, which is far from 0 for that
            found = least_squares(left, np.full(len(at), _FAR), method="lm", diff_step=_SHARE_OF_SCALE / _FAR, **limits)
        return np.asarray(at + scales * (found.x - _FAR))

    def left(self, at: Array) -> Array:
        """What remains of the whitened acceleration, shape (n,), unit of u."""
        if not self._sensible(at):
            return _SENSELESS * self.signals.target
        signals, (frequency, gap, share, part, inertia, late, damping) = self.signals, _plain(at)
        coupling = Coupling.of(frequency, damping, gap, part * float(self.friction.sum()) / (share * inertia))
        changes = self.changes(at)
        moved = []
        for i, (force, shift, s) in enumerate(zip(signals.force, signals.shift, signals.stretches, strict=True)):
            net = force + late * shift - sum(c * x[i] for c, x in zip(changes, signals.given, strict=True))
            moved.append(driven_motor(net / ((1.0 - share) * inertia), signals.step, coupling, share, s.speed))
        return np.asarray(signals.target - signals.inertia * signals.rows(moved))

    def sprung(self, at: Array) -> Array:
        """What remains without the gap: a load on a spring that rubs."""
        return self.left(self.fitted(np.where(np.arange(len(at)) == _LOG_GAP, _NO_GAP, at), _TOGETHER))

    def changes(self, at: Array) -> Array:
        """Of the coefficients of the other forces, shape (p,); what friction the load has the motor has not."""
        return np.asarray(at[7:] * self._units - _plain(at)[PART] * self.friction)

    def values(self, at: Array, variance: float, near: Sequence[Array]) -> dict[str, tuple[float, float]]:
        """{parameter of the effect: (value, standard error)}.

        The error is that of the curvature, or the scatter of the plays that leave nearly as little, if it is larger: in
        which of the valleys a fit ends is chance, of which the curvature knows nothing.

        variance : of a row. near : as `best`.
        """
        slopes = [(self.left(at + _STEP * e) - self.left(at - _STEP * e)) / (2.0 * _STEP) for e in np.eye(len(at))]
        jacobian = np.stack(slopes, axis=1)
        covariance = variance * np.linalg.pinv(jacobian.T @ jacobian)
        given = self._of_effect(at)
        rates = np.stack([(self._of_effect(at + 1e-6 * e) - given) / 1e-6 for e in np.eye(len(at))], axis=1)
        curved = np.maximum(np.diag(rates @ covariance @ rates.T), 0.0)
        scatter = np.mean([(self._of_effect(x) - given) ** 2 for x in (at, *near)], axis=0)
        spread = np.sqrt(np.maximum(curved, scatter))
        names = ("gap", "load_share", "stiffness", "load_level")
        found = {n: (float(v), float(s)) for n, v, s in zip(names, given, spread, strict=True)}
        level, error = found["load_level"]
        return found if level > POLICY.value_deviations * error else {n: found[n] for n in names[:-1]}

    def _of_effect(self, at: Array) -> Array:
        """(gap, load's share, stiffness of the contact, friction of the load)."""
        frequency, gap, share, part, inertia, *_ = _plain(at)
        return np.array([gap, share, share * inertia * (2.0 * math.pi * frequency) ** 2, part * self.friction.sum()])

    def _squares(self, at: Array) -> float:
        rest = self.left(at)
        return float(np.nan_to_num(rest @ rest, nan=math.inf, posinf=math.inf))

    def _shapes(self) -> list[Array]:
        """(log frequency, log gap, logit, part) of the best plays of a grid that are unlike each other, refined; best
        first. Amplitude and delay of the motion and the other forces are left free."""
        ranked = sorted(self._grid(), key=lambda shape: self._explained(shape)[0])
        distinct: list[Array] = []
        for shape in ranked:
            if len(distinct) < _STARTS and all(np.abs(shape - d).max() > _APART for d in distinct):
                distinct.append(shape)
        return sorted((self._lowest(x, _EDGES) for x in distinct), key=lambda shape: self._explained(shape)[0])

    def _lowest(self, shape: Array, edges: Sequence[float]) -> Array:
        """The best shape near one, by a simplex with these edges."""
        from scipy.optimize import minimize

        limits = {"maxfev": _EVALUATIONS, "initial_simplex": np.vstack([shape, shape + np.diag(edges)])}
        found = minimize(lambda x: self._explained(x)[0], shape, method="Nelder-Mead", options=limits)
        return np.asarray(found.x)

    def _at(self, shape: Array) -> Array:
        """All values: what makes the motion smaller by a factor is an inertia and a gap that are larger and smaller."""
        size, change, *others = self._explained(shape)[1]
        size = min(max(size, 0.2), 5.0)
        early = min(max(change / size, 1.0 - _LATEST), _LATEST - 1.0)
        own = [shape[0], shape[1] + math.log(size), *shape[2:], math.log(self.signals.inertia / size), early, 0.0]
        return np.array([*own, *(-x / size for x in others)])

    def _explained(self, shape: Array) -> tuple[float, Array, Array]:
        """(squares left, factors on its motion, on the change of that over a sample and on what other forces do to a
        rigid axis, what is left)."""
        at = np.concatenate([shape, [math.log(self.signals.inertia), 0.0, 0.0], np.zeros(len(self._units))])
        target = self.signals.target
        moved = target - self.left(at) if self._sensible(at) else np.full(len(target), np.nan)
        if not np.all(np.isfinite(moved)):  # what a senseless load leaves is a multiple of the target
            return math.inf, np.eye(1, 2 + len(self._given))[0], target
        rows = np.stack([moved, np.gradient(moved), *self._given])
        weights = np.linalg.lstsq(rows @ rows.T, rows @ target, rcond=1e-12)[0]
        rest = target - weights @ rows
        return float(rest @ rest), weights, rest

    def _rigid(self) -> Array:
        """What a rigid axis leaves with all forces free, shape (n,)."""
        signals = self.signals
        columns = [signals.rows(x) for x in (signals.force, signals.shift, *signals.given)]
        return left(np.stack(columns, axis=1), signals.target)

    def _sensible(self, at: Array) -> bool:
        """Whether its contacts swing, and the sampling resolves them: far outside, an integration takes very long."""
        frequency, gap, share, _, _, late, damping = _plain(at)
        resolved = _SLOWEST * _LOWEST < frequency / math.sqrt(1.0 - share) < _FASTEST / self.signals.step
        return resolved and gap < self.travel and abs(late) < _LATEST and damping < 1.0

    def _grid(self) -> list[Array]:
        top = _HIGHEST / self.signals.step
        frequencies = np.geomspace(_LOWEST, max(top, 2.0 * _LOWEST), _FREQUENCIES)
        gaps = np.geomspace(_SMALLEST, _LARGEST, _GAPS) * self.travel
        rubbing = product(frequencies[::-3], gaps, _SHARES, _PARTS if self.friction.any() else ())
        return [
            np.array([math.log(f), math.log(gap), math.log(s / (1.0 - s)), part])
            for f, gap, s, part in chain(product(frequencies, gaps, _SHARES[:3], (0.0,)), rubbing)
        ]


def _plain(at: Array) -> tuple[float, float, float, float, float, float, float]:
    f, gap, s, part, j, late, z = (0.0 if math.isnan(x) else min(max(x, -60.0), 60.0) for x in at[:7].tolist())
    share = 1.0 / (1.0 + math.exp(-min(max(s, -_MOST_LOGIT), _MOST_LOGIT)))
    return math.exp(f), math.exp(gap), share, max(part, 0.0), math.exp(j), late, CONTACT_DAMPING * math.exp(z)
