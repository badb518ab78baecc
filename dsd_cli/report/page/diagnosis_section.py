"""What is missing."""

from __future__ import annotations

import math
from collections.abc import Sequence

from dsd_cli.identify.results import Candidate, Diagnosis
from dsd_cli.report.diagnosis import found_text, in_final_set
from dsd_cli.report.levels import level_rows
from dsd_cli.report.names import error, estimate_text, fall_text, force_error, listed
from dsd_cli.report.page.html import Html, bar, joined, left, listing, name, table, tag, typeset
from dsd_cli.report.page.parts import missing, section
from dsd_cli.report.page.story import Story
from dsd_cli.report.verdict import verdict_line

#: Candidates that are listed at once; the rest can be opened.
MOST_CANDIDATES = 10


def diagnosis_section(story: Story) -> Html:
    """What `diagnose` says."""
    title = "What is missing"
    report = story.diagnosis.value
    if report is None:
        return section("missing", title, missing(story.why_not(story.diagnosis)))
    result = report.result
    tested = [c for c in result.ranking if not c.untestable]
    untested = [c for c in result.ranking if c.untestable]
    return section(
        "missing",
        title,
        tag("p", typeset(verdict_line(result, report.given)), ".", class_="verdict"),
        tag("p", f"Found together: {found_text(result)}.") if len(result.found) > 1 else None,
        table(
            ("log", *(f"{one.deviations.name}, mean {one.mean:.4g}" for one in result.levels)),
            [(left(log), *map(typeset, values)) for log, *values in level_rows(result.levels)],
            "",
            "Values that differ between the logs",
        )
        if result.levels
        else None,
        _ranking(result, tested[:MOST_CANDIDATES]),
        tag(
            "details",
            tag("summary", f"{len(tested) - MOST_CANDIDATES} more candidates"),
            _ranking(result, tested[MOST_CANDIDATES:]),
        )
        if len(tested) > MOST_CANDIDATES
        else None,
        listing(_levels(result), "facts"),
        tag(
            "details",
            tag(
                "summary",
                "1 effect that" if len(untested) == 1 else f"{len(untested)} effects that",
                " this log cannot test",
            ),
            listing(joined([tag("b", c.effect), ": ", c.untestable]) for c in untested),
        )
        if untested
        else None,
    )


def _ranking(result: Diagnosis, candidates: Sequence[Candidate]) -> Html:
    befores = [c.heldout_rmse_before for c in result.ranking if math.isfinite(c.heldout_rmse_before)]
    before = befores[0] if befores else math.nan
    rows = []
    for one in candidates:
        values = [typeset(f"{key} {estimate_text(e)}") for key, e in result.alone(one).items()]
        notes = [one.note] if one.note else []
        notes += [f"indistinguishable from {other}" for other in one.indistinguishable_from]
        winner = "winner" if one.effect == result.verdict else ""
        share = one.heldout_rmse_after / before if before > 0.0 and math.isfinite(one.heldout_rmse_after) else 0.0
        rows.append(
            (
                left(
                    tag("b", name(one.effect), class_=winner or None),
                    listing(values, "values"),
                    listing(notes, "notes"),
                ),
                tag("td", error(one.heldout_rmse_after), bar(share, winner)),
                fall_text(one.heldout_rmse_before, one.heldout_rmse_after),
                in_final_set(one, result),
            )
        )
    held = f"held-out {force_error(result.band_hz)}, {result.units.force} (without: {error(before)})"
    return table(("one effect more", held, "falls by", "in the final set"), rows, "long")


def _levels(result: Diagnosis) -> list[str]:
    """What an error can come down to."""
    on = f" of {listed(result.ceiling.on)}" if result.ceiling.on else ""
    found = (
        (result.ceiling.heldout_rmse, f"is what the best free-form function{on} reaches (ceiling)"),
        (result.noise, "is force that no smooth function of anything explains (noise)"),
        (result.floor, "is what the noise of the sensor alone would leave in the band (floor)"),
    )
    return [f"{error(value)} {result.units.force} {what}" for value, what in found if math.isfinite(value)]
