"""The functions of NumPy that laws may be written with, for symbols in place of numbers."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from dsd_cli.export.expression import FUNCTIONS, NUMPY, UFUNCS, Expression, make, negation, number, where


def _between(x: Any, low: Any = None, high: Any = None, **given: Any) -> Any:
    low, high = given.get("a_min", low), given.get("a_max", high)
    x = x if low is None else _larger(x, low)
    return x if high is None else _smaller(x, high)


def _larger(a: Any, b: Any) -> Any:
    return where(make("<", a, b), b, a)


def _smaller(a: Any, b: Any) -> Any:
    return where(make("<", b, a), b, a)


def _sign(x: Any) -> Any:
    return where(make("<", 0.0, x), 1.0, where(make("<", x, 0.0), -1.0, 0.0))


def _sinc(x: Any) -> Any:
    """As np.sinc has it."""
    y = make("*", math.pi, where(make("==", x, 0.0), 1e-20, x))
    return make("/", make("sin", y), y)


def _interp(x: Any, knots: Any, values: Any, *_: Any, **__: Any) -> Any:
    """As np.interp has it: halves are asked for, so that many knots are few questions."""
    k, f = [float(a) for a in knots], [float(a) for a in values]

    def segment(low: int, high: int) -> Any:
        if high - low == 1:
            slope = (f[high] - f[low]) / (k[high] - k[low])
            return slope * (x - k[low]) + f[low]
        middle = (low + high) // 2
        return where(make("<", x, k[middle]), segment(low, middle), segment(middle, high))

    if len(k) == 1:
        return number(f[0])
    inside = where(make("<=", k[-1], x), f[-1], segment(0, len(k) - 1))
    return where(make("<", x, k[0]), f[0], inside)


def _one(op: str) -> Callable[[Any], Expression]:
    return lambda x: make(op, x)


def _two(op: str) -> Callable[[Any, Any], Expression]:
    return lambda a, b: make(op, a, b)


UFUNCS |= {
    **{name: _one(name) for name in FUNCTIONS},
    "absolute": _one("abs"),
    "fabs": _one("abs"),
    "arctan": _one("atan"),
    "negative": _one("neg"),
    "positive": lambda x: x,
    "add": _two("+"),
    "subtract": _two("-"),
    "multiply": _two("*"),
    "divide": _two("/"),
    "true_divide": _two("/"),
    "power": _two("pow"),
    "float_power": _two("pow"),
    "arctan2": _two("atan2"),
    "square": lambda x: make("*", x, x),
    "reciprocal": lambda x: make("/", 1.0, x),
    "hypot": lambda a, b: make("sqrt", make("+", make("*", a, a), make("*", b, b))),
    "sign": _sign,
    "maximum": _larger,
    "minimum": _smaller,
    "fmax": _larger,
    "fmin": _smaller,
    "less": _two("<"),
    "less_equal": _two("<="),
    "greater": lambda a, b: make("<", b, a),
    "greater_equal": lambda a, b: make("<=", b, a),
    "equal": _two("=="),
    "not_equal": lambda a, b: negation(make("==", a, b)),
    "logical_and": lambda a, b: where(a, b, False),
    "logical_or": lambda a, b: where(a, True, b),
    "logical_not": negation,
    "isfinite": lambda x: number(True),
    "isnan": lambda x: number(False),
}
NUMPY |= {
    "where": where,
    "clip": _between,
    "sinc": _sinc,
    "interp": _interp,
    "any": lambda x: negation(make("==", x, 0.0)),
    "all": lambda x: negation(make("==", x, 0.0)),
    "ndim": lambda x: 0,
    "size": lambda x: 1,
    "shape": lambda x: (),
    "broadcast_to": lambda x, shape: x,
    "zeros_like": lambda x: number(0.0),
    "ones_like": lambda x: number(1.0),
}
