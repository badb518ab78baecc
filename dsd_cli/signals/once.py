"""Answers of a method that are asked for again."""

from collections.abc import Callable
from functools import wraps
from typing import Any, TypeVar, cast

_Method = TypeVar("_Method", bound=Callable[..., Any])


def once(method: _Method) -> _Method:
    """The method, which makes its answer to the same arguments once in the life of the object; they are hashable."""

    @wraps(method)
    def kept(self: Any, *arguments: Any, **named: Any) -> Any:
        answers = self.__dict__.setdefault(f"_{method.__name__}_once", {})
        key = (arguments, *named.items())
        if key not in answers:
            answers[key] = method(self, *arguments, **named)
        return answers[key]

    return cast(_Method, kept)
