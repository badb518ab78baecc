"""A published axis (EMPS): its values hold their limits, a wrong one does not, and MuJoCo moves as `dsd simulate`."""

import json
from pathlib import Path

import pytest

from tests.cli.rig import done, dsd
from tests.recordings import recording

#: A. Janot, M. Gautier, M. Brunot, 2019: M, viscous, Coulomb, offset.
AXIS = """
[signals]
time = "t_s"
u = "force_N"
position = "position_m"
position_unit = "m"
u_unit = "N"
[observer]
nominal_inertia = 95.1089
time_constant = 0.005
[model]
inertia = 95.1089
[model.effects.viscous_friction]
coefficient = 203.5034
[model.effects.coulomb_friction]
level = 20.3935
[model.effects.constant_load]
force = 3.1648
"""
LIMITS = """
[limits]
inertia = "within 5 %"
[limits.viscous_friction]
coefficient = "within 15 %"
[limits.coulomb_friction]
level = "within 15 %"
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("emps")
    (folder / "emps.toml").write_text(AXIS)
    (folder / "limits.toml").write_text(LIMITS)
    return folder


def test_the_published_values_are_within_and_a_wrong_friction_is_not(folder: Path) -> None:
    command = ("passport", "emps.toml", recording("emps/emps_train.csv"), "--limits", "limits.toml", "--format", "json")
    signed = json.loads(done(*command, "-q", cwd=folder).stdout)
    assert [one["verdict"] for one in signed["limits"]] == ["within"] * 3
    ran = dsd(*command, "-q", "--set", "model.effects.coulomb_friction.level=14", cwd=folder)
    assert ran.returncode == 3
    assert "coulomb_friction.level" in ran.stderr
    assert [one["verdict"] for one in json.loads(ran.stdout)["limits"]] == ["within", "within", "outside"]


def test_mujoco_moves_as_dsd_simulate_under_the_u_of_the_log(folder: Path) -> None:
    pytest.importorskip("mujoco", minversion="4.0", reason="dsd-cli[sim] is not installed")
    log = recording("emps/emps_train.csv")
    ran = done(
        "export", "emps.toml", "--to", "mjcf", "-o", "joint.xml", "--verify", log, "--format", "json", cwd=folder
    )
    verified = json.loads(ran.stdout)["verify"]
    assert verified["ran"]
    assert verified["rms_percent"] <= 1.0
    again = done("import", "joint.xml", "-o", "again.toml", "--format", "json", cwd=folder)
    model = json.loads(again.stdout)["model"]
    assert model["inertia"] == 95.1089
    assert model["effects"]["constant_load"]["force"] == pytest.approx(3.1648, rel=1e-9)
