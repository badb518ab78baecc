"""[effects]: Python files with effects of the user. They are code: they run only where the reader allows it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from typing import Any

from dsd_cli.errors import UsageError
from dsd_cli.files.config.rules import Place, Rule, Section, key, read_section, shown, text

#: Takes the name of a config and the files that it names: registers their effects, or raises UsageError.
Reader = Callable[[str, tuple[Path, ...]], None]


def _paths() -> Rule:
    item = text()

    def read(value: Any, at: Place) -> tuple[str, ...]:
        if not isinstance(value, list | tuple):
            raise at.wrong(value, 'a list of files, such as ["my_effect.py"]')
        return tuple(item.read(one, at.item(i)) for i, one in enumerate(value))

    return Rule("a list of files", read)


class OwnEffects(Section):
    """[effects]: effects of your own; relative to the config's folder, run only where that is allowed (--trust)."""

    vars()["from"] = key(_paths(), "Python files that define them, run only with --trust or when asked", default=())

    @property
    def files(self) -> tuple[str, ...]:
        """As the config names them."""
        return tuple(getattr(self, "from"))


def _refuse(config: str, files: tuple[Path, ...]) -> None:
    raise UsageError(
        f"{config}: effects.from = {shown([str(file) for file in files])} is Python that would be run",
        "it is run only where that is allowed: `dsd --trust`, or `allowing` around `load_config`",
    )


_READER: ContextVar[Reader] = ContextVar("reader of effects", default=_refuse)


@contextmanager
def allowing(reader: Reader) -> Iterator[None]:
    """In here the effects that a config names are read by `reader`; else such a config is refused."""
    token = _READER.set(reader)
    try:
        yield
    finally:
        _READER.reset(token)


def read_own_effects(written: Mapping[str, Any], name: str, folder: Path) -> None:
    """Registers the effects that a config names, before anything else of it is read.

    Raises
    ------
    UsageError : they may not be run, or cannot be used.
    """
    if "effects" in written:
        section = read_section(OwnEffects, written["effects"], Place(name, "effects"))
        if section.files:
            _READER.get()(name, tuple(folder / file for file in section.files))
