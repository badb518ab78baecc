"""Which intervals may vote: those in which the axis moves in a direction that the sensor shows.

A resting axis has no net force, whatever u is: friction takes up what it must. Where the model's friction could not do
that for any candidate, the axis sticks by a friction that the model does not have: such an interval says nothing about
inertia or delay, so its prediction is no force, for every candidate.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dsd_cli.detect.plan import Plan
from dsd_cli.effects import Role, get_effect
from dsd_cli.plant.filtering import lowpass_irregular, poles_of
from dsd_cli.plant.forces import IntervalChannels
from dsd_cli.signals.log import Array

#: Steps of the encoder that must lie behind a sample for the direction to be known.
LEAST_STEPS = 2.0
#: Samples to look back on at least: two changes must fit in.
LEAST_SPAN = 4
#: Share of a window that may be at rest without reason on irregular stamps, for its label to be confident.
MOST_REST = 0.02


class Motion:
    """Follows a position sample by sample: is it moving, by more than its resolution?

    The resolution is the smallest change seen so far, so that a position that is not quantised always moves.

    Parameters
    ----------
    span : samples to look back on.
    """

    def __init__(self, span: int) -> None:
        self._span = max(span, LEAST_SPAN)
        self._past: Array | None = None
        self._step = np.inf
        self._seen = 0

    def follow(self, position: Array) -> tuple[Array, NDArray[np.bool_]]:
        """Direction of the next samples, and whether the axis rests; both shape (n,).

        1 or -1 where it moved by two steps or more over the span, never back, and not come to rest since; else NaN. It
        rests where it made less than two changes and two steps.
        """
        past = np.full(self._span, position[0]) if self._past is None else self._past
        all_of_it = np.concatenate([past, position])
        every = np.diff(all_of_it)
        changes = np.abs(every[self._span - 1 :])
        steps = np.minimum.accumulate(np.minimum(np.where(changes > 0.0, changes, np.inf), self._step))
        self._past, self._step = all_of_it[position.size :], float(steps[-1])
        moved = position - all_of_it[: position.size]
        clear = np.abs(moved) >= (LEAST_STEPS - 1e-6) * steps
        forward, back = (self._counted(every * side > 0.0, self._span) for side in (1.0, -1.0))
        clear &= (forward == 0) | (back == 0)
        clear &= self._counted(every != 0.0, (self._span + 1) // 2) > 0
        rests = (forward + back < LEAST_STEPS) & ~(np.abs(moved) >= (LEAST_STEPS - 1e-6) * steps)
        rests &= self._seen + np.arange(position.size) >= self._span  # nothing is known of what was before
        self._seen += position.size
        return np.where(clear, np.sign(moved), np.nan), rests

    def _counted(self, changes: NDArray[np.bool_], span: int) -> NDArray[np.intp]:
        """How many of the last `span` changes are of a kind, per sample."""
        total = np.concatenate([[0], np.cumsum(changes)])
        return np.asarray(total[self._span :] - total[self._span - span : -span])


class RestShare:
    """Which labels rest on rest: too much of their window is intervals that no friction of the model explains.

    Parameters
    ----------
    window : samples that a decision looks back on.
    """

    def __init__(self, window: int) -> None:
        self._past = np.zeros(window, dtype=np.bool_)

    def restart(self) -> None:
        """What comes next rests on nothing that was before."""
        self._past[:] = False

    def unfounded(self, resting: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Of the next samples; both of shape (n,)."""
        window = self._past.size
        all_of_it = np.concatenate([self._past, resting])
        total = np.cumsum(all_of_it, dtype=np.intp)
        self._past = all_of_it[resting.size :]
        return np.asarray(total[window:] - total[: resting.size] > MOST_REST * window)


class FrictionMarks:
    """Marks the intervals that say nothing because friction there is whatever explains the motion.

    These are those at rest that no candidate explains, and those in which the plant starts, stops or turns: there J a
    is what was measured, for every inertia, so that Q { Jn a } of it is taken out of d_hat (`turning`) instead of being
    predicted. On irregular stamps rests have their vote, but no label may rest on them (`resting`, for `RestShare`).
    """

    def __init__(self, plan: Plan, sample_time: float, alone: bool) -> None:
        effects = {name for model in plan.effects for name in model.effects}
        self._acts = any(get_effect(name).role is Role.FRICTION for name in effects)
        self._plan = plan
        self._motion = Motion(round(2.0 * plan.observer.time_constant / sample_time))
        self._alone = alone
        self._lags = sorted({round(delay / sample_time) for delay in plan.grid.delays})
        self._past: Array | None = None  # the last samples of u, as far as a delay reaches
        self._turned = 0.0
        self.turning = np.zeros(0)
        self.resting = np.zeros(0, dtype=np.bool_)

    def marked(
        self,
        means: IntervalChannels,
        position: Array | None,
        interval: float | Array,
        pushed: tuple[Array, Array, Array],
    ) -> Array:
        """The signs of the speed, infinite where an interval says nothing; shape (n,).

        Parameters
        ----------
        position : shape (n,), where it is read; `alone` of the constructor: it alone shows the motion.
        pushed : u, shape (n,); forces and friction budgets, shape (n, combinations).
        """
        self.turning, self.resting = np.zeros(means.sign.size), np.zeros(means.sign.size, dtype=np.bool_)
        if not self._acts:
            return means.sign
        sign, still = means.sign, np.isnan(means.sign)
        if position is not None:
            direction, rests = self._motion.follow(position)
            # a speed flickers at rest where the position stands
            still = (rests if self._alone else still | rests) & ~self._explained(*pushed)
            if self._alone and self._plan.settings.sensor_noise:  # a single step of a coarse position is no direction
                sign = direction
                still |= np.isnan(direction)
        else:
            still &= ~self._explained(*pushed)
        if np.ndim(interval) > 0:
            # with rests left out, a real servo whose friction the model lacks had labels that are confident and wrong
            # in motion, where it had none before
            self.resting, still = still, np.zeros(sign.size, dtype=np.bool_)
        turns = self._taken_out(means.acceleration, interval) if self._plan.has_friction else still
        return np.where(still | turns, np.inf, sign)

    def _explained(self, u: Array, force: Array, budget: Array) -> NDArray[np.bool_]:
        """Where, for some candidate, friction holds the axis against what has arrived of u; shape (n,)."""
        longest = max(self._lags) + 1
        past = np.full(longest, u[0]) if self._past is None else self._past
        history = np.concatenate([past, u])
        self._past = history[u.size :]
        held = np.zeros(u.size, dtype=np.bool_)
        for lag in self._lags:
            drive = history[longest - 1 - lag : longest - 1 - lag + u.size]  # u of the interval that ends at a sample
            held |= (np.abs(drive[:, None] + force) <= budget).any(axis=1)
        return held

    def _taken_out(self, acceleration: Array, interval: float | Array) -> NDArray[np.bool_]:
        """Which intervals start, stop or turn; `turning` is what they put into d_hat."""
        observer, turns = self._plan.observer, np.isfinite(acceleration)
        if not self._plan.settings.observer_filter:
            return np.zeros(turns.size, dtype=np.bool_)
        if turns.any() or self._turned != 0.0:
            raw = observer.nominal_inertia * np.where(turns, acceleration, 0.0)
            poles = poles_of(np.broadcast_to(interval, turns.shape).tolist(), observer.time_constant)
            self.turning = lowpass_irregular(raw, poles, self._turned)
            self._turned = float(self.turning[-1])
            self._turned = 0.0 if abs(self._turned) < 1e-300 else self._turned
        return turns
