"""Finds the effects: every module of this folder that defines `EFFECT`."""

from __future__ import annotations

import importlib
import pkgutil
from functools import cache
from types import MappingProxyType

import dsd_cli.effects as package
from dsd_cli.effects.base import Effect
from dsd_cli.errors import UsageError

_NOT_EFFECTS = {"base", "catalogue", "memory", "_memory", "user"}


@cache
def catalogue() -> MappingProxyType[str, Effect]:
    """Effect by id, in alphabetical order."""
    names = sorted(m.name for m in pkgutil.iter_modules(package.__path__) if m.name not in _NOT_EFFECTS)
    effects = (importlib.import_module(f"{package.__name__}.{name}").EFFECT for name in names)
    return MappingProxyType({effect.id: effect for effect in effects})


def get_effect(effect_id: str) -> Effect:
    """The effect of that id.

    Raises
    ------
    UsageError : no such effect.
    """
    known = catalogue()
    if effect_id not in known:
        raise UsageError(f"no effect '{effect_id}'", "known effects are " + ", ".join(known))
    return known[effect_id]
