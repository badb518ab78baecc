"""The ladder, the values at its end, what the data cannot tell, the config, and how to repeat it."""

from __future__ import annotations

import math
from collections.abc import Sequence

from dsd_cli.identify.fit.values import flat
from dsd_cli.identify.results import Candidate, Diagnosis, Estimate, Ladder, Step
from dsd_cli.report.diagnosis import error, stability_line
from dsd_cli.report.ladder import LadderReport, own
from dsd_cli.report.names import estimate_text, fall_text, force_error, in_words, listed
from dsd_cli.report.page.html import Html, bar, joined, left, lines, listing, table, tag
from dsd_cli.report.page.parts import badge, missing, panel, panels, section
from dsd_cli.report.page.story import Story
from dsd_cli.report.validation import validation_lines
from dsd_cli.report.values_table import correlation_lines, told

#: Bars of errors end at this share of the smallest one.
_BELOW = 0.6
_GRADES = {"identified": "good", "weak": "warn", "not": "bad", "held": "note"}


def ladder_section(story: Story) -> Html:
    """Step by step; the chosen step is what the charts below show."""
    title = "The ladder"
    report = story.ladder.value
    if report is None:
        return section("ladder", title, missing(story.ladder.missing))
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
    )


def _rungs(result: Ladder) -> Html:
    errors = [step.score.heldout_rmse for step in result.steps]
    positive = [e for e in (*errors, result.last.floor) if math.isfinite(e) and e > 0.0]
    low, high = _BELOW * min(positive, default=1.0), max(positive, default=1.0)
    rows = []
    for i, step in enumerate(result.steps):
        values = [f"{name} {estimate_text(e)}" for name, e in own(step).items()] if step.kind != "taken back" else []
        rows.append(
            (
                left(f"{step.step} ", tag("b", _done(step)), listing(values, "values")),
                tag("td", error(errors[i]), bar(_log_share(errors[i], low, high), "strong")),
                fall_text(errors[i - 1], errors[i]) if i else "",
                f"{step.score.fit_percent:.1f} %" if math.isfinite(step.score.fit_percent) else "-",
            )
        )
    floor = ""
    if math.isfinite(result.last.floor):
        floor = f" The sensor's noise alone would leave {error(result.last.floor)}."
    note = tag("p", f"Bars are logarithmic.{floor}", class_="dim")
    held = f"held-out {force_error(result.last.band_hz)}, {result.last.units.force}"
    return joined([table(("step", held, "fell by", "fit"), rows, "rungs"), note])


def _log_share(value: float, low: float, high: float) -> float:
    if not (math.isfinite(value) and value > 0.0) or high <= low:
        return 0.0
    return math.log(value / low) / math.log(high / low)


def _done(step: Step) -> str:
    return f"{step.effect} taken back" if step.kind == "taken back" else step.effect


def _chooser(result: Ladder) -> Html:
    """Buttons; the script makes them work."""
    last = len(result.steps) - 1
    buttons = [
        tag(
            "button",
            f"{step.step} {_done(step)}",
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
    for name, value in flat(step.model).items():
        estimate = step.estimates.get(name)
        now = estimate_text(estimate) if estimate and i else f"{value:.6g}"
        was = "new" if i and name not in before else f"{before[name]:.6g}" if name in before else ""
        rows.append((left(name), left(now), left(was)))
    heads = ("value", "as given" if i == 0 else "at this step", "" if i == 0 else "the step before")
    return tag(
        "details",
        tag("summary", f"Values of step {step.step}: {_done(step)}"),
        table(heads, rows),
        class_="step",
        data_step=i,
    )


def values_section(story: Story) -> Html:
    """The table at the end, and the logs that were held out."""
    title = "Values, and what they are worth"
    report = story.ladder.value
    if report is None:
        return section("values", title, missing(story.ladder.missing))
    result = report.result
    given = flat(result.steps[0].model)
    rows = [_value_row(name, one, given.get(name)) for name, one in result.values.items()]
    held_out = [line for one in report.validation for line in validation_lines(one, result.last.units)]
    stable = stability_line(result.last)
    return section(
        "values",
        title,
        table(("value", "as given", "fitted, ± one standard error", "unit", "this log tells it"), rows, "values"),
        listing(correlation_lines(result.correlations), "facts"),
        tag("p", f"The last verdict is {stable}." if stable.startswith("the same") else f"The last verdict: {stable}.")
        if stable
        else None,
        tag("h3", "On logs that no fit saw") if held_out else None,
        listing(held_out, "facts"),
        tag("p", result.last.units.legend, class_="dim") if result.last.units.legend else None,
    )


def _value_row(name: str, one: Estimate, given: float | None) -> tuple[Html, ...]:
    bare = Estimate(one.value, one.std_error, "")
    grade = told(one).split(",")[0]
    rest = told(one)[len(grade) :]
    return (
        left(name),
        tag("td", "" if given is None else f"{given:.6g}"),
        tag("td", estimate_text(bare).replace(" +- ", " ± ")),
        left("" if one.unit == "1" else in_words(one.unit)),
        left(badge(grade, _GRADES.get(grade, "note")) if grade else "", rest),
    )


def untold_section(story: Story) -> Html:
    """What remains open, and the experiment that would close it."""
    title = "What the data cannot tell, and the experiment that would"
    open_ = list(dict.fromkeys(_open(story)))
    advice = list(dict.fromkeys(_advice(story)))
    return section(
        "untold",
        title,
        listing(open_, "facts") if open_ else tag("p", "Nothing that was asked is left open."),
        tag("h3", "What to do next") if advice else None,
        listing(advice, "advice"),
        _checked_values(story),
    )


def _open(story: Story) -> list[str]:
    found = [f"{log}: {one.what}" for log, check in zip(story.logs, story.checks, strict=True) for one in check.errors]
    report = story.ladder.value
    if report is None:
        return [*found, f"the model: {story.ladder.missing}"]
    result = report.result
    found += [f"{name} is told weakly" for name, one in result.values.items() if one.told == "weak"]
    found += [f"{name} is not told at all" for name, one in result.values.items() if one.told == "not"]
    found += [f"{name} stands at its bound, so it is not to be believed" for name, e in result.values.items() if e.at_bound]
    found += correlation_lines(result.correlations)
    ties = [*_ties(story), *(c for c in result.last.ranking if c.effect == result.last.verdict)]
    found += [f"{c.effect} cannot be told from {listed(c.indistinguishable_from, 'or')}" for c in ties if c.indistinguishable_from]
    if result.last.depends_on:
        found.append(f"something is left that depends on {listed(result.last.depends_on)}")
    untested = [c.effect for c in result.last.ranking if c.untestable]
    if untested:
        found.append(f"this log cannot test {listed(untested)} (reasons above, at what is missing)")
    return found


def _ties(story: Story) -> list[Candidate]:
    """The verdict of the first diagnosis, if others explain the log as well."""
    report = story.diagnosis.value
    if report is None:
        return []
    return [c for c in report.result.ranking if c.effect == report.result.verdict]


def _advice(story: Story) -> list[str]:
    found = [f.remedy for check in story.checks for f in check.findings if f.remedy and f.severity != "note"]
    for result in (r for r in (_last(story.ladder.value), _first(story)) if r is not None):
        found += result.advice
    return found


def _last(report: LadderReport | None) -> Diagnosis | None:
    return None if report is None else report.result.last


def _first(story: Story) -> Diagnosis | None:
    return None if story.diagnosis.value is None else story.diagnosis.value.result


def _checked_values(story: Story) -> Html | None:
    """Which values of the model as given each log tells."""
    made: list[Html] = []
    for log, check in zip(story.logs, story.checks, strict=True):
        if not check.parameters or check.errors:
            continue
        rows = [
            (
                left(one.name),
                left(badge(one.identified, _GRADES[one.identified])),
                tag("td", estimate_text(Estimate(one.value, one.std_error, one.unit)) if one.identified != "not" else "-"),
                left(f"not to be told from {listed(one.tied_to)}" if one.tied_to else ""),
            )
            for one in check.parameters
        ]
        made.append(table(("of the model as given", "told", "fitted in the band", ""), rows, "", log))
    return tag("details", tag("summary", "Which values of the model as given each log tells"), *made) if made else None


def config_section(story: Story) -> Html:
    """The config that results; the buttons work with its exact text."""
    title = "The config that results"
    if not story.config_text:
        return section("config", title, missing(story.ladder.missing))
    steps = len(story.ladder.value.result.steps) - 1 if story.ladder.value else 0
    what = (
        f"{story.config_name} with what the ladder found, its comments kept; [[history]] has the steps."
        if steps
        else f"{story.config_name} as it was: no step was taken."
    )
    buttons = tag(
        "div",
        tag("button", "Copy", type="button", data_copy="config"),
        tag("button", "Save as dsd.toml", type="button", data_save="config"),
        class_="buttons",
    )
    return section("config", title, tag("p", what), buttons, tag("pre", lines(story.config_text), id="config-text"))


def repeat_section(story: Story) -> Html:
    """Command, files and versions."""
    files: Sequence[tuple[Html, ...]] = [
        (left(f.name), tag("td", f"{f.size:,}"), left(tag("code", f.sha256 or "-", class_="hash"))) for f in story.files
    ]
    versions = [(left(name), left(value)) for name, value in story.versions.items()]
    return section(
        "repeat",
        "How to repeat it",
        tag("p", "The command, in the folder of the files:"),
        tag("div", tag("button", "Copy", type="button", data_copy="command"), class_="buttons"),
        tag("pre", lines(story.command), id="command-text"),
        table(("file", "bytes", "SHA-256"), files, "words"),
        table(("made with", "version"), versions, "words"),
    )
