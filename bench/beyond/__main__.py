"""`python -m bench.beyond [ITEM ...]`: measures, draws, and writes the tables of docs/how/beyond.md anew.

An item is a file of this folder. Its `section(pictures: Path) -> str` gives Markdown, and saves its pictures in the
folder `pictures` as `beyond-*.png`. The text goes between the lines `<!-- made by ITEM -->` and `<!-- end of ITEM -->`
of the page.
"""

from __future__ import annotations

import argparse
import importlib
import pkgutil
import re
import sys
from pathlib import Path

import bench.beyond

DOCS = Path(__file__).parents[2] / "docs"
PAGE = DOCS / "how" / "beyond.md"


def items() -> list[str]:
    """Names of the items: every public file of the folder that has a `section`."""
    found = [module.name for module in pkgutil.iter_modules(bench.beyond.__path__) if not module.name.startswith("_")]
    return [name for name in found if hasattr(importlib.import_module(f"bench.beyond.{name}"), "section")]


def replaced(page: str, item: str, text: str) -> str:
    """The page with `text` between the two marks of `item`.

    Raises
    ------
    LookupError : the page has no such marks.
    """
    marks = re.compile(rf"(<!-- made by {item} -->\n).*?(<!-- end of {item} -->)", re.DOTALL)
    if not marks.search(page):
        raise LookupError(f"{PAGE.name} has no lines <!-- made by {item} --> and <!-- end of {item} -->")
    return marks.sub(lambda found: f"{found[1]}{text.strip()}\n{found[2]}", page)


def main() -> None:
    known = items()
    parser = argparse.ArgumentParser(prog="python -m bench.beyond")
    parser.add_argument("items", nargs="*", metavar="ITEM", help="what to make: " + ", ".join(known))
    parser.add_argument("--print", action="store_true", help="print the text instead of writing the page")
    options = parser.parse_args()
    wanted = options.items or known
    for unknown in set(wanted) - set(known):
        sys.exit(f"no item {unknown}; there are {', '.join(known)}")
    for item in wanted:
        text = importlib.import_module(f"bench.beyond.{item}").section(DOCS)
        if options.print:
            print(text)
        else:
            PAGE.write_text(replaced(PAGE.read_text(encoding="utf-8"), item, text), encoding="utf-8")
        print(f"made: {item}", file=sys.stderr, flush=True)


if __name__ == "__main__":
    main()
