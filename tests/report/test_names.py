"""Values, units and changes in words."""

import math

import pytest

from dsd_cli.effects import catalogue
from dsd_cli.identify.results import Estimate
from dsd_cli.report.names import change_text, estimate_text, estimates_json, fall_text, in_words, listed, values_text

NAN = math.nan


@pytest.mark.parametrize(
    ("value", "error", "unit", "text"),
    [
        (0.5234, 0.03, "{u}", "0.52 +- 0.03 u"),
        (0.5234, 0.0134, "{u}/({v})", "0.523 +- 0.013 u/v"),
        (123.4, 20.0, "", "123 +- 20"),
        (0.5234, NAN, "{u}", "0.5234 u"),
        (0.5234, math.inf, "1", "0.5234"),
        (-3e-6, 2e-6, "s", "-3e-06 +- 2e-06 s"),
        (1.234567e8, 1.2e4, "{q}", "1.23457e+08 +- 1.2e+04 q"),
        (0.0, 0.5, "", "0.0 +- 0.5"),
        (NAN, NAN, "s", "nan s"),
    ],
)
def test_a_value_has_the_digits_that_its_error_deserves(value: float, error: float, unit: str, text: str) -> None:
    assert estimate_text(Estimate(value, error, unit)) == text


def test_a_value_on_its_bound_says_so() -> None:
    assert estimate_text(Estimate(1.0, 0.3, "s", at_bound=True)) == "1.0 +- 0.3 s (at its bound)"


def test_values_of_an_effect_are_named_and_inertia_stands_alone() -> None:
    one = Estimate(1.0, 0.3, "{u}")
    assert values_text({"level": one, "velocity": one}) == "level 1.0 +- 0.3 u, velocity 1.0 +- 0.3 u"
    assert values_text({"inertia": one}) == "1.0 +- 0.3 u"
    assert values_text({}) == ""


@pytest.mark.parametrize("unit", sorted({p.unit for e in catalogue().values() for p in e.parameters}))
def test_no_placeholder_is_left_in_a_unit(unit: str) -> None:
    assert not set("{}") & set(in_words(unit))


@pytest.mark.parametrize(
    ("before", "after", "change", "fall"),
    [
        (0.4, 0.1, "-75 %", "75 %"),
        (0.4, 0.39, "-2.5 %", "2.5 %"),
        (0.4, 0.41, "+2.5 %", "rises 2.5 %"),
        (1.0, 0.0011, "-99.9 %", "99.9 %"),
        (0.4, 0.40000001, "-0.0 %", "0.0 %"),
        (0.0, 0.1, "-", "-"),
        (NAN, 0.1, "-", "-"),
        (0.1, NAN, "-", "-"),
    ],
)
def test_changes(before: float, after: float, change: str, fall: str) -> None:
    assert (change_text(before, after), fall_text(before, after)) == (change, fall)


def test_json_has_no_nan_and_units_in_words() -> None:
    assert estimates_json({"x": Estimate(NAN, math.inf, "{u}/({v})", at_bound=True)}) == {
        "x": {"value": None, "std_error": None, "unit": "u/v", "at_bound": True}
    }


def test_lists_in_words() -> None:
    assert (listed(["a"]), listed("ab"), listed("abc", "or")) == ("a", "a and b", "a, b or c")
