"""Laws with an `if` or a loop: both ways of an `if` are followed, a loop stays one."""

from __future__ import annotations

from collections.abc import Callable
from contextvars import ContextVar
from typing import Any

from dsd_cli.export.expression import (
    WAY,
    Expression,
    Refused,
    Undecided,
    make,
    negation,
    node,
    number,
    symbol,
    where,
)

#: Loops around the one that is being made; equal loops are one node, as they have equal symbols.
_DEPTH: ContextVar[int] = ContextVar("depth", default=0)


def merged(run: Callable[[], Any]) -> Any:
    """What `run` returns, with every `if` on a symbol followed both ways and its ends joined by `where`.

    `run` is called once for each way, and must do the same each time. Numbers, expressions and tuples may come back.
    """
    return _follow(run, {})


def _follow(run: Callable[[], Any], way: dict[Expression, bool]) -> Any:
    token = WAY.set(way)
    try:
        return run()
    except Undecided as asked:
        condition = asked.condition
    finally:
        WAY.reset(token)
    return join(condition, _follow(run, {**way, condition: True}), _follow(run, {**way, condition: False}))


def join(condition: Expression, yes: Any, no: Any) -> Any:
    """`where`, through tuples."""
    if isinstance(yes, tuple) and isinstance(no, tuple) and len(yes) == len(no):
        parts = [join(condition, a, b) for a, b in zip(yes, no, strict=True)]
        return type(yes)(*parts) if hasattr(yes, "_fields") else tuple(parts)
    if isinstance(yes, tuple | None) or isinstance(no, tuple | None):
        if yes is None and no is None:
            return None
        raise Refused("what its law remembers is of another kind in one case than in another")
    return where(condition, yes, no)


def repeat(count: int, body: Callable[..., tuple[Any, ...]], *start: Any) -> tuple[Expression, ...]:
    """`for i in range(count): values = body(i, *values)` as one node of which each value is a part."""
    if count == 1:
        return tuple(number(x) for x in body(0, *start))
    loop = f"loop{_DEPTH.get()}"
    index, held = symbol(f"{loop}_i"), tuple(symbol(f"{loop}_{k}") for k in range(len(start)))
    token = _DEPTH.set(_DEPTH.get() + 1)
    try:
        following = merged(lambda: tuple(number(x) for x in body(index, *held)))
    finally:
        _DEPTH.reset(token)
    begin = tuple(number(x) for x in start)
    parts = (number(count), index, *held, *begin, *following)
    whole = node("loop", parts)
    return tuple(node("part", (whole, k)) for k in range(len(start)))


def substituted(root: Expression, by: dict[Expression, Expression]) -> Expression:
    """The expression with other nodes in place of some."""
    known = dict(by)

    def of(e: Any) -> Any:
        if isinstance(e, Expression) and e not in known:
            args = tuple(of(a) for a in e.args)
            same = all(a is b for a, b in zip(args, e.args, strict=True))
            known[e] = e if same else rebuilt(e.op, args)
        return known[e] if isinstance(e, Expression) else e

    found: Expression = of(root)
    return found


def rebuilt(op: str, args: tuple[Any, ...]) -> Expression:
    """The node of that operation on other arguments, simplified where it can be."""
    if op == "where":
        return where(*args)
    return negation(args[0]) if op == "not" else node(op, args) if op in ("loop", "part") else make(op, *args)
