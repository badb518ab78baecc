"""Labels that one wrong value of u decides: a corrupt cell looks like a command that the plant never got.

A delay of 0 with the nominal inertia predicts d_hat = 0 for any u. One wrong value of u therefore speaks, with all the
weight of its square, for that state and against every other, and d_hat cannot contradict; delays see it one after the
other. So every value that stands out is asked both ways: was it commanded, or is it wrong? A second kernel takes u with
the value before in its place (and the d_hat that the observer would have computed from that). A label stays confident
only if its state, with u as logged, leads every other state with u either way. Once no state explains its window
without the value and one does with it, it was commanded, and is no spike any more.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsd_cli.detect.engine import Labels
from dsd_cli.detect.kernel import Kernel, likelihoods, make_kernel
from dsd_cli.detect.plan import Plan
from dsd_cli.detect.rows import Inputs, joined
from dsd_cli.detect.spec import WARMUP, KernelSpec
from dsd_cli.plant.filtering import SETTLED
from dsd_cli.plant.observer import DisturbanceObserver
from dsd_cli.signals.log import Array
from dsd_cli.signals.outliers import TIMES, Level

#: Times the level from which on a value of u is asked both ways: the least that `Level` distinguishes from it.
FACTOR = 2.0
#: Nats that both ways may still differ by in any state once a spike has left all windows.
FORGOTTEN = 1e-3
#: Likelihoods that are held at once.
AT_ONCE = 1_000_000


class Spikes:
    """Finds the labels that rest on a spike; every sample passes through it, in order.

    `largest` : of the spikes so far, unit of u.
    """

    def __init__(self, plan: Plan, spec: KernelSpec) -> None:
        self.largest = 0.0
        self._level = Level()
        self._ways = _Ways(plan, spec)
        self._past: deque[_Samples] = deque()  # what a kernel that begins now must have seen
        self._spikes: list[tuple[int, float]] = []  # row and size
        self._asked: list[_Asked] = []  # with u as logged; then without each run of spikes, at last without all

    @property
    def level(self) -> float:
        """What u usually reaches, as a power of two."""
        return self._level.value

    def restart(self) -> None:
        """What comes next rests on nothing that was before; the level of u stays."""
        self._past.clear()
        self._spikes, self._asked = [], []

    def unfounded(self, inputs: Inputs, labels: Labels) -> NDArray[np.bool_] | None:
        """Which labels and estimates of the next samples, shape (n,), rest on a spike; None: none does."""
        start = self._level.rows
        samples = _Samples(start, inputs)
        found = self._level.follow(inputs.u, FACTOR)
        wrong = np.zeros(inputs.u.size, dtype=np.bool_) if found or self._spikes else None
        begin = 0
        for row, size, level in found:
            self._advance(samples, slice(begin, row - start), labels, wrong)
            begin = row - start
            since = row - self._ways.lasting
            self._spikes = [one for one in self._spikes if one[1] >= FACTOR * level and one[0] >= since]
            if size >= FACTOR * level:
                self.largest = max(self.largest, size)
                self._spikes.append((row, size))
            self._asked = []
        self._advance(samples, slice(begin, inputs.u.size), labels, wrong)
        self._remember(samples)
        return wrong

    def _advance(self, samples: _Samples, rows: slice, labels: Labels, wrong: NDArray[np.bool_] | None) -> None:
        """Both ways over these samples where a label or an estimate is confident, as long as they differ."""
        begin, size = rows.start, self._ways.at_once
        while self._spikes and begin < rows.stop and wrong is not None:
            stop = min(begin + size, rows.stop)
            after = samples.start + stop - self._spikes[-1][0]
            if not any(column[begin:stop].any() for column in (labels.confident, *labels.estimates[4:])):
                self._asked = []
                if after > self._ways.lasting:
                    self._spikes = []
            elif self._asked or self._begin(samples, begin):
                logged, others, length = self._both(samples.part(begin, stop))
                stop = begin + length
                for other in others:
                    wrong[begin:stop] |= self._ways.decided(logged, other, labels.state[begin:stop])
                    if labels.estimates:
                        wrong[begin:stop] |= self._ways.excluded(logged, other)[:length]
                gone = all(_apart(logged[-1], other[-1]) <= FORGOTTEN for other in others)
                if self._asked and gone and after > self._ways.reach:
                    self._spikes, self._asked = [], []
            else:
                stop = begin  # no spike is left
            begin = stop

    def _begin(self, samples: _Samples, now: int) -> bool:
        """Kernels that have taken what was before the sample `now` of these; whether a spike is left."""
        known = _joined([*self._past, samples.part(0, now)])
        while self._spikes and not self._asked:
            rows = [row for row, _ in self._spikes]
            runs = [part.tolist() for part in np.split(rows, np.flatnonzero(np.diff(rows) >= TIMES) + 1)]
            sets = [[], *(runs[-TIMES:] if len(runs) > 1 else []), rows]  # more would be a level
            self._asked = [_Asked(self._ways, frozenset(one)) for one in sets]
            begin, end = max(rows[0] - self._ways.memory - known.start, 0), len(known.inputs.u)
            while self._asked and begin < end:
                stop = min(begin + self._ways.at_once, end)
                self._both(known.part(begin, stop))
                begin = stop
        return bool(self._spikes)

    def _both(self, samples: _Samples) -> tuple[Array, list[Array], int]:
        """Likelihoods with u as logged, without spikes, and of how many samples: up to where a spike was commanded.

        That one is none any more, and what follows begins anew. Where one run of them says it, it says nothing of the
        others, which no measurement may have seen yet.
        """
        logged, *others = (asked.likelihoods(samples) for asked in self._asked)
        first = [_first(self._ways.needed(logged, other)) for other in others]
        which = int(np.argmin(first))  # of those that say it at once the first: all of them are last
        if first[which] == len(logged):
            return logged, others, len(logged)
        without = self._asked[1 + which].without
        self._spikes, self._asked = [one for one in self._spikes if one[0] not in without], []
        return logged, others, first[which] + 1

    def _remember(self, samples: _Samples) -> None:
        """Keep what a kernel needs that begins at the first spike, or next."""
        end = samples.start + len(samples.inputs.u)
        first = min([row for row, _ in self._spikes], default=end) - self._ways.memory
        while self._past and self._past[0].start + len(self._past[0].inputs.u) <= first:
            self._past.popleft()
        self._past.append(samples.part(max(first - samples.start, 0), len(samples.inputs.u)))


class _Samples(NamedTuple):
    """Samples in a row, the first of which is the sample `start` of all."""

    start: int
    inputs: Inputs

    def part(self, begin: int, end: int) -> _Samples:
        """Those from `begin` to `end` of these."""
        u, d_hat, t, forces = self.inputs[:4]
        cut = slice(begin, end)
        some = None if forces is None else type(forces)(*(column[cut] for column in forces))
        return _Samples(self.start + begin, Inputs(u[cut], d_hat[cut], t[cut], some))


def _joined(parts: Sequence[_Samples]) -> _Samples:
    """One after the other: a stream may bring every sample by itself."""
    return _Samples(parts[0].start, joined([one.inputs for one in parts])) if len(parts) > 1 else parts[0]


class _Ways:
    """What all kernels of one detector have in common."""

    def __init__(self, plan: Plan, spec: KernelSpec) -> None:
        window = plan.settings.window
        self.spec = replace(spec, settings=replace(spec.settings, window=window))
        self.states, self.confidence = len(spec.grid), spec.settings.confidence
        self.floor = self.spec.log_likelihood_floor
        self.source, self.observer = plan.d_hat_source, plan.observer
        self.backend = plan.backend
        longest = max(whole for whole, _ in spec.taps())
        forgetting = 0 if spec.whitening is None else spec.whitening.memory
        self.reach = window + longest + spec.aperture + 2 + forgetting  # rows until all windows have had a spike
        settling = int(np.ceil(SETTLED * spec.time_constant / spec.sample_time))
        self.at_once = min(self.reach, max(AT_ONCE // self.states, 1))
        self.lasting = self.reach + 4 * settling  # and until Q has less than 1e-8 of it
        self.memory = window + spec.warmup_rows + int(np.ceil(spec.warmup_time / spec.sample_time)) + forgetting

    def needed(self, logged: Array, other: Array) -> NDArray[np.bool_]:
        """Whether a state explains its window with u as logged, and none does without the spikes; shape (n,)."""
        best = logged.max(axis=1)
        with np.errstate(invalid="ignore"):
            lead = best - other.max(axis=1)
        return np.asarray((best >= self.floor) & (lead >= max(self.confidence, FORGOTTEN)))

    def decided(self, logged: Array, other: Array, state: NDArray[Any]) -> NDArray[np.bool_]:
        """Whether the lead of the state chosen over all others is `confidence` by the spikes alone; shape (n,).

        Without them it is less; with them it is as much, or more by as much (a label that was chosen otherwise).
        """
        lead, without = (_lead(logged[: state.size], one[: state.size], state) for one in (logged, other))
        differ = _apart(logged[: state.size], other[: state.size]) > FORGOTTEN
        with np.errstate(invalid="ignore"):
            return differ & ~(without >= self.confidence) & ~(np.fmax(lead, lead - without) < self.confidence)

    def excluded(self, logged: Array, other: Array) -> NDArray[np.bool_]:
        """Whether a state is behind by `confidence` for the spikes alone: estimates rest on all states; shape (n,)."""
        best = logged.max(axis=1, keepdims=True) - self.confidence
        return np.asarray(((logged <= best) & (other > best)).any(axis=1))


def _lead(logged: Array, other: Array, state: NDArray[Any]) -> Array:
    """Nats by which these states, as logged, lead all others in `other`; shape (n,)."""
    at = np.arange(state.size), state
    other = other.copy()
    other[at] = -np.inf
    with np.errstate(invalid="ignore"):
        return np.asarray(logged[at] - other.max(axis=1))


def _apart(logged: Array, other: Array) -> Any:
    """Nats by which two likelihoods of a state differ at most; two that are infinitely far away do not."""
    with np.errstate(invalid="ignore"):
        return np.nan_to_num(np.abs(other - logged), nan=0.0).max(axis=-1)


def _first(yes: NDArray[np.bool_]) -> int:
    """The first of these that is; their number if none is."""
    return int(np.argmax(yes)) if yes.any() else yes.size


class _Asked:
    """A kernel that takes u without the spikes of these rows, in chunks."""

    def __init__(self, ways: _Ways, without: frozenset[int]) -> None:
        self._ways, self.without = ways, without
        self._kernel: Kernel = make_kernel(ways.spec, ways.backend)
        self._held = 0.0
        self._observer = None
        if without and ways.source != "logged":
            self._observer = DisturbanceObserver(ways.observer, ways.spec.sample_time, ways.source)

    def likelihoods(self, samples: _Samples) -> Array:
        """log p of every state over its window, shape (n, states); 0 where nothing is judged."""
        u, d_hat, t, forces = samples.inputs[:4]
        if len(u) and self.without:
            instead = self._instead(u, samples.start)
            d_hat = d_hat + self._observed(instead - u, t)
            u = instead
        spec = self._ways.spec
        inputs = (u, d_hat, t if spec.timed else None, *(forces or (None,) * 3))
        found, status = likelihoods(self._kernel, spec, inputs)
        found[status == WARMUP] = 0.0
        return found

    def _instead(self, u: Array, start: int) -> Array:
        """u with the value before them in place of the spikes."""
        rows = [row - start for row in self.without if start <= row < start + len(u)]
        instead = u.copy()
        for row in sorted(rows):
            instead[row] = instead[row - 1] if row else self._held
        if len(u):
            self._held = float(instead[-1])
        return instead

    def _observed(self, change: Array, t: Array) -> Array | float:
        """What the observer would have added to d_hat if u had been other by `change`."""
        if self._observer is None:
            return 0.0
        stamps = t if self._ways.spec.timed else None
        return self._observer.run(np.where(np.isfinite(change), change, 0.0), np.zeros(len(change)), stamps)
