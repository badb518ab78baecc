"""What a log says against what the user told of values: said once, and at the end of a verdict."""

from dataclasses import replace

from dsd_cli.identify.results import Estimate
from dsd_cli.identify.verdict.contradictions import Contradiction
from dsd_cli.report.prior_conflicts import first_of_all, once
from dsd_cli.report.values_table import correlation_lines
from tests.report.examples import DIAGNOSIS

BOUND = Contradiction.of("coulomb_friction.level", "bound", "stands on its upper bound, 0.1: the log asks for more")


def held(error, sigma):
    return Contradiction.of("inertia", "held", f"is held at 0.013; this log alone says 0.01 +- {error} ({sigma} off)")


def prior(value):
    return Contradiction.of("inertia", "prior", f"= {value} pulls against its prior 0.013 +- 0.0003 by 9.1 sigma")


def test_of_a_value_the_last_fit_says_it():
    first, last = held("5e-07", "5817.2"), held("4e-07", "6439.4")
    assert once([first, "the log has a gap", BOUND, last, "the log has a gap"]) == (last, "the log has a gap", BOUND)
    assert once([prior(0.0101), prior(0.0102)]) == (prior(0.0102),)
    assert len(once([prior(0.0101), BOUND, held(1, 2)])) == 3


def end(*warnings, **more):
    return first_of_all(replace(DIAGNOSIS, warnings=warnings, **more))


def test_the_end_of_a_verdict_names_each_value_once():
    assert end() == end("the log has a gap") == ""
    said = end(held(1, 2), prior(0.0101), BOUND, "the log has a gap")
    assert said == "; this log contradicts the given values of inertia and coulomb_friction.level: look at that first"
    beside = {"stribeck_friction": ("coulomb_friction.level",)}
    assert end(BOUND, stand_ins=beside).endswith(" look at that first (stribeck_friction may only stand in for that)")


def test_a_prior_that_gave_way_is_nothing_to_look_at_first():
    soft = Contradiction.of("inertia", "prior", "= 0.01 pulls against its prior 0.012 +- 0.0002", hard=False)
    assert end(soft) == "; this log is against the prior of inertia, which gave way"
    assert "look at that first" in end(soft, BOUND)


def test_values_of_which_a_log_leaves_one_open_are_named_with_what_they_go_with():
    pair = ("coulomb_friction.level", "constant_load.force", -0.97)
    sure, weak = Estimate(1.0, 0.01, "u", grade="identified"), Estimate(1.0, 0.2, "u", grade="weak")
    said = "strongly correlated: coulomb_friction.level and constant_load.force (correlation -0.97)"
    assert correlation_lines((pair,), {pair[0]: sure, pair[1]: weak}) == [said]
    assert correlation_lines((pair,), {pair[0]: sure, pair[1]: sure}) == []
    assert correlation_lines((), {}) == []
