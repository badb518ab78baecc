"""The picture of `dsd plan --plot`: the motion, and what is identified before and after it."""

from __future__ import annotations

from typing import Any

import numpy as np

from dsd_cli.design.measure import ENOUGH
from dsd_cli.design.results import Motion, Plan
from dsd_cli.report.figure import LIMIT, MEASURED, OTHER, PREDICTED, SHARE, headline, legend_above, line, sheet
from dsd_cli.report.planning import TOLD, channels
from dsd_cli.report.planning import headline as said

#: Nats below which a bar ends.
_LEAST = 0.1


def draw(plan: Plan) -> Any:
    """The figure; without a motion only what is identified now."""
    bars = _bars(plan)
    heights = [1.3, 1.0, 1.0] if plan.motion is not None else []
    shown = bool(bars) or not heights  # with unknown alone there is no pair and no value
    heights += [*([max(0.3 * len(bars), 0.6)] if shown else []), *([1.0] if len(plan.cost) > 1 else [])]
    figure = sheet(11.0, 1.6 + 1.6 * (len(heights) - 1) + 0.34 * len(bars))
    axes = figure.subplots(len(heights), 1, height_ratios=heights, squeeze=False)[:, 0]
    headline(figure, said(plan), 110)
    if plan.motion is not None:
        _draw_motion(axes[:3], plan, plan.motion)
    if len(plan.cost) > 1:
        _draw_cost(axes[-1], plan)
    if shown:
        _draw_bars(axes[3 if plan.motion is not None else 0], bars)
    return figure


def _draw_motion(axes: Any, plan: Plan, motion: Motion) -> None:
    t = np.asarray(np.arange(len(motion.position)) * motion.step, dtype=np.float64)
    for axis, one, color in zip(axes, channels(plan), (MEASURED, PREDICTED, OTHER), strict=True):
        line(axis, t, one.values, color)
        for end in one.limits:
            axis.axhline(end, color=LIMIT, lw=0.9, ls=":")
        for stage in plan.stages[1:]:
            axis.axvline(stage.start, color=SHARE, lw=0.9)
        axis.set_ylabel(f"{one.title}\n({one.unit})")
    for stage in plan.stages:
        axes[0].annotate(
            stage.kind,
            (0.5 * (stage.start + stage.end), 1.0),
            xycoords=("data", "axes fraction"),
            ha="center",
            va="bottom",
            fontsize=8.5,
        )
    axes[2].set_xlabel("time (s); dotted: limits")


def _draw_cost(axis: Any, plan: Plan) -> None:
    """Nats of what is identified least, over the length of the motion."""
    seconds, nats = zip(*plan.cost, strict=True)
    axis.plot(seconds, np.maximum(nats, _LEAST), "o-", color=MEASURED)
    axis.axhline(ENOUGH, color=LIMIT, lw=0.9, ls=":")
    if plan.motion is not None:
        axis.axvline(plan.motion.seconds, color=SHARE, lw=0.9)
    axis.set_yscale("log")
    axis.set_xlabel("length of the motion (s); dotted: enough for all that is open; upright: as it is written")
    axis.set_ylabel("least nats")


def _bars(plan: Plan) -> list[tuple[str, float, float]]:
    """(what, nats now, nats after) of pairs and values."""
    found = [(f"{p.a} or {p.b}", abs(p.nats_before), p.nats_expected) for p in plan.pairs]
    for v in plan.values:
        errors = (v.std_error_before, v.std_error_expected)
        now, after = (0.5 * (v.value / e) ** 2 if np.isfinite(e) and e > 0.0 else 0.0 for e in errors)
        found.append((v.name, now, after))
    return found


def _draw_bars(axis: Any, bars: list[tuple[str, float, float]]) -> None:
    for i, (_, now, after) in enumerate(bars):
        axis.barh(i + 0.18, max(after, _LEAST), 0.34, left=0.0, color=MEASURED, label="expected after it" * (i == 0))
        axis.barh(i - 0.18, max(now, _LEAST), 0.34, left=0.0, color=SHARE, label="by the logs" * (i == 0))
    axis.set_xscale("log")
    axis.set_xlim(left=_LEAST)
    axis.axvline(TOLD, color=LIMIT, lw=0.9, ls=":")
    axis.set_yticks(range(len(bars)), [name for name, *_ in bars])
    axis.invert_yaxis()
    axis.set_xlabel(
        "nats by which the true one leads; of a value (value / standard error)^2 / 2; dotted: odds of 400 to 1"
    )
    if bars:
        legend_above(axis, 2)
