"""Formulas that a file brings along: only arithmetic is computed.

The library that reads MDF files hands a formula that it cannot compute as it is to one that compiles it as Python, and
where that one is not installed it gives the raw numbers without a word. So both are kept from it.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from typing import Any

from dsd_cli.errors import DataError

NAMES = frozenset({"X", "X1", "INF", "NaN"})
#: What numexpr has of its own; anything else would go to the other library.
FUNCTIONS = frozenset(
    {"sin", "cos", "tan", "arcsin", "arccos", "arctan", "sinh", "cosh", "tanh", "arcsinh", "arccosh", "arctanh"}
    | {"log", "log10", "log1p", "exp", "expm1", "sqrt", "abs"}
)
#: Characters of a formula; the largest exponent. Beyond, working it out may take for ever.
LONGEST, HIGHEST = 1000, 64


def check_formulas(what: str, conversion: Any) -> None:
    """Refuse a conversion (asammdf's), or one that it refers to, whose formula is more than arithmetic.

    Raises
    ------
    DataError : there is such a formula.
    """
    for formula in _formulas(conversion, set()):
        if not is_arithmetic(formula):
            shown = formula if len(formula) <= 80 else f"{formula[:80]}..."
            raise DataError(
                f"{what}: its formula is not computed here: {shown}", "write the channel anew, with plain numbers"
            )


def _formulas(conversion: Any, seen: set[int]) -> Iterator[str]:
    if conversion is None or id(conversion) in seen:
        return
    seen.add(id(conversion))
    formula = getattr(conversion, "formula", "")
    if formula:
        yield formula if isinstance(formula, str) else formula.decode("latin-1")
    for referenced in (getattr(conversion, "referenced_blocks", None) or {}).values():
        if not isinstance(referenced, bytes | str):
            yield from _formulas(referenced, seen)


def is_arithmetic(formula: str) -> bool:
    """Whether it is made of X, numbers, + - * / **, brackets and the usual functions, and soon worked out."""
    if len(formula) > LONGEST:
        return False
    try:
        return _is_allowed(ast.parse(formula.strip(), mode="eval").body)
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        return False


def _is_allowed(node: ast.expr) -> bool:
    match node:
        case ast.Constant(value):
            return type(value) in (int, float)
        case ast.Name(name):
            return name in NAMES
        case ast.UnaryOp(ast.UAdd() | ast.USub(), inner):
            return _is_allowed(inner)
        case ast.BinOp(base, ast.Pow(), exponent):  # 9 ** 9 ** 9 ** 9 has no end
            return _is_allowed(base) and _has_x(base) and _is_small(exponent)
        case ast.BinOp(left, ast.Add() | ast.Sub() | ast.Mult() | ast.Div(), right):
            return _is_allowed(left) and _is_allowed(right)
        case ast.Call(ast.Name(name), arguments, []):
            return name in FUNCTIONS and len(arguments) == 1 and _is_allowed(arguments[0])
    return False


def _has_x(node: ast.expr) -> bool:
    return any(isinstance(part, ast.Name) and part.id in ("X", "X1") for part in ast.walk(node))


def _is_small(node: ast.expr) -> bool:
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.UAdd | ast.USub):
        node = node.operand
    value = node.value if isinstance(node, ast.Constant) else None
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= HIGHEST
