"""No comparison that decides what is missing holds a number without a name: a name says what it stands for.

And there are no more of them, nor of what else a reader of `identify` has to know: its size goes down only.
"""

import ast
from collections.abc import Iterator
from dataclasses import fields
from pathlib import Path

from dsd_cli.identify.policy import Policy

IDENTIFY = Path(__file__).parents[2] / "dsd_cli" / "identify"
#: Where it is decided what is missing.
ROOMS = ("compare", "fit", "recordings", "roles", "search", "verdict")
FILES = sorted([*IDENTIFY.glob("*.py"), *(path for room in ROOMS for path in (IDENTIFY / room).rglob("*.py"))])
#: None, one and two of something; no division by zero; percent.
PLAIN = {0, 1, 2, 1e-300, 100}


def _unnamed(source: str) -> Iterator[float]:
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Compare):
            for part in ast.walk(node):
                if isinstance(part, ast.Constant) and isinstance(part.value, int | float) and part.value not in PLAIN:
                    yield part.value


def test_numbers_in_conditions_have_names() -> None:
    found = {str(path.relative_to(IDENTIFY)): list(_unnamed(path.read_text("utf-8"))) for path in FILES}
    assert {path: numbers for path, numbers in found.items() if numbers} == {}


def test_a_number_is_found_wherever_it_stands_in_a_condition() -> None:
    assert list(_unnamed("if a < 0.3 * b and c > max(d, 5): e = 7")) == [0.3, 5]


#: What `identify` may have at most. Who makes it smaller lowers this; 55, 9,000 and 110 are what is aimed at.
MOST_FILES, MOST_LINES, MOST_THRESHOLDS = 146, 23_687, 126


def test_identify_grows_no_further() -> None:
    files = list(IDENTIFY.rglob("*.py"))
    assert len(files) <= MOST_FILES
    assert sum(len(path.read_text("utf-8").splitlines()) for path in files) <= MOST_LINES
    assert len(fields(Policy)) <= MOST_THRESHOLDS
