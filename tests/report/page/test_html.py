"""Nothing that a log or a config says becomes HTML or script."""

import html
import json
from html.parser import HTMLParser

import pytest

from dsd_cli.report.page.html import Html, data, joined, left, lines, table, tag, text

EVIL = ["<script>alert(1)</script>", "</td><img src=x onerror=alert(1)>", "[/x]", "$$", 'a" onload="x', "a' b", "&lt;",
        "\x1b]52;c;aGk=\x07", "\x00", "\u2028", "\u202egnp", "<!--", "]]>", "\ud800", "{{ 7*7 }}"]  # fmt: skip


class Seen(HTMLParser):
    """Elements, attributes and texts as a parser of its own sees them."""

    def __init__(self, source: str) -> None:
        super().__init__()
        self.elements: list[str] = []
        self.attributes: list[tuple[str, str | None]] = []
        self.text = ""
        self.feed(source)
        self.close()

    def handle_starttag(self, tag, attrs):
        self.elements.append(tag)
        self.attributes += attrs

    def handle_data(self, data):
        self.text += data

    def handle_comment(self, data):
        self.elements.append("comment")


@pytest.mark.parametrize("evil", EVIL)
def test_texts_stay_texts(evil):
    for made in (tag("p", evil), tag("p", f"{evil} and more"), tag("p", tag("b", evil), evil)):
        seen = Seen(made)
        assert set(seen.elements) <= {"p", "b"}
        assert seen.attributes == []
        made.encode()
    assert Seen(text("a < b & c")).text == "a < b & c"


@pytest.mark.parametrize("evil", EVIL)
def test_attributes_stay_attributes(evil):
    seen = Seen(tag("a", "x", title=evil, data_x=evil, class_="c"))
    assert seen.elements == ["a"]
    assert [name for name, _ in seen.attributes] == ["title", "data-x", "class"]


@pytest.mark.parametrize("evil", EVIL)
def test_cells_and_preformatted_text(evil):
    seen = Seen(table((evil, "b"), [(left(evil), evil)], "", evil))
    assert set(seen.elements) <= {"div", "table", "caption", "thead", "tbody", "tr", "th", "td"}
    assert Seen(tag("pre", lines(f"a\n\t{evil}"))).elements == ["pre"]
    assert Seen(tag("pre", lines("a = 1\n\tb = '<x>'"))).text == "a = 1\n\tb = '<x>'"


@pytest.mark.parametrize("evil", EVIL)
def test_data_ends_no_script_and_comes_back(evil):
    made = data({evil: [evil, 1.5, None]})
    assert not set("<>&\u2028\u2029\x1b\x00") & set(made)
    assert made.isascii()
    assert json.loads(made) == {evil: [evil, 1.5, None]}


def test_an_attribute_of_zero_is_there_and_one_of_none_is_not():
    assert tag("p", data_step=0, title=None, hidden=False, open=True) == '<p data-step="0" open></p>'


def test_a_nan_is_refused():
    with pytest.raises(ValueError, match="Out of range"):
        data({"x": float("nan")})


def test_a_string_is_never_taken_for_html():
    assert joined(["<b>", Html("<i>")]) == "&lt;b&gt;<i>"
    assert html.unescape(tag("p", "<b>")) == "<p><b></p>"
    assert tag("p", "<td>") == "<p>&lt;td&gt;</p>"
    assert "<tr><td>&lt;td&gt;</td></tr>" in table((), [("<td>",)])
