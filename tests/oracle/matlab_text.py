"""Functions of MATLAB, as far as the state equation of a discrete-time idnlgrey model needs it: columns of numbers,
which count from 1 and are copied where they are assigned, `if`, `for`, arithmetic.
"""

import math
from typing import Any

from tests.oracle.infix import Grammar, Text, Tokens, arguments, expression

_PATTERN = r"\d+\.?\d*(?:e[-+]?\d+)?|[A-Za-z]\w*|==|~=|<=|>=|&&|\|\||[-+*/^()\[\]=;:,<>~\n]"
_FUNCTIONS = ("exp", "expm1", "log", "log1p", "sin", "cos", "tan", "sinh", "cosh", "tanh", "atan", "atan2", "sqrt")
_BINARY = {"||": 0, "&&": 1, "==": 3, "~=": 3, "<": 3, "<=": 3, ">": 3, ">=": 3, "+": 4, "-": 4, "*": 5, "/": 5, "^": 7}
_PYTHON = {"||": "or", "&&": "and", "~=": "!=", "^": "**"}


class StateEquation:
    """`[dx, y] = name(t, x, u)` of one file; called with x and u it gives both."""

    def __init__(self, text: str) -> None:
        head, _, body = text.partition("\n")
        outputs, _, self.name = head.removeprefix("function [").partition("(")[0].partition("] = ")
        assert outputs == "dx, y"
        code = "\n".join(line.partition("%")[0] for line in body.splitlines())
        self._tokens = Tokens(code, _PATTERN)
        self._columns = {"x", "z"}
        self._grammar = Grammar(_BINARY, {"-": 6, "~": 6}, self._word, _combined)
        self._lines = ["def step(x, u):", *self._body(1), "    return dx, y"]
        known: dict[str, Any] = {"math": math}
        exec("\n".join(self._lines), known)
        self._step = known["step"]

    def __call__(self, x: list[float], u: float) -> tuple[list[float], list[float]]:
        return self._step(x, u)

    def _body(self, indent: int) -> list[str]:
        """Statements up to `else` or `end`, which is left; the function's own `end` closes the file."""
        lines: list[str] = []
        while True:
            while self._tokens.next in ("\n", ";"):
                self._tokens.take()
            if self._tokens.next in ("else", "end"):
                return lines or ["    " * indent + "pass"]
            lines += ["    " * indent + line for line in self._statement()]

    def _statement(self) -> list[str]:
        if self._tokens.took("if"):
            lines = [f"if {self._value()}:", *self._body(1)]
            if self._tokens.took("else"):
                lines += ["else:", *self._body(1)]
            self._tokens.take("end")
            return lines
        if self._tokens.took("for"):
            counter = self._tokens.take()
            self._tokens.take("=")
            first = self._value()
            self._tokens.take(":")
            lines = [f"for {counter} in range({first}, {self._value()} + 1):", *self._body(1)]
            self._tokens.take("end")
            return lines
        name = self._tokens.take()
        where = ""
        if self._tokens.took("("):
            where = f"[{self._index(name)}]"
            self._tokens.take(")")
        self._tokens.take("=")
        value = self._value()
        return [f"{name}{where} = {f'list({value})' if value in self._columns else value}"]

    def _value(self) -> str:
        if not self._tokens.took("["):
            return expression(self._tokens, self._grammar).source
        parts = [expression(self._tokens, self._grammar).source]
        while self._tokens.took(";"):
            parts.append(expression(self._tokens, self._grammar).source)
        self._tokens.take("]")
        return f"[{', '.join(parts)}]"

    def _index(self, name: str) -> str:
        assert name in self._columns, name
        found = expression(self._tokens, self._grammar).source
        return f"range(len({name}))[{found} - 1 if {found} > 0 else len({name})]"

    def _word(self, tokens: Tokens) -> Text:
        name = tokens.take()
        if name[0].isdigit() or not tokens.took("("):
            assert name[0].isalnum(), name
            return Text(name, "")
        if name in self._columns:
            index = self._index(name)
            tokens.take(")")
            return Text(f"{name}[{index}]", "")
        assert name == "abs" or name in _FUNCTIONS, name
        given = ", ".join(one.source for one in arguments(tokens, self._grammar))
        return Text(f"abs({given})" if name == "abs" else f"math.{name}({given})", "")


def _combined(operator: str, given: tuple[Text, ...]) -> Text:
    if len(given) == 1:
        return Text(f"({'not ' if operator == '~' else '-'}{given[0].source})", "")
    return Text(f"({given[0].source} {_PYTHON.get(operator, operator)} {given[1].source})", "")
