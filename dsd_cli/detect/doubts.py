"""Why a label that the engine calls confident is not: it rests on a spike, on rest, or does not explain its window."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsd_cli.detect.engine import Engine, Labels
from dsd_cli.detect.goodness import make_goodness
from dsd_cli.detect.kernel import KernelSpec
from dsd_cli.detect.plan import Plan
from dsd_cli.detect.rest import RestShare
from dsd_cli.detect.rows import Inputs, without_confidence
from dsd_cli.detect.settings import OFFLINE
from dsd_cli.detect.spikes import Spikes
from dsd_cli.detect.trust import BLOCKS
from dsd_cli.plant.filtering import lowpass_irregular, poles_of
from dsd_cli.signals.log import Array


class Doubts:
    """Takes the confidence from labels of an engine; every sample passes through it, in order."""

    def __init__(self, plan: Plan, engine: Engine) -> None:
        spec = engine.spec
        self._spikes = Spikes(plan, spec)
        self._rest = RestShare(plan.settings.effective_window)
        self._unknown = UnknownForces(spec) if plan.has_motion else None
        # methods whose recursion is the memory, and short windows: a label that is confident has stood for a while
        self._window = max(plan.settings.window, BLOCKS)
        judged, forces = plan.settings.method != "profile", FORCES if plan.has_motion else 0
        self._goodness = make_goodness(spec, self._window, forces, plan.backend) if judged else None
        self._afterwards = plan.settings.method in OFFLINE
        self._groups = len(spec.grid.delays) * len(spec.grid.combinations)
        self._doubted = 0

    def restart(self) -> None:
        """What comes next rests on nothing that was before."""
        self._spikes.restart()
        self._rest.restart()
        if self._goodness is not None:
            self._goodness.restart()
        if self._unknown is not None:
            self._unknown.restart()

    @property
    def warnings(self) -> list[str]:
        """One sentence each, about the samples so far."""
        if not self._doubted:
            return []
        return [
            f"u stands out (up to {self._spikes.largest:.3g}, it usually reaches about {self._spikes.level:.3g}), and "
            f"nothing shows that it was so: {self._doubted} label(s) that rest on it are not confident"
        ]

    def model(self, samples: int) -> Array | None:
        """What `Engine.run` shall fill for as many samples."""
        return None if self._goodness is None else np.empty((samples, 1 + self._groups))

    def checked(self, labels: Labels, inputs: Inputs, model: Array | None) -> Labels:
        """The labels of the next samples, confident only where nothing speaks against it."""
        spike = self._spikes.unfounded(inputs, labels)
        if spike is not None:
            self._doubted += int((labels.confident & spike).sum())
            labels = without_confidence(labels, spike)
        if inputs.resting is not None:
            labels = without_confidence(labels, self._rest.unfounded(inputs.resting))
        if self._goodness is not None and model is not None:
            forces = None if self._unknown is None else self._unknown.response(inputs)
            wrong = self._goodness.unfounded(model, labels.state, labels.confident, forces)
            if self._afterwards:
                wrong &= ~in_a_window_of(labels.state, labels.confident & ~wrong, self._window)
            labels = without_confidence(labels, wrong)
        return labels


def in_a_window_of(state: NDArray[Any], founded: NDArray[np.bool_], window: int) -> NDArray[np.bool_]:
    """Samples in the window of a founded label that is theirs too, with no other label between; shape (n,).

    Who labels afterwards may judge a sample by a window that holds it and ends later.
    """
    n = state.size
    at = np.arange(n)
    later = np.minimum.accumulate(np.where(founded, at, n + window)[::-1])[::-1]
    run = np.cumsum(np.diff(state, prepend=state[:1]) != 0)
    return np.asarray((later - at < window) & (run[np.minimum(later, n - 1)] == run))


#: A constant, a viscous and a dry force.
FORCES = 3


class UnknownForces:
    """What forces that the model may lack do to y: a constant, one along the speed, one along its sign, after Q."""

    def __init__(self, spec: KernelSpec) -> None:
        self._spec = spec
        self._whitening = spec.whitening
        self.restart()

    def restart(self) -> None:
        """Begin at rest."""
        self._last = [0.0] * FORCES
        self._t: float | None = None
        self._state: Array | None = None

    def response(self, inputs: Inputs) -> Array:
        """Of the next samples, shape (n, FORCES)."""
        assert inputs.motion is not None, "rows with the motion come with it"
        n = len(inputs.u)
        poles = self._poles(inputs.t)
        columns = np.column_stack([np.ones(n), inputs.motion])
        columns[~np.isfinite(columns)] = 0.0
        out = np.empty((n, FORCES))
        for i in range(FORCES):
            out[:, i] = lowpass_irregular(columns[:, i], poles, self._last[i])
            self._last[i] = float(out[-1, i]) if n else self._last[i]
        return out if self._whitening is None else self._whitened(out)

    def _poles(self, t: Array) -> Array:
        spec = self._spec
        if not spec.timed:
            return np.full(len(t), spec.pole)
        intervals = np.diff(t, prepend=t[0] - spec.sample_time if self._t is None else self._t)
        self._t = float(t[-1])
        return poles_of(intervals.tolist(), spec.time_constant if spec.settings.observer_filter else 0.0)

    def _whitened(self, columns: Array) -> Array:
        from scipy.signal import lfilter  # slow to import

        found: Any = self._whitening
        if self._state is None:
            self._state = np.zeros((max(len(found.denominator), 2) - 1, FORCES))
        out, self._state = lfilter(found.numerator, found.denominator, columns, axis=0, zi=self._state)
        return np.asarray(out)
