"""The figures of docs/plan.md out of the rows of `python -m bench plan`."""

from bench.plan import page


def test_limits_and_what_no_motion_identifies_are_figures_of_the_page():
    limits = [{"plans": 5, "broken": [{"u": 0.1}]}, {"plans": 4, "broken": [{"u": 0.02}, {"velocity": 0.08}]}]
    hardly, pushed = "load friction, pushed hardly", "load friction, pushed"
    impossible = [{"gain": True, hardly: True, pushed: False}, {"gain": False, hardly: True, pushed: True}]
    lines = page({"limits": limits, "impossible": impossible})
    assert "a limit broken by one of five plans of a log: 3 of 9 plans" in lines
    assert "what no motion identifies is said: 3 of 4; and where one does: 1 of 2" in lines


def test_what_was_not_asked_is_no_fault():
    assert "loops settled: 0 of 0" in page({})
