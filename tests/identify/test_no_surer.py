"""What is said of a verdict is no surer than what stands against it."""

from dataclasses import replace

import pytest

from dsd_cli.identify.fit.testability import Settings
from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.results import Unexplained
from dsd_cli.identify.verdict.contradictions import Contradiction, beside_told, no_surer
from dsd_cli.identify.verdict.diagnose import diagnose
from tests.identify.search_rig import BELIEVED, OBSERVER, seen
from tests.report.examples import DIAGNOSIS

SETTINGS = Settings(effects=("viscous_friction", "coulomb_friction", "constant_load", "gravity"))


@pytest.fixture(scope="module")
def found():
    return diagnose([seen({"viscous_friction": {"coefficient": 0.02}})], BELIEVED, OBSERVER, SETTINGS)


def test_beside_a_value_that_the_log_contradicts_the_set_is_no_surer_than_the_verdict(found):
    again = beside_told(found, [Contradiction.of("inertia", "held", "is held at 2; this log alone says 1")])
    said = [one.probability for one in (again, *again.ranking, *again.missing)]
    assert again.missing
    assert max(said) == POLICY.even
    assert beside_told(found, ["a warning"]) == found


def test_where_nothing_is_missing_what_is_left_is_as_likely_as_the_doubt():
    again = no_surer(replace(DIAGNOSIS, verdict="none", probability=0.99, unexplained=Unexplained(0.01, 0.1)), 0.3)
    assert again.probability == 0.3
    assert again.unexplained.probability >= 0.7
