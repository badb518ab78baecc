"""The next motion, at what the data cannot identify."""

from __future__ import annotations

from typing import Any

import numpy as np

from dsd_cli.report.names import error
from dsd_cli.report.page.html import Html, joined, left, listing, table, tag
from dsd_cli.report.page.parts import panels
from dsd_cli.report.page.story import Story
from dsd_cli.report.planning import Channel, channels, headline, nats_text, not_counted
from dsd_cli.signals.envelope import envelope
from dsd_cli.signals.log import Array

#: Points of a curve, and digits of a value that is drawn.
_POINTS, _DIGITS = 1_500, 5


def plan_part(story: Story) -> Html | None:
    """What `dsd plan` expects of a motion within the limits; None where nothing is left open."""
    plan = story.plan.value
    if plan is None:
        return tag("p", f"No motion is planned: {story.plan.missing}") if story.plan.missing else None
    pairs = [(left(f"{p.a} or {p.b}"), nats_text(abs(p.nats_before)), nats_text(p.nats_expected)) for p in plan.pairs]
    units = plan.units
    values = [
        (left(v.name), error(v.std_error_before), error(v.std_error_expected), left(units.words(v.unit)))
        for v in plan.values
    ]
    notes = [*plan.warnings, *([not_counted(plan)] if plan.not_counted else [])]
    charts = plan_charts(story)
    return joined(
        [
            tag("h3", "The motion that would identify it (dsd plan)"),
            tag("p", f"{headline(plan)}."),
            panels(*charts) if charts else None,
            table(("distinguished, nats", "by these logs", "with it"), pairs) if pairs else None,
            table(("standard error of", "by these logs", "with it", "unit"), values) if values else None,
            listing(joined([tag("b", one.what), ": ", one.remedy]) for one in plan.impossible),
            listing(notes, "facts"),
        ]
    )


def plan_charts(story: Story) -> dict[str, Any]:
    """Chart by name: each channel of the motion with its limits."""
    plan = story.plan.value
    if plan is None or plan.motion is None:
        return {}
    t = np.asarray(plan.motion.step * np.arange(len(plan.motion.position)), dtype=np.float64)
    return {f"plan-{i}": _chart(one, t) for i, one in enumerate(channels(plan))}


def _chart(one: Channel, t: Array) -> dict[str, Any]:
    at, values = envelope(t, one.values, _POINTS)
    whole = [float(t[0]), float(t[-1])]
    return {
        "title": f"planned {one.title}",
        "unit": one.unit,
        "x": "time from the start of the motion (s)",
        "series": [
            {"name": one.title, "color": "measured", "data": [[_numbers(at), _numbers(values)]]},
            *({"name": "limit", "color": "faint", "data": [[whole, [end, end]]]} for end in one.limits),
        ],
    }


def _numbers(x: Array) -> list[float]:
    return [float(f"{value:.{_DIGITS}g}") for value in x.tolist()]
