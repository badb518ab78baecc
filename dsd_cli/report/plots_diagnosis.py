"""The picture of `dsd diagnose --plot`: how far each candidate brings the error down, what the best explains."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from dsd_cli.effects import Role, get_effect
from dsd_cli.errors import DataError
from dsd_cli.identify.fit.bank import Bank
from dsd_cli.identify.fit.equations import equations_of
from dsd_cli.identify.fit.values import coefficients_of, terms_of
from dsd_cli.identify.recordings.recording import Recording
from dsd_cli.identify.results import DELAY, INERTIA, Candidate, Diagnosis
from dsd_cli.plant.model import PlantModel
from dsd_cli.report.diagnosis import DiagnosisReport, candidate, error, percent, verdict_line
from dsd_cli.report.figure import in_picture, png
from dsd_cli.report.names import force_error
from dsd_cli.report.plots_comparison import PREDICTED, RESIDUAL, SHARE, binned_mean
from dsd_cli.signals.log import Array
from dsd_cli.signals.units import Units

#: Bars, and points of the scatter.
MOST_BARS, POINTS = 14, 6000
#: Samples after the delay with which the first row begins: a row looks at one step of delay more.
_LATER = 50
_LABELS = {"t": "time (s)", "u": "u"}
#: Words of `Diagnosis.depends_on` that are channels of a log.
_CHANNELS = {"velocity": "velocity", "direction": "velocity", "position": "position", "u": "u", "time": "t"}


@dataclass(frozen=True)
class ResidualView:
    """What the model leaves of the balance of forces (unit of u, in the band), against one channel; shape (n,).

    `explained` : what the effect of the verdict takes of it; None without one.
    """

    on: str
    x: Array
    residual: Array
    effect: str = ""
    explained: Array | None = None


def residual_view(result: Diagnosis, given: PlantModel, recordings: Sequence[Recording]) -> ResidualView:
    """Residual of the model fitted along with the verdict's effect, but without it, against the channel it needs.

    Raises
    ------
    DataError : the recordings are too short for a balance.
    """
    winner = candidate(result, result.verdict)
    model = None if winner is None else winner.model
    without = result.model if winner is None or model is None else _without(model, winner.effect, given)
    on = _channel(result, recordings)
    latest = max(m.delay for m in (without, model) if m is not None)
    equations = equations_of(recordings, math.ceil(latest / recordings[0].sample_time) + _LATER)
    if not equations.stretches:
        raise DataError(f"{recordings[0].name}: too short for a picture", "log longer")
    bank, kept = Bank(equations), equations.kept
    x = equations.of_rows([stretch.log[on] for stretch in equations.stretches])[kept]
    residual = _balance(bank, without)[kept]
    if winner is None or model is None:
        return ResidualView(on, x, residual)
    return ResidualView(on, x, residual, winner.effect, residual - _balance(bank, model)[kept])


def _balance(bank: Bank, model: PlantModel) -> Array:
    """r of every row."""
    terms = terms_of(model)
    tap, theta = coefficients_of(model, terms, bank.tap_time)
    drive, *columns = bank.design(terms, tap).rows
    return np.asarray(drive - theta @ np.stack(columns))


def _without(model: PlantModel, effect: str, given: PlantModel) -> PlantModel:
    if effect in (INERTIA, DELAY):
        return model.changed(**{effect: getattr(given, effect)})
    rest = {name: values for name, values in model.effects.items() if name != effect}
    return PlantModel(model.inertia, model.delay, rest, model.rest_speed)


def _channel(result: Diagnosis, recordings: Sequence[Recording]) -> str:
    """The channel that the verdict's effect looks at; for a remainder without name, the first that it depends on."""
    if result.verdict in (INERTIA, DELAY):
        wanted = ["u"]
    elif candidate(result, result.verdict) is not None:
        effect = get_effect(result.verdict)
        wanted = [*effect.needs, *(["u"] if effect.role in (Role.INPUT, Role.STRUCTURE) else [])]
    else:
        wanted = [_CHANNELS[word] for word in result.depends_on if word in _CHANNELS]
    logs = [piece for recording in recordings for piece in recording.pieces]
    return next((name for name in wanted if all(name in log for log in logs)), "t")


def draw(report: DiagnosisReport, view: ResidualView) -> bytes:
    """The PNG."""
    from matplotlib.figure import Figure

    result = report.result
    tested = [c for c in result.ranking if not c.untestable and math.isfinite(c.heldout_rmse_after)]
    height = max(4.6, 0.34 * min(len(tested), MOST_BARS) + 2.2)
    figure = Figure(figsize=(13, height), layout="constrained")
    bars, residual = figure.subplots(1, 2, width_ratios=[1.0, 1.1])
    figure.suptitle(in_picture(_wrapped(verdict_line(result, report.given))), fontsize=11)
    _draw_bars(bars, result, tested[:MOST_BARS])
    _draw_residual(residual, view, result.units)
    for axis in (bars, residual):
        axis.spines[["top", "right"]].set_visible(False)
    return png(figure)


def _wrapped(text: str) -> str:
    import textwrap

    return textwrap.fill(text, 125)


def _draw_bars(axis: Any, result: Diagnosis, tested: Sequence[Candidate]) -> None:
    if not tested:
        axis.text(0.5, 0.5, "no effect could be tested", ha="center", transform=axis.transAxes, color="0.5")
        return
    after = [c.heldout_rmse_after for c in tested]
    colors = [PREDICTED if c.effect == result.verdict else SHARE for c in tested]
    axis.barh(range(len(tested)), after, color=colors, height=0.7)
    before = next((c.heldout_rmse_before for c in tested if math.isfinite(c.heldout_rmse_before)), math.nan)
    top = max([*after, before] if math.isfinite(before) else after)
    for place, one in enumerate(tested):
        text = f"{error(one.heldout_rmse_after)}  ({percent(one.probability)})"
        inside = one.heldout_rmse_after > 0.5 * top  # else right of the bar
        x = one.heldout_rmse_after + (-0.01 if inside else 0.01) * top
        axis.text(x, place, text, va="center", ha="right" if inside else "left", fontsize=9, zorder=4)
    lines = (
        (before, "without another effect", "-", "#1f5a8c"),
        (result.ceiling.heldout_rmse, f"ceiling: any function{_of(result)}", "--", "#b2182b"),
        (result.noise, "noise", ":", RESIDUAL),
        (result.floor, "what the sensor alone leaves", "-.", RESIDUAL),
    )
    for x, label, style, color in lines:
        if math.isfinite(x):
            axis.axvline(x, ls=style, color=color, lw=1.4, label=label, zorder=3)
    axis.set_yticks(range(len(tested)), [c.effect for c in tested])
    axis.invert_yaxis()
    axis.set_xlim(0.0, 1.06 * top)
    of = f"held-out {force_error(result.band_hz)} with one effect more ({result.units.force})"
    axis.set_xlabel(f"{of}; in brackets: in the final set")
    axis.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2, frameon=False, fontsize=9)


def _of(result: Diagnosis) -> str:
    return f" of {', '.join(result.ceiling.on)}" if result.ceiling.on else ""


def _draw_residual(axis: Any, view: ResidualView, units: Units) -> None:
    step = max(len(view.x) // POINTS, 1)
    axis.axhline(0.0, color="0.6", lw=0.8)
    axis.plot(view.x[::step], view.residual[::step], ".", color=RESIDUAL, ms=2.5, alpha=0.35, mew=0)
    if np.ptp(view.x) > 0.0:
        axis.plot(*binned_mean(view.x, view.residual, 60), color="#1f5a8c", lw=1.8, label="mean of the residual")
        if view.explained is not None:
            mean = binned_mean(view.x, view.explained, 60)
            axis.plot(*mean, color=PREDICTED, lw=1.8, ls="--", label=f"mean of what {view.effect} predicts")
        axis.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2, frameon=False, fontsize=9)
    named = {"velocity": units.of_velocity, "position": units.of_position, "u": units.u}.get(view.on, "")
    axis.set_xlabel(f"{view.on} ({named})" if named else _LABELS[view.on])
    without = f" without {view.effect}" if view.effect else ""
    axis.set_ylabel(f"force residual{without} ({units.force})")
