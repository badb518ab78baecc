"""The whole page in one file: HTML, style, script, and the data that the script draws."""

from __future__ import annotations

import base64
import hashlib
from importlib.resources import files
from pathlib import PurePath

from dsd_cli.report.page.diagnosis_section import diagnosis_section
from dsd_cli.report.page.drawing import drawing
from dsd_cli.report.page.end_sections import config_section, repeat_section, untold_section
from dsd_cli.report.page.html import Html, data, tag
from dsd_cli.report.page.ladder_sections import ladder_section, values_section
from dsd_cli.report.page.log_sections import detection_section, head, log_section
from dsd_cli.report.page.model_sections import comparison_section, where_section
from dsd_cli.report.page.results import results
from dsd_cli.report.page.story import Story

#: Anchor and name of each section, for the line on top.
SECTIONS = (
    ("log", "log"),
    ("detected", "detected"),
    ("compare", "model"),
    ("where", "where it fails"),
    ("missing", "what is missing"),
    ("ladder", "ladder"),
    ("values", "values"),
    ("untold", "open"),
    ("config", "config"),
    ("repeat", "repeat"),
)


def render(story: Story) -> bytes:
    """The page as UTF-8.

    A policy in its head forbids every request, and every script but the two that are in it.
    """
    scripts = [_asset("uPlot.min.js"), _asset("page.js")]
    title = ", ".join(PurePath(log).name for log in story.logs)
    page_head = tag(
        "head",
        tag("meta", charset="utf-8"),
        tag("meta", http_equiv="Content-Security-Policy", content=_policy(scripts)),
        tag("meta", name="viewport", content="width=device-width, initial-scale=1"),
        tag("meta", name="color-scheme", content="light dark"),
        tag("title", f"{title} · dsd report"),
        tag("style", Html(_asset("uPlot.min.css") + _asset("page.css"))),
    )
    body = tag(
        "body",
        _bar(story),
        tag("main", head(story), *_sections(story), _foot(story)),
        tag("script", data(drawing(story)), type="application/json", id="data"),
        tag("script", data(results(story)), type="application/json", id="results"),
        *(tag("script", Html(script)) for script in scripts),
    )
    return ("<!doctype html>\n" + tag("html", page_head, body, lang="en") + "\n").encode()


def _sections(story: Story) -> tuple[Html, ...]:
    return (
        log_section(story),
        detection_section(story),
        comparison_section(story),
        where_section(story),
        diagnosis_section(story),
        ladder_section(story),
        values_section(story),
        untold_section(story),
        config_section(story),
        repeat_section(story),
    )


def _bar(story: Story) -> Html:
    """The way to the sections, and the range of time that all charts show."""
    links = tag("span", *(tag("a", name, href=f"#{anchor}") for anchor, name in SECTIONS), class_="links")
    if story.views.value is None:
        return tag("nav", links)
    ends = [
        tag("label", f"{word} ", tag("input", type="number", step="any", id=f"range-{word}", aria_label=f"{word}, s"))
        for word in ("from", "to")
    ]
    zoom = tag(
        "span",
        *ends,
        tag("button", "−", type="button", id="zoom-out", title="show twice as much", aria_label="zoom out"),
        tag("button", "+", type="button", id="zoom-in", title="show half as much", aria_label="zoom in"),
        tag("button", "all", type="button", id="zoom-all", title="show the whole log"),
        class_="zoom",
    )
    return tag("nav", links, zoom)


def _foot(story: Story) -> Html | None:
    views = story.views.value
    if views is None:
        return None
    lines = [
        "Time 0 is the first stamp of the first log; logs follow each other. Drag over a chart to zoom all of them; "
        "a double click shows all again."
    ]
    if views.samples > views.points:
        lines.append(
            f"Curves have {views.samples:,} samples and are drawn with at most {views.points:,} points: of equally "
            "long stretches the lowest and the highest sample, so that no peak is lost."
        )
    every = max((cloud.every for cloud in views.clouds), default=1)
    if every > 1:
        lines.append(f"Clouds of points show one row in {every}; medians are of all rows.")
    lines.append("All figures in text and tables are of all samples.")
    return tag("footer", tag("p", " ".join(lines)))


def _policy(scripts: list[str]) -> str:
    hashes = " ".join(f"'sha256-{_digest(script)}'" for script in scripts)
    return f"default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src {hashes}"


def _digest(script: str) -> str:
    return base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()


def _asset(name: str) -> str:
    """A file beside this one, as it stands."""
    return files("dsd_cli.report.page").joinpath("assets", name).read_text("utf-8")
