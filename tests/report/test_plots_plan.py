"""What the pictures of a plan show: the motion with its limits, what is identified, what more seconds would bring."""

from dataclasses import replace
from itertools import pairwise

import numpy as np

from dsd_cli.design.limits import Limits
from dsd_cli.design.results import Motion, Plan, PlannedPair, Stage
from dsd_cli.report.figure import rendered
from dsd_cli.report.page.plan_part import plan_charts, plan_part
from dsd_cli.report.page.story import Outcome, Story
from dsd_cli.report.plots_plan import draw
from dsd_cli.signals.units import Units

T = np.arange(5001) * 0.001
Q = 0.9 * np.sin(2.0 * np.pi * T)
MOTION = Motion(0.001, Q, np.gradient(Q, T), np.gradient(np.gradient(Q, T), T), 0.01 * Q)
PLAN = Plan(
    ("a.csv",),
    "unknown",
    MOTION,
    (Stage("harmonics", 0.0, 5.0, {}),),
    (PlannedPair("gravity", "constant_load", 1.0, 80.0),),
    (),
    Limits(-1.0, 1.0, 6.0, 40.0, 400.0, 1.0, 0.0),
    cost=((5.0, 80.0), (10.0, 160.0)),
    not_counted=("drag",),
    warnings=("the simulated loop is unstable (kp 3, kd 1) with drag as the plant",),
)


def story(plan: Plan) -> Story:
    nothing = Outcome(None, "")
    return Story((), (), (), (), nothing, nothing, nothing, nothing, "", "", "", "", Units(), plan=Outcome(plan))


def lines(axis: object) -> int:
    return len(axis.get_lines())  # type: ignore[attr-defined]


def test_limits_that_are_near_are_drawn_and_the_others_are_not() -> None:
    position, velocity, u, *_ = draw(PLAN).axes
    assert [lines(axis) - 1 for axis in (position, velocity, u)] == [2, 2, 0]
    charts = plan_charts(story(PLAN))
    assert [len(chart["series"]) - 1 for chart in charts.values()] == [2, 2, 0]
    (curve,) = charts["plan-0"]["series"][0]["data"]
    assert max(curve[1]) == 0.9


def test_what_more_seconds_bring_is_drawn_where_they_were_asked_for() -> None:
    assert len(draw(PLAN).axes) == 1 + len(draw(replace(PLAN, cost=PLAN.cost[:1])).axes)
    curve = draw(PLAN).axes[-1].get_lines()[0].get_xydata()
    assert curve.tolist() == [[5.0, 80.0], [10.0, 160.0]]


def test_a_plan_for_what_is_unknown_has_no_panel_without_a_bar() -> None:
    assert len(draw(replace(PLAN, pairs=(), values=(), cost=())).axes) == 3


def test_no_label_of_an_axis_reaches_into_that_of_the_next() -> None:
    figures = []
    rendered(lambda: figures.append(draw(replace(PLAN, cost=()))) or figures[0], ".png")
    boxes = [axis.yaxis.label.get_window_extent() for axis in figures[0].axes[:3]]
    assert all(below.y1 + 4.0 < above.y0 for above, below in pairwise(boxes))


def test_the_page_says_who_was_not_counted_and_why() -> None:
    text = str(plan_part(story(PLAN)))
    assert "not counted, for it breaks a limit on every motion: drag" in text
    assert "the simulated loop is unstable (kp 3, kd 1) with drag as the plant" in text
    assert all(f'data-chart="{name}"' in text for name in plan_charts(story(PLAN)))


def test_without_a_motion_there_is_no_picture_of_one() -> None:
    still = replace(PLAN, motion=None, stages=(), cost=())
    assert plan_charts(story(still)) == {}
    assert len(draw(still).axes) == 1
