"""What a controller takes: C equals Python, the feed-forward is the simulator turned round."""

import shutil
import subprocess
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from dsd_cli.export.base import Joint, Motion
from dsd_cli.export.computing import compiled
from dsd_cli.export.motion import simulated
from dsd_cli.export.targets import get_target
from tests.export.cases import TOGETHER, joint

GCC = pytest.mark.skipif(shutil.which("gcc") is None, reason="no gcc")
MAIN = """#include <stdio.h>
#include "joint.h"
int main(void)
{
    joint_effects a, b, c;
    double x[6];
    joint_effects_init(&a, 0.1, 0.0);
    joint_effects_init(&b, 0.1, 0.0);
    joint_effects_init(&c, 0.1, 0.0);
    while (fread(x, sizeof *x, 6, stdin) == 6) {
        double y[3];
        y[0] = joint_feedforward(&a, x[0], x[2], x[3], x[4]);
        y[1] = joint_compensation(&b, x[0], x[1], x[2], x[3], x[5]);
        y[2] = joint_friction(&c, x[0], x[1], x[2], x[3]);
        fwrite(y, sizeof *y, 3, stdout);
    }
    return 0;
}
"""


def module(one: Joint) -> ModuleType:
    found = ModuleType("joint")
    exec(get_target("python").write(one).decode(), found.__dict__)
    return found


def rows(seed: int, sample_time: float, count: int = 300) -> np.ndarray:
    """t, u, q, v, a, direction: a motion with reversals, with v = 0 here and there."""
    rng = np.random.default_rng(seed)
    t = np.arange(count) * sample_time
    v = 2.0 * np.sin(11.0 * t)
    v[rng.random(count) < 0.2] = 0.0
    q = 0.1 + np.cumsum(v) * sample_time
    u, a, direction = rng.normal(0.0, 2.0, (3, count))
    direction[::7] = 0.0
    return np.stack([t, u, q, v, a, direction], axis=1)


@GCC
@pytest.mark.parametrize("effects", TOGETHER, ids=lambda names: names[0])
def test_c_equals_python(effects: tuple[str, ...], tmp_path: Path) -> None:
    one = joint(*effects)
    given = rows(1, one.sample_time)
    header = get_target("c").write(one).decode()
    program = compiled({"joint.h": header, "main.c": MAIN}, tmp_path)
    done = subprocess.run([str(program)], input=given.tobytes(), capture_output=True, check=True)
    in_c = np.frombuffer(done.stdout).reshape(-1, 3)
    a, b, c = (module(one).Effects(0.1, 0.0) for _ in range(3))
    in_python = np.array(
        [
            (a.feedforward(t, q, v, acc), b.compensation(t, u, q, v, way), c.friction(t, u, q, v))
            for t, u, q, v, acc, way in given.tolist()
        ]
    )
    assert np.abs(in_c - in_python).max() <= 1e-12 * np.abs(in_python).max()
    assert np.abs(in_python).max(axis=0).min() > 0.0


@pytest.mark.parametrize(
    ("effects", "most"),
    [
        (("viscous_friction", "coulomb_friction", "gravity"), 0.02),
        (("load_friction", "stribeck_friction", "stiffness"), 0.02),
        (("dead_zone", "quadratic_drag", "cogging"), 0.02),
        (("presliding_friction", "constant_load"), 0.02),
        (("flexible_coupling",), 0.02),
        (("hysteresis", "friction_curve"), 0.02),
        (("inertia_curve",), 0.02),
        (("curve over velocity and position", "viscous_friction"), 0.02),
    ],
    ids=lambda value: value[0] if isinstance(value, tuple) else "",
)
def test_the_feed_forward_makes_the_reference(effects: tuple[str, ...], most: float) -> None:
    """The simulator, which knows nothing of it, moves as wanted under that u; without it the axis does not."""
    step = 1e-3
    one = joint(*effects, delay=0.0, sample_time=step)
    t = (np.arange(600) + 0.5) * step
    w = 2.0 * np.pi * 2.0
    q, v, a = 0.5 * (1.0 - np.cos(w * t)), 0.5 * w * np.sin(w * t), 0.5 * w * w * np.cos(w * t)
    law = module(one).Effects(0.0, 0.0)
    u = [
        law.feedforward(s - 0.5 * step, *x)
        for s, *x in zip(t.tolist(), q.tolist(), v.tolist(), a.tolist(), strict=True)
    ]
    wanted = 0.5 * w * np.sin(w * np.arange(600) * step)

    def error(command: np.ndarray) -> float:
        speed = simulated(one.model, Motion(command, step)).velocity
        return float(np.sqrt(np.mean((speed - wanted) ** 2) / np.mean(wanted**2)))

    assert error(np.array(u)) <= most
    assert error(one.model.inertia * a) > 2.0 * error(np.array(u))


def test_friction_at_rest_is_what_it_holds() -> None:
    law = module(joint("coulomb_friction", "constant_load")).Effects()
    assert law.friction(0.0, 0.1, 0.0, 0.0) == pytest.approx(-0.3)  # 0.1 and the load of 0.2
    assert law.friction(0.0, 5.0, 0.0, 0.0) == pytest.approx(-0.5)
    assert law.friction(0.0, 0.0, 0.0, 1.0) == pytest.approx(-0.5)
    assert law.friction(0.0, 0.0, 0.0, -1.0) == pytest.approx(0.5)


def test_compensation_cancels_all_effects() -> None:
    law = module(joint("coulomb_friction", "constant_load", "viscous_friction")).Effects()
    assert law.compensation(0.0, 0.0, 0.0, 2.0, 0.0) == pytest.approx(0.5 - 0.2 + 0.3 * 2.0)
    assert law.compensation(0.0, 0.0, 0.0, 0.0, -1.0) == pytest.approx(-0.5 - 0.2)


def test_a_dead_zone_is_stepped_over_and_a_limit_is_left_alone() -> None:
    law = module(joint("dead_zone", "constant_load")).Effects()
    assert law.compensation(0.0, 0.0, 0.0, 0.0, 0.0) == pytest.approx(-0.2 - 0.3, rel=1e-12)
    law = module(joint("saturation")).Effects()
    assert law.feedforward(0.0, 0.0, 0.0, 100.0) == pytest.approx(50.0)
