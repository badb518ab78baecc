"""docs/how/policy.md says what the policy has: every threshold, its value, its unit and reason."""

import importlib.util
import re
from dataclasses import FrozenInstanceError, fields
from pathlib import Path

import pytest

from dsd_cli.identify.policy import POLICY, Policy

HERE = Path(__file__)
PAGE = HERE.parents[2] / "docs/how/policy.md"
ROW = re.compile(r"\| `(?P<name>\w+)` \| (?P<value>[^|]+) \| (?P<why>.+) \|")


@pytest.fixture(scope="module")
def made():
    spec = importlib.util.spec_from_file_location("policy_page", HERE.with_name("policy_page.py"))
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def rows():
    return [m for line in PAGE.read_text(encoding="utf-8").splitlines() if (m := ROW.fullmatch(line))]


def test_the_page_is_current(made):
    page = PAGE.read_text(encoding="utf-8").splitlines()
    assert page == list(made.page()), "run: python tests/docs/policy_page.py > docs/how/policy.md"


def test_every_threshold_is_on_the_page_once_with_its_value(rows):
    """Read from the page alone, against the dataclass."""
    shown = {row["name"]: [float(x) for x in row["value"].split(",")] for row in rows}
    assert len(shown) == len(rows)
    values = {f.name: getattr(POLICY, f.name) for f in fields(Policy)}
    assert shown == {name: list(value) if isinstance(value, tuple) else [value] for name, value in values.items()}


def test_every_threshold_says_its_reason(made):
    assert made.without_reason() == []
    assert all(len(why.split()) >= 1 for why in made.reasons().values())


def test_thresholds_in_seconds_or_hertz_say_so(made):
    reasons = made.reasons()
    assert reasons["least_band_hz"].startswith("Hz")
    for name in ("least_delay_range", "longest_delay"):
        assert reasons[name].split()[0].rstrip(";,") == "s", name


def test_the_policy_is_frozen_and_its_own_default():
    assert Policy() == POLICY
    with pytest.raises(FrozenInstanceError):
        POLICY.least_fall = 0.5


def test_shares_are_between_0_and_1():
    for name in ("highest_share", "flattest", "least_free", "exercised", "least_fall", "least_force", "much_force"):
        assert 0.0 < getattr(POLICY, name) < 1.0, name


def test_orders_that_the_reasons_rest_on():
    assert POLICY.least_force < POLICY.much_force
    assert POLICY.least_delay_range < POLICY.longest_delay
    assert POLICY.highest_share < 0.5  # of the sample rate: Nyquist
    assert POLICY.signal_over_noise > 1.0
    assert POLICY.stands_out > 1.0


def test_no_threshold_is_without_use():
    sources = (HERE.parents[2] / "dsd_cli").rglob("*.py")
    used = {name for path in sources for name in re.findall(r"\bPOLICY\.(\w+)", path.read_text(encoding="utf-8"))}
    assert used == {f.name for f in fields(Policy)}
