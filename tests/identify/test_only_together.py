"""Effects that lower the held-out error only together are named together."""

import numpy as np
import pytest

from dsd_cli.identify.fit.testability import Settings
from dsd_cli.identify.recordings.recording import prepare
from dsd_cli.identify.verdict.diagnose import diagnose
from dsd_cli.plant.model import ObserverSettings, PlantModel
from dsd_cli.signals.log import Log

STEP, FINE, COUNT, LATE = 0.002, 20, 1e-5, 4
INERTIA, WIDTH, LEVEL, VISCOUS = 0.22, 0.12, 0.26, 1.4


def _wanted(rng, n: int):
    """Moves at constant speeds with rests, m."""
    speed: list[float] = []
    while len(speed) < n:
        ramp, flat = int(0.1 / STEP), int(rng.uniform(0.1, 1.5) / STEP)
        top = rng.uniform(0.1, 0.3) * (-1.0 if np.sum(speed) > 0.0 else 1.0)
        up = list(np.linspace(0.0, top, ramp))
        speed += up + [top] * flat + up[::-1] + [0.0] * int(rng.uniform(0.05, 0.5) / STEP)
    return np.cumsum(speed[:n]) * STEP


def _log(seed: int, seconds: float = 14.0) -> Log:
    """The axis of a valve, m and kN, whose controller sees counts, behind a delay; friction holds it exactly."""
    rng, n, h = np.random.default_rng(seed), int(seconds / STEP), STEP / FINE
    wanted = _wanted(rng, n)
    q = v = slow = sum_of = 0.0
    u, seen = np.zeros(n), np.zeros(n)
    for i in range(n):
        seen[i] = COUNT * round(q / COUNT)
        slow += 0.2 * ((seen[i] - seen[max(i - 1, 0)]) / STEP - slow)
        error = 8.0 * (wanted[i] - seen[i]) - slow
        sum_of += 5.0 * error * STEP
        u[i] = 7.0 * (error + sum_of)
        late = u[max(i - LATE, 0)]
        drive = np.sign(late) * max(abs(late) - WIDTH, 0.0)
        for _ in range(FINE):
            if v == 0.0 and abs(drive) <= LEVEL:
                continue
            side = np.sign(v) if v else np.sign(drive)
            later = v + h / INERTIA * (drive - LEVEL * side - VISCOUS * v)
            v = 0.0 if later * side < 0.0 else later
            q += h * v
    return Log({"t": STEP * np.arange(n), "u": u, "position": seen}, STEP, "valve.csv")


@pytest.mark.parametrize("seed", [2, 5])
def test_friction_beside_a_dead_zone_of_the_model(seed):
    """Alone, Coulomb friction is taken up by the dead zone, and each raises the error that values would leave."""
    model = PlantModel(1.033 * INERTIA, 0.94 * LATE * STEP, {"dead_zone": {"width": 0.94 * WIDTH}})
    observer = ObserverSettings(INERTIA, 0.02)
    found = diagnose([prepare(_log(seed), observer)], model, observer, Settings())
    likely = {m.effect: m.probability for m in found.missing}
    assert set(likely) == {"coulomb_friction", "viscous_friction"}
    assert likely["viscous_friction"] > 0.9
    assert likely["coulomb_friction"] >= 0.5  # of 20 other logs even odds in 13: more of the dead zone does it as well
    value = {name: estimate.value for name, estimate in found.whole_values.items()}
    assert value["viscous_friction.coefficient"] == pytest.approx(VISCOUS, rel=0.03)
    # while u pushes the way the axis goes only their sum is identifiable
    assert value["coulomb_friction.level"] + value["dead_zone.width"] == pytest.approx(LEVEL + WIDTH, rel=0.03)
