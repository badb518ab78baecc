"""What the command line says of values: `--fix`, `--bounds` and `--prior`, and `--from` and `--to` of the log."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

from dsd_cli.errors import UsageError
from dsd_cli.files.config.fitting import PRIOR, Fit, read_bounds, read_fixed, read_prior
from dsd_cli.files.config.rules import Place

if TYPE_CHECKING:
    from dsd_cli.files.config.sections import Model
    from dsd_cli.files.config.signals import Signals

KINDS = ("fix", "bounds", "prior")
_NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"


class Option(Place):
    """Where a value stands on the command line; `file` is the option as it was written."""

    def child(self, key: str) -> Place:
        return self

    def item(self, index: int) -> Place:
        return self

    @property
    def subject(self) -> str:
        return self.file

    def refused(self, value: object, why: str) -> UsageError:
        return UsageError(self.file, why)


class Told(NamedTuple):
    """One of the options: `value` as the section [fit] has it."""

    at: Option
    kind: str
    name: str
    value: Any


def with_known(
    written: Mapping[str, Any],
    name: str,
    sections: tuple[Fit, Model],
    texts: Mapping[str, Iterable[str]],
    hold: bool = False,
) -> dict[str, Any]:
    """A copy of the tables of a config with the options in [fit].

    Parameters
    ----------
    name : the config's, for messages. sections : as the config has them. texts : by kind, as on the command line.

    Raises
    ------
    UsageError : a text of another form, a value that cannot be, or two that contradict each other.
    """
    fit, model = sections
    told = [_READ[kind](text) for kind in KINDS for text in texts.get(kind, ())]
    _check_once(told)
    _check_limits(told, fit, name)
    section: dict[str, Any] = {key: dict(x) if isinstance(x, Mapping) else x for key, x in _section(written).items()}
    for one in told:
        if one.value is True and not _has(model, one.name):
            raise UsageError(f"{one.at.file}: [model] has no {one.name} to hold", f"--fix {one.name}=VALUE says which")
        _put(section, one)
    if hold:
        section["hold"] = True
    return {**written, "fit": section} if section else dict(written)


def _fixed(text: str) -> Told:
    at, form = Option(f"--fix {text}"), "NAME=VALUE, such as inertia=0.35, or NAME alone to hold what [model] has"
    name, equals, value = _parts(text, at, form)
    found = _number(value, at, form) if equals else True
    read_fixed(found, at, name)
    return Told(at, "fix", name, found)


def _bounds(text: str) -> Told:
    at, form = Option(f"--bounds {text}"), "NAME=LOW:HIGH, such as viscous_friction.coefficient=0:5"
    name, _, value = _parts(text, at, form)
    ends = value.split(":")
    if len(ends) != 2 or not value.strip(": "):
        raise UsageError(at.file, f"write {form}")
    free = (-math.inf, math.inf)
    found = [_number(end, at, form, open_end) if end.strip() else open_end
             for end, open_end in zip(ends, free, strict=True)]  # fmt: skip
    read_bounds(found, at, name)
    return Told(at, "bounds", name, found)


def _prior(text: str) -> Told:
    at, form = Option(f"--prior {text}"), "NAME=VALUE+-SPREAD, such as inertia=0.35+-0.02 or 0.35+-5%"
    name, _, value = _parts(text, at, form)
    found = PRIOR.fullmatch(value)
    if not found:
        raise UsageError(at.file, f"write {form}")
    mean = _number(found[1], at, form)
    share = found[2].endswith("%")
    spread = _number(found[2].removesuffix("%"), at, form) * (abs(mean) / 100.0 if share else 1.0)
    read_prior(f"{mean!r}+-{spread!r}", at, name)
    return Told(at, "prior", name, f"{mean!r}+-{spread!r}")


_READ = {"fix": _fixed, "bounds": _bounds, "prior": _prior}


def _parts(text: str, at: Option, form: str) -> tuple[str, str, str]:
    """(name, "=" or "", what stands behind it). Raises UsageError : no name, or that of no value."""
    name, equals, value = (part.strip() for part in text.partition("="))
    if not name:
        raise UsageError(at.file.rstrip(), f"write {form}")
    read_fixed(True, at, name)
    return name, equals, value


def _number(text: str, at: Option, form: str, infinite: float = math.nan) -> float:
    """Raises UsageError : no finite number (nor the infinite one that may be here), with the likely reason."""
    text = text.strip()
    try:
        found = float(text)
    except ValueError:
        pass
    else:
        if not (math.isfinite(found) or found == infinite):
            raise UsageError(at.file, "must be a finite number")
        return found
    why = f"'{text}' is no number: write {form}" if text else f"write {form}"
    if re.fullmatch(r"[+-]?\d*,\d+", text):
        why = f"write {text.replace(',', '.')}, with a point"
    elif number := re.fullmatch(rf"({_NUMBER})\s*([^\W\d_].*)", text):
        bare = f"{1e-3 * float(number[1]):g}" if number[2] == "ms" else number[1]
        why = f"'{text}' is no number: write {bare} without a unit, in that of [model]"
    raise UsageError(at.file, why)


def _check_once(told: Iterable[Told]) -> None:
    """Raises UsageError : two options of a kind for one value, or one that is held has bounds or a prior as well."""
    before: dict[str, list[Told]] = {}
    for one in told:
        for other in before.setdefault(one.name, []):
            if other.kind == one.kind:
                raise UsageError(f"{other.at.file} and {one.at.file}", f"one of them for {one.name}")
            if other.kind == "fix":
                raise UsageError(
                    f"{other.at.file} and {one.at.file}", "what is held needs no more: leave one of them out"
                )
        before[one.name].append(one)


def _check_limits(told: Iterable[Told], fit: Fit, name: str) -> None:
    """Raises UsageError : a prior beyond the bounds of its value; one of the two may be the file's."""
    given = {(one.kind, one.name): one for one in told}
    for kind, value in given:
        bounds, prior = given.get(("bounds", value)), given.get(("prior", value))
        limits = read_bounds(bounds.value, bounds.at, value) if bounds else fit.bounds.get(value)
        expected = read_prior(prior.value, prior.at, value) if prior else fit.prior.get(value)
        if kind == "fix" or limits is None or expected is None or limits[0] <= expected[0] <= limits[1]:
            continue
        low, high = limits
        where = bounds.at.file if bounds else f"fit.bounds of {name}"
        if prior:
            raise UsageError(prior.at.file, f"{expected[0]:g} is outside of its bounds, {low:g} to {high:g} ({where})")
        raise UsageError(where, f"its prior, {expected[0]:g} +- {expected[1]:g} (fit.prior of {name}), is outside")


def _has(model: Model, name: str) -> bool:
    effect, dot, parameter = name.partition(".")
    if dot:
        return parameter in model.effects.get(effect, {})
    return name == "delay" or model.inertia is not None


def _section(written: Mapping[str, Any]) -> Mapping[str, Any]:
    found = written.get("fit", {})
    return found if isinstance(found, Mapping) else {}


def _put(section: dict[str, Any], told: Told) -> None:
    """What the command line says of a value replaces what the file says of it, of whatever kind."""
    for other in KINDS:
        table = section.get(other)
        if isinstance(table, Mapping) and (other == told.kind or told.kind == "fix" or other == "fix"):
            section[other] = _left_out(table, told.name)
    section.setdefault(told.kind, {})[told.name] = told.value


def _left_out(table: Mapping[str, Any], name: str) -> dict[str, Any]:
    effect, _, parameter = name.partition(".")
    inner = {k: {p: v for p, v in x.items() if p != parameter} if k == effect and isinstance(x, Mapping) else x
             for k, x in table.items()}  # fmt: skip
    return {k: x for k, x in inner.items() if k != name and x != {}}


def with_window(written: Mapping[str, Any], signals: Signals, name: str, start: float | None, end: float | None) -> Any:
    """A copy of the tables with `--from` and `--to` in [signals].

    Raises
    ------
    UsageError : no finite numbers, or nothing between them.
    """
    given = {"start": ("--from", start), "end": ("--to", end)}
    for option, value in given.values():
        if value is not None and not math.isfinite(value):
            raise UsageError(f"{option} {value:g}", "must be a finite number of seconds")
    first, last = signals.start if start is None else start, signals.end if end is None else end
    if not first < last:
        since = f"--from {start:g}" if start is not None else f"signals.start = {first:g} of {name}"
        until = f"--to {end:g}" if end is not None else f"signals.end = {last:g} of {name}"
        raise UsageError(f"{since} and {until}", "nothing is between them: the start must be before the end")
    section = written.get("signals", {})
    return {**written, "signals": {**section, **{key: value for key, (_, value) in given.items() if value is not None}}}
