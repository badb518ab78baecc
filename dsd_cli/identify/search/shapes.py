"""Shape parameters by golden section along their logarithms, one after the other."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from dsd_cli.effects import Role, get_effect
from dsd_cli.identify.fit.bank import Term, Terms
from dsd_cli.identify.fit.golden import golden_section

if TYPE_CHECKING:
    from dsd_cli.identify.search.sets import Search

#: Half width of the bracket (natural logarithm) by what is searched: lines of a spectrum are narrow.
BRACKET = 0.8
STEPS = 9
#: With several parameters they are searched in turn, in so many rounds of narrower brackets, until a round gains less
#: than this share; those that matter less come last.
ROUNDS, SHRINK, ENOUGH = 5, 0.7, 1e-3
BROAD = ("damping",)


def refined(search: Search, terms: Terms, i: int, tap: int) -> tuple[Terms, int]:
    """(terms with effect number i at its best shape, best delay); the squares over all rows are what counts."""
    term = terms[i]
    names = [name for name, value in term.items if isinstance(value, float) and value > 0.0]
    names.sort(key=lambda name: name in BROAD)
    best, best_squares = term, search.solver.squares(terms, tap)
    for turn in range(1 if len(names) == 1 else ROUNDS):
        before = best_squares
        for name in names:
            half = _half_width(search, term, name) * (SHRINK**turn)
            best, best_squares, tap = _along(search, (terms, i, tap), (best, best_squares), (name, half))
        if best_squares > (1.0 - ENOUGH) * before:
            break
    return (*terms[:i], best, *terms[i + 1 :]), tap


def _half_width(search: Search, term: Term, name: str) -> float:
    """A line of n periods is told to about 1/n of itself."""
    value = term.shape[name]
    if term.id == "periodic_disturbance":
        return min(BRACKET, 0.7 / (value * search.ranges.duration))
    if term.id == "cogging":
        return min(BRACKET, 2.0 * math.pi * 0.7 / (value * search.ranges.travel))
    return BRACKET


def _along(
    search: Search, where: tuple[Terms, int, int], best: tuple[Term, float], along: tuple[str, float]
) -> tuple[Term, float, int]:
    """Golden section over log(parameter); (best term, its squares, delay)."""
    terms, i, tap = where
    name, half = along
    centre = math.log(best[0].shape[name])
    found: list[tuple[float, Term, int]] = [(best[1], best[0], tap)]

    def squares(x: float) -> float:
        term = Term.of(best[0].id, {**best[0].shape, name: math.exp(x)})
        tried = (*terms[:i], term, *terms[i + 1 :])
        taps = search.taps_for(term, tap)[:4] if term.effect.role is Role.INPUT else [tap]
        value, n = min((search.solver.squares(tried, n, keep=False), n) for n in dict.fromkeys([tap, *taps]))
        found.append((value, term, n))
        return value

    least, most = _limits(search, best[0].id, name)
    low, high = max(centre - half, math.log(least)), min(centre + half, math.log(most))
    if not low < high:
        return best[0], best[1], tap
    golden_section(squares, low, high, STEPS)
    value, term, n = min(found, key=lambda f: f[0])
    return term, value, n


def _limits(search: Search, effect_id: str, name: str) -> tuple[float, float]:
    """A little beyond the starting shapes: further out the log cannot tell the shape, and the effect is another one."""
    values = [shape[name] for shape in get_effect(effect_id).starts(search.ranges) if shape.get(name, 0.0) > 0.0]
    return (min(values) / 1.5, max(values) * 1.5) if values else (1e-300, 1e300)
