"""`python -m bench.figures [NAME ...]`: draws docs/figures/NAME.png; without a name all of them.

Each is made small: fewer colours, and no wider than a page shows. The same source gives the same files.
"""

from __future__ import annotations

import argparse
import io
import sys
import tempfile
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from bench.figures import commands, fleet, paper, plan
from dsd_cli.files.whole import write_whole

FIGURES = Path(__file__).parents[2] / "docs" / "figures"
#: Pictures of studies that take long, in docs/: name -> what makes them.
STUDIES = {
    "beyond-*.png": "make beyond",
    "hidden-calibration.png": "python -m bench hidden --page",
    "paired-reliability.png": "python -m bench paired --page",
}
#: Pixels; colours, most first; bytes for which fewer are taken.
WIDEST, COLOURS, MOST_BYTES = 1100, (255, 128, 64), 140_000


def pictures() -> dict[str, Callable[[Path], None]]:
    """Name -> what draws it into a file."""
    found: dict[str, Callable[[Path], None]] = {}
    for maker in (commands, fleet, paper, plan):
        found |= {name: partial(maker.draw, name) for name in maker.PICTURES}
    return found


def small(content: bytes) -> bytes:
    """A PNG of fewer pixels and colours."""
    from PIL import Image

    with Image.open(io.BytesIO(content)) as image:
        picture = image.convert("RGB")
    if picture.width > WIDEST:
        picture = picture.resize((WIDEST, round(picture.height * WIDEST / picture.width)), Image.Resampling.LANCZOS)
    tried = (_with_colours(picture, colours) for colours in COLOURS)
    found = next(tried)
    while len(found) > MOST_BYTES and (fewer := next(tried, b"")):
        found = fewer
    return found


def _with_colours(picture: Any, colours: int) -> bytes:
    from PIL import Image

    out = io.BytesIO()
    few = picture.quantize(colours, method=Image.Quantize.MEDIANCUT, dither=Image.Dither.NONE)
    few.save(out, format="png", optimize=True)
    return out.getvalue()


def main() -> None:
    known = pictures()
    parser = argparse.ArgumentParser(prog="python -m bench.figures")
    parser.add_argument("names", nargs="*", metavar="NAME", help="what to draw: " + ", ".join(known))
    names = parser.parse_args().names or list(known)
    for unknown in set(names) - set(known):
        sys.exit(f"no picture {unknown}; there are {', '.join(known)}")
    FIGURES.mkdir(exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        for name in names:
            drawn = Path(folder) / f"{name}.png"
            known[name](drawn)
            target = FIGURES / drawn.name
            write_whole(target, small(drawn.read_bytes()))
            print(f"docs/figures/{target.name}: {target.stat().st_size / 1e3:.0f} kB", file=sys.stderr, flush=True)


if __name__ == "__main__":
    main()
