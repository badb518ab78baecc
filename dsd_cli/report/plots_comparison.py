"""The picture of `dsd compare --plot`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from dsd_cli.identify.compare.comparison import Comparison
from dsd_cli.identify.compare.evaluation import Evaluation
from dsd_cli.report.conclusions import conclusion
from dsd_cli.report.figure import in_picture, png
from dsd_cli.signals.log import Array

MEASURED, PREDICTED, RESIDUAL, SHARE = "#1f5a8c", "#e08214", "#444444", "#b9c6d3"
#: Columns of the time axis; each shows the least and the largest of its samples. Points of a scatter.
_PIXELS, _POINTS = 1200, 6000


def draw(result: Comparison, evaluation: Evaluation) -> bytes:
    """The PNG: d_hat and residual over time, residual against motion, its correlation, its share by regime."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(13, 10), layout="constrained")
    axes = figure.subplot_mosaic(
        [["time"] * 2, ["residual"] * 2, ["velocity", "position"], ["correlation", "regimes"]],
        height_ratios=[1.2, 0.8, 1.0, 1.0],
    )
    axes["residual"].sharex(axes["time"])
    fit = result.accuracy.fit_percent
    fitted = "" if fit is None else f", fit {fit:.1f} %"
    logs = in_picture(", ".join(_short(log) for log in result.logs))
    figure.suptitle(f"{logs}: rmse {result.accuracy.rmse:.3g}{fitted}")
    _draw_time(axes["time"], axes["residual"], evaluation, result.units.force)
    for channel, unit in (("velocity", result.units.of_velocity), ("position", result.units.of_position)):
        _draw_against(axes[channel], evaluation, channel, unit)
    _draw_correlation(axes["correlation"], result)
    _draw_regimes(axes["regimes"], result)
    for axis in axes.values():
        axis.spines[["top", "right"]].set_visible(False)
    figure.text(0.008, -0.004, in_picture(conclusion(result)).replace("`", ""), fontsize=10, va="top")
    return png(figure, bbox_inches="tight", pad_inches=0.15)


def _short(log: str) -> str:
    return Path(log).name


def _draw_time(above: Any, below: Any, evaluation: Evaluation, unit: str) -> None:
    """Each stretch by itself; the logs one after the other if there are several."""
    offset, end = 0.0, -np.inf
    for i, stretch in enumerate(evaluation.stretches):
        t = stretch.judged(stretch.log["t"])
        if t[0] + offset < end:  # another log begins anew
            offset = end - t[0]
        t = t + offset
        end = float(t[-1])
        labels = ("measured", "predicted", "residual") if i == 0 else (None, None, None)
        series = (stretch.log["d_hat"], stretch.predicted, stretch.residual)
        for axis, x, color, label in zip(
            (above, above, below), series, (MEASURED, PREDICTED, RESIDUAL), labels, strict=True
        ):
            at, low, high = envelope(t, stretch.judged(x), _PIXELS)
            axis.fill_between(at, low, high, color=color, lw=0.9, alpha=0.85, label=label)
    above.set_ylabel(f"d_hat ({unit})")
    above.legend(loc="upper right", ncols=2, frameon=False, bbox_to_anchor=(1.0, 1.12))
    above.tick_params(labelbottom=False)
    below.axhline(0.0, color="0.6", lw=0.8)
    below.set_ylabel("residual")
    below.set_xlabel("time (s)")
    below.margins(x=0.01)


def envelope(t: Array, x: Array, columns: int) -> tuple[Array, Array, Array]:
    """(stamps, least, largest) of x in at most `columns` equal parts; neighbours share a sample, so no gap opens."""
    if len(x) <= columns:
        return t, x, x
    starts = np.linspace(0, len(x) - 1, columns + 1).astype(int)[:-1]
    least, largest = np.minimum.reduceat(x, starts), np.maximum.reduceat(x, starts)
    least[:-1], largest[:-1] = np.minimum(least[:-1], x[starts[1:]]), np.maximum(largest[:-1], x[starts[1:]])
    return t[starts], least, largest


def _draw_against(axis: Any, evaluation: Evaluation, channel: str, unit: str) -> None:
    axis.set_xlabel(f"{channel} ({unit})")
    axis.set_ylabel("residual")
    if any(channel not in s.log for s in evaluation.stretches):
        axis.text(0.5, 0.5, f"no {channel} in the log", ha="center", va="center", transform=axis.transAxes, color="0.5")
        return
    x, e = evaluation.pooled(lambda s: s.log[channel]), evaluation.errors
    step = max(len(x) // _POINTS, 1)
    axis.axhline(0.0, color="0.6", lw=0.8)
    axis.plot(x[::step], e[::step], ".", color=RESIDUAL, ms=2.5, alpha=0.35, mew=0)
    at, mean = binned_mean(x, e)
    axis.plot(at, mean, color=PREDICTED, lw=2.0, marker="o", ms=3.5, label="mean")
    axis.legend(loc="lower right", frameon=False, bbox_to_anchor=(1.0, 0.96))


def binned_mean(x: Array, e: Array, bins: int = 30) -> tuple[Array, Array]:
    """(mean of x, mean of e) of the bins of x that hold at least 0.1 % of the samples; 0 is an edge."""
    width = max(float(np.ptp(x)) / bins, 1e-300)
    _, place = np.unique(np.floor(x / width), return_inverse=True)
    count = np.bincount(place)
    kept = count >= max(1e-3 * len(x), 1.0)
    return (np.bincount(place, x) / count)[kept], (np.bincount(place, e) / count)[kept]


def _draw_correlation(axis: Any, result: Comparison) -> None:
    tests = result.residual
    step = result.sample_time * 1e3
    lag = np.arange(1, tests.lags + 1) * step
    axis.axhspan(-tests.band, tests.band, color=SHARE, alpha=0.6, lw=0, label="chance (99 %)")
    axis.axhline(0.0, color="0.6", lw=0.8)
    axis.fill_between(lag, 0.0, tests.autocorrelation, color=RESIDUAL, alpha=0.15, lw=0)
    axis.plot(lag, tests.autocorrelation, color=RESIDUAL, lw=1.4, label="with its own past")
    axis.plot(np.arange(tests.lags + 1) * step, tests.correlation_with_u, color=MEASURED, lw=1.4, label="with u before")
    axis.axhline(tests.band_u, color=MEASURED, lw=0.8, ls=":")
    axis.axhline(-tests.band_u, color=MEASURED, lw=0.8, ls=":", label="chance (99 %), u")
    axis.set_xlabel("lag (ms)")
    axis.set_ylabel("correlation of the residual")
    shown = [*tests.autocorrelation, *tests.correlation_with_u, tests.band_u, -tests.band_u]
    low, high = min(*shown, -0.1), max(*shown, 0.1)
    axis.set_ylim(low - 0.05 * (high - low), high + 0.45 * (high - low))
    step = 0.5 if high - low > 0.6 else 0.1 if high - low > 0.15 else 0.05
    axis.set_yticks([tick for tick in np.arange(-1.0, 1.0 + step / 2, step) if low - 0.02 <= tick <= high + 0.02])
    axis.legend(loc="upper right", ncols=2, frameon=False, fontsize=9)


def _draw_regimes(axis: Any, result: Comparison) -> None:
    regimes = result.where.regimes
    names = [f"({r.regime})" if r.overlaps else r.regime for r in regimes]
    place = np.arange(len(regimes))
    axis.barh(place - 0.2, [100 * r.share_of_error for r in regimes], 0.4, color=PREDICTED, label="of the error")
    axis.barh(place + 0.2, [100 * r.share_of_samples for r in regimes], 0.4, color=SHARE, label="of the samples")
    axis.set_yticks(place, names)
    axis.invert_yaxis()
    axis.set_xlabel("share (%)")
    axis.legend(loc="best", frameon=False)
