"""Texts of the command line to plain values, without pydantic.

Recent versions of typer coerce every value through pydantic, whose import (100 ms) would be the largest part of a small
`dsd detect`. Parameters of plain types get the coercion below instead; all others, and all of older versions of typer,
keep typer's own.
"""

from __future__ import annotations

from collections.abc import Callable
from enum import Enum
from pathlib import Path
from typing import Any, NamedTuple, get_args, get_origin

import typer

_PLAIN: dict[Any, tuple[Callable[[str], Any], str]] = {
    str: (str, "a text"),
    int: (int, "an integer"),
    float: (float, "a number"),
    Path: (Path, "a path"),
    bool: (bool, "a flag"),
}
#: Checks that typer itself shall do.
_SPECIAL = ("min", "max", "parser", "click_type", "exists", "resolve_path", "formats")


class PlainCoercion(NamedTuple):
    """Stands where typer keeps its own coercion of a parameter."""

    convert: Callable[[str], Any]
    what: str

    def coerce(self, value: Any, param: Any, ctx: Any) -> Any:
        """The value, or a tuple of values of a repeatable parameter."""
        several = param.multiple or param.nargs == -1
        if value is None:
            return () if several else None
        return [self._one(v, param, ctx) for v in value] if several else self._one(value, param, ctx)

    def _one(self, value: Any, param: Any, ctx: Any) -> Any:
        try:
            return self.convert(value)
        except ValueError:
            raise typer.BadParameter(f"{str(value)!r} is not {self.what}", ctx=ctx, param=param) from None


def use_plain_coercion(command: Any) -> None:
    """Give every parameter of a plain type, --help included, the coercion of this module."""
    context = typer.Context(command, **command.context_settings)
    for param in command.get_params(context):
        descriptor = getattr(param, "type_descriptor", None)
        if descriptor is not None and getattr(param, "_runtime_param", ...) is None:
            param._runtime_param = _plain(descriptor)


def _plain(descriptor: Any) -> PlainCoercion | None:
    annotation, info = descriptor.annotation, descriptor.parameter_info
    if get_origin(annotation) is list:
        (annotation,) = get_args(annotation)
    if any(getattr(info, name, None) not in (None, False) for name in _SPECIAL):
        return None
    if isinstance(annotation, type) and issubclass(annotation, Enum):
        choices = ", ".join(str(member.value) for member in annotation)
        return PlainCoercion(annotation, f"one of {choices}")
    if annotation in _PLAIN:
        return PlainCoercion(*_PLAIN[annotation])
    return None
