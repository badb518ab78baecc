"""Friction takes power out of an axis, whichever way it moves."""

from __future__ import annotations

import numpy as np

from dsd_cli.effects import Channels, Role, get_effect
from dsd_cli.identify.fit.solve import Fit
from dsd_cli.identify.search.sets import Search

#: Times the top speed: there dry friction, which has one level, is little beside what grows with the speed.
BEYOND_DRY = 1e3


def drives_along(search: Search, fit: Fit) -> bool:
    """Whether the laws of the speed of a set, together, would push the axis along in one direction: what makes viscous
    friction differ between the directions is there only beside that friction. A log of one direction does not show
    that."""
    speed = BEYOND_DRY * search.ranges.top_speed * np.array([-1.0, 1.0])
    zero, power = np.zeros(2), np.zeros(2)
    for name, values in search.problem.scale.model(fit).effects.items():
        effect = get_effect(name)
        if tuple(effect.needs) == ("velocity",) and not effect.memory:
            force, _ = effect.force(Channels(zero, zero, speed, zero), values)
            power += -np.abs(speed) * force if effect.role is Role.FRICTION else speed * force
    return bool(power.max() > 0.0)
