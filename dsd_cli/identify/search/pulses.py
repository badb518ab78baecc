"""Rectangular pulses in time: where something pushed the axis, as far as the residual shows it.

A pulse is an event, not a law: it cannot be predicted on a held-out block. It is searched only where no law explains
the recording, every edge is penalised, and it is accepted only if nothing unknown remains.
"""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from dsd_cli.effects import get_effect
from dsd_cli.identify.fit.bank import Term
from dsd_cli.identify.fit.row_weights import sure_rows
from dsd_cli.identify.fit.solve import Fit
from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.search.sets import Search
from dsd_cli.signals.log import Array
from dsd_cli.signals.spread import robust_deviation

ROUNDS = 3
#: Rows by which the edges of the best window are moved before the next one is looked for.
MOST_REACH = 200
#: Samples: no edge is looked for more finely.
FINEST = 0.3


def event_effect(search: Search) -> str | None:
    """The effect that is a list of events in time, if the search may add one."""
    return next((name for name in search.allowed if get_effect(name).listed), None)


def with_pulses(search: Search, fit: Fit, shown_by: Array | None = None) -> Fit | None:
    """A fit and the pulses that its residual shows, their edges to a row; None if it shows none, or may have none.

    shown_by : a residual to begin with in place of that of the fit, shape (N,), 0 in rows that do not count.
    """
    effect = event_effect(search)
    if effect is None:
        return None
    errors = search.problem.errors
    for i in range(ROUNDS):
        if shown_by is None or i > 0:
            shown_by = errors.residual(_without_pulses(fit), held_out=False)
        edges = _pulses(search, fit, shown_by)
        if not edges:
            return None
        term = Term.of(effect, {"edges": edges})
        terms = (*(t for t in fit.terms if t.id != effect), term)
        fit = search.fit(terms, fit.tap)
    return fit


def _pulses(search: Search, fit: Fit, values: Array) -> tuple[tuple[float, float], ...]:
    """(start, end) in s, in the order of time; values : what is left beside the fit's laws, shape (N,)."""
    found: list[tuple[float, float, float]] = []
    times = [s.frame.times for s in search.equations.stretches]
    at = search.equations.by_stretch(search.equations.of_rows(times))
    # a stop or a creep looks like a push
    sure = search.equations.by_stretch(sure_rows(fit.terms, search.equations, POLICY.unsure_push))
    rows = zip(at, search.equations.by_stretch(values), sure, search.equations.row_times, strict=True)
    for stamps, x, clear, row_time in rows:
        for a, b, level in _strongest(x, clear):
            found.append((float(stamps[a] - 0.5 * row_time), float(stamps[b] + 0.5 * row_time), abs(level)))
    top = max((level for *_, level in found), default=0.0)
    kept = sorted(found, key=lambda p: -p[2])[: POLICY.most_pulses]
    return _apart(sorted((a, b) for a, b, level in kept if level > POLICY.weakest_pulse * top))


def _apart(windows: list[tuple[float, float]]) -> tuple[tuple[float, float], ...]:
    """Windows that overlap, cut at each other's edges: two pushes on top of each other are three levels."""
    edges = sorted({edge for window in windows for edge in window})
    inside = [(a, b) for a, b in pairwise(edges) if any(start <= a and b <= end for start, end in windows)]
    return tuple(inside)


def _without_pulses(fit: Fit) -> Fit:
    forward = fit.forward.copy()
    for term in fit.terms:
        if term.effect.listed:
            at = fit.columns_of(term)
            forward[1 + at.start : 1 + at.stop] = 0.0
    return replace(fit, forward=forward)


def _strongest(x: Array, sure: NDArray[np.bool_] | None = None) -> list[tuple[int, int, float]]:
    """(first row, row behind the last, level) by matching pursuit over start and length; rows that are not `sure`
    count neither for a window nor against it."""
    clear = np.ones(len(x), dtype=bool) if sure is None else sure
    if clear.sum() <= POLICY.shortest_pulse:
        return []
    left = x - np.median(x[clear])
    steps = np.abs(np.diff(left))[clear[1:] & clear[:-1]]
    noise = robust_deviation(steps) / np.sqrt(2.0) if steps.size else math.inf
    lengths = np.unique(
        np.geomspace(POLICY.shortest_pulse, max(len(x) // 3, POLICY.shortest_pulse + 1), 24).astype(int)
    )
    found = []
    for _ in range(POLICY.most_pulses):
        a, b, strength = _best_window(left, clear, lengths)
        if strength < POLICY.pulse_deviations * noise or clear[a:b].sum() < POLICY.shortest_pulse:
            break
        level = float(np.mean(left[a:b][clear[a:b]]))
        left = left.copy()
        left[a:b] -= level
        found.append((a, b - 1, level))
    return found


def _best_window(x: Array, clear: NDArray[np.bool_], lengths: Array) -> tuple[int, int, float]:
    """(start, end, |mean| sqrt(length)) of the window that stands out most, its edges sharpened; of its clear rows."""
    sums = np.concatenate([[0.0], np.cumsum(np.where(clear, x, 0.0))])
    counts = np.concatenate([[0.0], np.cumsum(clear)])
    best = (0, 0, 0.0)
    for n in lengths[lengths <= x.size]:
        score = np.abs(sums[n:] - sums[:-n]) / np.sqrt(np.maximum(counts[n:] - counts[:-n], 1.0))
        k = int(np.argmax(score))
        if score[k] > best[2]:
            best = (k, k + int(n), float(score[k]))
    a, b, stands_out = best
    if not stands_out > 0.0:  # a trial at rest, of which nothing is left
        return best
    reach = min(max((b - a) // 4, 1), MOST_REACH)
    starts = np.arange(max(a - reach, 0), min(a + reach, b - 1) + 1)
    ends = np.arange(max(b - reach, a + reach + 1), min(b + reach, len(x)) + 1)
    lengths2 = np.maximum(counts[ends][None, :] - counts[starts][:, None], 1.0)
    score2 = np.abs(sums[ends][None, :] - sums[starts][:, None]) / np.sqrt(lengths2)
    i, j = np.unravel_index(int(np.argmax(score2)), score2.shape)
    return int(starts[i]), int(ends[j]), float(score2[i, j])


def sharpened(search: Search, fit: Fit) -> Fit:
    """Every edge moved, by half samples at last, while that lowers the squares."""
    position = next(i for i, t in enumerate(fit.terms) if t.effect.listed)
    event = fit.terms[position]
    edges = [list(pair) for pair in event.shape["edges"]]

    def terms() -> tuple[Term, ...]:
        moved = Term.of(event.id, {"edges": tuple((a, b) for a, b in edges)})
        return (*fit.terms[:position], moved, *fit.terms[position + 1 :])

    best = search.solver.squares(terms(), fit.tap, keep=False)
    for pair in edges:
        for side in (0, 1):
            step = 0.5 * search.equations.band.step * search.equations.sample_time
            while step > FINEST * search.equations.sample_time:
                before = pair[side]
                for way in (1.0, -1.0):
                    pair[side] = before + way * step
                    now = search.solver.squares(terms(), fit.tap, keep=False) if pair[0] < pair[1] else np.inf
                    if now < best:
                        best = now
                        break
                    pair[side] = before
                else:
                    step *= 0.5
    return search.fit(terms(), fit.tap)
