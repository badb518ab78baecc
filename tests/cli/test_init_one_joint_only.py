"""Channels that one joint has and another has not: u and the motion are of one joint all the same."""

from pathlib import Path

import numpy as np
import pytest

from dsd_cli.files.joints import joints_of
from dsd_cli.files.recognise import recognise
from tests.cli.test_init_joints import AXIS, SIZE, written

RNG = np.random.default_rng(5)
STILL = 1e-3 * RNG.standard_normal(SIZE)


def names(found: dict[str, str]) -> dict[str, str]:
    return {role: found[role] for role in ("u", "position", "velocity") if found.get(role)}


@pytest.mark.parametrize(
    "form", ["J{}.{}", "{1}{0}", "arm/{}/{}", "{1}_{0} [x]"], ids=["before", "behind", "group", "with units"]
)
def test_a_speed_that_only_the_other_joint_has_is_not_taken(form: str, tmp_path: Path) -> None:
    """Joint 1 moves and has no speed of its own; that of joint 2, which rests, would belong to no motion of it."""
    called = {
        (1, "Torque"): AXIS["u"],
        (1, "Pos"): AXIS["q"],
        (2, "Torque"): STILL,
        (2, "Pos"): np.cumsum(STILL) * 1e-3,
        (2, "Vel"): STILL,
    }
    table = {"t": AXIS["t"], **{form.format(*key).replace(" [x]", ""): values for key, values in called.items()}}
    said, _, found = written(tmp_path, table)
    one = {role: form.format(1, name).replace(" [x]", "") for role, name in (("u", "Torque"), ("position", "Pos"))}
    assert names(found) == one
    assert "joint 1 of 2: it moves most (standard deviation of position: 1 " in said


def test_joints_are_compared_by_a_channel_that_each_of_them_has(tmp_path: Path) -> None:
    """The speed of the one that moves is no measure of the other, which has none: it would be compared with itself."""
    table = {"t": AXIS["t"], "J2.Torque": AXIS["u"], "J2.Pos": AXIS["q"], "J2.Vel": AXIS["v"]}
    said, _, found = written(tmp_path, table | {"J1.Torque": STILL, "J1.Pos": np.full(SIZE, 12.0)})
    assert names(found) == {"u": "J2.Torque", "position": "J2.Pos", "velocity": "J2.Vel"}
    assert f"position: 2 {np.std(AXIS['q']):.3g}, 1 0)" in said


def test_nor_with_a_torque_that_only_one_joint_has(tmp_path: Path) -> None:
    """u of joint 1 names its joint though no other torque is there."""
    table = {"t": AXIS["t"], "J1.Torque": AXIS["u"], "J1.Pos": AXIS["q"]}
    _, _, found = written(tmp_path, table | {"J2.Pos": np.cumsum(STILL) * 1e-3, "J2.Vel": STILL})
    assert names(found) == {"u": "J1.Torque", "position": "J1.Pos"}


def test_nor_where_no_two_joints_have_the_same_motion(tmp_path: Path) -> None:
    table = {"t": AXIS["t"], "J1.Torque": AXIS["u"], "J1.Pos": AXIS["q"], "J2.Torque": STILL, "J2.Vel": STILL}
    _, _, found = written(tmp_path, table)
    assert len({column[:2] for column in names(found).values()}) == 1


def test_the_number_in_a_unit_is_no_joint() -> None:
    columns = ["Torque1", "Torque2", "Pos1", "Pos2", "Speed [1/min]"]
    joints = joints_of(columns, recognise(columns))
    assert joints == {"1": {"Torque1", "Pos1"}, "2": {"Torque2", "Pos2"}}
