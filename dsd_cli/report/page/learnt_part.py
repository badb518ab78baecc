"""The law that was learnt, at the foot of the ladder whose last rung it is."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from dsd_cli.learn.results import LEARNT, Curve, Formula, View
from dsd_cli.report.learning import as_forces, learn_line, tie_line
from dsd_cli.report.names import estimate_text
from dsd_cli.report.page.html import Html, joined, listing, name, table, tag, typeset
from dsd_cli.report.page.parts import panels
from dsd_cli.report.page.story import Story
from dsd_cli.signals.units import Units

#: Points of a cloud, and digits of a value that is drawn.
_CLOUD, _DIGITS = 1_500, 5


def learnt_part(story: Story) -> Html | None:
    """Line, formula, curves with their bands, other laws that are as good; None where nothing was to be learnt."""
    law = story.law
    if law is None:
        return None
    parts: list[Html | None] = [tag("h3", "What was learnt (dsd learn)"), tag("p", f"{learn_line(law)}.")]
    if law.verdict == LEARNT:
        parts += [_formula(law.formula, law.units)] if law.formula is not None else []
        parts.append(panels(*law_charts(story)))
        parts += [_curve(one, law.units) for one in law.curves if len(one.channels) == 1]
        parts.append(listing(tie_line(one) for one in law.ties))
    return joined([*parts, listing(law.notes, "facts")])


def _formula(formula: Formula, units: Units) -> Html:
    values = [typeset(f"{key} {estimate_text(one)}") for key, one in formula.parameters.items()]
    return joined([tag("p", tag("b", formula.text), f", that is {formula.words}"), listing(values, "values")])


def _curve(curve: Curve, units: Units) -> Html:
    rows = [
        (f"{knot:.4g}", f"{value:.4g}", f"{low:.3g} to {high:.3g}" if math.isfinite(low) else "not visited")
        for knot, value, low, high in zip(curve.knots[0], curve.values, curve.low, curve.high, strict=True)
    ]
    heads = (curve.channels[0], units.words(curve.unit) or "factor", "95 % band")
    return tag("details", tag("summary", "Knots of ", name(curve.effect)), table(heads, rows))


def law_charts(story: Story) -> dict[str, Any]:
    """Chart by name: each law over its channel with its band and the force that is missing, before and with it."""
    law = story.law
    if law is None or law.verdict != LEARNT:
        return {}
    pairs = zip(law.curves, law.views, strict=True)
    found: dict[str, Any] = {}
    for i, (curve, view) in enumerate(pairs):
        if curve.channels == (view.channel,):
            found[f"law-{i}"] = _law(*as_forces(curve, view), law.units)
        found[f"left-{i}"] = _left(view, law.units)
    return found


def _law(curve: Curve, view: View, units: Units) -> dict[str, Any]:
    known = np.isfinite(curve.low)
    knots = _numbers(np.array(curve.knots[0])[known])
    told = np.isfinite(view.points)
    at, points = _some(view.at[told], view.points[told])
    lines = (("law", "model", curve.values), ("band, low", "faint", curve.low), ("band, high", "faint", curve.high))
    return {
        "title": f"{curve.effect} over {curve.channels[0]}, with its band of 95 %",
        "unit": units.words(curve.unit),
        "x": curve.channels[0],
        "series": [
            {"name": "missing", "color": "cloud", "points": True, "data": [[at, points]]},
            *({"name": n, "color": c, "data": [[knots, _numbers(np.array(x)[known])]]} for n, c, x in lines),
        ],
    }


def _left(view: View, units: Units) -> dict[str, Any]:
    parts = (("without the law", "measured", view.before), ("with it", "model", view.after))
    return {
        "title": f"missing force against {view.channel}, without the law and with it",
        "unit": units.force,
        "x": view.channel,
        "series": [{"name": n, "color": c, "points": True, "data": [list(_some(view.at, x))]} for n, c, x in parts],
    }


def _some(at: Any, x: Any) -> tuple[list[float], list[float]]:
    """Evenly over time, in order of `at`."""
    some = np.arange(0, len(at), max(-(-len(at) // _CLOUD), 1))
    some = some[np.argsort(at[some], kind="stable")]
    return _numbers(at[some]), _numbers(x[some])


def _numbers(x: Any) -> list[float]:
    return [float(f"{value:.{_DIGITS}g}") for value in x.tolist()]
