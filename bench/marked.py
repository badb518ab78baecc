"""Pages of docs/ in which a study writes its lines between marks of their own."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path


def put(page: Path, part: str, lines: Sequence[str]) -> None:
    """These lines in the place of what stood between the marks of that part of a page."""
    begin, end = f"<!-- {part} -->", f"<!-- end of {part} -->"
    before, rest = page.read_text(encoding="utf-8").split(begin)
    page.write_text(f"{before}{begin}\n\n" + "\n".join(lines) + f"\n\n{end}{rest.split(end)[1]}", encoding="utf-8")
