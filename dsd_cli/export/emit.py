"""Expressions as statements of a language: what is asked for again has a name, `where` is an `if`, a loop a loop."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field

from dsd_cli.export.base import number as digits
from dsd_cli.export.expression import CONDITIONS, Expression, known_on, node, symbols
from dsd_cli.export.needs import Needs
from dsd_cli.export.ways import rebuilt

#: A text longer than this gets a name of its own.
_LONGEST = 90


@dataclass(frozen=True)
class Syntax:
    """How a language writes what an expression needs.

    assign : `{name}` and `{value}`. declare : as `assign` for a name that is new; "" where names are declared apart.
    blank : a name that is new and has no value yet; "" where there is no need. if_, else_, end : an `if`; for_ (`{i}`,
    `{count}`, `{last}`) and end_for a loop that counts from 0. call : function of one number -> its name, or a rule of
    its own on the text. infix : + - * / < <= == by others. negate : not a condition. power, atan2 : of two numbers.
    carried : as `declare` for a name that a loop changes. ternary : a choice between words, where there is one.
    spelt : functions that the language lacks, by others.
    """

    assign: str
    declare: str
    blank: str
    if_: str
    else_: str
    end: str
    for_: str
    end_for: str
    call: dict[str, str]
    infix: dict[str, str] = field(default_factory=dict)
    negate: str = "(!{0})"
    power: str = "pow({0}, {1})"
    atan2: str = "atan2({0}, {1})"
    digits: Callable[[float], str] = digits
    index: str = "(double){0}"
    spelt: dict[str, Callable[..., Expression]] = field(default_factory=dict)
    carried: str = ""
    ternary: str = ""


@dataclass
class Text:
    """Statements, and the names that they use: reals and counters."""

    lines: list[str]
    reals: list[str]
    counters: list[str]


def statements(outputs: dict[str, Expression], syntax: Syntax, names: dict[str, str], indent: int = 1) -> Text:
    """Statements that give each output a value.

    Parameters
    ----------
    outputs : target text -> expression; all are computed before the first is assigned, so that they may be inputs, too.
    names : symbol -> its text in the language; others stand by themselves.
    """
    writer = _Writer(syntax, names, Counter())
    spelt = {target: writer.spell(e) for target, e in outputs.items()}
    writer.count(spelt.values())
    scope = _Scope(indent, {}, {}, tuple(spelt.values()))
    values = [(target, writer.text(e, scope)) for target, e in spelt.items()]
    asked = symbols(outputs.values())
    for i, (target, value) in enumerate(values):  # an output that is an input still asked for is kept apart first
        if any(names.get(s, s) == t for t, _ in values[:i] for s in asked):
            values[i] = (target, writer.named(value, scope))
    for target, value in values:
        if target != value:
            writer.line(syntax.assign.format(name=target, value=value), scope)
    return Text(scope.lines, writer.reals, writer.counters)


@dataclass
class _Scope:
    """Statements of one branch, what has a name in it or around it, and what it is to give."""

    indent: int
    known: dict[Expression, str]
    way: dict[Expression, bool]
    wanted: tuple[Expression, ...]
    lines: list[str] = field(default_factory=list)

    def inner(self, wanted: tuple[Expression, ...], condition: Expression | None = None, holds: bool = True) -> _Scope:
        way = self.way if condition is None else {**self.way, condition: holds}
        return _Scope(self.indent + 1, dict(self.known), way, wanted)


@dataclass
class _Writer:
    syntax: Syntax
    names: dict[str, str]
    uses: Counter[Expression]
    reals: list[str] = field(default_factory=list)
    counters: list[str] = field(default_factory=list)
    spelled: dict[Expression, Expression] = field(default_factory=dict)
    needs: Needs = field(default_factory=Needs)

    def spell(self, e: Expression) -> Expression:
        """With functions that the language lacks spelt out."""
        if e not in self.spelled:
            args = tuple(self.spell(a) if isinstance(a, Expression) else a for a in e.args)
            if e.op in self.syntax.spelt:
                found = self.spell(self.syntax.spelt[e.op](*args))
            elif args == () or all(a is b for a, b in zip(args, e.args, strict=True)):
                found = e
            else:
                found = rebuilt(e.op, args)
            self.spelled[e] = found
        return self.spelled[e]

    def count(self, roots: Iterable[Expression]) -> None:
        """How often each node is an argument."""
        seen: set[Expression] = set()
        stack = list(roots)
        while stack:
            e = stack.pop()
            self.uses[e] += 1
            if e not in seen:
                seen.add(e)
                stack += [a for a in e.args if isinstance(a, Expression)]

    def line(self, text: str, scope: _Scope) -> None:
        scope.lines += ["    " * scope.indent + part for part in text.split("\n")]

    def fresh(self) -> str:
        self.reals.append(f"x{len(self.reals) + 1}")
        return self.reals[-1]

    def named(self, value: str, scope: _Scope, how: str = "") -> str:
        """A name for a text."""
        name = self.fresh()
        self.line((how or self.syntax.declare or self.syntax.assign).format(name=name, value=value), scope)
        return name

    def text(self, e: Expression, scope: _Scope) -> str:
        """The expression where the scope is now; statements before it are in the scope."""
        if e.op == "number":
            return self.syntax.digits(e.args[0])
        if e in scope.known:
            return scope.known[e]
        if e.op == "symbol":
            return self.names.get(e.args[0], e.args[0])
        if e.op == "where":
            return self.choice(e, scope)
        if e.op == "part":
            self.loop(e.args[0], scope)
            return scope.known[e]
        return self.shared(e, self.operation(e, [self.text(a, scope) for a in e.args]), scope)

    def shared(self, e: Expression, found: str, scope: _Scope) -> str:
        """A text that is long or asked for again gets a name; a condition never does."""
        if e.op in CONDITIONS or (self.uses[e] < 2 and len(found) < _LONGEST):
            return found
        scope.known[e] = self.named(found, scope)
        return scope.known[e]

    def operation(self, e: Expression, args: list[str]) -> str:
        syntax = self.syntax
        if e.op in syntax.call:
            return syntax.call[e.op].format(*args)
        match e.op:
            case "neg":
                return f"(-{args[0]})"
            case "not":
                return syntax.negate.format(*args)
            case "pow":
                return syntax.power.format(*args)
            case "atan2":
                return syntax.atan2.format(*args)
        return f"({args[0]} {syntax.infix.get(e.op, e.op)} {args[1]})"

    def choice(self, e: Expression, scope: _Scope) -> str:
        asked, yes, no = e.args
        decided = known_on(asked, scope.way)
        if decided is not None:
            return self.text(yes if decided else no, scope)
        if self.syntax.ternary and self.simple(yes, scope) and self.simple(no, scope):
            parts = [self.text(part, scope) for part in e.args]
            return self.shared(e, self.syntax.ternary.format(*parts), scope)
        condition = self.text(asked, scope)
        together = self.alike(e, scope)
        branches = [tuple(x.args[k] for x in together) for k in (1, 2)]
        for x in self.needs.ahead(branches[0], branches[1], self.sure(scope)):
            if x.op == "part" or (self.uses[x] > 1 and x.op not in (*CONDITIONS, "loop", "number", "symbol")):
                self.text(x, scope)
        names = [self.fresh() for _ in together]
        for name in names if self.syntax.blank else ():
            self.line(self.syntax.blank.format(name=name), scope)
        openings = (self.syntax.if_.format(condition), self.syntax.else_)
        for opening, values, holds in zip(openings, branches, (True, False), strict=True):
            branch = scope.inner(values, asked, holds)
            for name, value in zip(names, values, strict=True):
                self.line(self.syntax.assign.format(name=name, value=self.text(value, branch)), branch)
            self.line(opening, scope)
            scope.lines += branch.lines
        if self.syntax.end:
            self.line(self.syntax.end, scope)
        scope.known |= dict(zip(together, names, strict=True))
        return scope.known[e]

    def alike(self, e: Expression, scope: _Scope) -> tuple[Expression, ...]:
        """This choice, and others by the same condition that the scope is sure to need and of which none is within
        another: they go into the same `if`.
        """
        found = [e]
        for x in self.sure(scope):
            if x.op == "where" and x.args[0] is e.args[0] and x not in scope.known:
                apart = (not self.needs.within(x, y) and not self.needs.within(y, x) for y in found)
                found += [x] if all(apart) else []
        return tuple(found)

    def sure(self, scope: _Scope) -> dict[Expression, None]:
        """What the scope is sure to need."""
        return self.needs.certain(self.decided(x, scope) for x in scope.wanted)

    def decided(self, e: Expression, scope: _Scope) -> Expression:
        """What it is where the conditions of the scope hold."""
        while e.op == "where" and (holds := known_on(e.args[0], scope.way)) is not None:
            e = e.args[1 if holds else 2]
        return e

    def simple(self, e: Expression, scope: _Scope) -> bool:
        """Whether it is a word or two in an expression, and harmless where it is not asked for."""
        if e.op in ("number", "symbol") or e in scope.known:
            return True
        return e.op in ("neg", "where", *CONDITIONS) and all(self.simple(a, scope) for a in e.args)

    def loop(self, e: Expression, scope: _Scope) -> None:
        """All values of the loop get their names."""
        count, index, *others = e.args
        third = len(others) // 3
        held, begin, following = others[:third], others[third : 2 * third], others[2 * third :]
        names = [self.named(self.text(b, scope), scope, self.syntax.carried) for b in begin]
        counter = f"i{len(self.counters) + 1}"
        self.counters.append(counter)
        times = int(count.args[0])
        self.line(self.syntax.for_.format(i=counter, count=times, last=times - 1), scope)
        body = scope.inner(tuple(following))
        body.known |= {index: self.syntax.index.format(counter), **dict(zip(held, names, strict=True))}
        values = [self.text(f, body) for f in following]
        kept = [self.named(value, body) for value in values]  # all of them before the first is overwritten
        for name, value in zip(names, kept, strict=True):
            self.line(self.syntax.assign.format(name=name, value=value), body)
        scope.lines += body.lines
        if self.syntax.end_for:
            self.line(self.syntax.end_for, scope)
        for k, name in enumerate(names):
            scope.known[node("part", (e, k))] = name
