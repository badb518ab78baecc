"""The picture of `dsd compare --plot`: one model on its logs."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from dsd_cli.identify.compare.comparison import Comparison, Series
from dsd_cli.identify.compare.evaluation import Evaluation, Stretch
from dsd_cli.report.conclusions import conclusion
from dsd_cli.report.figure import (
    BACKWARD,
    FORWARD,
    LIMIT,
    MEASURED,
    PREDICTED,
    RESIDUAL,
    channel_label,
    cloud,
    headline,
    legend_above,
    line,
    nothing,
    sheet,
    shortened,
)
from dsd_cli.report.names import error, force_error
from dsd_cli.report.plots_residual import draw_correlation, draw_dependence, draw_regimes
from dsd_cli.report.timeline import TimedPiece, Timeline, timeline, zero
from dsd_cli.report.views_comparison import Curve, curves_over, spectrum_of
from dsd_cli.signals.log import Array
from dsd_cli.signals.units import Units

_ROWS = (1.2, 0.8, 0.65, 0.65, 0.65, 1.35, 1.0, 1.15, 1.25)
_TIME = ("d_hat", "residual", "u", "velocity", "position")


def draw(result: Comparison, series: Series) -> Any:
    """The figure."""
    figure = sheet(12.0, 17.0)
    axes = figure.subplot_mosaic(
        [
            *([name] * 2 for name in _TIME),
            ["force over velocity", "force over position"],
            ["left over velocity", "left over position"],
            ["correlation", "spectrum"],
            ["regimes", "dependence"],
        ],
        height_ratios=_ROWS,
    )
    headline(figure, f"{title(result)}\n{conclusion(result)}", 115)
    evaluation = series.evaluation
    _draw_time([axes[name] for name in _TIME], evaluation, series.aside, result.units)
    for channel in ("velocity", "position"):
        _draw_forces(axes[f"force over {channel}"], axes[f"left over {channel}"], series, channel, result)
    draw_correlation(axes["correlation"], result)
    _draw_spectrum(axes["spectrum"], result, evaluation)
    draw_regimes(axes["regimes"], result)
    draw_dependence(axes["dependence"], result)
    return figure


def title(result: Comparison) -> str:
    """The error that the tables begin with: of the forces, without one of d_hat."""
    force, aside = result.force.log, result.force.holdout
    shown, held = (result.accuracy, result.holdout and result.holdout.accuracy) if force is None else (force, aside)
    what = "rmse of d_hat" if force is None else force_error(force.band_hz)
    fitted = "" if shown.fit_percent is None else f", fit {shown.fit_percent:.1f} %"
    names = [shortened(Path(log).name, 36) for log in result.logs]
    logs = ", ".join(names[:4]) + (f" and {len(names) - 4} more" if len(names) > 4 else "")
    text = f"{logs}: {what} {error(shown.rmse)} {result.units.force}{fitted}"
    return f"{text}; hold-out {error(held.rmse)}" if held else text


def _draw_time(panels: list[Any], evaluation: Evaluation, aside: Evaluation | None, units: Units) -> None:
    stretches = [*evaluation.stretches, *(aside.stretches if aside is not None else ())]
    held = len(stretches) - len(evaluation.stretches)
    parts = [TimedPiece(s.name, s.judged(s.log["t"]), i >= len(stretches) - held) for i, s in enumerate(stretches)]
    time = timeline(parts)

    def put(panel: Any, of: Callable[[Stretch], Array], color: str, label: str | None = None) -> None:
        line(panel, *time.joined([s.judged(of(s)) for s in stretches]), color, label)

    measured, residual, *channels = panels
    for panel in panels[1:]:
        panel.sharex(measured)
    put(measured, lambda s: s.log["d_hat"], MEASURED, "measured")
    put(measured, lambda s: s.predicted, PREDICTED, "predicted")
    measured.set_ylabel(channel_label("d_hat", units))
    legend_above(measured, 2, lift=1.0 if len(time.logs) > 1 else 0.0)
    zero(residual)
    put(residual, lambda s: s.residual, RESIDUAL)
    residual.set_ylabel(f"residual{f' ({units.u})' if units.u else ''}")
    for panel, name in zip(channels, _TIME[2:], strict=True):
        _draw_channel(panel, name, stretches, time, units)
    for panel in panels[:-1]:
        panel.tick_params(labelbottom=False)
    time.mark(panels)


def _draw_channel(panel: Any, name: str, stretches: list[Stretch], time: Timeline, units: Units) -> None:
    panel.set_ylabel(channel_label(name, units).replace(" (", "\n("))
    if all(name in s.log for s in stretches):
        line(panel, *time.joined([s.judged(s.log[name]) for s in stretches]), MEASURED)
    else:
        panel.text(0.5, 0.5, f"no {name} in the log", ha="center", va="center", transform=panel.transAxes, color="0.45")
        panel.set_yticks([])


def _draw_forces(above: Any, below: Any, series: Series, channel: str, result: Comparison) -> None:
    """Forces over a channel, as measured and as the model has them, in the band; below, what is left between them."""
    stretches, balance = series.evaluation.stretches, series.balance
    if balance is None or any(channel not in s.log for s in stretches):
        why = result.force.missing if balance is None else f"no {channel} in the log"
        for axis in (above, below):
            nothing(axis, why)
        return
    above.sharex(below)
    above.tick_params(labelbottom=False)
    x, forces = balance.at_rows(channel), balance.forces
    both = channel == "position" and all("velocity" in s.log for s in stretches)
    curves = curves_over(x, forces, np.sign(balance.at_rows("velocity")) if both else None)
    cloud(above, x, forces.measured, RESIDUAL)
    cloud(below, x, forces.measured - forces.modelled, RESIDUAL)
    for axis in (above, below):
        zero(axis)
    for curve in curves:
        _draw_curve(above, below, curve)
    unit, band = (f" ({result.units.u})" if result.units.u else ""), balance.errors.equations.band.hz
    above.set_ylabel(f"forces below {band:.3g} Hz{unit}")
    below.set_ylabel(f"residual{unit}")
    below.set_xlabel(channel_label(channel, result.units))
    legend_above(above, 2)


def _draw_curve(above: Any, below: Any, curve: Curve) -> None:
    color = {"": MEASURED, "forward": FORWARD, "backward": BACKWARD}[curve.name]
    named = f", {curve.name}" if curve.name else ""
    above.plot(curve.x, curve.measured, color=color, lw=1.7, label=f"median{named}")
    above.plot(
        curve.x,
        curve.modelled,
        color=LIMIT,
        lw=1.5,
        ls=":" if curve.name == "backward" else "--",
        label=f"model{named}",
    )
    below.plot(curve.x, curve.measured - curve.modelled, color=color, lw=1.7)


def _draw_spectrum(axis: Any, result: Comparison, evaluation: Evaluation) -> None:
    """Of d_hat and of the residual; up to the end of the band forces can be balanced, beyond is the sensor's noise."""
    parts = {
        "d_hat": ([s.judged(s.log["d_hat"]) for s in evaluation.stretches], MEASURED, "-"),
        "residual": ([s.errors for s in evaluation.stretches], RESIDUAL, "-"),
    }
    drawn = False
    for label, (series, color, style) in parts.items():
        found = spectrum_of(series, evaluation.sample_time)
        if found.amplitude.size and (found.amplitude > 0.0).any():
            axis.loglog(found.frequency, np.maximum(found.amplitude, 1e-300), color=color, ls=style, label=label)
            drawn = True
    if not drawn:
        nothing(axis, "too short, or too exact, for a spectrum")
        return
    force = result.force.log
    if force is not None:
        axis.axvspan(axis.get_xlim()[0], force.band_hz, color="0.93", lw=0, zorder=0)
        axis.axvline(force.band_hz, color="0.25", lw=0.9, ls=(0, (4, 2)), label=f"band: below {force.band_hz:.3g} Hz")
    axis.autoscale(enable=True, axis="x", tight=True)
    axis.set_xlabel("frequency (Hz)")
    axis.set_ylabel(f"density ({result.units.force} / √Hz)")
    legend_above(axis, 3)
