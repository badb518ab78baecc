"""All of `dsd tune`: fit, look for missing candidates, choose, and say what to expect."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from dsd_cli.detect.grid import Grid
from dsd_cli.detect.settings import DetectorSettings
from dsd_cli.detect.tune.baum_welch import Fitted, fit
from dsd_cli.detect.tune.choose import SLACK, Choice, Path, choose, judged, smoothed
from dsd_cli.detect.tune.evidence import Evidence
from dsd_cli.detect.tune.expect import Expected, expect, false_changes, quiet_logs, state_disturbances
from dsd_cli.detect.tune.grid import Addition, additions, extended
from dsd_cli.plant.filtering import SETTLED

#: Simulated logs without a change that the best tunings are tried on.
TRIED = 6


@dataclass(frozen=True)
class Tuning:
    """What was chosen, and why.

    Attributes
    ----------
    samples : judged samples that it rests on.
    noise : rho of the fit, unit of u: what the right states leave.
    correlation : samples that count as one, because what is left lasts.
    dwell : s that a state lasts on average, by the fitted `stay`.
    changes : changes of state on the smoothed path.
    added : candidates that the grid lacked; they are in `grid`.
    visited : states of `grid` that the smoothed path has.
    before, after : the tuning of the config and the chosen one, with their agreement with the smoothed path; the same
        where no other is as good.
    expected : of the chosen one, by simulation.
    given, evidence, path : what it was made from: the recording with the grid of the config and with `grid`, and the
        smoothed path on that.
    """

    samples: int
    noise: float
    correlation: float
    dwell: float
    changes: int
    added: tuple[Addition, ...]
    visited: tuple[int, ...]
    grid: Grid
    before: Choice
    after: Choice
    expected: Expected
    given: Evidence
    evidence: Evidence
    path: Path


def tune(evidence: Evidence, progress: Callable[[str, float], None] = lambda _what, _share: None) -> Tuning:
    """Tune the detector whose engine the evidence has.

    Parameters
    ----------
    progress : called with what is being done and the share that is done.

    Raises
    ------
    DataError : too few samples can be judged.
    """
    now, given = evidence.engine.settings, evidence
    progress("fitting noise and dwell times", 0.0)
    fitted, path = _path(evidence)
    before, first = judged(evidence, now, path), (fitted, path)
    added = additions(evidence, path)
    if added:
        evidence = _on(evidence, extended(evidence.engine.grid, added))
        fitted, path = _path(evidence)
    progress("trying tunings", 0.2)
    quiet = quiet_logs(evidence, path, TRIED)
    chosen = choose(
        evidence,
        path,
        _least_rho(fitted, path),
        lambda settings: sum(false_changes(evidence, settings, one) for one in quiet),
        lambda share: progress("trying tunings", 0.2 + 0.6 * share),
    )
    if chosen.settings.method == now.method and chosen.agreement < before.agreement - SLACK:
        chosen, evidence, added, (fitted, path) = before, given, [], first  # what is there is better than all of these
    progress("simulating what to expect", 0.8)
    return Tuning(
        samples=int(path.at.size),
        noise=fitted.rho,
        correlation=path.correlation,
        dwell=evidence.engine.measurement.sample_time / (1.0 - fitted.stay),
        changes=int((np.diff(path.states) != 0).sum()),
        added=tuple(added),
        visited=tuple(np.unique(path.states).tolist()),
        grid=evidence.engine.grid,
        before=before,
        after=before if chosen is before else replace(chosen, settings=rounded(chosen.settings)),
        expected=expect(evidence, chosen.settings, path),
        given=given,
        evidence=evidence,
        path=path,
    )


def _path(evidence: Evidence) -> tuple[Fitted, Path]:
    squares, at = evidence.squares()
    fitted = fit(squares)
    errors = evidence.inputs.d_hat[:, None] - state_disturbances(evidence)
    measurement = evidence.engine.measurement
    settling = int(np.ceil(SETTLED * measurement.time_constant / measurement.sample_time)) + 2
    return fitted, smoothed(fitted, at, errors[at], settling)


def _least_rho(fitted: Fitted, path: Path) -> float:
    """The noise, and more where it lasts: a window of M samples holds M / correlation."""
    return fitted.rho * float(np.sqrt(min(path.correlation, 100.0)))


def _on(evidence: Evidence, grid: Grid) -> Evidence:
    """The evidence on a larger grid, with the initial state that it had."""
    old, settings = evidence.engine.grid, evidence.engine.settings
    initial = grid.index(float(old.axes["delay"][settings.initial]), float(old.axes["inertia"][settings.initial]))
    larger = evidence.with_grid(grid)
    larger.engine.settings = replace(larger.engine.settings, initial=initial)
    return larger


def rounded(settings: DetectorSettings) -> DetectorSettings:
    """rho with two digits, upwards."""
    step = 10.0 ** (np.floor(np.log10(settings.rho)) - 1)
    return replace(settings, rho=float(f"{np.ceil(settings.rho / step - 1e-9) * step:.2g}"))
