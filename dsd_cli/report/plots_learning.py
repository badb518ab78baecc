"""The picture of `dsd learn`: each law with its band over what was measured, and what is left before and after."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from dsd_cli.learn.results import Curve, Learnt, View
from dsd_cli.report.figure import BACKWARD, FORWARD, MEASURED, PREDICTED, SHARE
from dsd_cli.report.learning import as_forces, learn_line
from dsd_cli.report.timeline import zero

#: Quantiles of a cloud beyond which a picture does not reach.
_SHOWN = (0.005, 0.995)


def draw(result: Learnt) -> Any:
    """The figure; a row of two panels for each law."""
    from matplotlib.figure import Figure

    rows = max(len(result.views), 1)
    figure = Figure(figsize=(9.6, 0.6 + 3.3 * rows))
    axes = figure.subplots(rows, 2, squeeze=False)
    figure.suptitle("\n".join(_wrapped(learn_line(result))), fontsize=10.5)
    for (left, right), curve, view in zip(axes, result.curves, result.views, strict=False):
        _draw_law(left, *as_forces(curve, view), result)
        _draw_left(right, view, result)
    if not result.views:
        for axis in axes.ravel():
            axis.set_axis_off()
    return figure


def _wrapped(line: str) -> list[str]:
    import textwrap

    return textwrap.wrap(line, 110)


def _draw_law(axis: Any, curve: Curve, view: View, result: Learnt) -> None:
    unit = result.units.words(curve.unit) or "1"
    if len(curve.channels) == 2:
        _draw_table(axis, curve, unit)
        return
    for side, color, name in ((1.0, FORWARD, "forward"), (-1.0, BACKWARD, "backward")):
        own = (view.direction == side) & np.isfinite(view.points)
        if own.any() and view.channel == curve.channels[0]:
            axis.plot(view.at[own], view.points[own], ".", ms=2, color=color, alpha=0.35, label=f"missing, {name}")
    knots, values = np.array(curve.knots[0]), np.array(curve.values)
    low, high = np.array(curve.low), np.array(curve.high)
    known = np.isfinite(low)
    axis.fill_between(knots[known], low[known], high[known], color=SHARE, alpha=0.9, lw=0, label="95 % band")
    axis.plot(knots[known], values[known], "-", color="k", lw=1.6, label="law")
    _limit(axis, [*view.points, *values[known]])
    zero(axis)
    over = curve.channels[0]
    axis.set_xlabel({"radius": "radius of the spring", "time constant": "time constant (s)"}.get(over, over))
    axis.set_ylabel(f"{curve.effect.replace('_', ' ')} ({unit})")
    axis.legend(loc="best")


def _draw_table(axis: Any, curve: Curve, unit: str) -> None:
    x, y = (np.array(one) for one in curve.knots)
    shaped = np.where(np.isfinite(curve.low), curve.values, math.nan).reshape(len(x), len(y))
    image = axis.pcolormesh(x, y, shaped.T, shading="nearest", cmap="cividis")
    axis.figure.colorbar(image, ax=axis, label=f"{curve.effect.replace('_', ' ')} ({unit})")
    axis.set_xlabel(curve.channels[0])
    axis.set_ylabel(curve.channels[1])


def _draw_left(axis: Any, view: View, result: Learnt) -> None:
    axis.plot(view.at, view.before, ".", ms=2, color=MEASURED, alpha=0.4, label="without the law")
    axis.plot(view.at, view.after, ".", ms=2, color=PREDICTED, alpha=0.6, label="with it")
    _limit(axis, view.before)
    zero(axis)
    axis.set_xlabel(view.channel)
    axis.set_ylabel(f"missing force ({result.units.force})")
    axis.legend(loc="best", markerscale=4)


def _limit(axis: Any, values: Any) -> None:
    finite = np.asarray([x for x in values if math.isfinite(x)])
    if finite.size:
        low, high = np.quantile(finite, _SHOWN)
        margin = 0.12 * max(high - low, 1e-300)
        axis.set_ylim(low - margin, high + 3.0 * margin)
