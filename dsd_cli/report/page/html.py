"""HTML whose texts are escaped because there is no other way to put them in."""

from __future__ import annotations

import html
import json
from collections.abc import Iterable, Sequence
from typing import Any

from dsd_cli.errors import ORDERS, printable

#: Elements without content.
_VOID = {"meta", "input", "br"}


class Html(str):
    """Text that is HTML already; only `tag`, `text` and `lines` make it."""

    __slots__ = ()


Child = Html | str | int | float | None


def text(content: object) -> Html:
    """Escaped, on one line, with control characters and marks of direction as `\\x1b`."""
    return Html(html.escape(printable(str(content))))


def lines(content: str) -> Html:
    """Escaped, for <pre>: line ends and tabs stay, and nothing is shortened."""
    shown = ORDERS.sub(lambda one: one[0] if one[0] in "\n\t" else printable(one[0]), content.replace("\r\n", "\n"))
    return Html(html.escape(shown))


def tag(name: str, /, *children: Child, **attributes: Any) -> Html:
    """`<name class="...">children</name>`; `class_` and `data_x` are written class and data-x; None is left out."""
    given = "".join(
        _attribute(key, value) for key, value in attributes.items() if value is not None and value is not False
    )
    if name in _VOID:
        return Html(f"<{name}{given}>")
    return Html(f"<{name}{given}>{joined(children)}</{name}>")


def _attribute(key: str, value: Any) -> str:
    key = key.rstrip("_").replace("_", "-")
    return f" {key}" if value is True else f' {key}="{text(value)}"'


def name(identifier: str) -> Html:
    """An id, which may be broken after `_` and `.` where it is too long for its column."""
    return Html(text(identifier).replace("_", "_<wbr>").replace(".", ".<wbr>"))


def typeset(sentence: str) -> str:
    """A sentence of the commands in the signs of a page."""
    return sentence.replace(" +- ", " ± ").replace(" -> ", " → ").replace("`", "")


def joined(children: Iterable[Child]) -> Html:
    """One after the other; what is no HTML is escaped."""
    return Html("".join(c if isinstance(c, Html) else text(c) for c in children if c is not None))


def data(value: Any) -> Html:
    """JSON for a <script type="application/json">: no `<`, no line ends of Unicode; a NaN fails."""
    dumped = json.dumps(value, ensure_ascii=True, allow_nan=False, separators=(",", ":"))
    return Html(dumped.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026"))


def table(head: Sequence[Child], rows: Iterable[Sequence[Child]], kind: str = "", caption: str = "") -> Html:
    """A table; cells after the first are numbers to the right unless they say `class="left"` themselves."""
    cells = [[_cell(c) for c in row] for row in rows]
    body = [tag("tr", *row) for row in cells]
    parts = [tag("caption", caption)] if caption else []
    if any(head):
        words = [c.startswith('<td class="left"') for c in cells[0]] if cells else [True] * len(head)
        heads = (tag("th", c, scope="col", class_="left" if w else None) for c, w in zip(head, words, strict=True))
        parts.append(tag("thead", tag("tr", *heads)))
    return tag("div", tag("table", *parts, tag("tbody", *body), class_=kind or None), class_="scroll")


def left(*children: Child) -> Html:
    """A cell of words."""
    return tag("td", *children, class_="left")


def _cell(child: Child) -> Html:
    return child if isinstance(child, Html) and child.startswith("<td") else tag("td", child)


def bar(share: float, kind: str = "") -> Html:
    """A bar of that share, 0 to 1, of its cell."""
    width = 100.0 * min(max(share, 0.0), 1.0)
    return tag("span", tag("i", style=f"width:{width:.2f}%"), class_=f"bar {kind}".strip())


def listing(items: Iterable[Child], kind: str = "") -> Html:
    """Items of a list; nothing without any."""
    made = [tag("li", item) for item in items]
    return tag("ul", *made, class_=kind or None) if made else Html("")
