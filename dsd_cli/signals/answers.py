"""What a controller makes of one count of its sensor."""

from __future__ import annotations

import numpy as np

from dsd_cli.signals.log import Array
from dsd_cli.signals.spread import robust_deviation

#: Samples of an answer; rounds in which it is fitted without the steps of u that are so many deviations off it.
_SAMPLES, _ROUNDS, _OUTLIER = 20, 5, 3.0


def largest_answer(u: Array, counts: Array) -> float:
    """Largest |u| by which a controller answers one count, both of shape (n,): the steps of u by the counts of the last
    few samples, least squares without those steps that something else made."""
    steps = np.pad(np.diff(counts), (_SAMPLES - 1, 0))
    last = np.lib.stride_tricks.sliding_window_view(steps, _SAMPLES)
    heard = np.any(last, axis=1)
    last, answers = last[heard], np.diff(u)[heard]
    off: Array = np.zeros(len(answers))
    taps: Array = np.zeros(_SAMPLES)
    for _ in range(_ROUNDS):
        kept = off <= _OUTLIER * robust_deviation(off)
        normal = last[kept].T @ last[kept]  # of integers: what few counts leave open is exactly so
        taps = np.asarray(np.linalg.lstsq(normal, last[kept].T @ answers[kept], rcond=1e-10)[0])
        off = np.asarray(np.abs(answers - last @ taps))
    return float(np.abs(np.cumsum(taps[::-1])).max())
