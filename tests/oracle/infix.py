"""Tokens and expressions of languages with infix operators, made into Python: what interpreters of tests share."""

import re
from collections.abc import Callable, Mapping
from typing import NamedTuple


class Text(NamedTuple):
    """Python source and the type of its value."""

    source: str
    kind: str


class Tokens:
    """The tokens of a text; what is neither a token nor blank is an error."""

    def __init__(self, text: str, pattern: str) -> None:
        self.at, self.all = 0, []
        end = 0
        for found in re.finditer(pattern, text):
            assert not text[end : found.start()].strip(), f"no token: {text[end : found.start()]!r}"
            self.all.append(found.group())
            end = found.end()
        assert not text[end:].strip(), f"no token: {text[end:]!r}"

    @property
    def next(self) -> str:
        return self.all[self.at] if self.at < len(self.all) else ""

    def take(self, wanted: str = "") -> str:
        found = self.next
        assert found, "the text ends"
        assert not wanted or found == wanted, f"{wanted!r} is wanted, {found!r} stands there"
        self.at += 1
        return found

    def took(self, wanted: str) -> bool:
        """Whether it stands there, which is then taken."""
        if self.next != wanted:
            return False
        self.at += 1
        return True


class Grammar(NamedTuple):
    """binary, unary : operator -> how tightly it binds. word : what a number, a name or a call is.

    combine : (operator, operands) -> what they make together.
    """

    binary: Mapping[str, int]
    unary: Mapping[str, int]
    word: Callable[[Tokens], Text]
    combine: Callable[[str, tuple[Text, ...]], Text]


def expression(tokens: Tokens, grammar: Grammar, least: int = 0) -> Text:
    """By precedence climbing; operators of one level group from the left."""
    if tokens.next in grammar.unary:
        operator = tokens.take()
        left = grammar.combine(operator, (expression(tokens, grammar, grammar.unary[operator]),))
    elif tokens.took("("):
        left = expression(tokens, grammar)
        tokens.take(")")
    else:
        left = grammar.word(tokens)
    while (level := grammar.binary.get(tokens.next, -1)) >= least:
        operator = tokens.take()
        left = grammar.combine(operator, (left, expression(tokens, grammar, level + 1)))
    return left


def arguments(tokens: Tokens, grammar: Grammar) -> list[Text]:
    """In parentheses, of which the first is taken."""
    found = [expression(tokens, grammar)]
    while tokens.took(","):
        found.append(expression(tokens, grammar))
    tokens.take(")")
    return found
