"""Candidates that the log shows and the grid lacks: where a stretch of one label is explained better between them."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import Any

import numpy as np

from dsd_cli.detect.grid import Grid
from dsd_cli.detect.tune.choose import Path
from dsd_cli.detect.tune.evidence import Evidence
from dsd_cli.signals.log import Array

#: A stretch has at least so many samples; a value is new if it is so many standard errors, and this share (of its own
#: size, of the span of the delays), away.
LEAST, SIGMAS, APART = 100, 4.0, 0.04
#: The rms of a stretch must fall below this share with the new value.
FALLS = 0.8
#: Delays tried between two candidates.
BETWEEN = 20


@dataclass(frozen=True)
class Addition:
    """A candidate that is missing: `axis` "delay" or "inertia", its value, since when the log has it (s), the rms of
    that stretch with the nearest candidate and with this one (unit of u), and the standard error of the value."""

    axis: str
    value: float
    start: float
    rms_before: float
    rms_after: float
    std_error: float


def additions(evidence: Evidence, path: Path) -> list[Addition]:
    """At most one delay and one inertia per stretch of one state; none that is already on the grid."""
    grid = evidence.engine.grid
    if grid.effects:
        return []
    fine = evidence.with_grid(Grid(_lattice(grid.delays), (evidence.engine.measurement.nominal_inertia,)))
    w, z = fine.predictions()
    y = w + evidence.engine.measurement.sign * evidence.inputs.d_hat
    found: list[Addition] = []
    cuts = np.flatnonzero(np.diff(path.states)) + 1
    for part in np.split(np.arange(path.states.size), cuts):
        if part.size >= LEAST:
            found += _of_stretch(evidence, fine.engine.grid, path, part, y[path.at[part]], z[path.at[part]])
    return _without_repeats(found, grid)


def _lattice(delays: tuple[float, ...]) -> tuple[float, ...]:
    ordered = sorted(delays)
    between = [np.linspace(a, b, BETWEEN + 1)[:-1] for a, b in itertools.pairwise(ordered)]
    return tuple(np.round(np.concatenate([*between, ordered[-1:]]), 12).tolist())


def _of_stretch(evidence: Evidence, fine: Grid, path: Path, part: Any, y: Array, z: Array) -> list[Addition]:
    """Best delay and inertia of the stretch (alpha = S_zy / S_zz per delay), where they beat its candidate."""
    grid, nominal = evidence.engine.grid, evidence.engine.measurement.nominal_inertia
    judged = np.isfinite(z).all(axis=1) & np.isfinite(y)
    y, z, n = y[judged], z[judged], int(judged.sum())
    szz = (z * z).sum(axis=0)
    if n < LEAST or not szz.min() > 0.0:
        return []
    alpha = (z * y[:, None]).sum(axis=0) / szz
    rms = np.sqrt(np.maximum((y * y).sum() - alpha**2 * szz, 0.0) / n)
    state = int(path.states[part[0]])
    delay, inertia = float(grid.axes["delay"][state]), float(grid.axes["inertia"][state])
    now = fine.delays.index(min(fine.delays, key=lambda x: abs(x - delay)))
    before = float(np.sqrt(np.mean((y - nominal / inertia * z[:, now]) ** 2)))
    best = int(rms.argmin())
    if rms[best] >= FALLS * before:
        return []
    start = float(evidence.inputs.t[path.at[part[0]]])
    best = best if rms[best] < FALLS * rms[now] else now  # a delay is new only if it helps beside the inertia
    error = float(rms[best] * np.sqrt(path.correlation / szz[best]))
    value, found = nominal / float(alpha[best]) if alpha[best] > 0.0 else np.nan, []
    away = abs(alpha[best] - nominal / inertia) > SIGMAS * error
    if away and min(abs(value / j - 1.0) for j in grid.inertias) > APART:
        size = value * error / float(alpha[best])
        found.append(Addition("inertia", float(f"{value:.3g}"), start, before, float(rms[best]), size))
    if best != now:
        error = _delay_error(np.array(fine.delays), n * rms**2, best, n / path.correlation)
        if _away(fine.delays[best], grid.delays, error, APART * _span(grid)):
            found.append(Addition("delay", float(f"{fine.delays[best]:.6g}"), start, before, float(rms[best]), error))
    return found


def _span(grid: Grid) -> float:
    return max(grid.delays) - min(grid.delays)


def _away(value: float, others: tuple[float, ...], error: float, apart: float) -> bool:
    """Whether it is another value than all of these, by what the log can identify and by what is worth a candidate."""
    return min(abs(value - x) for x in others) > max(SIGMAS * error, apart)


def _delay_error(delays: Array, squares: Array, best: int, independent: float) -> float:
    """Standard error of the best delay: from the curvature of the sum of squares over the delays, s."""
    at = min(max(best, 1), delays.size - 2)
    below, above = delays[at] - delays[at - 1], delays[at + 1] - delays[at]
    slopes = (squares[at] - squares[at - 1]) / below, (squares[at + 1] - squares[at]) / above
    curvature = 2.0 * (slopes[1] - slopes[0]) / (below + above)
    return float(np.sqrt(2.0 * squares[best] / (curvature * independent))) if curvature > 0.0 else np.inf


def _without_repeats(found: list[Addition], grid: Grid) -> list[Addition]:
    """Of those of one axis that are indistinguishable on this log the surest; at most as many as the axis has."""
    kept: list[Addition] = []
    for one in sorted(found, key=lambda a: a.std_error):
        same = [k for k in kept if k.axis == one.axis]
        apart = APART * (_span(grid) if one.axis == "delay" else one.value)
        new = all(_away(one.value, (k.value,), float(np.hypot(one.std_error, k.std_error)), apart) for k in same)
        if new and len(same) < len(grid.delays if one.axis == "delay" else grid.inertias):
            kept.append(one)
    return kept


def extended(grid: Grid, new: list[Addition]) -> Grid:
    """The grid with these candidates in their order."""
    delays = sorted({*grid.delays, *(a.value for a in new if a.axis == "delay")})
    inertias = sorted({*grid.inertias, *(a.value for a in new if a.axis == "inertia")})
    return Grid(tuple(delays), tuple(inertias), grid.effects)
