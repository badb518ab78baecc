"""Options that several commands have alike, declared once: as a dataclass, or added to every command."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from dataclasses import fields, is_dataclass
from functools import wraps
from typing import Any, get_type_hints

Command = Callable[..., Any]


def spread(command: Command) -> Command:
    """A command whose parameter of a dataclass type stands for the fields of that, each an option by its annotation.

    The options keep the place of the parameter; the command gets the dataclass with what was given.
    """
    signature = inspect.signature(command, eval_str=True)
    groups: dict[str, Any] = {
        name: one.annotation for name, one in signature.parameters.items() if is_dataclass(one.annotation)
    }
    parameters: list[inspect.Parameter] = []
    for name, one in signature.parameters.items():
        parameters += _options(groups[name]) if name in groups else [one]

    def call(given: dict[str, Any]) -> Any:
        for name, group in groups.items():
            given[name] = group(**{option.name: given.pop(option.name) for option in fields(group)})
        return command(**given)

    return _with_signature(command, parameters, call)


def with_option(command: Command, name: str, annotation: Any, default: Any) -> Command:
    """The command with one option more, that only its callback hears of; itself if it has one of that name."""
    signature = inspect.signature(command, eval_str=True)
    if name in signature.parameters:
        return command
    option = inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=annotation)

    def call(given: dict[str, Any]) -> Any:
        return command(**{key: value for key, value in given.items() if key != name})

    return _with_signature(command, [*signature.parameters.values(), option], call)


def _options(group: type) -> list[inspect.Parameter]:
    hints = get_type_hints(group, include_extras=True)
    return [
        inspect.Parameter(one.name, inspect.Parameter.KEYWORD_ONLY, default=one.default, annotation=hints[one.name])
        for one in fields(group)
    ]


def _with_signature(
    command: Command, parameters: list[inspect.Parameter], call: Callable[[dict[str, Any]], Any]
) -> Command:
    keyword = inspect.Parameter.KEYWORD_ONLY
    plain = [one.replace(kind=keyword) for one in parameters]

    @wraps(command)
    def shared(**given: Any) -> Any:
        return call(given)

    hints: Mapping[str, Any] = {one.name: one.annotation for one in plain}
    del shared.__wrapped__  # its signature is that of the command
    shared.__signature__ = inspect.Signature(plain)  # type: ignore[attr-defined]
    shared.__annotations__ = dict(hints)
    return shared
