"""A learnt law is drawn as the force on the axis, as every other picture has it."""

import numpy as np
import pytest

from dsd_cli.learn.results import Curve, View
from dsd_cli.report.learning import as_forces

SPEED = (-2.0, -1.0, 0.0, 1.0, 2.0)


def curve(effect: str, level: np.ndarray, channel: str = "velocity") -> tuple[Curve, View]:
    low, high = level - 0.01, level + 0.02
    at = np.array([-1.5, -0.5, 0.5, 1.5])
    points = np.interp(at, SPEED, level)
    way, nothing = np.sign(at), np.zeros(4)
    made = Curve(effect, (channel,), (SPEED,), tuple(level), tuple(low), tuple(high), "{u}")
    return made, View(channel, at, way, -way * points, nothing, points)


def test_friction_is_negative_over_a_positive_velocity() -> None:
    """Its level was drawn, positive both ways, beside the missing force, which is not."""
    level = 0.3 + 0.1 * np.abs(SPEED)
    force, view = as_forces(*curve("friction_curve", level))
    assert force.values == pytest.approx(-np.sign(SPEED) * level)
    assert view.points == pytest.approx(view.before)
    moving = np.array(SPEED) != 0.0
    assert (np.array(force.low) <= force.values)[moving].all()
    assert (np.array(force.high) >= force.values)[moving].all()
    width = np.array(force.high) - np.array(force.low)
    assert width[moving] == pytest.approx(0.03)


@pytest.mark.parametrize(("effect", "channel"), [("curve", "velocity"), ("friction_curve", "position")])
def test_a_force_and_a_level_over_the_position_stay(effect: str, channel: str) -> None:
    given = curve(effect, -0.2 * np.array(SPEED), channel)
    assert as_forces(*given) == given
