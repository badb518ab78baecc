"""The next motion, at what the data cannot identify."""

from __future__ import annotations

from dsd_cli.report.names import error
from dsd_cli.report.page.html import Html, joined, left, listing, table, tag
from dsd_cli.report.page.story import Story
from dsd_cli.report.planning import headline, nats_text


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
    return joined(
        [
            tag("h3", "The motion that would identify it (dsd plan)"),
            tag("p", f"{headline(plan)}."),
            table(("distinguished, nats", "by these logs", "with it"), pairs) if pairs else None,
            table(("standard error of", "by these logs", "with it", "unit"), values) if values else None,
            listing(joined([tag("b", one.what), ": ", one.remedy]) for one in plan.impossible),
        ]
    )
