"""Expressions that a law becomes when it is called with symbols in place of numbers.

An `Expression` takes part in arithmetic, comparisons and the NumPy functions that laws are written with; each operation
makes a node, equal nodes are one. What a law does at an `if` is found by following both ways (`ways.merged`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from contextvars import ContextVar
from typing import TYPE_CHECKING, Any

import numpy as np

#: Operations of one number that targets have by themselves or spell out.
FUNCTIONS: dict[str, Callable[[float], Any]] = {
    "exp": math.exp,
    "expm1": math.expm1,
    "log": math.log,
    "log1p": math.log1p,
    "sin": math.sin,
    "cos": math.cos,
    "tan": math.tan,
    "sinh": math.sinh,
    "cosh": math.cosh,
    "tanh": math.tanh,
    "atan": math.atan,
    "sqrt": math.sqrt,
    "abs": abs,
}
_ARITHMETIC: dict[str, Callable[[float, float], Any]] = {
    "+": lambda a, b: a + b,
    "-": lambda a, b: a - b,
    "*": lambda a, b: a * b,
    "/": lambda a, b: a / b,
    "pow": lambda a, b: a**b,
    "atan2": math.atan2,
    "<": lambda a, b: a < b,
    "<=": lambda a, b: a <= b,
    "==": lambda a, b: a == b,
}

#: What stands for the functions of NumPy, by their names: `numpy_names` says.
UFUNCS: dict[str, Callable[..., Any]] = {}
NUMPY: dict[str, Callable[..., Any]] = {}

#: Node by what it is: equal nodes are one object.
_NODES: dict[tuple[Any, ...], Expression] = {}
#: Truth of the conditions that hold on the way that is being followed.
WAY: ContextVar[dict[Expression, bool]] = ContextVar("way")


class Refused(Exception):  # noqa: N818 (not an error: that law is not exported)
    """A law that cannot be written as an expression, and why."""


class Undecided(BaseException):
    """An `if` on a symbol, whose ways `ways.merged` follows both."""

    def __init__(self, condition: Expression) -> None:
        self.condition = condition


class Expression:
    """A node: an operation (`op`) on nodes and, for "number" and "symbol", a float or a name."""

    __slots__ = ("args", "op")
    op: str
    args: tuple[Any, ...]

    if TYPE_CHECKING:  # `_operators` defines them

        def __add__(self, other: Any) -> Expression: ...
        def __sub__(self, other: Any) -> Expression: ...
        def __mul__(self, other: Any) -> Expression: ...
        def __truediv__(self, other: Any) -> Expression: ...
        def __radd__(self, other: Any) -> Expression: ...
        def __rsub__(self, other: Any) -> Expression: ...
        def __rmul__(self, other: Any) -> Expression: ...
        def __rtruediv__(self, other: Any) -> Expression: ...
        def __lt__(self, other: Any) -> Expression: ...
        def __le__(self, other: Any) -> Expression: ...

    def __bool__(self) -> bool:
        if self.op == "number":
            return bool(self.args[0])
        condition = self if self.op in CONDITIONS else negation(make("==", self, number(0.0)))
        if condition.op == "not":
            return not bool(condition.args[0])
        found = known_on(condition, WAY.get({}))
        if found is None:
            raise Undecided(condition)
        return found

    def __float__(self) -> float:
        if self.op == "number":
            return float(self.args[0])
        raise Refused("its law turns a value into a float; it must be written with NumPy functions only")

    def __index__(self) -> int:
        raise Refused("its law looks something up by a number that is computed")

    __ceil__ = __round__ = __int__ = __iter__ = __index__
    __hash__ = object.__hash__

    def __abs__(self) -> Expression:
        return make("abs", self)

    def __neg__(self) -> Expression:
        return make("neg", self)

    def __pos__(self) -> Expression:
        return self

    def __array_ufunc__(self, ufunc: Any, method: str, *inputs: Any, **options: Any) -> Any:
        if method != "__call__" or options or ufunc.__name__ not in UFUNCS:
            raise Refused(f"its law uses numpy.{ufunc.__name__}, which no target has")
        return UFUNCS[ufunc.__name__](*inputs)

    def __array_function__(self, function: Any, types: Any, args: Any, options: Any) -> Any:
        if function.__name__ not in NUMPY:
            raise Refused(f"its law uses numpy.{function.__name__}, which no target has")
        return NUMPY[function.__name__](*args, **options)

    def __array__(self, *_: Any, **__: Any) -> Any:
        raise Refused("its law makes an array of a value; it must be written with NumPy functions of numbers")


def _operators() -> None:
    """`a + b`, `2.0 * a`, `a < b`, ... as nodes."""

    def binary(op: str, swap: bool) -> Any:
        def method(self: Expression, other: Any) -> Any:
            if isinstance(other, np.ndarray) and other.ndim:
                raise Refused("its law mixes a value with an array")
            return make(op, *((other, self) if swap else (self, other)))

        return method

    names = {"add": "+", "sub": "-", "mul": "*", "truediv": "/", "pow": "pow"}
    for name, op in names.items():
        setattr(Expression, f"__{name}__", binary(op, False))
        setattr(Expression, f"__r{name}__", binary(op, True))
    for name, (op, swap) in {"lt": ("<", False), "le": ("<=", False), "gt": ("<", True), "ge": ("<=", True)}.items():
        setattr(Expression, f"__{name}__", binary(op, swap))
    setattr(Expression, "__eq__", binary("==", False))  # noqa: B010 (a plain definition would ask for a bool)
    setattr(Expression, "__ne__", lambda self, other: negation(make("==", self, other)))  # noqa: B010
    setattr(Expression, "__and__", lambda self, other: where(self, other, False))  # noqa: B010
    setattr(Expression, "__or__", lambda self, other: where(self, True, other))  # noqa: B010
    setattr(Expression, "__invert__", lambda self: negation(self))  # noqa: B010


CONDITIONS = ("<", "<=", "==", "not")


def node(op: str, args: tuple[Any, ...]) -> Expression:
    key = (op, *(id(a) if isinstance(a, Expression) else repr(a) for a in args))
    found = _NODES.get(key)
    if found is None:
        found = _NODES[key] = Expression()
        found.op, found.args = op, args
    return found


def number(value: Any) -> Expression:
    """A value as a node; one that is a node already stays."""
    return value if isinstance(value, Expression) else node("number", (float(value),))


def _value(x: Any) -> Expression:
    """As `number`; a condition is 1 where it holds, else 0."""
    found = number(x)
    return node("where", (found, number(1.0), number(0.0))) if found.op in CONDITIONS else found


def symbol(name: str, positive: bool = False) -> Expression:
    """What has a value only when the exported model runs; `positive`: it is known to be above 0."""
    return node("symbol", (name, positive))


def symbols(roots: Iterable[Expression]) -> set[str]:
    """Names of all symbols that are asked for."""
    found, stack, seen = set(), list(roots), set()
    while stack:
        one = stack.pop()
        if one not in seen:
            seen.add(one)
            found |= {one.args[0]} if one.op == "symbol" else set()
            stack += [a for a in one.args if isinstance(a, Expression)]
    return found


def _positive(x: Expression) -> bool:
    return x.op == "symbol" and bool(x.args[1])


def make(op: str, *values: Any) -> Expression:
    """The node of that operation; what is known now is computed now."""
    args = tuple(_value(v) for v in values)
    known = [a.args[0] for a in args if a.op == "number"]
    if len(known) == len(args):
        with np.errstate(all="ignore"):
            return number(_computed(op, known))
    simple = _simplified(op, args)
    return simple if simple is not None else node(op, args)


def _computed(op: str, known: list[float]) -> float:
    if op == "neg":
        return -known[0]
    if op in FUNCTIONS:
        return float(FUNCTIONS[op](known[0]))
    if op == "/" and known[1] == 0.0:
        return math.nan if known[0] == 0.0 else math.copysign(math.inf, known[0])
    return float(_ARITHMETIC[op](known[0], known[1]))


def _simplified(op: str, args: tuple[Expression, ...]) -> Expression | None:
    """x + 0, x * 1, x * 0, x / 1, x < x and the like."""
    a, b = args if len(args) == 2 else (args[0], args[0])
    left = a.args[0] if a.op == "number" else None
    right = b.args[0] if b.op == "number" and len(args) == 2 else None
    match op:
        case "+":
            return b if left == 0.0 else a if right == 0.0 else None
        case "-":
            return a if right == 0.0 else make("neg", b) if left == 0.0 else None
        case "*" if left == 0.0 or right == 0.0:
            return number(0.0)
        case "*":
            return b if left == 1.0 else a if right == 1.0 else None
        case "/":
            return number(0.0) if left == 0.0 else a if right == 1.0 else None
        case "pow" if right == 2.0:
            return make("*", a, a)
        case "neg" if a.op == "neg":
            inner: Expression = a.args[0]
            return inner
        case "==" if right == 0.0 and a.op == "where" and a.args[1] is number(1.0) and a.args[2] is number(0.0):
            return negation(a.args[0])
        case "<" if a is b or (right == 0.0 and _positive(a)):
            return number(0.0)
        case "<" | "<=" if left == 0.0 and _positive(b):
            return number(1.0)
        case "<=" if right == 0.0 and _positive(a):
            return number(0.0)
        case "==" if (right == 0.0 and _positive(a)) or (left == 0.0 and _positive(b)):
            return number(0.0)
        case "<=" | "==" if a is b:
            return number(1.0)
    return None


def negation(condition: Any) -> Expression:
    """Not that."""
    condition = number(condition)
    if condition.op == "number":
        return number(not condition.args[0])
    return condition.args[0] if condition.op == "not" else node("not", (condition,))


def where(condition: Any, yes: Any, no: Any) -> Expression:
    """`yes` where the condition holds (is not 0), else `no`."""
    condition, yes, no = number(condition), _value(yes), _value(no)
    if condition.op == "number":
        return yes if condition.args[0] else no
    if yes is no:
        return yes
    if condition.op not in CONDITIONS:
        condition = negation(make("==", condition, 0.0))
    if condition.op == "not":
        return where(condition.args[0], no, yes)
    return node("where", (condition, yes, no))


def known_on(condition: Expression, way: dict[Expression, bool]) -> bool | None:
    """Whether it holds where these do, by itself or by what holds of the same two numbers; NaN is left aside."""
    if condition in way or not way or condition.op == "not":
        return way.get(condition)
    a, b = condition.args
    less, more, same = (make("<", a, b), make("<", b, a), make("==", a, b))
    below, above = make("<=", a, b), make("<=", b, a)
    order = None
    if way.get(less) or way.get(above) is False:
        order = -1
    elif way.get(more) or way.get(below) is False:
        order = 1
    elif way.get(same) or way.get(make("==", b, a)) or (way.get(below) and way.get(above)):
        order = 0
    order = 0 if order is None and (way.get(less), way.get(more)) == (False, False) else order
    if order is not None:
        return {"<": order < 0, "<=": order <= 0, "==": order == 0}[condition.op]
    if condition.op == "==" and make("==", b, a) in way:
        return way[make("==", b, a)]
    return None


_operators()
