"""What a value in `dsd.toml` may be: small rules that read one value or say in one line why not.

Plain read-only objects read by these rules, not pydantic: importing pydantic and building its models takes 60-110 ms,
which is most of what a small `dsd detect` may add to the bare imports of numpy, pyarrow, typer and rich.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterable, Mapping
from typing import Any, ClassVar, NamedTuple, TypeVar, dataclass_transform

from dsd_cli.errors import UsageError


class Place(NamedTuple):
    """Where in which file a value stands; builds the errors that name it."""

    file: str
    path: str = ""

    def child(self, key: str) -> Place:
        return Place(self.file, f"{self.path}.{key}" if self.path else key)

    def item(self, index: int) -> Place:
        return Place(self.file, f"{self.path}[{index}]")

    @property
    def subject(self) -> str:
        return f"{self.file}: {self.path}"

    def refused(self, value: object, why: str) -> UsageError:
        return UsageError(f"{self.subject} = {shown(value)}", why)

    def wrong(self, value: object, allowed: str) -> UsageError:
        return self.refused(value, f"must be {allowed}")

    def missing(self, key: str, meaning: str, *more: str) -> UsageError:
        """more : further keys that are missing as well."""
        keys = f"{' and '.join((key, *more))} {'are' if more else 'is'}"
        return UsageError(f"{self.file}: [{self.path}] {keys} missing", meaning)

    def unknown(self, key: str, known: Iterable[str], what: str = "key") -> UsageError:
        return UsageError(f"{self.file}: unknown {what} {self.child(key).path}", suggestion(key, known))


def suggestion(word: str, known: Iterable[str]) -> str:
    """`did you mean X?`, or what is allowed when nothing is near."""
    from difflib import get_close_matches

    known = list(known)
    near = get_close_matches(word, known, n=1)
    return f"did you mean {near[0]}?" if near else "known here are " + ", ".join(known)


def shown(value: object) -> str:
    """A value as the user would write it, on one line and not too long."""
    match value:
        case bool():
            return "true" if value else "false"
        case str():
            text = '"' + value.replace("\n", "\\n") + '"'
        case Mapping():
            text = "{ " + ", ".join(f"{k} = {shown(v)}" for k, v in value.items()) + " }"
        case list() | tuple():
            text = "[" + ", ".join(map(shown, value)) + "]"
        case _:
            text = str(value)
    return text if len(text) <= 60 else text[:57] + "..."


class Rule(NamedTuple):
    """How one value is read: `allowed` in words, and the sections it may contain (for the documentation)."""

    allowed: str
    read: Callable[[Any, Place], Any]
    sections: tuple[type[Section], ...] = ()


#: s; delays and time constants are not longer.
LONGEST = 1e4
#: No number is larger in size, none of those above 0 smaller: squares and ratios of two stay finite.
SMALLEST, LARGEST = 1e-100, 1e100

_NO_DEFAULT: Any = object()


class Key(NamedTuple):
    """What a key of the config means."""

    rule: Rule
    meaning: str
    unit: str = ""
    default: Any = _NO_DEFAULT

    @property
    def required(self) -> bool:
        return self.default is _NO_DEFAULT


def key(rule: Rule, meaning: str, unit: str = "", *, default: Any = _NO_DEFAULT) -> Any:
    """Declares an attribute of a section as a key of the file; without a default it must be there."""
    return Key(rule, meaning, unit, default)


@dataclass_transform(frozen_default=True, kw_only_default=True, field_specifiers=(key,))
class Section:
    """A table of the config: subclasses declare their keys with `key(...)`, instances are read-only.

    To a type checker a frozen, keyword-only dataclass; sixteen real ones would take 20 ms of every start.
    """

    keys: ClassVar[Mapping[str, Key]] = {}

    def __init_subclass__(cls) -> None:
        cls.keys = {name: value for name, value in vars(cls).items() if isinstance(value, Key)}

    def __init__(self, **values: Any) -> None:
        missing = [name for name, spec in self.keys.items() if spec.required and name not in values]
        if missing or values.keys() - self.keys.keys():
            raise TypeError(f"{type(self).__name__} has the keys {', '.join(self.keys)}, given are {', '.join(values)}")
        self.__dict__.update({name: values.get(name, spec.default) for name, spec in self.keys.items()})

    def __setattr__(self, name: str, value: object) -> None:
        raise AttributeError(f"{type(self).__name__} is read-only")

    def __eq__(self, other: object) -> bool:
        return type(self) is type(other) and all(getattr(self, k) == getattr(other, k) for k in self.keys)

    __hash__ = None  # type: ignore[assignment]

    def __repr__(self) -> str:
        return f"{type(self).__name__}({', '.join(f'{k}={getattr(self, k)!r}' for k in self.keys)})"

    def check(self, at: Place) -> None:
        """Raise UsageError if the values contradict each other."""


S = TypeVar("S", bound=Section)


def read_section(kind: type[S], table: Any, at: Place) -> S:
    """A table of the file as a section, every key checked.

    Raises
    ------
    UsageError : an unknown or missing key, a wrong value, or values that contradict each other.
    """
    if not isinstance(table, Mapping):
        raise at.wrong(table, f"a table, written [{at.path}]")
    for name in table:
        if name not in kind.keys:
            raise at.unknown(name, kind.keys)
    for name, spec in kind.keys.items():
        if spec.required and name not in table:
            raise at.missing(name, f"{spec.meaning}{f' ({spec.unit})' if spec.unit else ''}, {spec.rule.allowed}")
    section = kind(**{name: kind.keys[name].rule.read(value, at.child(name)) for name, value in table.items()})
    section.check(at)
    return section


def number(lower: float = -math.inf, above: float = -math.inf, upper: float = math.inf) -> Rule:
    """A number of no absurd size, `lower <= x <= upper` and `x > above`; integers are taken, texts and flags not."""
    limits = [f"of at least {lower:g}"] if lower > -math.inf else []
    limits += [f"above {above:g}"] if above > -math.inf else []
    limits += [f"of at most {upper:g}"] if upper < math.inf else []
    allowed = " ".join(["a number", " and ".join(limits)]).strip()

    def read(value: Any, at: Place) -> float:
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise at.wrong(value, allowed)
        if not (abs(value) <= sys.float_info.max and lower <= value <= upper and value > above):
            raise at.wrong(value, allowed if limits else "a finite number")
        if abs(value) > LARGEST or 0 < value < SMALLEST * (above == 0):
            raise at.wrong(value, f"between {SMALLEST:g} and {LARGEST:g} in size")
        return float(value)

    return Rule(allowed, read)


def factor() -> Rule:
    """A finite number other than 0, so that what is multiplied by it can be had back."""
    allowed, finite = "a number other than 0", number()

    def read(value: Any, at: Place) -> float:
        if value == 0 or isinstance(value, bool):
            raise at.wrong(value, allowed)
        return float(finite.read(value, at))

    return Rule(allowed, read)


def integer(lower: int) -> Rule:
    """An integer of at least `lower`."""
    allowed = f"an integer of at least {lower}"

    def read(value: Any, at: Place) -> int:
        if isinstance(value, bool) or not isinstance(value, int) or value < lower:
            raise at.wrong(value, allowed)
        return value

    return Rule(allowed, read)


def flag() -> Rule:
    """true or false."""

    def read(value: Any, at: Place) -> bool:
        if not isinstance(value, bool):
            raise at.wrong(value, "true or false")
        return value

    return Rule("true or false", read)


def text() -> Rule:
    """A text that is not empty."""

    def read(value: Any, at: Place) -> str:
        if not isinstance(value, str) or not value:
            raise at.wrong(value, 'a text in quotes, such as "u"')
        return value

    return Rule("a text", read)


def choice(*options: str | int) -> Rule:
    """One of a few words (or integers)."""
    allowed = "one of " + ", ".join(map(shown, options))

    def read(value: Any, at: Place) -> Any:
        if isinstance(value, bool) or value not in options:
            raise at.wrong(value, allowed)
        return value

    return Rule(allowed, read)


def axis(item: Rule) -> Rule:
    """A list of numbers: not empty, none twice."""
    allowed = f"a list, not empty and none twice, of {item.allowed.removeprefix('a ').replace('number', 'numbers', 1)}"

    def read(value: Any, at: Place) -> tuple[float, ...]:
        if not isinstance(value, list | tuple) or not value:
            raise at.wrong(value, allowed)
        values = tuple(item.read(v, at.item(i)) for i, v in enumerate(value))
        for i, v in enumerate(values):
            if v in values[:i]:
                raise UsageError(f"{at.file}: {at.path} = {shown(value)}", f"{v:g} is in it twice")
        return values

    return Rule(allowed, read)


def span() -> Rule:
    """Two numbers, the first below the second."""
    allowed = "a smaller and a larger number, such as [-10, 10]"

    def read(value: Any, at: Place) -> tuple[float, float]:
        if not isinstance(value, list | tuple) or len(value) != 2:
            raise at.wrong(value, allowed)
        low, high = (number().read(item, at.item(i)) for i, item in enumerate(value))
        if not low < high:
            raise at.wrong(value, allowed)
        return low, high

    return Rule(allowed, read)


def table(kind: type[Section]) -> Rule:
    """A table with the keys of one section."""
    return Rule("a table", lambda value, at: read_section(kind, value, at), (kind,))


def tables(kind: type[Section]) -> Rule:
    """An array of tables."""

    def read(value: Any, at: Place) -> tuple[Section, ...]:
        if not isinstance(value, list | tuple):
            raise at.wrong(value, f"an array of tables, written [[{at.path}]]")
        return tuple(read_section(kind, item, at.item(i)) for i, item in enumerate(value))

    return Rule("an array of tables", read, (kind,))


def kinds(**options: type[Section]) -> Rule:
    """A table whose `kind` decides which keys it has."""
    choose = choice(*options)

    def read(value: Any, at: Place) -> Section:
        if not isinstance(value, Mapping):
            raise at.wrong(value, f"a table, written [{at.path}]")
        if "kind" not in value:
            raise at.missing("kind", choose.allowed)
        kind = options[choose.read(value["kind"], at.child("kind"))]
        return read_section(kind, {k: v for k, v in value.items() if k != "kind"}, at)

    return Rule(choose.allowed, read, tuple(options.values()))
