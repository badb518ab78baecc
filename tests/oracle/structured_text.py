"""IEC 61131-3 structured text, as far as function blocks of reals need it, with its types: nothing is converted
unasked, names mean the same in any case, an index out of its array is an error. As the standard has it, edition 3.
"""

import math
import re
from collections.abc import Callable
from typing import Any

from tests.oracle.infix import Grammar, Text, Tokens, arguments, expression

_PATTERN = r"\d+\.\d+(?:E-?\d+)?|\d+(?!\w)|[A-Za-z_]\w*|:=|<=|>=|<>|\.\.|[-+*/()\[\]:;,<>=]"
_FUNCTIONS = {name: f"math.{name.lower()}" for name in ("SIN", "COS", "TAN", "ATAN", "EXP", "SQRT")}
_FUNCTIONS |= {"LN": "math.log", "ABS": "abs"}
_BINARY = {
    "OR": 0,
    "XOR": 1,
    "AND": 2,
    "=": 3,
    "<>": 3,
    "<": 4,
    ">": 4,
    "<=": 4,
    ">=": 4,
    "+": 5,
    "-": 5,
    "*": 6,
    "/": 6,
}
_PYTHON = {"OR": "or", "AND": "and", "=": "==", "<>": "!="}
_BEGIN = {"LREAL": 0.0, "DINT": 0, "BOOL": False}


def blocks(text: str) -> dict[str, Callable[[], "Block"]]:
    """Name of each function block of a file -> what makes an instance."""
    code = re.sub(r"\(\*.*?\*\)", " ", text, flags=re.S)
    tokens, found = Tokens(code, _PATTERN), {}
    while tokens.next:
        reader = _Reader(tokens)
        name = reader.block()
        found[name] = lambda reader=reader: Block(reader)
    return found


class Block:
    """An instance: a call sets inputs, runs the body once and gives the outputs."""

    def __init__(self, reader: "_Reader") -> None:
        self._reader = reader
        self._values = {name: _fresh(kind) for name, kind in reader.kinds.items()} | reader.begins
        self._code = compile("\n".join(["if True:", *reader.lines]), "structured text", "exec")

    def __call__(self, **inputs: float) -> tuple[float, ...]:
        assert set(inputs) == set(self._reader.inputs), self._reader.inputs
        self._values.update(inputs)
        exec(self._code, {"math": math, "at": _at, "select": _select, "s": self._values})
        return tuple(self._values[name] for name in self._reader.outputs)


def _fresh(kind: str) -> Any:
    size, _, of = kind.rpartition(" ")
    return [_BEGIN[of]] * int(size) if size else _BEGIN[of]


def _at(values: list, index: int) -> int:
    assert 0 <= index < len(values), "out of the array"
    return index


def _select(which: bool, first: float, second: float) -> float:
    """Both are computed, whichever it is."""
    return second if which else first


class _Reader:
    """One function block: its names with their types, and its body as lines of Python over the dictionary `s`."""

    def __init__(self, tokens: Tokens) -> None:
        self.tokens = tokens
        self.kinds: dict[str, str] = {}
        self.begins: dict[str, Any] = {}
        self.inputs: list[str] = []
        self.outputs: list[str] = []
        self.lines: list[str] = []
        self.grammar = Grammar(_BINARY, {"-": 7, "NOT": 7}, self.word, _combined)

    def block(self) -> str:
        self.tokens.take("FUNCTION_BLOCK")
        name = self.tokens.take()
        while self.tokens.next.startswith("VAR"):
            section = self.tokens.take()
            while not self.tokens.took("END_VAR"):
                names = self.declaration()
                self.inputs += names if section == "VAR_INPUT" else []
                self.outputs += names if section == "VAR_OUTPUT" else []
        self.body("END_FUNCTION_BLOCK", indent=1)
        self.tokens.take("END_FUNCTION_BLOCK")
        return name

    def declaration(self) -> list[str]:
        names = [self.tokens.take()]
        while self.tokens.took(","):
            names.append(self.tokens.take())
        self.tokens.take(":")
        kind = self.tokens.take()
        if kind == "ARRAY":
            self.tokens.take("[")
            assert self.tokens.take() == "0"
            self.tokens.take("..")
            size = int(self.tokens.take()) + 1
            self.tokens.take("]")
            self.tokens.take("OF")
            kind = f"{size} {self.tokens.take()}"
        if self.tokens.took(":="):
            self.begins |= dict.fromkeys(names, {"TRUE": True, "FALSE": False}[self.tokens.take()])
        self.tokens.take(";")
        for name in names:
            assert name.lower() not in {known.lower() for known in self.kinds}, f"{name} is declared twice"
            self.kinds[name] = kind
        return names

    def body(self, *ends: str, indent: int) -> None:
        """Statements up to one of these words."""
        before = len(self.lines)
        while self.tokens.next not in ends:
            self.statement(indent)
        if len(self.lines) == before:
            self.line("pass", indent)

    def line(self, text: str, indent: int) -> None:
        self.lines.append("    " * indent + text)

    def statement(self, indent: int) -> None:
        if self.tokens.took("IF"):
            self.line(f"if {self.typed('BOOL')}:", indent)
            self.tokens.take("THEN")
            self.body("ELSE", "END_IF", indent=indent + 1)
            if self.tokens.took("ELSE"):
                self.line("else:", indent)
                self.body("END_IF", indent=indent + 1)
            self.tokens.take("END_IF")
        elif self.tokens.took("FOR"):
            counter = self.target()
            assert counter.kind == "DINT"
            self.tokens.take(":=")
            first = self.typed("DINT")
            self.tokens.take("TO")
            self.line(f"for {counter.source} in range({first}, {self.typed('DINT')} + 1):", indent)
            self.tokens.take("DO")
            self.body("END_FOR", indent=indent + 1)
            self.tokens.take("END_FOR")
        else:
            target = self.target()
            self.tokens.take(":=")
            self.line(f"{target.source} = {self.typed(target.kind)}", indent)
        self.tokens.take(";")

    def typed(self, kind: str) -> str:
        found = expression(self.tokens, self.grammar)
        assert found.kind == kind, f"{found.source} is {found.kind}, {kind} is wanted"
        return found.source

    def target(self) -> Text:
        name = self.tokens.take()
        assert name in self.kinds, f"{name} is not declared"
        kind = self.kinds[name]
        if not self.tokens.took("["):
            return Text(f"s[{name!r}]", kind)
        index = self.typed("DINT")
        self.tokens.take("]")
        return Text(f"s[{name!r}][at(s[{name!r}], {index})]", kind.split()[1])

    def word(self, tokens: Tokens) -> Text:
        if tokens.next[0].isdigit():
            number = tokens.take()
            return Text(number, "LREAL" if "." in number else "DINT")
        if tokens.next in ("TRUE", "FALSE"):
            return Text(tokens.take().capitalize(), "BOOL")
        if tokens.next in self.kinds:
            return self.target()
        name = tokens.take()
        tokens.take("(")
        return _called(name, arguments(tokens, self.grammar))


def _called(name: str, given: list[Text]) -> Text:
    kinds = [one.kind for one in given]
    if name == "SEL":
        assert kinds == ["BOOL", "LREAL", "LREAL"], kinds
        return Text(f"select({', '.join(one.source for one in given)})", "LREAL")
    if name == "DINT_TO_LREAL":
        assert kinds == ["DINT"]
        return Text(f"float({given[0].source})", "LREAL")
    if name == "EXPT":
        assert kinds == ["LREAL", "LREAL"]
        return Text(f"({given[0].source} ** {given[1].source})", "LREAL")
    assert kinds == ["LREAL"], (name, kinds)
    return Text(f"{_FUNCTIONS[name]}({given[0].source})", "LREAL")


def _combined(operator: str, given: tuple[Text, ...]) -> Text:
    kinds = {one.kind for one in given}
    assert len(kinds) == 1, f"{operator} of {kinds}"
    (kind,) = kinds
    if len(given) == 1:
        assert kind == "BOOL" if operator == "NOT" else kind != "BOOL"
        return Text(f"({'not ' if operator == 'NOT' else '-'}{given[0].source})", kind)
    source = f"({given[0].source} {_PYTHON.get(operator, operator)} {given[1].source})"
    if operator in ("AND", "OR"):
        assert kind == "BOOL"
        return Text(source, "BOOL")
    assert kind != "BOOL"
    return Text(source, kind if operator in "+-*/" else "BOOL")
