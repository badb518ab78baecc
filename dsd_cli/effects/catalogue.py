"""Finds the effects: every module of this folder that defines `EFFECT`, and those that were registered.

A model may have several of an effect that repeats (`Effect.repeats`): `cogging`, `cogging_2`, `cogging_3`, ... Each is
looked up by the id before its number, and is the same law under a name of its own. The laws of any form (`general`)
are known by name alone: no search tries them.
"""

from __future__ import annotations

import importlib
import re
from collections.abc import Collection, Iterable
from dataclasses import replace
from difflib import get_close_matches
from functools import cache
from pathlib import Path
from types import MappingProxyType

from dsd_cli.effects.base import Effect
from dsd_cli.effects.general import GENERAL
from dsd_cli.errors import UsageError

#: Effects of the user, by id: the one registry, written only by `register` and `unregister`.
_REGISTERED: dict[str, Effect] = {}

#: The name of a further effect of one kind: that of the first is the kind itself.
_NUMBERED = re.compile(r"(?P<kind>.+)_(?P<number>[2-9]|[1-9][0-9])")


@cache
def _own() -> dict[str, Effect]:
    import pkgutil

    here = str(Path(__file__).parent)  # not the package itself, which imports this module
    names = [m.name for m in pkgutil.iter_modules([here]) if not m.name.startswith("_")]  # a compiled one may not load
    modules = (importlib.import_module(f"{__package__}.{name}") for name in names)
    effects = [module.EFFECT for module in modules if hasattr(module, "EFFECT")]
    return {effect.id: effect for effect in sorted(effects, key=lambda effect: effect.id)}


def catalogue() -> MappingProxyType[str, Effect]:
    """Effect by id, in alphabetical order, those of the user last."""
    return MappingProxyType({**_own(), **_REGISTERED})


def named_effects() -> MappingProxyType[str, Effect]:
    """All that a config may name: the catalogue, then the laws of any form."""
    return MappingProxyType({**catalogue(), **GENERAL})


def register(effects: Iterable[Effect]) -> None:
    """From now on this process knows these effects too; the command line calls it once, before it reads a config.

    Raises
    ------
    UsageError : an id that is taken.
    """
    for effect in effects:
        if effect.id in catalogue() or effect.id in GENERAL:
            raise UsageError(f"effect '{effect.id}' is there already", "give it another id")
        _REGISTERED[effect.id] = effect
    _numbered.cache_clear()


def unregister(ids: Iterable[str]) -> None:
    """Undoes `register`."""
    for effect_id in ids:
        _REGISTERED.pop(effect_id, None)
    _numbered.cache_clear()


def find_effect(name: str) -> Effect | None:
    """The effect of that name, or of that kind where the name has a number; None if there is none."""
    return _own().get(name) or _REGISTERED.get(name) or GENERAL.get(name) or _numbered(name)


def delays_command(name: str) -> bool:
    """Whether what has this name, an effect or the delay of a model, makes u late."""
    effect = find_effect(name)
    return name == "delay" or (effect is not None and effect.lateness is not None)


def is_angle(name: str) -> bool:
    """Whether a value, "<effect>.<parameter>" or one of the plant, is an angle that is the same after a turn."""
    effect, _, parameter = name.partition(".")
    return bool(parameter) and get_effect(effect).parameter(parameter).whole_turn


@cache
def _numbered(name: str) -> Effect | None:
    """The effect that repeats under a name with a number."""
    found = _NUMBERED.fullmatch(name)
    kind = found and (_own().get(found["kind"]) or _REGISTERED.get(found["kind"]) or GENERAL.get(found["kind"]))
    return replace(kind, id=name) if kind and kind.repeats is not None else None


def get_effect(name: str) -> Effect:
    """The effect of that name, as `find_effect`.

    Raises
    ------
    UsageError : no such effect.
    """
    found = find_effect(name)
    if found is None:
        numbered = _NUMBERED.fullmatch(name)
        if numbered and numbered["kind"] in catalogue():
            raise UsageError(f"no effect '{name}'", f"a model has one {numbered['kind']}")
        near = get_close_matches(name, catalogue(), n=1)
        told = f"did you mean {near[0]}? " if near else ""
        raise UsageError(f"no effect '{name}'", f"{told}known effects are {', '.join(catalogue())}")
    return found


def kind_of(name: str) -> str:
    """The id in the catalogue of the effect of that name: the name without its number."""
    found = _NUMBERED.fullmatch(name)
    return found["kind"] if found and name not in catalogue() and find_effect(name) is not None else name


def told_apart(one: str, other: str) -> str:
    """The experiment that distinguishes two effects, from the file of either; "" if neither knows one."""
    known, pair = catalogue(), (kind_of(one), kind_of(other))
    found = (known[a].told_apart.get(b) for a, b in (pair, pair[::-1]) if a in known)
    return next((experiment for experiment in found if experiment), "")


def free_name(kind: str, taken: Collection[str]) -> str:
    """The first name of that kind that is not taken; "" where there is one in a model and it is taken."""
    if kind not in taken:
        return kind
    names = (f"{kind}_{number}" for number in range(2, 100))
    known = catalogue()
    return next((n for n in names if n not in taken and n not in known and find_effect(n) is not None), "")
