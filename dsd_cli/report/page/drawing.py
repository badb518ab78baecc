"""What the script of the page draws: charts by name, as JSON."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

import numpy as np

from dsd_cli.errors import printable
from dsd_cli.report.page.learnt_part import law_charts
from dsd_cli.report.page.plan_part import plan_charts
from dsd_cli.report.page.series import Cloud, Curve, Views
from dsd_cli.report.page.story import Labels, Outcome, Story
from dsd_cli.report.page.timebase import onward
from dsd_cli.signals.log import Array
from dsd_cli.signals.units import Units

#: Digits of a value that is drawn.
DIGITS = 5


def drawing(story: Story) -> dict[str, Any]:
    """Everything the script needs; texts in it are shown as texts."""
    copies = {"config": story.config_text, "command": story.command}
    views = story.views.value
    if views is None:
        return {"charts": {}, "logs": [], "end": 0, "steps": 1, "copies": copies}
    steps = max(len(views.predicted), 1)
    charts = _channels(views, story.units) | _fits(views, story.units) | _clouds(views, story.units)
    charts |= _labels(views, story.detections, story.units) | law_charts(story)
    charts |= plan_charts(story)
    logs = [{"name": printable(one.name), "start": _time(one.start), "shift": one.shift} for one in views.base.logs]
    return {"charts": charts, "logs": logs, "end": _time(views.base.end), "steps": steps, "copies": copies}


def _channels(views: Views, units: Units) -> dict[str, Any]:
    named = {"u": units.u, "velocity": units.of_velocity, "position": units.of_position}
    named |= {"reference": units.of_position, "d_hat": units.force}
    return {
        name: {"title": name, "unit": unit, "low": True, "series": [_series(name, "measured", [views.channels[name]])]}
        for name, unit in named.items()
        if name in views.channels
    }


def _fits(views: Views, units: Units) -> dict[str, Any]:
    if not views.predicted:
        return {}
    unit = units.force
    measured = _series("measured", "measured", [views.channels["d_hat"]])
    found = {
        "d_hat-given": {
            "title": "d_hat, the model as given",
            "unit": unit,
            "series": [measured, _series("predicted", "model", views.predicted[:1])],
        },
        "residual-given": {
            "title": "residual of d_hat, measured − predicted",
            "unit": unit,
            "series": [_series("residual", "residual", views.residual[:1])],
        },
        "d_hat-step": {
            "title": "d_hat, the chosen step",
            "unit": unit,
            "by_step": True,
            "series": [measured, _series("predicted", "model", views.predicted)],
        },
    }
    if views.force:
        found["force-step"] = {
            "title": f"force residual below {views.band_hz:.3g} Hz, the chosen step",
            "unit": unit,
            "by_step": True,
            "series": [_series("residual", "residual", views.force)],
        }
    return found


def _clouds(views: Views, units: Units) -> dict[str, Any]:
    of = {"velocity": units.of_velocity, "position": units.of_position, "u": units.u}
    found = {}
    for cloud in views.clouds:
        for which, steps in (("given", 1), ("step", len(cloud.residuals))):
            found[f"{which}-{cloud.on}"] = _cloud(cloud, steps, of[cloud.on], units.force, which == "step")
    return found


def _cloud(cloud: Cloud, steps: int, unit: str, force: str, by_step: bool) -> dict[str, Any]:
    x = _numbers(cloud.x)
    return {
        "title": f"against {cloud.on}",
        "unit": force,
        "x": f"{cloud.on} ({unit})" if unit else cloud.on,
        "by_step": by_step,
        "series": [
            {
                "name": "residual",
                "color": "cloud",
                "points": True,
                "data": [[x, _numbers(r)] for r in cloud.residuals[:steps]],
            },
            *(
                {"name": name, "color": color, "data": [[_numbers(a), _numbers(b)] for a, b in curves[:steps]]}
                for color, (name, curves) in zip(("measured", "model"), cloud.medians.items(), strict=False)
            ),
        ],
    }


def _labels(views: Views, detections: Iterable[tuple[str, Outcome[Labels]]], units: Units) -> dict[str, Any]:
    """Label of each axis over time, faint where it is not confident."""
    placed = {one.name: one for one in views.base.logs}
    by_axis: dict[str, list[tuple[Array, ...]]] = {}
    for log, part in detections:
        if part.value is None or log not in placed:
            continue
        labels = part.value
        known = np.isfinite(labels.t)
        t = onward(labels.t[known], placed[log])
        for axis, values in labels.axes.items():
            between = labels.between.get(axis, np.full(values.size, np.nan))
            by_axis.setdefault(axis, []).append((t, values[known], labels.confident[known], between[known]))
    known_units = {"delay": "s", "inertia": units.words("{u}/({v}/s)") if units.u and units.position else ""}
    return {
        f"label-{axis}": _label_chart(axis, known_units.get(axis, ""), parts, views) for axis, parts in by_axis.items()
    }


def _label_chart(axis: str, unit: str, parts: list[tuple[Array, ...]], views: Views) -> dict[str, Any]:
    t, values, confident, between = (np.concatenate(column) for column in zip(*parts, strict=True))
    sure = np.where(confident, values, np.nan)
    estimated = [_series("estimated", "model", [views.reduced(t, between)])] if np.isfinite(between).any() else []
    return {
        "title": f"{axis} of the label",
        "unit": unit,
        "stepped": True,
        "low": True,
        "series": [
            _series("label", "faint", [views.reduced(t, values)]),
            {**_series("confident", "measured", [views.reduced(t, sure)]), "wide": True},
            *estimated,
        ],
    }


def _series(name: str, color: str, curves: Iterable[Curve]) -> dict[str, Any]:
    return {"name": name, "color": color, "data": [[_times(t), _numbers(x)] for t, x in curves]}


def _time(t: float) -> float:
    return float(f"{t:.9g}")


def _times(t: Array) -> list[float]:
    """Times in steps that are smaller than any sample time: two samples never fall together."""
    span = float(t[-1] - t[0]) if len(t) else 0.0
    places = max(0, 8 - math.floor(math.log10(span))) if span > 0.0 else 9
    return [float(x) for x in np.round(t, min(places, 9))]


def _numbers(x: Array) -> list[float | None]:
    return [float(f"{value:.{DIGITS}g}") if math.isfinite(value) else None for value in x.tolist()]
