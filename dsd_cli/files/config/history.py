"""The section [[history]] of `dsd.toml`: the steps that `dsd add` and `dsd improve` took, newest last."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import datetime
from types import MappingProxyType
from typing import Any

from dsd_cli.files.config.rules import Place, Rule, Section, flag, key, number, read_section, text
from dsd_cli.files.config.sections import Model

Values = Mapping[str, Any]
_NOTHING: Values = MappingProxyType({})


def _read_date(value: Any, at: Place) -> str:
    try:
        datetime.fromisoformat(value)
    except (TypeError, ValueError):
        raise at.wrong(value, _DATE) from None
    return str(value)


_DATE = 'a date and time in quotes, such as "2026-01-31T12:00:00Z"'


def _read_texts(value: Any, at: Place) -> tuple[str, ...]:
    if not isinstance(value, list | tuple):
        raise at.wrong(value, "a list of texts")
    return tuple(text().read(item, at.item(i)) for i, item in enumerate(value))


def _read_numbers(value: Any, at: Place) -> Values:
    if not isinstance(value, Mapping):
        raise at.wrong(value, "a table of values")
    # lists (the pulses of an external force) are kept as they are: nothing computes with them
    found = {
        name: item if isinstance(item, list | tuple) else number().read(item, at.child(name))
        for name, item in value.items()
    }
    return MappingProxyType(found)


def _read_correlations(value: Any, at: Place) -> Mapping[str, Values]:
    if not isinstance(value, Mapping) or any(not isinstance(row, Mapping) for row in value.values()):
        raise at.wrong(value, "a table of tables of values")
    one = number(lower=-1, upper=1)
    rows = {
        name: {other: one.read(r, at.child(name).child(other)) for other, r in row.items()}
        for name, row in value.items()
    }
    return MappingProxyType(rows)


def _read_units(value: Any, at: Place) -> Mapping[str, str]:
    if not isinstance(value, Mapping):
        raise at.wrong(value, "a table of texts")
    return MappingProxyType({name: text().read(item, at.child(name)) for name, item in value.items()})


def _read_before(value: Any, at: Place) -> Mapping[str, Any]:
    read_section(Model, value, at)  # what --undo would put back must be a valid [model]
    return MappingProxyType(dict(value))


def _error(meaning: str) -> Any:
    return key(number(lower=0), meaning, "unit of u", default=None)


def _values(meaning: str) -> Any:
    return key(Rule("a table of values", _read_numbers), meaning, default=_NOTHING)


class History(Section):
    """[[history]]: one step."""

    effect: str = key(text(), "what was added: an effect, inertia, delay, or refit")
    date: str = key(Rule(_DATE, _read_date), "when")
    logs: tuple[str, ...] = key(Rule("a list of texts", _read_texts), "the logs it was fitted to", default=())
    rmse_before: float | None = _error("error before the step")
    rmse_after: float | None = _error("error after the step")
    heldout_rmse_before: float | None = _error("held-out error before the step")
    heldout_rmse_after: float | None = _error("held-out error after the step")
    values: Values = _values("values that the step brought")
    std_errors: Values = _values("their standard errors")
    taken_back: bool = key(flag(), "the effect was taken out again: it had become needless", default=False)
    fitted: Values = _values("all values of the model after the step")
    fitted_errors: Values = _values("their standard errors; none where they are held or not identifiable")
    fitted_correlations: Mapping[str, Values] = key(
        Rule("a table of tables of values", _read_correlations),
        "correlation of each of these errors with those before it",
        default=_NOTHING,
    )
    units: Mapping[str, str] = key(
        Rule("a table of texts", _read_units),
        "units of the fitted values and of the errors, where they are known",
        default=_NOTHING,
    )
    levels: Values = _values("values that differ between `logs`, one for each; [model] has their mean")
    level_errors: Values = _values("their standard errors")
    before: Mapping[str, Any] | None = key(
        Rule("a table as [model]", _read_before), "[model] before the step, for `dsd improve --undo`", default=None
    )
