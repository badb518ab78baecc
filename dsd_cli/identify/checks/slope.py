"""The velocity beside the slope of the position: factor between them, and which of them is late."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dsd_cli.identify.checks.scan import block_starts, jackknife
from dsd_cli.identify.checks.stretches import LowPass, Stretch
from dsd_cli.signals.log import Array

#: Share of the power of the velocity that lies in the band at least, to be compared there.
_IN_BAND = 0.01
#: Share of the best agreement that a smaller lag may have and be taken.
_NEARLY = 0.9
#: And what is less than this share between two peaks makes them two.
_DIP = 0.5
#: Below this share of its square that nothing else explains, a column says nothing.
_COLLINEAR = 1e-9
#: Delays between the two that are tried, s.
FARTHEST = 0.06


@dataclass(frozen=True)
class Slope:
    """velocity(t) = factor x slope of position(t - late).

    factor, factor_error, late (s), late_error : with standard errors, correlated errors counted.
    agreement : share of the velocity that this explains, 0 to 1.
    """

    factor: float
    factor_error: float
    late: float
    late_error: float
    agreement: float


def compare_slope(stretches: Sequence[Stretch], cutoff: float) -> Slope | None:
    """Both within `cutoff` (Hz); None unless both are logged and both change."""
    speeds, slopes = _rows(stretches, cutoff)
    if not speeds:
        return None
    T = stretches[0].T
    lags = np.linspace(-FARTHEST, FARTHEST, max(int(np.ceil(2.0 * FARTHEST * 32.0 * cutoff)), 8) + 1)
    v, s = np.concatenate(speeds), np.concatenate([_shifted(*pair, lags / T) for pair in slopes])
    edges = block_starts(v.size)
    vs, ss = (np.add.reduceat(x, edges) for x in (v[:, None] * s, s**2))
    explained = vs.sum(axis=0) ** 2 / np.maximum(ss.sum(axis=0), 1e-300)
    at = _nearest_peak(explained - explained.min(), lags)  # a mean speed is explained at every lag
    if at is None:
        return None
    factors = (vs.sum(axis=0) - vs)[:, at] / np.maximum(ss.sum(axis=0) - ss, 1e-300)[:, at]
    late, late_error, agreement = _lateness(v, s[:, at - 1 : at + 2], float(lags[1] - lags[0]))
    return Slope(
        float(vs[:, at].sum() / ss[:, at].sum()),
        float(jackknife(factors)),
        float(lags[at]) + late,
        late_error,
        agreement,
    )


def _lateness(v: Array, s: Array, step: float) -> tuple[float, float, float]:
    """(s by which v is later than the middle column of `s`, its standard error, the share of v's changes explained).

    By least squares v = f s + f late ds/dlag + offset: in a ramp a lag is an offset, and its error is infinite.

    s : slopes at three lags, `step` s apart, shape (rows, 3).
    """
    columns = np.column_stack([s[:, 1], (s[:, 2] - s[:, 0]) / (2.0 * step), np.ones(v.size)])
    sizes = np.maximum(np.sqrt(np.mean(columns**2, axis=0)), 1e-300)
    x = columns / sizes
    inverse = np.linalg.pinv(x.T @ x, rcond=_COLLINEAR)
    found = inverse @ (x.T @ v)
    rest = v - x @ found
    change = max(float(np.sum((v - v.mean()) ** 2)), 1e-300)
    agreement = 1.0 - float(rest @ rest) / change
    unique = x[:, 1] - x[:, [0, 2]] @ np.linalg.lstsq(x[:, [0, 2]], x[:, 1], rcond=None)[0]
    power = float(unique @ unique)
    if power < _COLLINEAR * v.size or found[0] == 0.0:
        return 0.0, np.inf, agreement
    scores = np.add.reduceat(unique * rest, block_starts(v.size))
    error = np.sqrt(max(float(scores @ scores), float(rest @ rest) / v.size * power)) / power
    slope = float(found[0] / sizes[0] * sizes[1])
    return float(found[1]) / slope, abs(float(error) / slope), agreement


def _rows(stretches: Sequence[Stretch], cutoff: float) -> tuple[list[Array], list[tuple[Array, Array]]]:
    """Low-passed speeds at some samples, and beside each the low-passed slope with these samples' places."""
    keep = LowPass(stretches[0].T, cutoff)
    margin = int(np.ceil(FARTHEST / keep.T)) + 1
    speeds, slopes = [], []
    for s in stretches:
        rows = keep.rows(s.t.size, margin)
        if s.velocity is None or s.position is None or rows.size < 2:
            continue
        speeds.append(keep(s.velocity)[rows])
        slopes.append((keep(np.gradient(s.position, s.T)), rows.astype(np.float64)))
    all_of_it = sum(float(np.var(s.velocity)) for s in stretches if s.velocity is not None)
    if not speeds or sum(float(np.var(x)) for x in speeds) <= _IN_BAND * all_of_it:
        return [], []  # what the axis does is above the band
    return speeds, slopes


def _shifted(slope: Array, rows: Array, lags: Array) -> Array:
    """The slope `lags` samples before the rows, shape (rows, lags)."""
    at = rows[:, None] - lags
    whole = np.floor(at).astype(np.int64)
    part = at - whole
    return np.asarray((1.0 - part) * slope[whole] + part * slope[whole + 1])


def _nearest_peak(values: Array, lags: Array) -> int | None:
    """The peak next to no lag that is nearly as high as the highest, with a dip between: half a period later motion of
    one frequency explains as much, with the other sign. None if the highest stands at an end."""
    highest = int(values.argmax())
    if not (values.max() > 0.0 and 0 < highest < lags.size - 1):
        return None
    inner = values[1:-1]
    tops = 1 + np.flatnonzero((inner >= values[:-2]) & (inner >= values[2:]) & (inner > _NEARLY * values.max()))
    between = [values[min(k, highest) : max(k, highest) + 1].min() for k in tops.tolist()]
    others = tops[np.array(between) < _DIP * values.max()]
    return int(min((highest, *others.tolist()), key=lambda k: abs(lags[k])))
