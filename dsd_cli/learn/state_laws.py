"""Hysteresis with one state in the place of springs that slip: few numbers, shapes refined beside the model."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from dsd_cli.effects import Channels, Effect, Shape, Values, free_name
from dsd_cli.effects.general import BOUC_WEN, HYSTERESIS, LUGRE
from dsd_cli.effects.presliding_friction import EFFECT as DAHL
from dsd_cli.identify.results import Estimate
from dsd_cli.learn.families import FAMILIES, MEMORY, RADII, Columns, Family
from dsd_cli.learn.judge import Judge, LawFit
from dsd_cli.learn.results import Curve
from dsd_cli.learn.rows import covariance_of, stacked
from dsd_cli.signals.log import Array

#: Name, effect, columns that it has of it; the simple ones first.
_KINDS: tuple[tuple[str, Effect, int], ...] = (
    ("hysteresis of one spring that yields (Dahl)", DAHL, 1),
    ("hysteresis with one state (Bouc-Wen)", BOUC_WEN, 1),
    ("dry friction of bristles (LuGre)", LUGRE, 1),
    ("dry friction of bristles that are damped (LuGre)", LUGRE, 2),
)
_RANK = next(family.rank for family in FAMILIES if family.effect is HYSTERESIS)
STATE_LAWS = tuple(Family(name, (MEMORY,), effect, (), "one", _RANK) for name, effect, _ in _KINDS)
#: Shape -> least, first and largest value; of the distance in travels, of the speed in top speeds.
_SHAPES = {
    "distance": (RADII[0], 0.05, 1.0),
    "exponent": (1.0, 1.5, 10.0),
    "unloading": (1.0, 1.5, 5.0),
    "ratio": (0.02, 0.5, 20.0),
    "velocity": (0.01, 0.2, 1.0),
}
#: Relative step of slopes; of a refinement the share of the squares that ends it, and its steps at most.
_STEP, _SETTLED, _MOST = 1e-3, 1e-5, 40
#: Knots of a curve, and distances that it reaches.
_KNOTS, _REACH = 33, 4.0
#: A speed at which all of what bristles have more when slow is there.
_SLOW = 1e-9


def springs_of(fits: Sequence[LawFit]) -> LawFit:
    """The one of springs that slip."""
    return next(fit for fit in fits if fit.laws[0].family.effect is HYSTERESIS)


def state_laws(judge: Judge, springs: LawFit, before: Sequence[LawFit]) -> list[LawFit]:
    """All of them, beside the model; `before` : fits on another balance, where those that were there begin; else they
    begin at what springs that slip show."""
    known = {law.family.name: law.law for fit in before for law in fit.laws if law.family in STATE_LAWS}
    found: list[LawFit] = []
    own = judge.balance.problem.model.effects
    for family, (_, _, columns) in zip(STATE_LAWS, _KINDS, strict=True):
        if not free_name(family.effect.id, own):  # there is one in a model, and it has it
            continue
        sooner = [fit.laws[0].law for fit in found if fit.laws[0].family.effect is family.effect]
        start = known.get(family.name) or next(iter(sooner), None) or _start(judge, springs, family.effect)
        fit = judge.fit((_refined(judge, family, columns, start),))
        if all(fit.total[len(fit.total) - columns :] > 0.0):  # friction and damping take energy
            found.append(fit)
    return sorted(found, key=lambda fit: (len(fit.laws[0].rows) + len(fit.laws[0].law), fit.loss))


def _start(judge: Judge, springs: LawFit, effect: Effect) -> Shape:
    """The distance after which springs that slip have built up 1 - 1/e of their force from rest."""
    first = {name: middle * _scale(judge, name) for name, (_, middle, _) in _SHAPES.items()}
    radii = np.array(springs.laws[0].law.radii)
    built = np.minimum(radii[:, None], radii) / radii @ springs.total[len(springs.total) - len(radii) :]
    if built[-1] > 0.0:
        first["distance"] = float(radii[np.argmax(built > (1.0 - math.exp(-1.0)) * built[-1])])
    shape = effect.to_columns({p.name: 1.0 for p in effect.parameters})[1]
    return {name: first[name] for name in shape}


def _scale(judge: Judge, name: str) -> float:
    ranges = judge.balance.problem.ranges
    return {"distance": ranges.travel, "velocity": ranges.top_speed}.get(name, 1.0)


def _refined(judge: Judge, family: Family, columns: int, start: Shape) -> Columns:
    """With the shapes at which the law and the model leave the least of all rows."""
    from scipy.optimize import least_squares

    b = judge.balance
    base, _ = np.linalg.qr(stacked(b, b.fitted()).T)
    target = b.white(b.u)
    target = target - base @ (target @ base)
    names = tuple(start)
    ends = np.array([[_SHAPES[name][i] * _scale(judge, name) for name in names] for i in (0, 2)])

    def at(x: Array) -> list[Array]:
        return b.columns(family.effect, _shape(names, x))[:columns]

    def left(x: Array) -> Array:
        law = stacked(b, at(x))
        law = law - (law @ base) @ base.T
        return np.asarray(target - np.linalg.lstsq(law @ law.T, law @ target, rcond=1e-12)[0] @ law)

    begin = np.log(np.clip(list(start.values()), *ends))
    found = least_squares(left, begin, bounds=np.log(ends), diff_step=_STEP, ftol=_SETTLED, max_nfev=_MOST)
    shape, eye = _shape(names, found.x), np.eye(columns)
    more = (0.0,) * (sum(p.linear for p in family.effect.parameters) - columns)

    def values(coefficients: Array) -> Values:
        return family.effect.from_columns((*map(float, coefficients), *more), shape)

    return Columns(family, tuple(at(found.x)), np.zeros_like(eye), shape, eye, values)


def _shape(names: Sequence[str], logarithms: Array) -> Shape:
    return dict(zip(names, np.exp(logarithms).tolist(), strict=True))


@dataclass(frozen=True)
class Fitted:
    """A law with one state as it came out of a fit.

    values : of its effect. covariance : of the logarithms of those that are not 0, by all rows, shape (n, n).
    """

    effect: Effect
    values: Values
    covariance: Array

    @property
    def estimates(self) -> dict[str, Estimate]:
        """The values that are not 0, with their standard errors."""
        units = {p.name: p.unit for p in self.effect.parameters}
        errors = np.sqrt(np.maximum(np.diag(self.covariance), 0.0)).tolist()
        found = zip(_given(self.values), errors, strict=True)
        return {name: Estimate(value, error * value, units[name]) for (name, value), error in found}

    def curve(self, name: str, band: float) -> Curve:
        """The force as it builds up from rest over the way, slowly, within so many standard errors."""
        ways = np.linspace(0.0, _REACH * self.effect.to_columns(self.values)[1]["distance"], _KNOTS)
        step, still = float(ways[1]), np.zeros(_KNOTS)
        slow = Channels(still, still, still + _SLOW, ways, still + step / _SLOW)

        def built(values: Values) -> Array:
            coefficients, shape = self.effect.to_columns(values)
            return -coefficients[0] * np.asarray(self.effect.run(slow, shape)[0][0])

        force, slopes = built(self.values), _slopes(built, self.values)
        half = band * np.sqrt(np.maximum(np.einsum("ik,ij,jk->k", slopes, self.covariance, slopes), 0.0))
        middles = tuple((ways + 0.5 * step).tolist())
        low, high = (tuple((force + side * half).tolist()) for side in (-1.0, 1.0))
        return Curve(name, ("way",), (middles,), tuple(force.tolist()), low, high, "{u}")

    @property
    def said(self) -> tuple[str, str]:
        """In symbols, and in words."""
        _, shape = self.effect.to_columns(self.values)
        n = {name: f"{value:.3g}" for name, value in {**self.values, **shape}.items()}
        b, over = 1.0 - 0.5 * shape.get("unloading", 2.0), f"after {n['distance']} of way"
        slope = self.values["level"] / shape["distance"]
        text = f"-{self.values['level']:.4g} h, h' = v/{n['distance']} "
        if self.effect is BOUC_WEN:
            inner = f"|h|^{n['exponent']} ({b:.3g} + {1.0 - b:.3g} sgn(v h))"
            return f"{text}(1 - {inner})", f"a spring of {slope:.3g} that yields {over}, up to {n['level']}"
        if self.effect is not LUGRE:
            return f"{text}(1 - h sgn v)", f"dry friction of {n['level']} that is built up {over}"
        slow = f"{100.0 * shape['ratio']:.0f} % higher when slower than {n['velocity']}"
        inner = f"h sgn v/(1 + {n['ratio']} exp(-(v/{n['velocity']})^2))"
        damped = f" - {n['damping']} z', z = {n['distance']} h" if self.values["damping"] else ""
        return f"{text}(1 - {inner}){damped}", f"dry friction of {n['level']}, {slow}, that is built up {over}"


def fitted(law: Columns, theta: Array, judge: Judge, variance: float) -> Fitted:
    """With these coefficients of its columns, of a fit that leaves this variance in a whitened row."""
    b, effect, values = judge.balance, law.family.effect, law.values(theta)

    def force(values: Values) -> Array:
        coefficients, shape = effect.to_columns(values)
        return sum((c * x for c, x in zip(coefficients, b.columns(effect, shape), strict=True)), np.zeros(len(b.u)))

    x = stacked(b, [*b.fitted(), *_slopes(force, values)])
    covariance = variance * covariance_of(x)
    own = slice(-len(_given(values)), None)
    return Fitted(effect, values, covariance[own, own])


def _given(values: Values) -> list[tuple[str, float]]:
    return [(name, float(value)) for name, value in values.items() if value != 0.0]


def _slopes(of: Callable[[Values], Array], values: Values) -> Array:
    """Of a function of values over the logarithm of each that is not 0, shape (n, N)."""
    found = []
    for name, value in _given(values):
        up, down = (of({**values, name: value * (1.0 + side * _STEP)}) for side in (1.0, -1.0))
        found.append((up - down) / (2.0 * _STEP))
    return np.stack(found)
