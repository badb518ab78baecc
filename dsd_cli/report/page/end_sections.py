"""What the data cannot identify, the config that results, and how to repeat it."""

from __future__ import annotations

from collections.abc import Sequence

from dsd_cli.identify.checks import Parameter
from dsd_cli.identify.results import Candidate, Diagnosis, Estimate
from dsd_cli.report.ladder import LadderReport
from dsd_cli.report.names import estimate_text, listed
from dsd_cli.report.page.html import Html, left, lines, listing, name, table, tag, typeset
from dsd_cli.report.page.parts import GRADES, badge, missing, section
from dsd_cli.report.page.plan_part import plan_part
from dsd_cli.report.page.story import Story
from dsd_cli.report.values_table import GRADES as WORDS
from dsd_cli.report.values_table import correlation_lines
from dsd_cli.report.verdict import advice_of


def untold_section(story: Story) -> Html:
    """What remains open, and the experiment that would close it."""
    title = "What is not identifiable from these data, and the experiment that would show it"
    open_ = list(dict.fromkeys(_open(story)))
    advice = list(dict.fromkeys(_advice(story)))
    return section(
        "untold",
        title,
        listing(open_, "facts") if open_ else tag("p", "Nothing that was asked is left open."),
        tag("h3", "What to do next") if advice else None,
        listing(advice, "advice"),
        plan_part(story),
        _checked_values(story),
    )


def _open(story: Story) -> list[str]:
    found = [f"{log}: {one.what}" for log, check in zip(story.logs, story.checks, strict=True) for one in check.errors]
    report = story.ladder.value
    if report is None:
        return [*found, f"the model: {story.ladder.missing}"]
    result = report.result
    said = {"weak": "is weakly identifiable", "not": "is not identifiable"}
    found += [f"{key} {said[one.grade]}" for key, one in result.values.items() if one.grade in said]
    found += [
        f"{key} stands at its bound: neither it nor its error is to be believed"
        for key, one in result.values.items()
        if one.at_bound
    ]
    found += correlation_lines(result.correlations, result.values)
    ties = [*_ties(story), *(c for c in result.last.ranking if c.effect == result.last.verdict)]
    pairs = [(c.effect, listed(c.indistinguishable_from, "or")) for c in ties if c.indistinguishable_from]
    found += [f"{effect} is indistinguishable from {others}" for effect, others in pairs]
    if result.last.depends_on:
        found.append(f"something is left that depends on {listed(result.last.depends_on)}")
    untested = [c.effect for c in result.last.ranking if c.untestable]
    if untested:
        found.append(f"this log cannot test {listed(untested)} (reasons above, at what is missing)")
    return found


def _ties(story: Story) -> list[Candidate]:
    """The verdict of the first diagnosis, if others explain the log as well; not where it was taken back later."""
    report, ladder = story.diagnosis.value, story.ladder.value
    if report is None:
        return []
    back = {step.effect for step in ladder.result.steps if step.kind == "taken back"} if ladder else set()
    return [c for c in report.result.ranking if c.effect == report.result.verdict and c.effect not in back]


def _advice(story: Story) -> list[str]:
    found = [f.remedy for check in story.checks for f in check.findings if f.remedy and f.severity != "note"]
    first, last = _first(story), _last(story.ladder.value)
    if last is not None:
        found += advice_of(last)
    tied = any(one.indistinguishable_from for one in _ties(story))
    if first is not None and (last is None or tied):
        found += advice_of(first)
    return [typeset(line) for line in found]


def _last(report: LadderReport | None) -> Diagnosis | None:
    return None if report is None else report.result.last


def _first(story: Story) -> Diagnosis | None:
    return None if story.diagnosis.value is None else story.diagnosis.value.result


def _checked_values(story: Story) -> Html | None:
    """Which values of the model as given are identifiable from each log."""
    made: list[Html] = []
    for log, check in zip(story.logs, story.checks, strict=True):
        if not check.parameters or check.errors:
            continue
        rows = [
            (
                left(name(one.name)),
                left(badge(WORDS[one.identified], GRADES[one.identified])),
                tag("td", _fitted(one)),
                left(f"indistinguishable from {listed(one.tied_to)}" if one.tied_to else ""),
            )
            for one in check.parameters
        ]
        made.append(
            table(("of the model as given", "identifiability", "value by the fit in the band", ""), rows, "", log)
        )
    return (
        tag("details", tag("summary", "Which values of the model as given are identifiable from each log"), *made)
        if made
        else None
    )


def _fitted(one: Parameter) -> str:
    if one.identified == "not":
        return "no value"
    return typeset(estimate_text(Estimate(one.value, one.std_error, one.unit)))


def config_section(story: Story) -> Html:
    """The config that results; the buttons work with its exact text."""
    title = "The config that results"
    if not story.config_text:
        return section("config", title, missing(story.why_not(story.ladder)))
    steps = len(story.ladder.value.result.steps) - 1 if story.ladder.value else 0
    what = (
        f"{story.config_name} with what the ladder found, its comments kept; [[history]] has the steps."
        if steps
        else f"{story.config_name} as it was: no step was taken."
    )
    buttons = tag(
        "div",
        tag("button", "Copy", type="button", data_copy="config"),
        tag("button", "Save as dsd.toml", type="button", data_save="dsd.toml"),
        class_="buttons",
    )
    return section("config", title, tag("p", what), buttons, tag("pre", lines(story.config_text), id="config-text"))


def repeat_section(story: Story) -> Html:
    """Command, files and versions."""
    files: Sequence[tuple[Html, ...]] = [
        (left(f.name), tag("td", f"{f.size:,}"), left(tag("code", f.sha256 or "-", class_="hash"))) for f in story.files
    ]
    versions = [(left(key), left(value)) for key, value in story.versions.items()]
    return section(
        "repeat",
        "How to repeat it",
        tag("p", "The command, in the folder of the files:"),
        tag(
            "div",
            tag("button", "Copy", type="button", data_copy="command"),
            tag("button", "Save the results as JSON", type="button", data_save="results.json"),
            class_="buttons",
        ),
        tag("pre", lines(story.command), id="command-text"),
        table(("file", "bytes", "SHA-256"), files, "words"),
        table(("made with", "version"), versions, "words"),
    )
