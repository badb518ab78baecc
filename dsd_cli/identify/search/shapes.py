"""Shape parameters by golden section along their logarithms, one after the other."""

from __future__ import annotations

import math

from dsd_cli.effects import get_effect
from dsd_cli.identify.fit.bank import Term, Terms
from dsd_cli.identify.fit.priors import is_shape
from dsd_cli.identify.search.evidence import Evidence
from dsd_cli.identify.search.scan import Scan
from dsd_cli.identify.search.starts import apart
from dsd_cli.signals.golden import golden_section

#: Half width of the bracket, natural logarithm of the parameter; frequencies of lines have narrower ones.
BRACKET = 0.6
STEPS = 7
#: With several parameters they are searched in turn, in so many rounds of narrower brackets, until a round gains less
#: than this share; those that matter less come last. A single one takes a second, much narrower round at most, and the
#: periods of a line, which a log tells to a thousandth of one, a third.
ROUNDS, SHRINK, SHRINK_ALONE, ENOUGH = 5, 0.7, 0.1, 1e-3


def refined(search: Evidence, terms: Terms, i: int, tap: int, rounds: int = ROUNDS) -> tuple[Terms, int]:
    """(terms with effect number i at its best shape, best delay); the squares over all rows are what counts."""
    term = terms[i]
    scan = search.scan((*terms[:i], *terms[i + 1 :]), tap)
    held = search.solver.known.fixed
    names = [name for name, value in term.items if isinstance(value, float) and value > 0.0]
    names = [n for n in names if f"{term.id}.{n}" not in held or not is_shape(term.effect, n, term.shape)]
    names.sort(key=lambda name: name in term.effect.broad)
    found = (*scan.gain(term), term)
    shrink = SHRINK if len(names) > 1 else SHRINK_ALONE
    line = term.effect.periods is not None
    alone = 1 + (rounds == ROUNDS) * (2 if line else 1) if names else 0
    for turn in range(rounds if len(names) > 1 else alone):
        before = found[0]
        for name in names:
            found = _along(search, scan, found, name, _half_width(search, term, name) * (shrink**turn))
        if not line and found[0] < (1.0 + ENOUGH) * before:
            break
    if not apart(found[2], terms, search.ranges):  # it went where another of its kind is
        return terms, tap
    return (*terms[:i], found[2], *terms[i + 1 :]), found[1]


def _half_width(search: Evidence, term: Term, name: str) -> float:
    """The frequency of a line of n periods is known to about 1/n of itself."""
    if term.effect.periods is None:
        return BRACKET
    return min(BRACKET, 0.7 / max(term.effect.periods(term.shape, search.ranges), 1e-300))


def _along(
    search: Evidence, scan: Scan, best: tuple[float, int, Term], name: str, half: float
) -> tuple[float, int, Term]:
    """Golden section over log(parameter); (gain, delay, term) of the best that was met."""
    centre = math.log(best[2].shape[name])
    found = [best]

    def squares(x: float) -> float:
        term = Term.of(best[2].id, {**best[2].shape, name: math.exp(x)})
        found.append((*scan.gain(term), term))
        return -found[-1][0]

    least, most = _limits(search, best[2].id, name)
    low, high = max(centre - half, math.log(least)), min(centre + half, math.log(most))
    if low < high:
        golden_section(squares, low, high, STEPS)
    return max(found, key=lambda f: f[0])


def _limits(search: Evidence, effect_id: str, name: str) -> tuple[float, float]:
    """A little beyond the starting shapes: further out the shape is not identifiable."""
    effect = get_effect(effect_id)
    starts = effect.starts(search.ranges)
    low, high = search.solver.known.limits(f"{effect_id}.{name}")
    if (low, high) != (-math.inf, math.inf) and starts and is_shape(effect, name, starts[0]):
        return max(low, 1e-300), high
    values = [shape[name] for shape in starts if shape.get(name, 0.0) > 0.0]
    return (min(values) / 1.5, max(values) * 1.5) if values else (1e-300, 1e300)
