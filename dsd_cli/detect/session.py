"""From cleaned pieces of a log to one label per row of the log."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from dsd_cli.detect.damping.derivative import DampingStates
from dsd_cli.detect.doubts import Doubts
from dsd_cli.detect.engine import Engine, Forces, Labels, Measurement
from dsd_cli.detect.plan import Plan
from dsd_cli.detect.profile.cells import Estimates
from dsd_cli.detect.repeats import Repeats
from dsd_cli.detect.rest import FrictionMarks
from dsd_cli.detect.rows import (
    Inputs,
    Rows,
    cut,
    estimates_of,
    held_again,
    joined,
    labels_arrays,
    part,
    unjudged,
)
from dsd_cli.detect.settings import ESTIMATING, OFFLINE
from dsd_cli.effects import Channels
from dsd_cli.plant.forces import Sample, interval_channels, interval_forces
from dsd_cli.plant.observer import DisturbanceObserver
from dsd_cli.signals.cleaning import Cleaner, Piece
from dsd_cli.signals.clock import clock_window
from dsd_cli.signals.log import Array

if TYPE_CHECKING:
    from dsd_cli.detect.profile.changes import Change


class Session:
    """Feed raw rows, get labels: cleaning, observer, effect forces and engine in a row.

    Online methods give the labels of every row as soon as its clock is known; viterbi and smooth give all at
    `finish`. `observed` : stamps (s) and d_hat (unit of u) of the samples that were labelled last.
    """

    def __init__(self, plan: Plan, cleaner: Cleaner) -> None:
        self.plan, self.cleaner = plan, cleaner
        self.engine: Engine | None = None
        self.repeats = Repeats(plan)
        self._doubts: Doubts | None = None  # as the engine: when the clock is known
        self._observer: DisturbanceObserver | None = None
        self._damping: DampingStates | None = None
        self._last_t: float | None = None
        self._before: Sample | None = None
        self._friction: FrictionMarks | None = None
        self._motion: Array | None = None  # mean speed and its sign, of the samples at hand
        self._label = plan.settings.initial
        self._waiting: list[Piece] = []
        self._early = 0
        # before the first estimate; () for methods that have none
        self._estimates: tuple[float, ...] = (np.nan,) * 4 if plan.settings.method in ESTIMATING else ()
        self._in_window = 0
        self._stamps: Array | None = np.empty(0) if cleaner.sample_time is None else None
        self._settling = 0
        self.observed: tuple[Array, Array] = (np.empty(0), np.empty(0))

    @property
    def label(self) -> int:
        """The state chosen last."""
        return self._label

    @property
    def changes(self) -> list[Change]:
        """Changes of state so far (method "profile"); times are stamps, s."""
        return [] if self.engine is None else self.engine.changes

    @property
    def warnings(self) -> list[str]:
        """One sentence each, about the rows so far."""
        doubts = [] if self._doubts is None else self._doubts.warnings
        return [*self.cleaner.warnings, *self.repeats.warnings(self.cleaner.sample_time), *doubts]

    def feed(self, t: Array | None, values: Mapping[str, Array], restart: bool = False) -> Iterator[Rows]:
        """Rows as they are in the log, shape (n,) each; `restart`: they begin another recording."""
        if restart:
            yield from self._label_pieces(self.cleaner.restart())
        if self._stamps is not None and t is not None:
            self._stamps = np.concatenate([self._stamps, t])
        yield from self._label_pieces(self.cleaner.feed(t, {name: values[name] for name in self.plan.columns}))

    def held(self, t: Array) -> Rows | None:
        """Labels of the rows that a live stream just fed, if they wait for the clock: they are rows of the warm-up.

        `feed` then leaves them out when they come. Methods that need the whole log give no early labels.
        """
        new = self.cleaner.held - self._early
        if new <= 0 or self.plan.settings.method in OFFLINE:
            return None
        self._early += new
        nothing = np.full(new, np.nan)
        state = np.full(new, self._label, dtype=np.int32)
        unsure, none = np.zeros(new, dtype=np.bool_), np.zeros(new, dtype=np.int32)
        found = Estimates(nothing, nothing, nothing, nothing, unsure, unsure) if self._estimates else ()
        return Rows(t[-new:], state, nothing, nothing, unsure, none, found)

    def _after_early(self, rows: Rows) -> Rows:
        skip = min(self._early, rows.state.size)
        self._early -= skip
        return part(rows, skip) if skip else rows

    def finish(self) -> Iterator[Rows]:
        """The end of the log."""
        yield from self._label_pieces(self.cleaner.finish())
        if self._waiting:
            yield from self._offline()

    # -- pieces ----------------------------------------------------------------------------------------------------

    def _label_pieces(self, pieces: list[Piece]) -> Iterator[Rows]:
        self._watch_clock()
        self.repeats.look(pieces)
        if self.plan.settings.method in OFFLINE:
            self._waiting += pieces
            return
        for piece in pieces:
            if piece.restart:
                self._restart()
            rows = self._to_rows(piece, self._run(piece) if piece.t.size else None)
            yield self._after_early(unjudged(rows, self._settling - piece.start, self.plan.settings.initial))

    def _watch_clock(self) -> None:
        """Rows that the clock was settled from are warm-up, also where bridged holes make many samples of them.

        A live stream labels them before there is a clock, and a file gets the same labels.
        """
        if self._stamps is not None and self.cleaner.sample_time is not None:
            self._settling = clock_window(self._stamps) or self._stamps.size
            self._stamps = None

    def _offline(self) -> Iterator[Rows]:
        """Every recording of the log as a whole: one engine run from restart to restart."""
        runs: list[list[Piece]] = []
        for piece in self._waiting:
            if piece.restart or not runs:
                runs.append([])
            runs[-1].append(piece)
        self._waiting = []
        for run in runs:
            self._restart()
            inputs = [self._inputs(piece) for piece in run if piece.t.size]
            labels = self._run_inputs(joined(inputs)) if inputs else None
            begin = 0
            for piece in run:
                end = begin + piece.t.size
                yield self._to_rows(piece, cut(labels, begin, end) if labels is not None and end > begin else None)
                begin = end

    def _restart(self) -> None:
        if self.engine is not None:
            self.engine.restart()
        if self._doubts is not None:
            self._doubts.restart()
        self._observer, self._last_t, self._before, self._friction = None, None, None, None
        self._damping, self._in_window = None, 0

    def _run(self, piece: Piece) -> Labels:
        return self._run_inputs(self._inputs(piece))

    def _run_inputs(self, inputs: Inputs) -> Labels:
        engine = self._engine_now()
        if self._doubts is None:
            self._doubts = Doubts(self.plan, engine)
        model = self._doubts.model(len(inputs.u))
        labels = engine.run(inputs.u, inputs.d_hat, t=inputs.t, forces=inputs.forces, model=model)
        labels = self._doubts.checked(labels, inputs, model)
        return held_again(labels, self._estimates) if labels.estimates else labels

    def _engine_now(self) -> Engine:
        if self.engine is None:
            plan, regular = self.plan, self.cleaner.regular
            measurement = Measurement(
                sample_time=self._sample_time(),
                nominal_inertia=plan.observer.nominal_inertia,
                time_constant=plan.observer.time_constant,
                sign=plan.observer.sign,
                aperture=plan.aperture,
                timed=not regular,
            )
            self.engine = Engine(plan.grid, plan.settings, measurement, plan.backend)
        return self.engine

    def _sample_time(self) -> float:
        sample_time = self.cleaner.sample_time
        assert sample_time is not None, "pieces come only after the clock is settled"
        return sample_time

    def _derivatives(self, u: Array, d_hat: Array, t: Array) -> Inputs:
        """Eq. 6: the engine compares derivatives; u has done its part in them."""
        if self._damping is None:
            self._damping = DampingStates(self.plan.grid, self._engine_now().measurement)
        rate, forces = self._damping.run(u, d_hat)
        return Inputs(np.zeros_like(u), rate, t, forces)

    def _inputs(self, piece: Piece) -> Inputs:
        u = piece.values["u"]
        d_hat = piece.values[self.plan.measured]
        if self.plan.d_hat_source != "logged":
            if self._observer is None:
                self._observer = DisturbanceObserver(self.plan.observer, self._sample_time(), self.plan.d_hat_source)
            d_hat = self._observer.run(u, d_hat, piece.stamps)
        self.observed = piece.t, d_hat
        if self.plan.settings.output == "derivative":
            return self._derivatives(u, d_hat, piece.t)
        forces = self._forces(piece) if self.plan.has_effects or self.plan.has_motion else None
        if forces is not None and self._friction is not None and self._friction.turning.any():
            d_hat = d_hat - self.plan.observer.sign * self._friction.turning
        self._last_t = float(piece.t[-1])
        resting = None if self._friction is None else self._friction.resting
        return Inputs(u, d_hat, piece.t, forces, resting, self._motion)

    def _forces(self, piece: Piece) -> Forces | None:
        """Forces of every combination of effect values, per interval that ends at a sample; beside them the motion."""
        velocity, position = piece.values.get("velocity"), piece.values.get("position")
        if self.plan.aperture == 2 and position is not None:
            velocity = None  # the speed then is the same difference of positions that d_hat was made from
        interval: float | Array = self._sample_time()
        if piece.stamps is not None:
            start = piece.t[0] - interval if self._last_t is None else self._last_t
            interval = np.diff(piece.t, prepend=start)
        u, n = piece.values["u"], piece.t.size
        means = None
        missing, middle = np.full(n, np.nan), piece.t - 0.5 * interval
        if velocity is None and position is None:
            channels, sign = Channels(middle, u, missing, missing, interval), np.zeros(n)
        else:
            means = interval_channels(velocity, position, interval, self.plan.model.rest_speed, self._before)
            channels, sign = Channels(middle, u, means.velocity, means.position, interval), means.sign
            self._before = Sample(
                None if velocity is None else float(velocity[-1]), None if position is None else float(position[-1])
            )
            self._motion = np.column_stack([means.velocity, means.sign])
        if not self.plan.has_effects:
            return None
        pairs = [interval_forces(model.effects, channels, model.inertia) for model in self.plan.effects]
        applied, budget = (np.column_stack([np.broadcast_to(pair[i], n) for pair in pairs]) for i in (0, 1))
        if means is not None:
            if self._friction is None:
                self._friction = FrictionMarks(self.plan, self._sample_time(), alone=velocity is None)
            sign = self._friction.marked(means, position, interval, (u, applied, budget))
            self._motion = np.column_stack([means.velocity, sign])
        return Forces(applied, budget, sign)

    # -- rows ------------------------------------------------------------------------------------------------------

    def _samples(self, log_likelihood: Array) -> NDArray[np.int32]:
        """How many samples the window holds, for each of the next samples of the engine."""
        window = self.plan.settings.effective_window
        judged = np.isfinite(log_likelihood)
        if self._in_window >= window and judged.all():
            return np.full(judged.size, window, dtype=np.int32)
        count = np.minimum(self._in_window + np.cumsum(judged), window)
        self._in_window = int(count[-1]) if count.size else self._in_window
        return np.where(judged, count, 0).astype(np.int32)

    def _to_rows(self, piece: Piece, labels: Labels | None) -> Rows:
        """Samples back to the rows they came from; every row gets a label."""
        estimates = estimates_of(labels, piece.keep, piece.rows, self._estimates)
        if estimates and piece.rows:
            self._estimates = tuple(float(column[-1]) for column in estimates[:4])
        if labels is not None and piece.keep is None:
            self._label = int(labels.state[-1])
            state, ll, probability, confident = labels_arrays(labels)
            return Rows(piece.row_t, state, ll, probability, confident, self._samples(ll), estimates)
        n = piece.rows
        out = Rows(
            piece.row_t,
            np.full(n, self._label, dtype=np.int32),
            np.full(n, np.nan),
            np.full(n, np.nan),
            np.zeros(n, dtype=np.bool_),
            np.zeros(n, dtype=np.int32),
            estimates,
        )
        if labels is None or piece.keep is None:
            return out
        at = np.flatnonzero(piece.keep >= 0)
        rows = piece.keep[at]
        sources = (*labels_arrays(labels), self._samples(labels.log_likelihood))
        for target, source in zip(out[1:6], sources, strict=True):
            target[rows] = source[at]
        kept = np.zeros(n, dtype=np.int64)
        kept[rows] = rows + 1
        last = np.maximum.accumulate(kept) - 1
        out.state[last >= 0] = out.state[last[last >= 0]]
        self._label = int(out.state[-1]) if n else self._label
        return out
