"""TOML text as statements with their places, so that one value can be changed and every other byte stays.

Only for text that `tomllib` has read without complaint: nothing is checked a second time.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping
from typing import Any, NamedTuple

Path = tuple[str, ...]

_PART = r"""(?:[A-Za-z0-9_-]+|"(?:[^"\\\n]|\\.)*"|'[^'\n]*')"""
_KEY = rf"{_PART}(?:[ \t]*\.[ \t]*{_PART})*"
_HEADER = re.compile(rf"[ \t]*(\[\[?)[ \t]*({_KEY})[ \t]*\]\]?")
_ASSIGNMENT = re.compile(rf"[ \t]*({_KEY})[ \t]*=[ \t]*")
_TOKEN = re.compile(
    r'"""(?:\\.|[^\\])*?"""(?:"{0,2})'
    r"|'''.*?'''(?:'{0,2})"
    r'|"(?:\\.|[^"\\\n])*"'
    r"|'[^'\n]*'"
    r"|\#[^\n]*|.",
    re.DOTALL,
)


class Statement(NamedTuple):
    """A header, an assignment, or a line that is neither (a comment, nothing).

    Attributes
    ----------
    kind : "[" , "[[", "=", "#" or "" (blank).
    start, end : place of its lines in the text, line end included.
    path : table, or table and key.
    value : place of the value of an assignment.
    """

    kind: str
    start: int
    end: int
    path: Path = ()
    value: tuple[int, int] = (0, 0)

    def raw(self, text: str) -> str:
        """The value as it is written."""
        return text[slice(*self.value)]


def statements(text: str) -> list[Statement]:
    """All of them in order; together they cover the text."""
    found: list[Statement] = []
    at, table = 0, ()  # type: tuple[int, Path]
    while at < len(text):
        header, assignment = _HEADER.match(text, at), _ASSIGNMENT.match(text, at)
        if header:
            table = _path(header[2])
            found.append(Statement(header[1], at, _line_end(text, header.end()), table))
        elif assignment:
            value = (assignment.end(), _value_end(text, assignment.end()))
            path = (*table, *_path(assignment[1]))
            found.append(Statement("=", at, _line_end(text, value[1]), path, value))
        else:
            end = _line_end(text, at)
            found.append(Statement("#" if text[at:end].strip() else "", at, end))
        at = found[-1].end
    return found


def _path(key: str) -> Path:
    here, parts = tomllib.loads(f"{key} = 0"), []
    while isinstance(here, dict):
        ((part, here),) = here.items()
        parts.append(part)
    return tuple(parts)


def _line_end(text: str, at: int) -> int:
    return (text.find("\n", at) + 1) or len(text)


def _value_end(text: str, at: int) -> int:
    """End of the value that begins at `at`, without blanks and comment behind it."""
    depth, end = 0, at
    while at < len(text):
        token = _TOKEN.match(text, at)
        assert token is not None
        word = token[0]
        if depth == 0 and (word == "\n" or word[0] == "#"):
            break
        depth += (word in "[{") - (word in "]}")
        at = token.end()
        if not word.isspace():
            end = at
    return end


def strings(raw: str) -> list[tuple[int, int]]:
    """Places of the strings in a value, with quotation marks, quoted keys with them; comments hold none."""
    return [token.span() for token in _TOKEN.finditer(raw) if token[0][0] in "\"'"]


def leaves(table: Mapping[str, Any], above: Path = ()) -> dict[Path, Any]:
    """Path -> value of everything in a table that is no table itself."""
    found: dict[Path, Any] = {}
    for name, value in table.items():
        found |= leaves(value, (*above, name)) if isinstance(value, Mapping) else {(*above, name): value}
    return found


def inline_leaves(raw: str) -> dict[Path, str]:
    """The leaves of an inline table, each as it is written."""
    import tomlkit

    table: Any = tomlkit.value(raw)
    return {path: item.as_string() for path, item in leaves(table).items()}


def inline(raws: Mapping[Path, str]) -> str:
    """Leaves with their texts as an inline table."""
    groups: dict[str, dict[Path, str]] = {}
    for (first, *rest), raw in raws.items():
        groups.setdefault(first, {})[tuple(rest)] = raw
    items = (f"{_key(name)} = {below[()] if () in below else inline(below)}" for name, below in groups.items())
    return "{ " + ", ".join(items) + " }" if groups else "{}"


def _key(name: str) -> str:
    return name if re.fullmatch(r"[A-Za-z0-9_-]+", name) else literal(name)


def literal(value: Any) -> str:
    """A value on one line."""
    match value:
        case bool():
            return "true" if value else "false"
        case int() | float():
            return repr(value)
        case Mapping():
            return inline({(name,): literal(v) for name, v in value.items()})
        case list() | tuple():
            return "[" + ", ".join(map(literal, value)) + "]"
    import tomlkit  # late: its knowledge of what to escape in a text

    return str(tomlkit.item(value).as_string())
