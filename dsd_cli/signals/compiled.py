"""The C modules of the package, where the build had a compiler."""

from __future__ import annotations

import importlib
from typing import Any


def compiled_module(module: str, newest: str = "") -> Any:
    """The module of that name; None where it was not compiled, or before `newest` was in it."""
    try:
        found = importlib.import_module(module)
    except ImportError:
        return None
    return found if not newest or hasattr(found, newest) else None
