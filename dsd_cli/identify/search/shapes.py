"""Shapes of effects: where a search begins, by what the log exercises and by the lines of the residual's spectrum, and
how it goes on, by golden section along the logarithms of their parameters, one after the other. Of several effects of
one kind, whether a log distinguishes two of them."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Iterator
from functools import cached_property

import numpy as np

from dsd_cli.effects import Ranges, Shape, free_name, get_effect, kind_of
from dsd_cli.identify.fit.bank import Term, Terms
from dsd_cli.identify.fit.errors import Errors
from dsd_cli.identify.fit.priors import is_shape
from dsd_cli.identify.fit.solve import Fit
from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.search.evidence import Evidence
from dsd_cli.identify.search.scan import Scan
from dsd_cli.signals.golden import golden_section
from dsd_cli.signals.log import Array
from dsd_cli.signals.peaks import peaks

#: Bins over the position, and the quantile of the speed at which a ripple over it must pass the band.
BINS, SLOW = 4096, 0.25


def names_to_try(allowed: Iterable[str], here: Collection[str], ranges: Ranges) -> Iterator[str]:
    """Effects that may be added to those that are `here`: one that is there already under its next name, if it repeats
    and the log may distinguish one more of it."""
    tried = set()
    for name in allowed:
        kind, repeats = kind_of(name), get_effect(name).repeats
        if name in here:
            name = free_name(kind, here) if repeats is not None and repeats(ranges) else ""
        if name and kind not in tried:
            tried.add(kind)
            yield name


def apart(one: Term, others: Iterable[Term], ranges: Ranges) -> bool:
    """Whether an effect differs from those of its kind by as many periods in the log as it takes to distinguish two."""
    periods = one.effect.periods
    if periods is None:
        return True
    kind, own = kind_of(one.id), periods(one.shape, ranges)
    alike = (t for t in others if t.id != one.id and kind_of(t.id) == kind)
    return all(abs(periods(t.shape, ranges) - own) >= 1.0 for t in alike)


def renamed(terms: Terms, alike: Terms) -> Terms:
    """The same effects, those of one kind in the order of `alike` and under the first names that the others leave."""
    names, left = {t.id for t in terms} - {t.id for t in alike}, iter(alike)
    found = []
    for term in terms:
        if term in alike:
            term = next(left)
            term = Term(free_name(kind_of(term.id), names), term.items)
            names.add(term.id)
        found.append(term)
    return tuple(found)


def starts(effect_id: str, found: Ranges, lines: Lines) -> list[Shape]:
    """Starting shapes of an effect: those over the ranges of the log, and those that the residual's lines suggest."""
    effect = get_effect(effect_id)
    return [*effect.starts(found), *effect.seeds(lines)]


class Lines:
    """Lines in the spectrum of what a fit leaves (rows in the unit of u)."""

    def __init__(self, errors: Errors, fit: Fit) -> None:
        self._equations = errors.equations
        self._residual = errors.residual(fit, held_out=False)
        self._by_stretch = self._equations.by_stretch(self._residual)

    @cached_property
    def over_time(self) -> tuple[float, ...]:
        """Frequencies of the strongest lines, Hz."""
        cycle = self._equations.recordings[0].cycle
        pairs = zip(self._by_stretch, self._equations.row_times, strict=True)
        parts = [(_beside_cycle(x, cycle / t), t) for x, t in pairs if len(x)]
        longest = max(len(x) * t for x, t in parts)
        step, shortest = 0.5 / longest, POLICY.least_periods / longest
        power = np.zeros(int(self._equations.band.hz / step) + 1)
        finest = min(t for _, t in parts)
        for x, row_time in parts:  # a line at one frequency, in whichever band, and of one size
            own = np.abs(np.fft.rfft(x - x.mean(), round(2.0 * longest / row_time))) ** 2 * (row_time / finest) ** 2
            power[: len(own)] += own[: len(power)]
        return tuple(k * step for k in peaks(power, int(shortest / step) + 1))

    @cached_property
    def over_position(self) -> tuple[float, ...]:
        """Spatial frequencies of the strongest lines, rad per unit of position."""
        stretches = self._equations.stretches
        if any("position" not in s.log for s in stretches):
            return ()
        place = self._equations.of_rows([s.log["position"] for s in stretches])
        speed = np.abs(self._equations.of_rows([s.log["velocity"] for s in stretches]))
        travel = float(np.ptp(place))
        usual = float(np.quantile(speed[speed > 0.0], SLOW)) if np.any(speed > 0.0) else 0.0
        if not travel > 0.0 or not usual > 0.0:
            return ()
        bins = np.minimum(((place - place.min()) / travel * BINS).astype(int), BINS - 1)
        sums = np.bincount(bins, self._residual - self._residual.mean(), BINS)
        power = np.abs(np.fft.rfft(sums, 2 * BINS)) ** 2
        step = 2.0 * np.pi / (2.0 * travel)
        highest = 2.0 * np.pi * self._equations.band.hz / usual  # what passes the band at such speeds
        told = POLICY.resolved_deviations * max(r.position_noise for r in self._equations.recordings)
        highest = min(highest, 2.0 * np.pi / max(told, 1e-300))  # a line of the sensor's own counts is no force
        return tuple(k * step for k in peaks(power[: int(highest / step) + 1], int(2 * POLICY.least_periods)))


def _beside_cycle(rows: Array, cycle: float) -> Array:
    """Rows without what each cycle of the motion has: a force that depends on the motion is a sum of lines in time at
    its harmonics, whatever its law. cycle : in rows, infinite where the motion does not repeat itself."""
    if not cycle * POLICY.least_cycles < len(rows):
        return rows
    phase = (np.arange(len(rows)) % cycle).astype(int)
    return rows - (np.bincount(phase, rows) / np.maximum(np.bincount(phase), 1))[phase]


#: Half width of the bracket, natural logarithm of the parameter; frequencies of lines have narrower ones.
BRACKET = 0.6
STEPS = 7
#: With several parameters they are searched in turn, in so many rounds of narrower brackets, until a round gains less
#: than this share; those that matter less come last. A single one takes a second, much narrower round at most, and the
#: periods of a line, which a log tells to a thousandth of one, a third.
ROUNDS, SHRINK, SHRINK_ALONE, ENOUGH = 5, 0.7, 0.1, 1e-3


def refined(
    search: Evidence, terms: Terms, i: int, tap: int, rounds: int = ROUNDS, near: bool = False
) -> tuple[Terms, int]:
    """(terms with effect number i at its best shape, best delay), by squares of all rows; near : in its valley."""
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
            found = _along(search, scan, found, name, _half_width(search, term, name, near) * (shrink**turn))
        if not line and found[0] < (1.0 + ENOUGH) * before:
            break
    if not apart(found[2], terms, search.ranges):  # it went where another of its kind is
        return terms, tap
    return (*terms[:i], found[2], *terms[i + 1 :]), found[1]


def _half_width(search: Evidence, term: Term, name: str, near: bool) -> float:
    """The frequency of a line of n periods is known to about 1/n of itself."""
    if term.effect.periods is None:
        return term.effect.valley.get(name, BRACKET) if near else BRACKET
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
    first = effect.starts(search.ranges)
    low, high = search.solver.known.limits(f"{effect_id}.{name}")
    if (low, high) != (-math.inf, math.inf) and first and is_shape(effect, name, first[0]):
        return max(low, 1e-300), high
    values = [shape[name] for shape in first if shape.get(name, 0.0) > 0.0]
    return (min(values) / 1.5, max(values) * 1.5) if values else (1e-300, 1e300)
