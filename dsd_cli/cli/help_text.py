"""The text of `--help`: one line each where a program reads it; on a terminal no name is cut at its hyphens."""

from __future__ import annotations

from typing import Any, TextIO

import typer

#: Columns of what is no terminal: more than any line has.
_UNBROKEN = 10_000
#: Stands for the hyphen of a name while lines are folded (U+2011, which no text of ours has).
_KEPT = "\u2011"
#: Of the version of typer that is installed; none of them exports it.
_BASE: Any = typer.Context.formatter_class


def width_of(stream: TextIO) -> int | None:
    """Columns of a help text that goes to this stream; None: those of the terminal, 80 at most."""
    return None if stream.isatty() else _UNBROKEN


class _Formatter(_BASE):
    """Folds between words only."""

    def write_dl(self, rows: Any, *args: Any, **more: Any) -> None:
        super().write_dl([tuple(text.replace("-", _KEPT) for text in row) for row in rows], *args, **more)

    def write_text(self, text: str) -> None:
        super().write_text(text.replace("-", _KEPT))

    def getvalue(self) -> str:
        return str(super().getvalue()).replace(_KEPT, "-")


class HelpContext(typer.Context):
    """A context whose help is written so."""

    formatter_class = _Formatter
