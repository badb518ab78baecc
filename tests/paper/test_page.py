"""docs/measured/paper.md: the row of the choice that was made is as measured now."""

from pathlib import Path

from tests.paper.choices import CHOICES, row

PAGE = (Path(__file__).parents[2] / "docs/measured/paper.md").read_text(encoding="utf-8")


def test_the_chosen_row_is_current_and_holds_every_claim() -> None:
    """Fig. 6, 7 and 8 under the templates' own settings."""
    line = row(*CHOICES[0])
    assert line in PAGE.splitlines()
    assert "no" not in line


def test_every_alternative_has_its_row() -> None:
    """The numbers of the others may differ in the last digit from machine to machine; the verdicts are in the page."""
    for sample_time, derivative, q in CHOICES:
        assert f"| {1e3 * sample_time:g} ms | {derivative} | {'yes' if q else 'no'} |" in PAGE
