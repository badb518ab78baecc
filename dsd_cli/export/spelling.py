"""Functions that a language lacks, by those that it has."""

from __future__ import annotations

from dsd_cli.export.expression import Expression, make, number, where


def expm1(x: Expression) -> Expression:
    """exp(x) - 1 without loss for small x (Kahan): (w - 1) x / log w, w = exp x."""
    w = make("exp", x)
    less = w - 1.0
    small = w == 1.0
    return where(small, x, where(less == -1.0, -1.0, less * x / make("log", where(small, 2.0, w))))


def log1p(x: Expression) -> Expression:
    """log(1 + x) without loss for small x (Kahan)."""
    w = 1.0 + x
    small = w == 1.0
    return where(small, x, make("log", w) * x / where(small, 1.0, w - 1.0))


def sinh(x: Expression) -> Expression:
    """(exp(x) - exp(-x)) / 2."""
    return 0.5 * (expm1(x) - expm1(-x))


def cosh(x: Expression) -> Expression:
    """(exp(x) + exp(-x)) / 2."""
    return 0.5 * (make("exp", x) + make("exp", -x))


def tanh(x: Expression) -> Expression:
    """(1 - exp(-2 |x|)) / (1 + exp(-2 |x|)), with the sign of x."""
    less = expm1(-2.0 * abs(x))
    size = -less / (2.0 + less)
    return where(make("<", x, 0.0), -size, size)


def atan2(y: Expression, x: Expression) -> Expression:
    """By atan of one number."""
    half = make("atan", y / where(x == 0.0, 1.0, x))
    pi = number(3.141592653589793)
    left = where(make("<", y, 0.0), half - pi, half + pi)
    above = where(make("<", 0.0, y), 0.5 * pi, where(make("<", y, 0.0), -0.5 * pi, 0.0))
    return where(x == 0.0, above, where(make("<", x, 0.0), left, half))
