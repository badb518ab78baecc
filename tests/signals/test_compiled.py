"""Modules that a build may lack."""

import math

import pytest

from dsd_cli.signals.compiled import compiled_module


@pytest.mark.parametrize(
    ("module", "newest", "found"),
    [("math", "", math), ("math", "sin", math), ("math", "sine_of_a_newer_build", None), ("dsd_cli.no_such", "", None)],
)
def test_a_module_is_found_where_it_is_built_and_new_enough(module, newest, found):
    assert compiled_module(module, newest) is found
