"""Which rho, window and A label best: as often as possible like the path that the whole log, seen afterwards, says."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsd_cli.detect.profile.kernel import LEAST_WINDOW
from dsd_cli.detect.settings import OFFLINE, DetectorSettings
from dsd_cli.detect.transition import Transition
from dsd_cli.detect.tune.baum_welch import Fitted
from dsd_cli.detect.tune.evidence import Evidence
from dsd_cli.signals.log import Array

#: Windows tried, samples; those of at most a tenth of the log.
WINDOWS = (1, 2, 5, 10, 20, 35, 50, 75, 100, 150, 200, 300, 500, 1000, 2000)
#: rho tried, in parts of the noise; below 1 labels would be surer than the log allows.
RHOS = (1.0, 1.5, 2.5, 5.0, 10.0)
#: 1 - stay tried, beside A uniform.
LEAVES = (1e-2, 1e-4, 1e-6, 1e-9, 1e-12)
#: Agreement that is given up for fewer changes of the label, and more confident labels.
SLACK = 0.004
#: Of the tunings within SLACK, so many are tried on simulated logs.
MOST_SIMULATED = 80


@dataclass(frozen=True)
class Choice:
    """Settings, and what they make of the log.

    Attributes
    ----------
    agreement : share of the judged samples whose label is that of the smoothed path.
    changes : of the label.
    confident : share of the judged samples with a confident label that is that of the path, less thrice that of the
        confident ones that are not.
    """

    settings: DetectorSettings
    agreement: float
    changes: int
    confident: float


@dataclass(frozen=True)
class Path:
    """The smoothed path: the most probable state of every judged sample, given all of them.

    Attributes
    ----------
    states : shape (judged,).
    at : which samples of the recording these are.
    errors : what the path leaves of d_hat, unit of u, away from its changes, where Q shows both states: shape (m,).
    correlation : how many samples count as one: 1 + 2 sum of the autocorrelation of the errors while it is positive.
    """

    states: NDArray[Any]
    at: NDArray[Any]
    errors: Array
    correlation: float


def smoothed(fitted: Fitted, at: NDArray[Any], residual: Array, settling: int) -> Path:
    """The path behind a fit.

    Parameters
    ----------
    residual : signed errors of every state, shape (judged, states).
    settling : samples on both sides of a change that are no noise, while Q settles.
    """
    states = fitted.posterior.gamma.argmax(axis=1)
    errors = residual[np.arange(len(states)), states]
    near = np.convolve(np.diff(states, prepend=states[:1]) != 0, np.ones(2 * settling + 1), mode="same") > 0
    errors = errors if near.mean() > 0.5 else errors[~near]
    return Path(states, at, errors, _correlation(errors))


def _correlation(x: Array) -> float:
    """Integrated autocorrelation time in samples, at least 1."""
    x = x - x.mean()
    size = 2 * len(x)
    spectrum = np.abs(np.fft.rfft(x, size)) ** 2
    covariance = np.fft.irfft(spectrum, size)[: len(x) // 4]
    if covariance[0] <= 0.0:
        return 1.0
    falls = covariance / covariance[0]
    ends = np.flatnonzero(falls <= 0.05)
    return float(max(1.0 + 2.0 * falls[1 : ends[0] if ends.size else None].sum(), 1.0))


def judged(evidence: Evidence, settings: DetectorSettings, path: Path) -> Choice:
    """What these settings make of the log."""
    labels = evidence.run(settings)
    state, sure = labels.state[path.at], labels.confident[path.at]
    right = state == path.states
    gain = float(np.mean(sure & right)) - 3.0 * float(np.mean(sure & ~right))
    return Choice(settings, float(np.mean(right)), int((np.diff(state) != 0).sum()), gain)


def candidates(now: DetectorSettings, noise: float, samples: int) -> Iterator[DetectorSettings]:
    """Everything that is tried; a method that needs the whole log is tuned as dsd, which labels as samples come."""
    method = "dsd" if now.method in OFFLINE else now.method
    least = LEAST_WINDOW if method == "profile" else 1
    windows = [w for w in WINDOWS if least <= w <= max(samples // 10, least)] if method != "imm" else [now.window]
    transitions = [Transition(), *(Transition(stay=1.0 - leave) for leave in LEAVES)]
    if method == "profile":  # which weighs no way from state to state
        transitions = [now.transition]
    for window in windows:
        for transition in transitions:
            for factor in RHOS:
                yield replace(now, method=method, window=window, rho=factor * noise, transition=transition)


def choose(
    evidence: Evidence,
    path: Path,
    noise: float,
    alarms: Callable[[DetectorSettings], int],
    done: Callable[[float], None] = lambda _share: None,
) -> Choice:
    """The best agreement; within SLACK of it the fewest changes of the label, then of false ones in simulated logs.

    Parameters
    ----------
    noise : the least rho, unit of u.
    alarms : false changes of the label in some simulated logs; asked of the MOST_SIMULATED best only.
    done : called with the share that is done.
    """

    now, samples = evidence.engine.settings, len(evidence.inputs.u)
    wanted = list(candidates(now, noise, samples))
    tried, scored = list[Choice](), list[tuple[int, int]]()
    for settings in wanted:
        tried.append(judged(evidence, settings, path))
        done(0.5 * len(tried) / len(wanted))
    best = max(choice.agreement for choice in tried)
    near = [choice for choice in tried if choice.agreement >= best - SLACK]
    near.sort(key=lambda choice: (choice.changes, -round(choice.confident, 3), choice.settings.window))
    near = near[:MOST_SIMULATED]
    for choice in near:
        scored.append((choice.changes, alarms(choice.settings)))
        done(0.5 + 0.5 * len(scored) / len(near))
    return near[scored.index(min(scored))]
