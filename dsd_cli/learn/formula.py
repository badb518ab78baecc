"""Forward selection of terms: shapes are scanned, the best refined before one is chosen, three terms at most."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations, product

import numpy as np

from dsd_cli.effects import Shape
from dsd_cli.identify.fit.row_weights import inflation
from dsd_cli.identify.policy import POLICY
from dsd_cli.learn.dictionary import CHANNELS, Kind, effect_of, kinds
from dsd_cli.learn.families import samples_of
from dsd_cli.learn.rows import Balance, stacked
from dsd_cli.signals.log import Array

#: Terms at most; kinds that are refined before one is chosen; evaluations of one refinement, and of a joint one.
MOST_TERMS, _REFINED, _STEPS, _TOGETHER = 3, 8, 36, 60
#: Places over the range of a channel, widths as shares of it, scales as shares of its largest.
_PLACES, _WIDTHS = 13, (0.04, 0.1, 0.25)
_SCALES = tuple(float(x) for x in np.geomspace(0.04, 1.2, 8))
#: Distances beyond the range, as shares of it, of the pole of an inverse square.
_POLES = (0.1, 0.2, 0.4, 0.8)
#: Cycles of a sine over the range: the least, the step, the most.
_CYCLES = (0.4, 0.35, 30.0)
#: Least angle that a sine goes through over the range: less is a line.
_LEAST = 2.0
#: Share by which the squares that a simpler law leaves may be larger: 2 % of the rms.
AS_GOOD = 0.04


@dataclass(frozen=True)
class Term:
    """A kind with its shapes."""

    kind: Kind
    shape: tuple[tuple[str, float], ...]

    @property
    def values(self) -> Shape:
        """Shapes by name."""
        return dict(self.shape)


class Formulas:
    """Looks for terms beside the model's own effects on one balance; every column is made once."""

    def __init__(self, balance: Balance) -> None:
        self.balance = balance
        here = {name: samples_of(name, balance) for name in ("velocity", "position", "u", "time")}
        self.channels = tuple(n for n, x in here.items() if len(x) and np.ptp(x) > 0.0)
        self.samples = {letter: here["time" if name == "t" else name] for letter, name in CHANNELS.items()}
        self.white: dict[Term, Array] = {}
        self.counted = float(balance.weight @ balance.weight)
        b = balance
        self.sides = {
            forward: (b.white(b.inertia * b.acceleration if forward else b.u),
                      stacked(b, b.fitted(forward)))
            for forward in (False, True)
        }  # fmt: skip

    def columns(self, term: Term) -> Array:
        """Whitened, shape (1 or 2, N)."""
        if term not in self.white:
            rows = self.balance.columns(effect_of(term.kind), term.values)
            self.white[term] = np.stack([self.balance.white(x) for x in rows])
        return self.white[term]

    def squares(self, terms: Sequence[Term], forward: bool) -> float:
        """What these leave, fitted to all rows, as a share of what nothing leaves in this form."""
        target, base = self.sides[forward]
        return _left(target, [base, *(self.columns(t) for t in terms)]) / _left(target, [base])

    def run(self, worth: Callable[[Sequence[Term], Sequence[Term]], bool]) -> list[Term]:
        """The terms, one after the other, as long as each pays for itself; `worth` : (before, after) -> whether a term
        more is certain and of use on data that it was not fitted to."""
        found: list[Term] = []
        while len(found) < MOST_TERMS:
            following = self._best(found)
            if following is None:
                break
            following = self._plainer(self._without_needless(self._together(following)))
            if following == found or not worth(found, following):
                break
            found = following
        return found

    def _plainer(self, found: list[Term]) -> list[Term]:
        """Bases alone, where one or two of them leave hardly more than terms with shapes: those imitate them."""
        size = _size(found)
        if not any(t.shape for t in found) or any(t.kind.of_u for t in found):
            return found
        alone = [Term(k, ()) for k in kinds(self.channels) if k.modulation == "alone" and not k.of_u]
        sets = [list(s) for n in (1, 2) for s in combinations(alone, n) if _size(s) < size]
        good = [s for s in sets if self._as_good(s, found)]
        return min(good, key=lambda s: (_size(s), self.squares(s, False)), default=found)

    def _best(self, current: list[Term]) -> list[Term] | None:
        scanned = sorted(self._scanned(current), key=lambda pair: -pair[0])
        best: dict[Kind, tuple[float, Term]] = {}
        for score, term in scanned:
            best.setdefault(term.kind, (score, term))
        tried = []
        for _, term in list(best.values())[:_REFINED]:
            terms = self._refined([*current, term], len(current), _STEPS)
            tried.append((self.nats(current, terms) - _price(terms[-1]), terms))
        if not tried:
            return None
        best_gain, best_terms = max(tried, key=lambda pair: pair[0])
        near = [
            (gain, terms)
            for gain, terms in tried
            if len(terms[-1].shape) < len(best_terms[-1].shape) and self._as_good(terms, best_terms)
        ]
        gain, terms = max(near, key=lambda pair: pair[0], default=(best_gain, best_terms))
        of_use = self.falls(current, terms) > 1.0 - (1.0 - POLICY.unknown_fall) ** 2
        return terms if gain > POLICY.unknown_nats and of_use else None

    def falls(self, before: Sequence[Term], after: Sequence[Term]) -> float:
        """Share of the whitened squares that a set takes off another."""
        forward = any(t.kind.of_u for t in after)
        return 1.0 - self.squares(after, forward) / max(self.squares(before, forward), 1e-300)

    def nats(self, before: Sequence[Term], after: Sequence[Term]) -> float:
        """Log-likelihood that a set gains over another, both in the form of the second."""
        forward = any(t.kind.of_u for t in after)
        was, now = self.squares(before, forward), self.squares(after, forward)
        target, base = self.sides[forward]
        rest = _rest(target, [base, *(self.columns(t) for t in after)])
        slow = inflation(rest[self.balance.equations.kept])
        return 0.5 * self.counted / slow * math.log(max(was, 1e-300) / max(now, 1e-300))

    def _as_good(self, simpler: Sequence[Term], other: Sequence[Term]) -> bool:
        """Whether a set leaves hardly more than another, in the form of both."""
        forward = any(t.kind.of_u for t in (*simpler, *other))
        return self.squares(simpler, forward) < (1.0 + AS_GOOD) * self.squares(other, forward)

    def _scanned(self, current: list[Term]) -> Iterator[tuple[float, Term]]:
        """(nats less the price, term) of every start."""
        ready = {}
        for forward in (False, True):
            target, base = self.sides[forward]
            rows = np.vstack([base, *(self.columns(t) for t in current)])
            q, _ = np.linalg.qr((rows / np.maximum(np.linalg.norm(rows, axis=1, keepdims=True), 1e-300)).T)
            ready[forward] = q, target - q @ (q.T @ target)
        of_u = any(t.kind.of_u for t in current)
        for kind in kinds(self.channels):
            if kind.of_u and not (
                of_u or (not current and self.balance.answered)
            ):  # beside a law of the motion u would explain its own noise
                continue
            q, rest = ready[kind.of_u or of_u]
            size = float(rest @ rest)
            for shape in self._starts(kind):
                term = Term(kind, tuple(shape.items()))
                columns = self.columns(term)
                apart = columns - (columns @ q) @ q.T
                if float(np.sum(apart**2)) < 1e-6 * float(np.sum(columns**2)):
                    continue
                taken = _explained(apart, rest)
                share = min(taken / max(size, 1e-300), 1.0 - 1e-12)
                yield -0.5 * self.counted * math.log(1.0 - share) - _price(term), term

    def _starts(self, kind: Kind) -> Iterator[dict[str, float]]:
        x = self.samples[kind.over or "t"]
        low, high = (float(x.min()), float(x.max())) if len(x) else (0.0, 0.0)
        span, top = high - low, max(abs(low), abs(high))
        inside = np.linspace(low, high, _PLACES + 2)[1:-1].tolist()
        grids: dict[str, Sequence[float]] = {
            "place": [low - s * span for s in _POLES] + [high + s * span for s in _POLES]
            if kind.modulation == "inverse" else inside,
            "width": [share * span for share in _WIDTHS],
            "scale": [share * top for share in _SCALES],
            "n": (2.0 * math.pi / max(span, 1e-300) * np.arange(*_CYCLES[::2], _CYCLES[1])).tolist(),
        }  # fmt: skip
        for values in product(*(grids[name] for name in kind.parameters)):
            yield dict(zip(kind.parameters, values, strict=True))

    def _refined(self, terms: list[Term], i: int, steps: int) -> list[Term]:
        """With the shapes of term i where the squares are least."""
        names = terms[i].kind.parameters
        if not names:
            return terms
        forward = any(t.kind.of_u for t in terms)
        target, base = self.sides[forward]
        others = [base, *(self.columns(t) for k, t in enumerate(terms) if k != i)]
        span = max(float(np.ptp(self.samples[terms[i].kind.over])), 1e-300)

        def at(x: Array) -> Term:
            values = [float(v) if n == "place" else math.exp(v) for n, v in zip(names, x, strict=True)]
            return Term(terms[i].kind, tuple(zip(names, values, strict=True)))

        @np.errstate(divide="ignore", invalid="ignore")  # a pole on a sample
        def squares(x: Array) -> float:
            rows = self.balance.columns(effect_of(terms[i].kind), at(x).values)
            if not all(np.isfinite(r).all() for r in rows) or (names == ("n",) and math.exp(x[0]) * span < _LEAST):
                return math.inf
            return _left(target, [*others, np.stack([self.balance.white(r) for r in rows])])

        shape = terms[i].values
        start = np.array([shape[n] if n == "place" else math.log(max(shape[n], 1e-300)) for n in names])
        width = {"place": 0.04 * span, "width": 0.4, "scale": 0.35, "n": 0.2 / max(shape.get("n", 1.0) * span, 0.5)}
        best = nelder_mead(squares, start, np.array([width[n] for n in names]), steps)
        return [*terms[:i], at(best), *terms[i + 1 :]]

    def _together(self, terms: list[Term]) -> list[Term]:
        """Every shape once more beside the others."""
        for _ in range(2 if len(terms) > 1 else 1):
            for i in range(len(terms)):
                terms = self._refined(terms, i, _TOGETHER)
        return terms

    def _without_needless(self, terms: list[Term]) -> list[Term]:
        """A term that a later one made needless goes."""
        for i in range(len(terms) - 1):
            less = [*terms[:i], *terms[i + 1 :]]
            of_use = self.falls(less, terms) > 1.0 - (1.0 - POLICY.unknown_fall) ** 2
            if self.nats(less, terms) - _price(terms[i]) < POLICY.least_gain or not of_use:
                return self._without_needless(self._together(less))
        return terms


def _size(terms: Sequence[Term]) -> int:
    """Numbers that a set has."""
    return sum(1 + len(t.shape) for t in terms)


def _price(term: Term) -> float:
    return POLICY.effect_price * (1 + len(term.shape))


def _rest(target: Array, columns: Sequence[Array]) -> Array:
    rows = np.vstack(columns)
    size = np.maximum(np.linalg.norm(rows, axis=1), 1e-300)
    scaled = rows / size[:, None]
    gram = scaled @ scaled.T + 1e-11 * np.eye(len(rows))
    return np.asarray(target - np.linalg.solve(gram, scaled @ target) @ scaled)


def _left(target: Array, columns: Sequence[Array]) -> float:
    rest = _rest(target, columns)
    return float(rest @ rest)


def _explained(columns: Array, rest: Array) -> float:
    """Of the squares of a residual, by one or two columns."""
    moments = columns @ rest
    if len(columns) == 1:
        return float(moments[0] ** 2 / max(float(columns[0] @ columns[0]), 1e-300))
    gram = columns @ columns.T
    return float(moments @ np.linalg.solve(gram + 1e-12 * max(np.trace(gram), 1e-280) * np.eye(len(gram)), moments))


def nelder_mead(of: Callable[[Array], float], start: Array, widths: Array, steps: int) -> Array:
    """Where a function of one or two numbers is least (Nelder and Mead 1965); `scipy.optimize` takes 0.3 s to load."""
    corners = [start, *(start + w * e for w, e in zip(widths, np.eye(len(start)), strict=True))]
    found = sorted(((of(x), k, x) for k, x in enumerate(corners)), key=lambda f: f[:2])
    count = len(found)
    while count < steps:
        centre = np.mean([x for *_, x in found[:-1]], axis=0)
        worst = found[-1][2]
        new = centre + (centre - worst)
        value = of(new)
        count += 1
        if value < found[0][0]:
            far = centre + 2.0 * (centre - worst)
            further = of(far)
            count += 1
            new, value = (far, further) if further < value else (new, value)
        elif value >= found[-2][0]:
            near = centre + (0.5 if value < found[-1][0] else -0.5) * (centre - worst)
            nearer = of(near)
            count += 1
            if nearer < min(value, found[-1][0]):
                new, value = near, nearer
            else:
                best = found[0][2]
                found = [
                    found[0],
                    *((of(best + 0.5 * (x - best)), k, best + 0.5 * (x - best)) for _, k, x in found[1:]),
                ]
                count += len(found) - 1
                found.sort(key=lambda f: f[:2])
                continue
        found = sorted([*found[:-1], (value, count, new)], key=lambda f: f[:2])
    return np.asarray(found[0][2])
