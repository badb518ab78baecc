"""The targets: every module of this folder that defines `TARGET`."""

from __future__ import annotations

import importlib
import pkgutil
from functools import cache
from types import MappingProxyType

from dsd_cli.errors import UsageError
from dsd_cli.export.base import Target


@cache
def targets() -> MappingProxyType[str, Target]:
    """Target by id, in alphabetical order."""
    names = sorted(module.name for module in pkgutil.iter_modules(__path__))
    found = (importlib.import_module(f"{__name__}.{name}").TARGET for name in names)
    return MappingProxyType({target.id: target for target in sorted(found, key=lambda one: one.id)})


def get_target(name: str) -> Target:
    """The target of that id.

    Raises
    ------
    UsageError : no such target.
    """
    if name not in targets():
        raise UsageError(f"--to {name}", "targets are " + ", ".join(targets()))
    return targets()[name]
