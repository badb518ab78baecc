"""A law that acts where the axis turns is one all the same, if more of it is left elsewhere than the sensor leaves."""

from bench.learn import recording_of
from dsd_cli.identify.fit.problem import pose
from dsd_cli.identify.fit.testability import Settings
from dsd_cli.learn.choose import choose
from dsd_cli.learn.rows import balance_of
from tests.oracle.rig_strange import make


def test_an_end_stop_that_is_met_at_the_turns_alone_is_a_law():
    """13 % of u is left of it at the turns, 0.9 % where the axis certainly moves, six times what the sensor leaves."""
    recording, model = recording_of(make("end_stop", 1502, "speed40k", "sines"))
    chosen = choose(balance_of(pose([recording], model, Settings())))
    assert not chosen.refused
    assert [law.family.name for law in chosen.fit.laws] == ["a function of the position"]
