"""Text for terminals: what comes out of files is shown, never obeyed."""

from __future__ import annotations

import re
from collections.abc import Iterator
from textwrap import wrap
from typing import Any

from dsd_cli.errors import ORDERS, printable


def escaped(text: str) -> str:
    """Safe from the terminal and from rich's markup; line ends stay."""
    from rich.markup import escape

    return escape("\n".join(map(printable, text.split("\n"))))


#: Columns of a table at least: with less its numbers are cut, and with none (COLUMNS=0) nothing is printed at all.
NARROWEST = 60
#: More columns than any table has.
_ENDLESS = 10_000


def console(file: Any) -> Any:
    """Where tables are printed; long lines are broken between words on a terminal.

    A table is as wide as its numbers need: where the terminal is narrower, it folds the lines, and nothing is cut.
    Where there is no terminal nothing is folded: a program reads lines, and a file has no edge.
    """
    from rich.console import Console
    from rich.table import Table

    class Roomy(Console):
        def print(self, *objects: Any, **how: Any) -> None:
            tables = [one for one in objects if isinstance(one, Table)]
            given = self.width
            self.width = max(given, *(_least_width(self, one) for one in tables), 0)
            try:
                if broken:
                    super().print(*objects, **how)
                else:  # blanks that fill the last column are for the eye only
                    with self.capture() as printed:
                        super().print(*objects, **how)
                    file.write(re.sub(r" +(?=\n)", "", printed.get()))
            finally:
                self.width = given

    broken = file.isatty()
    made = Roomy(file=file, highlight=False, emoji=False, soft_wrap=not broken)
    made.width = max(made.width, NARROWEST) if broken else _ENDLESS
    return made


def _least_width(printer: Any, table: Any) -> int:
    """Characters that a table needs so that no cell which stays on its line is cut, nor a word of the others."""
    from rich.measure import Measurement

    options = printer.options.update(width=_ENDLESS)
    needed = Measurement.get(printer, options, table).maximum
    if needed <= printer.width:
        return int(needed)
    widest = least = 0
    for column in table.columns:
        cells = [Measurement.get(printer, options, cell) for cell in (column.header, *column.cells)]
        most = max(one.maximum for one in cells)
        widest += most
        least += most if column.no_wrap else max(one.minimum for one in cells)
    return int(needed) - widest + least


class Hanging:
    """A cell of lines, broken between words where there is no room for one; what is broken off stands further in."""

    def __init__(self, *lines: str) -> None:
        self.lines = [printable(line) for text in lines for line in text.split("\n")]

    def __rich_measure__(self, console: Any, options: Any) -> Any:
        from rich.measure import Measurement

        words = [len(word) + len(_further_in(line)) for line in self.lines for word in line.split()]
        return Measurement(max(words, default=0), max(map(len, self.lines), default=0)).with_maximum(options.max_width)

    def __rich_console__(self, console: Any, options: Any) -> Iterator[Any]:
        from rich.text import Text

        for line in self.lines:
            for part in wrap(line, options.max_width, subsequent_indent=_further_in(line)) or [""]:
                yield Text(part, no_wrap=True)


def _further_in(line: str) -> str:
    return " " * (len(line) - len(line.lstrip()) + 2)


def json_text(result: Any, indent: int | None = None) -> str:
    """JSON as UTF-8 text without control characters; a NaN is a mistake of ours and fails."""
    import json

    text = json.dumps(result, indent=indent, ensure_ascii=False, allow_nan=False)
    return re.sub("[^\n]", lambda one: ORDERS.sub(_as_json, one[0]), text) if _has_orders(text) else text


def _has_orders(text: str) -> bool:
    return ORDERS.search(text.replace("\n", "")) is not None


def _as_json(found: re.Match[str]) -> str:
    return f"\\u{ord(found[0]):04x}"
