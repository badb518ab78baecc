"""From terms to a formula: coefficients with errors, symbols, words, the law file, effects of the catalogue."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from dsd_cli.effects import Channels, Effect, Role, Values, catalogue
from dsd_cli.identify.results import Estimate
from dsd_cli.learn.choose import Choice, as_good, why_not
from dsd_cli.learn.curves import coefficients, effects_of
from dsd_cli.learn.dictionary import BASES, CHANNELS, MODULATIONS, effect_of, unit_of
from dsd_cli.learn.families import Columns, Family
from dsd_cli.learn.formula import Formulas, Term
from dsd_cli.learn.judge import Judge, LawFit
from dsd_cli.learn.law_file import law_source, words_of
from dsd_cli.learn.results import Formula
from dsd_cli.learn.rows import Balance, covariance_of, stacked
from dsd_cli.learn.sampled import strengths_of, tables_of
from dsd_cli.learn.state_laws import STATE_LAWS, fitted
from dsd_cli.signals.log import Array

#: Share of a column by which a term may differ from an effect of the catalogue, to be that effect.
_SAME = 2e-3
#: Relative step of the slopes over shapes.
_STEP = 1e-3
#: Standard errors from 0 that the strength of each term must have at least.
_LEAST_SIGMAS = 3.0
#: Times the curve's held-out error; a formula that leaves more is not said.
_MUCH_WORSE = 1.5


@dataclass(frozen=True)
class Found:
    """A formula, its fit, and where it explains as much as the curve the effects that a model then has: those of the
    catalogue, or tables of it. known : whether they are of the catalogue. on : the channels it depends on."""

    formula: Formula
    fit: LawFit
    effects: Mapping[str, Values]
    known: bool
    on: tuple[str, ...]


def formula_of(chosen: Choice) -> Found | None:
    """The formula that explains what the model lacks; None where no term does."""
    judge, first = chosen.judge, chosen.fit.laws[0].family
    if first in STATE_LAWS:
        return _of_state(chosen) if len(chosen.fit.laws) == 1 else None
    search = Formulas(judge.balance)
    fits: dict[tuple[Term, ...], LawFit] = {(): chosen.base}

    def fit(terms: Sequence[Term]) -> LawFit:
        key = tuple(terms)
        if key not in fits:
            fits[key] = judge.fit([_columns(t, judge) for t in key])
        return fits[key]

    terms = search.run(lambda before, after: not why_not(judge, fit(before), fit(after)))
    if not terms:
        return None
    found = fit(terms)
    replaces = as_good(found, chosen.fit)
    if not replaces and chosen.rmse(found) > _MUCH_WORSE * chosen.rmse(chosen.fit):
        return None
    estimates = _estimates(terms, found, judge)
    if not all(identified(each) for each in estimates):
        return None
    values = [{name: one.value for name, one in each.items()} for each in estimates]
    known = [_of_catalogue(t, v) for t, v in zip(terms, values, strict=True)]
    all_known = all(known) and len({name for one in known if one for name in one}) == len(known)
    names = [effect_of(t.kind).id for t in terms]
    effects = tuple(next(iter(k)) if k else n for k, n in zip(known, names, strict=True))
    formula = Formula(
        text=" ".join(_signed(t, v, k == 0) for k, (t, v) in enumerate(zip(terms, values, strict=True))),
        words=" and ".join(words_of(t, v) for t, v in zip(terms, values, strict=True)),
        parameters={f"{n}.{p}": e for n, each in zip(effects, estimates, strict=True) for p, e in each.items()},
        effects=effects,
        known=all_known,
        source=law_source(terms, names, values),
        heldout_rmse=chosen.rmse(found),
        replaces=replaces,
    )
    merged = {name: v for one in known if one for name, v in one.items()}
    tables = tables_of(terms, strengths_of(values), judge.balance.problem.model, judge.balance)
    on = tuple(dict.fromkeys(name for t in terms for name in _on(t)))
    return Found(formula, found, (merged if all_known else tables) if replaces else {}, all_known, on)


def _of_state(chosen: Choice) -> Found:
    """Of hysteresis with one state, whose law is a formula."""
    fit, judge = chosen.fit, chosen.judge
    own = fitted(fit.laws[0], coefficients(fit), judge, judge.nats(fit) / 2.0)
    effects = effects_of(fit, judge.balance.problem.model)
    names, known = tuple(effects), own.effect.id in catalogue()
    parameters = {f"{names[0]}.{name}": one for name, one in own.estimates.items()}
    formula = Formula(*own.said, parameters, names, known, "", chosen.rmse(fit), replaces=True)
    return Found(formula, fit, effects, known, fit.laws[0].family.on)


def identified(estimates: Mapping[str, Estimate]) -> bool:
    """Whether the strength of a term is distinguished from 0: else its shape lies where it hardly acts."""
    strengths = [estimates[name] for name in ("coefficient", "amplitude") if name in estimates]
    return all(abs(e.value) > _LEAST_SIGMAS * e.std_error for e in strengths)


def _on(term: Term) -> tuple[str, ...]:
    """Channels of a term as those of a family: friction looks at the direction alone, unless it is over the speed."""
    over = {"t": "time", "": ""}.get(term.kind.over, CHANNELS.get(term.kind.over, ""))
    own: tuple[str, ...] = {"dry": ("direction",), "load": ("direction", "u"), "inertia": ("acceleration",)}.get(
        term.kind.base, BASES[term.kind.base].needs
    )
    names = [*own, *([over] if over else [])]
    return tuple(name for name in dict.fromkeys(names) if name != "direction" or "velocity" not in names)


def _columns(term: Term, judge: Judge) -> Columns:
    """A term as a law that is judged."""
    effect = effect_of(term.kind)
    rows = tuple(judge.balance.columns(effect, term.values))
    on = tuple("u" if name == "u" else name for name in term.kind.needs) or ("time",)
    family = Family(effect.id, on, effect, (), "one", 0)
    size = len(rows)
    return Columns(family, rows, np.zeros((size, size)), None, np.eye(size), lambda found: {"values": found})


def _estimates(terms: Sequence[Term], fit: LawFit, judge: Judge) -> list[dict[str, Estimate]]:
    """Coefficients and shapes with standard errors out of all rows, shapes by their slopes; sine and cosine become
    amplitude and phase."""
    balance = judge.balance
    force = coefficients(fit)
    columns = [x for law in fit.laws for x in law.rows]
    slopes, at = [], 0
    for term, law in zip(terms, fit.laws, strict=True):
        own = force[at : at + len(law.rows)]
        at += len(law.rows)
        for name, value in term.shape:
            step = _STEP * (abs(value) if name != "place" else max(abs(value), 1e-3))
            ends = [own @ np.stack(_rows(term, name, value + side * step, balance)) for side in (1.0, -1.0)]
            slopes.append((ends[0] - ends[1]) / (2.0 * step))
    base = balance.fitted(fit.forward)
    covariance = judge.nats(fit) / 2.0 * covariance_of(stacked(balance, [*base, *columns, *slopes]))
    errors = np.sqrt(np.maximum(np.diag(covariance), 0.0))[len(base) :]
    return _named(terms, fit, force, errors)


def _rows(term: Term, name: str, value: float, balance: Balance) -> list[Array]:
    shape = {**term.values, name: value}
    return balance.columns(effect_of(term.kind), shape)


def _named(terms: Sequence[Term], fit: LawFit, force: Array, errors: Array) -> list[dict[str, Estimate]]:
    found, at, shape_at = [], 0, sum(len(law.rows) for law in fit.laws)
    for term, law in zip(terms, fit.laws, strict=True):
        own, error = force[at : at + len(law.rows)], errors[at : at + len(law.rows)]
        at += len(law.rows)
        unit = term.kind.unit
        if len(own) == 1:
            each = {"coefficient": Estimate(float(own[0]), float(error[0]), unit)}
        else:
            amplitude, phase = math.hypot(*own), math.atan2(own[1], own[0])
            share = own**2 / max(amplitude**2, 1e-300)
            each = {
                "amplitude": Estimate(amplitude, math.sqrt(float(share @ error**2)), unit),
                "phase": Estimate(phase, math.sqrt(float(share[::-1] @ error**2)) / max(amplitude, 1e-300), "rad"),
            }
        for name, value in term.shape:
            each[name] = Estimate(float(value), float(errors[shape_at]), unit_of(term.kind, name))
            shape_at += 1
        found.append(each)
    return found


def _signed(term: Term, values: Mapping[str, float], first: bool) -> str:
    """One term in symbols, with its sign."""
    base, modulation = BASES[term.kind.base], MODULATIONS[term.kind.modulation]
    strength = values.get("coefficient", values.get("amplitude", 0.0))
    sign = -strength if base.role is Role.FRICTION or base.law.startswith("-") or base.name == "inertia" else strength
    said = {name: f"{value:.3g}" for name, value in values.items()}
    shape = modulation.symbol.format(x=term.kind.over, **said)
    shape = shape.replace("- -", "+ ").replace("+ -", "- ")
    parts = [f"{abs(strength):.4g}", *([base.symbol] if base.symbol != "1" else []), *([shape] if shape else [])]
    text = " ".join(parts).replace(" /", "/")
    return ("-" if sign < 0.0 else "") + text if first else ("- " if sign < 0.0 else "+ ") + text


def _of_catalogue(term: Term, values: Mapping[str, float]) -> dict[str, Values] | None:
    """{effect: values} of the effect of the catalogue that a term is, None if it is none."""
    own, at = effect_of(term.kind), _probe(term)
    mine = np.stack(own.columns(at, term.values)[0] if own.memory else own.columns(at, term.values))
    force = strengths_of([values])[0] @ mine
    for name, effect in catalogue().items():
        if effect.role is not own.role or effect.memory or effect.listed or set(effect.needs) - set(term.kind.needs):
            continue
        shape = _shape_like(effect, term)
        if shape is None:
            continue
        theirs = np.stack([np.broadcast_to(c, len(at.t)) for c in effect.columns(at, shape)])
        coefficients = np.linalg.lstsq(theirs.T, force, rcond=1e-12)[0]
        if np.linalg.norm(force - coefficients @ theirs) < _SAME * np.linalg.norm(force):
            found = dict(effect.from_columns(tuple(map(float, coefficients)), shape))
            if all(p.lower <= found[p.name] <= p.upper for p in effect.parameters):
                return {name: found}
    return None


def _probe(term: Term) -> Channels:
    """Rows on which two laws are compared."""
    rng = np.random.default_rng(0)
    v, q, u = 2.0 * rng.standard_normal((3, 200))
    return Channels(np.linspace(0.0, 5.0, 200), u, v, q, np.zeros(200))


def _shape_like(effect: Effect, term: Term) -> dict[str, float] | None:
    """The shape of an effect that has one parameter, or none, with the value that the term has."""
    names = [p.name for p in effect.parameters if not p.linear]
    values = [value for _, value in term.shape]
    if not names:
        return {}
    return dict(zip(names, values, strict=True)) if len(names) == len(values) == 1 else None
