"""The ladder, and the values at its end."""

from __future__ import annotations

import math

from dsd_cli.identify.fit.values import flat
from dsd_cli.identify.results import Estimate, Ladder, without_errors
from dsd_cli.report.ladder import brought, done
from dsd_cli.report.names import error, estimate_text, fall_text, force_error, in_words
from dsd_cli.report.page.html import Html, bar, joined, left, listing, name, table, tag, typeset
from dsd_cli.report.page.learnt_part import learnt_part
from dsd_cli.report.page.parts import GRADES, badge, missing, panel, panels, section
from dsd_cli.report.page.story import Story
from dsd_cli.report.validation import validation_lines
from dsd_cli.report.values_table import correlation_lines, grade

#: Bars of errors end at this share of the smallest one.
_BELOW = 0.6


def ladder_section(story: Story) -> Html:
    """Step by step; the chosen step is what the charts below show."""
    title = "The ladder"
    report = story.ladder.value
    if report is None:
        return section("ladder", title, missing(story.why_not(story.ladder)))
    result = report.result
    views = story.views.value
    charts: list[Html | None] = []
    if views is not None:
        clouds = [f"step-{cloud.on}" for cloud in views.clouds]
        force = [panel("force-step")] if views.force else [tag("p", views.no_force, class_="dim")]
        charts = [panel("d_hat-step"), *force, panels(*clouds) if clouds else None]
    else:
        charts = [missing(story.views.missing)]
    return section(
        "ladder",
        title,
        tag(
            "p",
            "One effect at a time is added, and everything fitted again; a step stays only if the error on data that no"
            " fit saw falls.",
        ),
        _rungs(result),
        _chooser(result),
        *(_chosen(result, i) for i in range(len(result.steps))),
        *charts,
        learnt_part(story),
    )


def _rungs(result: Ladder) -> Html:
    errors = [step.score.heldout_rmse for step in result.steps]
    positive = [e for e in (*errors, result.last.floor) if math.isfinite(e) and e > 0.0]
    low, high = _BELOW * min(positive, default=1.0), max(positive, default=1.0)
    rows = []
    for i, step in enumerate(result.steps):
        values = [typeset(f"{key} {estimate_text(e)}") for key, e in brought(step, result).items()]
        rows.append(
            (
                left(f"{step.step} ", tag("b", name(done(step))), listing(values, "values")),
                tag("td", error(errors[i]), bar(_log_share(errors[i], low, high), "strong")),
                fall_text(errors[i - 1], errors[i]) if i else "",
                f"{step.score.fit_percent:.1f} %" if math.isfinite(step.score.fit_percent) else "-",
            )
        )
    floor = ""
    if math.isfinite(result.last.floor):
        floor = f" The sensor's noise alone would leave {error(result.last.floor)} (with the inertia at the end)."
    note = tag("p", f"Bars are logarithmic.{floor}", class_="dim")
    held = f"held-out {force_error(result.last.band_hz)}, {result.last.units.force}"
    return joined([table(("step", held, "fell by", "fit"), rows, "rungs"), note])


def _log_share(value: float, low: float, high: float) -> float:
    if not (math.isfinite(value) and value > 0.0) or high <= low:
        return 0.0
    return math.log(value / low) / math.log(high / low)


def _chooser(result: Ladder) -> Html:
    """Buttons; the script makes them work."""
    last = len(result.steps) - 1
    buttons = [
        tag(
            "button",
            f"{step.step} {done(step)}",
            type="button",
            role="radio",
            aria_checked="true" if step.step == last else "false",
            data_step=i,
        )
        for i, step in enumerate(result.steps)
    ]
    same = tag("label", tag("input", type="checkbox", id="same-scale"), " one scale for all steps")
    group = tag("div", *buttons, role="radiogroup", aria_label="step of the ladder", class_="steps")
    return tag("div", tag("span", "Show step", class_="name"), group, same, class_="chooser")


def _chosen(result: Ladder, i: int) -> Html:
    """Values of a step, and what each was on the step before."""
    step = result.steps[i]
    before = flat(result.steps[i - 1].model) if i else {}
    rows = []
    for key, value in flat(step.model).items():
        estimate = (step.estimates if step is result.steps[-1] else without_errors(step.estimates)).get(key)
        now = typeset(estimate_text(estimate)) if estimate and i else f"{value:.6g}"
        was = "new" if i and key not in before else f"{before[key]:.6g}" if key in before else ""
        rows.append((left(name(key)), left(now), left(was)))
    heads = ("value", "as given" if i == 0 else "at this step", "" if i == 0 else "the step before")
    return tag(
        "details",
        tag("summary", f"Values of step {step.step}: {done(step)}"),
        table(heads, rows),
        class_="step",
        data_step=i,
    )


def values_section(story: Story) -> Html:
    """The table at the end, and the logs that were held out."""
    title = "Values, and what they are worth"
    report = story.ladder.value
    if report is None:
        return section("values", title, missing(story.why_not(story.ladder)))
    result = report.result
    given = flat(result.steps[0].model)
    rows = [_value_row(key, one, given.get(key)) for key, one in result.values.items()]
    held_out = [line for one in report.validation for line in validation_lines(one, result.last.units)]
    return section(
        "values",
        title,
        table(("value", "as given", "fitted, ± one standard error", "unit", "identifiability"), rows, "values"),
        listing(correlation_lines(result.correlations, result.values), "facts"),
        tag("h3", "On logs that no fit saw") if held_out else None,
        listing(held_out, "facts"),
        tag("p", result.last.units.legend, class_="dim") if result.last.units.legend else None,
    )


def _value_row(key: str, one: Estimate, given: float | None) -> tuple[Html, ...]:
    bare = Estimate(one.value, one.std_error, "")
    word, comma, rest = grade(one).partition(",")
    return (
        left(name(key)),
        tag("td", "" if given is None else f"{given:.6g}"),
        tag("td", typeset(estimate_text(bare))),
        left("" if one.unit == "1" else in_words(one.unit)),
        left(badge(word, GRADES.get(one.grade, "note")) if word else "", comma + rest),
    )
