"""Answers of a method that are asked for again."""

from collections.abc import Callable
from functools import wraps
from typing import Any, TypeVar, cast

_Method = TypeVar("_Method", bound=Callable[..., Any])
_Object = TypeVar("_Object")
#: (name of the method, arguments) -> its answer.
Answers = dict[Any, Any]
_KEPT = "_answers"


def once(method: _Method) -> _Method:
    """The method, which makes its answer to the same arguments once in the life of the object; they are hashable."""

    @wraps(method)
    def kept(self: Any, *arguments: Any, **named: Any) -> Any:
        answers = self.__dict__.setdefault(_KEPT, {})
        key = (method.__name__, arguments, *named.items())
        if key not in answers:
            answers[key] = method(self, *arguments, **named)
        return answers[key]

    return cast(_Method, kept)


def with_answers(one: _Object, answers: Answers) -> _Object:
    """The object, with the answers of others that are like it, which live longer than what they were made of."""
    one.__dict__[_KEPT] = answers
    return one
