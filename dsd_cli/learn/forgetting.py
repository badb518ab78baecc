"""Rows in which it is known how far springs that slip are bent: what they remember from before a log is forgotten."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from dsd_cli.effects.lagging import LAGGED
from dsd_cli.identify.fit.problem import Problem
from dsd_cli.identify.recordings.recording import Recording
from dsd_cli.learn.families import MEMORY, RADII
from dsd_cli.learn.judge import LawFit
from dsd_cli.learn.rows import LEAST_ROWS, Balance, balance_of
from dsd_cli.signals.log import Log, with_channels

#: Why rows at the begin of a log are not judged.
UNKNOWN = "how far springs were bent at its begin nobody knows until the axis has swung over twice their radius"


def forgetting(recordings: Sequence[Recording], problem: Problem) -> tuple[Recording, ...]:
    """The recordings with "clear" 0 where nobody knows how springs are bent, of the largest radius that is tried on the
    travel of a problem; as they are where too few rows are left for a curve.

    Begun bent as far as it goes one way and the other, a spring comes to the same as soon as the axis has swung over
    twice its radius.
    """
    places = [p["position"] for r in problem.recordings for p in r.pieces if "position" in p]
    swing = 2.0 * RADII[1] * (max(map(np.max, places)) - min(map(np.min, places))) if places else 0.0
    step = problem.equations.band.step
    known = tuple(replace(r, pieces=tuple(_cleared(p, swing, step) for p in r.pieces)) for r in recordings)
    clear = sum(float(p["clear"].sum()) for r in known for p in r.pieces if "clear" in p)
    return known if clear >= LEAST_ROWS * step else tuple(recordings)


def _cleared(piece: Log, swing: float, width: int) -> Log:
    """Fading in over two rows: cut at once, the noise of a position would be an impulse at the cut."""
    if "position" not in piece:
        return piece
    place = piece["position"]
    swung = np.maximum.accumulate(place) - np.minimum.accumulate(place)
    clear = piece["clear"] if "clear" in piece else np.ones(len(piece))
    since = np.cumsum(swung >= swing) / (2.0 * width)
    return with_channels(piece, clear=clear * np.sin(0.5 * np.pi * np.minimum(since, 1.0)) ** 2)


def is_hysteresis(fit: LawFit) -> bool:
    """Whether it has springs that slip, or one state in their place."""
    return any(law.family.on == (MEMORY,) and law.family.effect is not LAGGED for law in fit.laws)


def where_known(balance: Balance) -> Balance:
    """The same, judged by these rows alone; by all of them where too few are left for a curve."""
    problem = balance.problem
    if problem.errors.equations.counting < 1.0:  # it is already
        return balance
    recordings = forgetting(problem.recordings, problem)
    if all(one is other for one, other in zip(recordings, problem.recordings, strict=True)):
        return balance
    errors = problem.errors_for(problem.model, recordings)
    if problem.blocks.rows * float(np.mean(errors.equations.kept)) < LEAST_ROWS:
        return balance
    return balance_of(replace(problem, recordings=recordings, errors=errors), balance.delay)
