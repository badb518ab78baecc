"""Every picture that README and docs show is there, is made by `make figures`, and is small."""

import re
from fnmatch import fnmatch
from pathlib import Path

import pytest

from bench.figures.__main__ import FIGURES, STUDIES, WIDEST, main, pictures, small

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
SHOWN = [
    (page, (page.parent / link).resolve())
    for page in PAGES
    for link in re.findall(r"!\[[^\]]*\]\(([^)]+)\)", page.read_text("utf-8"))
]


def test_pictures_are_shown() -> None:
    assert len(SHOWN) > 10
    assert len([page for page, _ in SHOWN if page.name == "README.md"]) >= 3


@pytest.mark.parametrize(("page", "path"), SHOWN, ids=[f"{page.name}:{path.name}" for page, path in SHOWN])
def test_a_picture_that_is_shown_exists_and_is_made(page: Path, path: Path) -> None:
    assert path.read_bytes().startswith(b"\x89PNG")
    if path.parent == FIGURES:
        assert path.stem in pictures()
    else:
        assert [pattern for pattern in STUDIES if fnmatch(path.name, pattern)]


def test_what_is_made_is_shown_and_small() -> None:
    shown = {path.name for _, path in SHOWN if path.parent == FIGURES}
    assert {path.name for path in FIGURES.iterdir()} == shown == {f"{name}.png" for name in pictures()}
    assert {path.name: path.stat().st_size for path in FIGURES.iterdir() if path.stat().st_size > 150_000} == {}


def test_the_make_target_draws_them() -> None:
    makefile = (ROOT / "Makefile").read_text("utf-8")
    assert re.search(r"^figures:.*\n\t.*-m bench\.figures", makefile, re.MULTILINE)


def test_one_is_drawn_as_the_target_does_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from PIL import Image

    monkeypatch.setattr("bench.figures.__main__.FIGURES", tmp_path)
    monkeypatch.setattr("sys.argv", ["figures", "observe"])
    main()
    (made,) = tmp_path.iterdir()
    assert made.name == "observe.png"
    with Image.open(made) as image, Image.open(FIGURES / "observe.png") as kept:
        assert image.width <= WIDEST
        assert (image.width, image.height) == pytest.approx((kept.width, kept.height), rel=0.05)
    content = made.read_bytes()
    assert small(content) == small(content)
