"""What no motion settles."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from dsd_cli.design.impossible import not_by_motion
from dsd_cli.identify.results import Unexplained


@pytest.mark.parametrize(("probability", "planned"), [(0.86, False), (0.2, True), (np.nan, True)])
def test_what_no_law_describes_is_said_where_a_motion_is_planned(probability: float, planned: bool) -> None:
    """ "Nothing is left open", said the plan of a log of which the diagnosis says that more is missing."""
    problem = SimpleNamespace(recordings=(), untestable={})
    search: Any = SimpleNamespace(solver=SimpleNamespace(known=SimpleNamespace(fixed={}, priors={})), problem=problem)
    targets: Any = SimpleNamespace(asked=(), unknown=False)
    diagnosis: Any = SimpleNamespace(verdict="coulomb_friction", unexplained=Unexplained(0.05, probability))
    found = not_by_motion(search, targets, diagnosis)
    assert (found == []) is planned
    assert all("5 % of u" in one.what and "no effect of the catalogue" in one.remedy for one in found)
