"""The head of the page, what the log is worth, and what the detector saw in it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import PurePath

from dsd_cli.identify.checks import CheckResult
from dsd_cli.identify.results import Ladder
from dsd_cli.report.checks import answers_little, facts, verdict
from dsd_cli.report.detection import Detection
from dsd_cli.report.ladder import final_line, learnt
from dsd_cli.report.names import change_text, error, percent
from dsd_cli.report.page.html import Html, bar, joined, left, listing, table, tag, typeset
from dsd_cli.report.page.parts import badge, missing, panel, section
from dsd_cli.report.page.story import Labels, Outcome, Story

#: Rows of a table on the page; the commands list all as JSON.
MOST_STATES, MOST_SEGMENTS = 12, 40


def head(story: Story) -> Html:
    """Title, the answer in one sentence, and the figures that matter most."""
    names = ", ".join(PurePath(log).name for log in story.logs)
    aside = tag("p", "held out: ", ", ".join(story.holdout), class_="dim") if story.holdout else None
    return tag(
        "header",
        tag("p", f"dsd report · {story.made.replace('T', ' ').replace('Z', ' UTC')}", class_="dim"),
        tag("h1", names),
        aside,
        *_cautions(story),
        tag("p", typeset(_answer(story)), class_="answer"),
        tag("div", *_cards(story), class_="cards"),
        _warnings(story),
    )


def _cautions(story: Story) -> list[Html]:
    """What must be mended before anything below is believed."""
    return [
        tag(
            "p",
            tag("b", f"{PurePath(check.log).name} cannot answer as it is: {one.what}."),
            " What follows is not to be believed until that is mended",
            tag("span", ": ", tag("code", one.remedy)) if one.remedy else "",
            ".",
            class_="caution",
        )
        for check in story.checks
        for one in check.errors
    ]


def _answer(story: Story) -> str:
    if story.ladder.value is not None:
        line = final_line(story.ladder.value.result)
        return f"{line[:1].upper()}{line[1:]}."
    return f"No answer about the model: {story.ladder.missing}"


def _cards(story: Story) -> list[Html]:
    bad = sum(bool(one.errors) for one in story.checks)
    grave = sum(f.severity == "warning" for one in story.checks for f in one.findings)
    kind = "bad" if bad else "warn" if grave else "good"
    below = "" if not grave else "with a warning" if grave == 1 else f"with {grave} warnings"
    little = any(answers_little(one) for one in story.checks)
    figure = "cannot answer" if bad else "can answer little" if little else "can answer"
    cards = [_card("the log", figure, below, "warn" if little and not bad else kind)]
    if story.ladder.value is None:
        return cards
    ladder = story.ladder.value.result
    first, last = ladder.steps[0].score, ladder.steps[-1].score
    unit = ladder.last.units.force
    fell = change_text(first.heldout_rmse, last.heldout_rmse)
    figure = f"{error(first.heldout_rmse)} → {error(last.heldout_rmse)}"
    cards.append(_card("held-out force error", figure, f"{unit} · {fell}", ""))
    steps = len(ladder.steps) - 1
    cards.append(_card("steps taken", str(steps), ", ".join(s.effect for s in ladder.steps[1:]) or "none", ""))
    cards.append(_at_the_end(ladder))
    return cards


def _at_the_end(ladder: Ladder) -> Html:
    """The verdict on the model at the end; where a law was learnt, what that leaves."""
    kind = "good" if ladder.verdict == "none" else "warn"
    if learnt(ladder):
        left = f"{percent(ladder.last.unexplained.share_of_u)} of u stays unexplained"
        return _card("at the end", "a law was learnt", left, kind)
    what = {"none": "nothing is missing", "unknown": "something unknown"}.get(ladder.verdict, ladder.verdict)
    return _card("at the end", what, f"probability {percent(ladder.last.probability)}", kind)


def _card(name: str, figure: str, below: str, kind: str) -> Html:
    return tag(
        "div",
        tag("span", name, class_="name"),
        tag("b", figure, class_=kind or None),
        tag("span", below, class_="below"),
        class_="card",
    )


def _warnings(story: Story) -> Html | None:
    own = story.ladder.value.warnings if story.ladder.value else ()
    found = list(dict.fromkeys((*story.warnings, *own)))
    if not found:
        return None
    title = "1 warning" if len(found) == 1 else f"{len(found)} warnings"
    return tag("details", tag("summary", title), listing(found), class_="warnings", open=len(found) < 4)


def log_section(story: Story) -> Html:
    """What `check` says of each log, and the channels."""
    title = "The log and its quality"
    parts: list[Html] = [_checked(one) for one in story.checks]
    views = story.views.value
    if views is None:
        return section("log", title, *parts, missing(story.views.missing))
    sources = [f"{name} {how}" for name, how in views.provenance.items() if how != "logged"]
    if sources:
        parts.append(tag("p", "Channels of the comparison and the fits: ", "; ".join(sources), ".", class_="dim"))
    return section(
        "log", title, *parts, *(panel(name) for name in views.channels if name != "d_hat" or not views.predicted)
    )


def _checked(result: CheckResult) -> Html:
    kind = "bad" if result.errors else "good" if verdict(result) == "can answer" else "warn"
    rows = [
        (
            left(badge(one.severity, {"error": "bad", "warning": "warn"}.get(one.severity, "note"))),
            left(one.what, "" if one.sure >= 0.9 else f" ({percent(one.sure)} sure)"),
            left(tag("code", one.remedy) if one.remedy else ""),
        )
        for one in result.findings
    ]
    return joined(
        [
            tag("h3", badge(verdict(result).split(":")[0], kind), " ", PurePath(result.log).name),
            listing(facts(result), "facts"),
            table(("", "finding", "what to do"), rows, "words") if rows else None,
        ]
    )


def detection_section(story: Story) -> Html:
    """The labels."""
    title = "What was detected"
    if not story.detections:
        return section("detected", title, missing("the config has no [states], so no state was asked for"))
    parts: list[Html] = [tag("p", f"Detected {story.detected_with}.")] if story.detected_with else []
    for log, part in story.detections:
        if len(story.detections) > 1:
            parts.append(tag("h3", PurePath(log).name))
        parts.append(_detected(part))
    if story.views.value is not None:
        first = next((part.value for _, part in story.detections if part.value), None)
        parts += [panel(f"label-{axis}") for axis in (first.axes if first else ())]
    return section("detected", title, *parts)


def _detected(part: Outcome[Labels]) -> Html:
    if part.value is None:
        return missing(part.missing)
    result = part.value.result
    summary = result.summary
    final = ", ".join(f"{name} {value:g}" for name, value in summary.final.items())
    sure = "confident" if summary.final_confident else "not confident"
    lines = [
        f"At the end: {final} ({sure}). {summary.judged:,} of {summary.samples:,} samples judged, "
        f"{_percent(summary.confident_share)} confident; method {result.method}, d_hat {_source(result)}."
    ]
    if summary.residual_rms is not None and summary.explained_share is not None:
        lines.append(
            f"The labels leave {summary.residual_rms:.3g} of {result.output} unexplained (rms; rho is {result.rho:g}); "
            f"{_percent(summary.explained_share)} of the judged samples are within 2 rho."
        )
    if not result.explains:
        lines.append("No candidate explains this log: widen the grid, or the model lacks an effect.")
    if summary.truth is not None:
        lines.append(f"The log knows the truth: {_percent(summary.truth.share_correct)} of the labels are right.")
    return joined([*(tag("p", line) for line in lines), _states(result), _segments(result)])


def _source(result: Detection) -> str:
    return "logged" if result.d_hat_source == "logged" else f"computed from {result.d_hat_source}"


def _states(result: Detection) -> Html:
    chosen = sorted((s for s in result.summary.states if s.share > 0.0), key=lambda s: -s.share)
    rows = [
        (
            *(tag("td", f"{value:g}") for value in state.values.values()),
            tag("td", _percent(state.share), bar(state.share)),
            tag("td", _percent(state.confident_share), bar(state.confident_share, "strong")),
        )
        for state in chosen[:MOST_STATES]
    ]
    head_row = [*_axes(result), "of all samples", "of confident ones"]
    more = _more(len(chosen), MOST_STATES, "states")
    return joined([table(head_row, rows, "", "States chosen"), more])


def _segments(result: Detection) -> Html:
    segments, total = result.summary.segments, result.summary.segments_total
    rows = [
        (
            tag("td", f"{one.start:.6g}"),
            tag("td", f"{one.end:.6g}"),
            *(tag("td", f"{value:g}") for value in one.values.values()),
            tag("td", _percent(one.confident_share)),
        )
        for one in segments[:MOST_SEGMENTS]
    ]
    made = table(("from s", "to s", *_axes(result), "confident"), rows, "long")
    more = _more(total, MOST_SEGMENTS, "segments")
    title = "1 segment of one label" if total == 1 else f"{total:,} segments of one label"
    return tag("details", tag("summary", title), made, more)


def _axes(result: Detection) -> Sequence[str]:
    return [{"delay": "delay s"}.get(axis, axis) for axis in result.summary.final]


def _more(total: int, shown: int, what: str) -> Html | None:
    if total <= shown:
        return None
    return tag("p", f"and {total - shown:,} more {what} (dsd detect --format json lists them)", class_="dim")


def _percent(share: float) -> str:
    return f"{100 * share:.1f} %"
