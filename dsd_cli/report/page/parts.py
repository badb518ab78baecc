"""Pieces that sections share."""

from __future__ import annotations

from dsd_cli.report.page.html import Child, Html, tag

#: Colour of what `told` says of a value.
GRADES = {"identified": "good", "weak": "warn", "not": "bad", "held": "note"}


def section(name: str, title: str, *children: Child) -> Html:
    """A section of the page; `name` is its anchor."""
    return tag("section", tag("h2", title), *children, id=name)


def missing(why: str) -> Html:
    """The one honest line where there is no result."""
    return tag("p", "Not available", " " if why.startswith("for ") else ": ", why, class_="missing")


def badge(word: str, kind: str) -> Html:
    """A word in a colour; the word alone must say it."""
    return tag("span", word, class_=f"badge {kind}")


def panel(name: str) -> Html:
    """Where the script draws the chart of that name."""
    return tag(
        "figure",
        tag("figcaption", tag("b", ""), tag("span", class_="legend"), class_="head"),
        tag("div", class_="plot"),
        class_="panel",
        data_chart=name,
    )


def panels(*names: str) -> Html:
    """Panels side by side where there is room."""
    return tag("div", *(panel(name) for name in names), class_="panels")
