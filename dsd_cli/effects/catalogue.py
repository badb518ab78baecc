"""Finds the effects: every module of this folder that defines `EFFECT`, and those that were registered."""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Iterable
from functools import cache
from pathlib import Path
from types import MappingProxyType

from dsd_cli.effects.base import Effect
from dsd_cli.errors import UsageError

_NOT_EFFECTS = {"base", "catalogue", "memory", "_memory", "user"}

#: Effects of the user, by id: the one registry, written only by `register` and `unregister`.
_REGISTERED: dict[str, Effect] = {}


@cache
def _own() -> dict[str, Effect]:
    here = str(Path(__file__).parent)  # not the package itself, which imports this module
    names = sorted(m.name for m in pkgutil.iter_modules([here]) if m.name not in _NOT_EFFECTS)
    effects = (importlib.import_module(f"{__package__}.{name}").EFFECT for name in names)
    return {effect.id: effect for effect in effects}


def catalogue() -> MappingProxyType[str, Effect]:
    """Effect by id, in alphabetical order, those of the user last."""
    return MappingProxyType({**_own(), **_REGISTERED})


def register(effects: Iterable[Effect]) -> None:
    """From now on this process knows these effects too; the command line calls it once, before it reads a config.

    Raises
    ------
    UsageError : an id that is taken.
    """
    for effect in effects:
        if effect.id in catalogue():
            raise UsageError(f"effect '{effect.id}' is there already", "give it another id")
        _REGISTERED[effect.id] = effect


def unregister(ids: Iterable[str]) -> None:
    """Undoes `register`."""
    for effect_id in ids:
        _REGISTERED.pop(effect_id, None)


def get_effect(effect_id: str) -> Effect:
    """The effect of that id.

    Raises
    ------
    UsageError : no such effect.
    """
    found = _own().get(effect_id) or _REGISTERED.get(effect_id)
    if found is None:
        raise UsageError(f"no effect '{effect_id}'", "known effects are " + ", ".join(catalogue()))
    return found
