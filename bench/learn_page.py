"""docs/measured/learn.md: what the studies of `dsd learn` write between marks of their own."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from bench.engines import ROOT

PAGE = ROOT / "docs" / "measured" / "learn.md"


def put(part: str, lines: Sequence[str], page: Path | None = None) -> None:
    """These lines in the place of what stood between the marks of that part of a page."""
    file = page or PAGE
    begin, end = f"<!-- {part} -->", f"<!-- end of {part} -->"
    text = file.read_text(encoding="utf-8")
    before, rest = text.split(begin)
    file.write_text(f"{before}{begin}\n\n" + "\n".join(lines) + f"\n\n{end}{rest.split(end)[1]}", encoding="utf-8")
