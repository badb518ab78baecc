"""Lines of two models stand beside each other by their periods, whatever their numbers."""

from dsd_cli.identify.compare.versus import paired, renamed
from dsd_cli.plant.model import PlantModel


def rig(*periods):
    lines = {f"cogging_{i + 1}" if i else "cogging": {"amplitude": 0.01, "periods": n, "phase": 0.0}
             for i, n in enumerate(periods)}  # fmt: skip
    return PlantModel(1.0, 0.0, {"coulomb_friction": {"level": 0.1}, **lines})


def test_the_same_line_under_another_number_is_found():
    assert paired(rig(40.0, 80.0), rig(40.0, 80.0)) == {}
    assert paired(rig(40.0, 80.0), rig(80.1, 40.0)) == {"cogging": "cogging_2", "cogging_2": "cogging"}


def test_a_line_that_the_other_lacks_stands_alone():
    assert paired(rig(40.0), rig(120.0, 40.0)) == {"cogging": "cogging_3", "cogging_2": "cogging"}
    assert paired(rig(40.0), rig(60.0)) == {"cogging": "cogging_2"}
    assert paired(rig(), rig(60.0)) == {}


def test_values_go_with_their_line():
    values = {"inertia": 1.0, "cogging.periods": 80.0, "cogging_2.periods": 40.0}
    names = {"cogging": "cogging_2", "cogging_2": "cogging"}
    assert renamed(values, names) == {"inertia": 1.0, "cogging_2.periods": 80.0, "cogging.periods": 40.0}
