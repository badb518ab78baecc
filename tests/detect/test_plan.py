"""What the detector cannot compute for every state is refused, in one line that says why."""

import pytest

from dsd_cli.detect.grid import Grid
from dsd_cli.detect.plan import Plan
from dsd_cli.detect.settings import DetectorSettings
from dsd_cli.effects import Role, catalogue
from dsd_cli.errors import UsageError
from dsd_cli.plant.model import ObserverSettings, PlantModel

REFUSED = {
    "dead_zone": "changes the command",
    "saturation": "changes the command",
    "actuator_lag": "changes the command",
    "flexible_coupling": "hangs a load",
    "backlash": "hangs a load",
    "presliding_friction": "has memory",
    "load_friction": "looks at the command",
    "gain_droop": "looks at the command",
}


def plan(name, axes=None):
    effect = catalogue()[name]
    values = {p.name: [] if p.listed else min(max(0.5, p.lower), p.upper) for p in effect.parameters}
    grid = Grid((0.0, 0.1), (1.0,), axes or {})
    return Plan(grid, DetectorSettings(), PlantModel(effects={name: values}), ObserverSettings())


@pytest.mark.parametrize(("name", "why"), REFUSED.items())
def test_refused_in_the_model(name, why):
    with pytest.raises(UsageError, match=f"cannot take {name} yet: .*{why}"):
        plan(name)


def test_refused_as_an_axis():
    with pytest.raises(UsageError, match="cannot take dead_zone yet"):
        plan("viscous_friction", {"dead_zone.width": (0.1, 0.2)})


@pytest.mark.parametrize("name", sorted(set(catalogue()) - set(REFUSED)))
def test_all_others_are_taken(name):
    assert catalogue()[name].role in (Role.APPLIED, Role.FRICTION)
    plan(name)
