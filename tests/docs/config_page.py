"""The tables of docs/config.md, made from the sections themselves."""

from collections.abc import Iterator

from dsd_cli.files.config import Config
from dsd_cli.files.config.rules import Key, Section, shown


def rows(kind: type[Section] = Config, prefix: str = "") -> Iterator[tuple[str, str]]:
    """(dotted key, its line in the table), sections inside sections included."""
    for name, spec in kind.keys.items():
        dotted = f"{prefix}.{name}" if prefix else name
        if prefix:
            yield dotted, _line(dotted, spec)
        for inner in spec.rule.sections:
            yield from rows(inner, dotted)


def _line(dotted: str, spec: Key) -> str:
    cells = (f"`{dotted}`", spec.meaning, spec.unit, spec.rule.allowed, _default(spec))
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


def _default(spec: Key) -> str:
    if spec.required:
        return "must be given"
    if (
        spec.default is None
        or spec.default == ()
        or isinstance(spec.default, Section)
        or not isinstance(spec.default, str | int | float)
    ):
        return "none"
    return f"`{shown(spec.default)}`"
