"""Joints of simulators and tables of values, read as models: what `dsd export` wrote, and what others write."""

import json
import math
import tomllib
from pathlib import Path

import numpy as np
import pytest

from dsd_cli.errors import DataError, UsageError
from dsd_cli.export.making import make
from dsd_cli.export.motion import built_in
from dsd_cli.export.reading.joints import read_joint
from dsd_cli.export.targets import get_target
from tests.cli.rig import done, dsd, refused
from tests.export.test_simulators import INERTIA, NOT_IN_MUJOCO, STEP, VALUES, beside, joint

SAMPLES = Path(__file__).parents[2] / "sample_logs"
#: Effects that MJCF has under names of its own; tables come back as tables.
AS_TABLES = {"curve", "friction_curve", "stribeck_friction", "viscous_asymmetry"}

ARM = """<robot name="arm">
  <link name="base"/>
  <link name="upper"><inertial><origin xyz="0.2 0.03 0" rpy="0.3 0.2 0.1"/><mass value="2"/>
    <inertia ixx="0.03" iyy="0.04" izz="0.05" ixy="0.001" ixz="0.002" iyz="0.003"/></inertial></link>
  <link name="lower"><inertial><origin xyz="0.1 0 0.05"/><mass value="1"/>
    <inertia ixx="0.003" iyy="0.004" izz="0.005" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="tool"><inertial><mass value="0.5"/>
    <inertia ixx="0.001" iyy="0.001" izz="0.001" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="shoulder" type="revolute"><origin xyz="0 0 0.4" rpy="1.2 0 0.4"/>
    <parent link="base"/><child link="upper"/>
    <axis xyz="0 0.6 0.8"/><limit lower="-2" upper="2" effort="60" velocity="3"/>
    <dynamics damping="0.7" friction="0.3"/></joint>
  <joint name="elbow" type="revolute"><origin xyz="0.4 0 0" rpy="0 0.5 0"/><parent link="upper"/><child link="lower"/>
    <axis xyz="0 1 0"/><limit lower="-2" upper="2" effort="30" velocity="3"/></joint>
  <joint name="flange" type="fixed"><origin xyz="0.25 0 0" rpy="0 0 1"/>
    <parent link="lower"/><child link="tool"/></joint>
</robot>"""

ROBOT = """<mujoco>
  <compiler angle="radian"/>
  <default><joint armature="0.02" damping="0.4"/></default>
  <worldbody><body>
    <joint name="hip" axis="0 1 0" frictionloss="0.25" range="-1 1"/>
    <inertial pos="0 0 -0.3" mass="2" diaginertia="0.01 0.01 0.01"/>
    <body pos="0 0 -0.6"><joint name="knee" axis="0 1 0"/>
      <inertial pos="0 0 -0.2" mass="1" diaginertia="0.002 0.002 0.002"/></body>
  </body></worldbody>
  <actuator><motor name="drive" joint="hip" gear="50" ctrlrange="-1 1"/><position joint="knee" kp="20"/></actuator>
</mujoco>"""


def written(folder: Path, text: str, name: str = "joint.xml") -> Path:
    (folder / name).write_text(text)
    return folder / name


@pytest.mark.parametrize("linear", [False, True])
@pytest.mark.parametrize("effect", sorted(set(VALUES) - NOT_IN_MUJOCO))
def test_mjcf_comes_back_as_it_went(effect: str, linear: bool, tmp_path: Path) -> None:
    pytest.importorskip("mujoco", minversion="4.0", reason="dsd-cli[sim] is not installed")
    one = joint(beside(effect), delay=0.0023, linear=linear)
    content = make(get_target("mjcf"), one, built_in(one.model, STEP), False).content
    (tmp_path / "joint.xml").write_bytes(content)
    found = read_joint(tmp_path / "joint.xml", None)
    assert (found.name, found.linear, found.missed) == ("joint", linear, ())
    assert (found.model.inertia, found.model.delay) == pytest.approx((INERTIA, 0.0023), rel=1e-9)
    if effect in AS_TABLES:  # it does the same to the axis
        again = make(
            get_target("mjcf"), joint(dict(found.model.effects), 0.0023, linear), built_in(one.model, STEP), False
        )
        theirs, ours = (get_target("mjcf").run(c, one, built_in(one.model, STEP)) for c in (again.content, content))
        assert np.max(np.abs(theirs - ours)) < 2e-4 * np.max(np.abs(ours))
    elif effect == "gravity" and linear:  # a sine over metres is no weight
        (ripple,) = (v for name, v in found.model.effects.items() if name != "viscous_friction")
        assert (ripple["amplitude"], ripple["periods"]) == pytest.approx((0.3, 1.0))
    else:
        assert set(found.model.effects) == set(beside(effect))
        for parameter, value in VALUES[effect].items():
            assert found.model.effects[effect][parameter] == pytest.approx(value, rel=1e-6)


@pytest.mark.parametrize("effect", sorted(VALUES))
def test_a_table_of_values_comes_back_exactly(effect: str, tmp_path: Path) -> None:
    one = joint(beside(effect), delay=0.0023)
    (tmp_path / "v.csv").write_bytes(get_target("parameters").write(one))
    found = read_joint(tmp_path / "v.csv", None)
    assert found.model.inertia == INERTIA
    assert json.dumps(dict(found.model.effects[effect])) == json.dumps(dict(one.model.effects[effect]))


@pytest.mark.parametrize("name", ["shoulder", "elbow"])
def test_an_arm_of_urdf_has_the_inertia_and_the_weight_that_mujoco_finds(name: str, tmp_path: Path) -> None:
    mujoco = pytest.importorskip("mujoco", minversion="4.0", reason="dsd-cli[sim] is not installed")
    found = read_joint(written(tmp_path, ARM, "arm.urdf"), name)
    model = mujoco.MjModel.from_xml_string(ARM)
    data, j = mujoco.MjData(model), model.joint(name).id
    assert found.model.inertia == pytest.approx(model.dof_M0[j], rel=1e-9)
    weight = found.model.effects["gravity"]
    for q in (0.0, 0.4, -1.5):
        data.qpos[:] = 0.0
        data.qpos[j] = q
        mujoco.mj_forward(model, data)
        assert weight["amplitude"] * math.sin(q + weight["phase"]) == pytest.approx(data.qfrc_bias[j], rel=1e-9)
    if name == "shoulder":
        effects = found.model.effects
        assert effects["viscous_friction"]["coefficient"] == 0.7
        assert (effects["coulomb_friction"]["level"], effects["saturation"]["limit"]) == (0.3, 60.0)
        assert "inertia with elbow held where the file has them" in found.notes
    assert any("end stops at -2 and 2 rad" in one for one in found.missed)
    assert any("limit of the speed, 3" in one for one in found.missed)


def test_a_robot_of_mjcf_by_hand(tmp_path: Path) -> None:
    pytest.importorskip("mujoco", minversion="4.0", reason="dsd-cli[sim] is not installed")
    path = written(tmp_path, ROBOT)
    with pytest.raises(UsageError, match="has 2 joints: --joint names one of hip, knee"):
        read_joint(path, None)
    with pytest.raises(UsageError, match="--joint hipp: did you mean hip"):
        read_joint(path, "hipp")
    hip = read_joint(path, "hip")
    assert hip.model.inertia == pytest.approx(0.02 + 0.01 + 2 * 0.09 + 0.002 + 0.64, rel=1e-9)
    assert hip.model.effects["gravity"]["amplitude"] == pytest.approx(9.81 * (2 * 0.3 + 0.8), rel=1e-9)
    assert hip.model.effects["saturation"]["limit"] == 50.0
    assert hip.model.effects["viscous_friction"]["coefficient"] == 0.4
    assert any("50 for each unit of the control of drive" in one for one in hip.notes)
    assert any("end stops" in one for one in hip.missed)
    knee = read_joint(path, "knee")
    assert any("servo (kp 20, kv 0) is a controller" in one for one in knee.missed)
    assert knee.model.inertia == pytest.approx(0.02 + 0.002 + 0.04, rel=1e-9)


def test_what_goes_with_a_joint_of_urdf_is_said(tmp_path: Path) -> None:
    gear = """<transmission name="t"><joint name="shoulder"/>
      <actuator name="m"><mechanicalReduction>100</mechanicalReduction></actuator></transmission></robot>"""
    text = ARM.replace("</robot>", gear).replace(
        '<axis xyz="0 1 0"/>', '<axis xyz="0 1 0"/><mimic joint="shoulder" multiplier="2"/>'
    )
    path = written(tmp_path, text, "arm.urdf")
    missed = read_joint(path, "shoulder").missed
    assert "elbow, which follows it (<mimic>)" in missed
    assert "<transmission>, a reduction of 100" in missed
    direct = read_joint(written(tmp_path, text.replace(">100<", "> 1.0 <"), "direct.urdf"), "shoulder")
    assert not any("<transmission>" in one for one in direct.missed)
    assert "<mimic>" in read_joint(path, "elbow").missed


#: As robots are written: an included file with classes, degrees, limits by the range alone.
CLASSES = """<mujocoinclude><default><default class="arm">
  <joint axis="0 1 0" damping="1.5" armature="0.1" range="-120 120" stiffness="2" springref="10"/>
  <general forcerange="-87 87"/>
  <default class="wrist"><joint damping="0.2" frictionloss="0.3"/>{motor}</default>
</default></default></mujocoinclude>"""
WITH_CLASSES = """<mujoco><compiler angle="degree" autolimits="true"/><include file="classes.xml"/>
  <worldbody><body childclass="arm"><joint name="wrist" class="wrist"/>
    <inertial pos="0 0.2 0" mass="1" diaginertia="0.01 0.01 0.01"/></body></worldbody>
  <actuator><general name="drive" joint="wrist" class="wrist"/></actuator>
</mujoco>"""


@pytest.mark.parametrize(
    ("motor", "limit", "missed"),
    [
        ('<motor gear="20" ctrlrange="-1 1"/>', 20.0, ""),  # 87 N m before the gear is never reached
        ('<motor gear="20" ctrlrange="-90 90"/>', 87.0 * 20.0, ""),
        ('<motor gear="1" ctrlrange="0 1"/>', 87.0, "actuator drive: limits of the command, 0 and 1: not alike"),
        ('<general gear="1" dyntype="filter" dynprm="0.01" ctrlrange="-90 90"/>', 87.0,
         "the limit of the command at 90, ahead of a narrower one of the force"),
    ],
)  # fmt: skip
def test_classes_degrees_and_several_limits(motor: str, limit: float, missed: str, tmp_path: Path) -> None:
    pytest.importorskip("mujoco", minversion="4.0", reason="dsd-cli[sim] is not installed")
    written(tmp_path, CLASSES.format(motor=motor), "classes.xml")
    found = read_joint(written(tmp_path, WITH_CLASSES), None)
    effects = found.model.effects
    assert found.model.inertia == pytest.approx(0.1 + 0.01, rel=1e-9)
    assert effects["viscous_friction"]["coefficient"] == 0.2
    assert effects["coulomb_friction"]["level"] == 0.3
    assert effects["stiffness"]["coefficient"] == 2.0
    assert effects["constant_load"]["force"] == pytest.approx(2.0 * math.radians(10.0), rel=1e-6)
    assert effects["saturation"]["limit"] == pytest.approx(limit)
    others = [one for one in found.missed if not one.startswith("end stops at -2.09")]
    assert [missed in one for one in others] == ([True] if missed else [])


def test_lines_of_a_parameter_file(tmp_path: Path) -> None:
    lines = ["% grey box", "p.inertia = 0.02;  % kg m2", "p.delay = 0.003;",
             "p.viscous_friction.coefficient = 0.4; % N m s", "Kt = 0.1;", "nonsense"]  # fmt: skip
    found = read_joint(written(tmp_path, "\n".join(lines), "p.m"), None)
    assert (found.model.inertia, found.model.delay) == (0.02, 0.003)
    assert found.model.effects["viscous_friction"]["coefficient"] == 0.4
    assert found.missed == ("line 5: Kt", "line 6: nonsense")


BOMB = '<?xml version="1.0"?><!DOCTYPE r [<!ENTITY a "aaaa"><!ENTITY b "&a;&a;">]><robot name="&b;"/>'


@pytest.mark.parametrize(
    ("text", "line"),
    [
        (BOMB, "has a document type or entities of its own"),
        ('<robot><!DOCTYPE x SYSTEM "file:///etc/passwd"></robot>', "has a document type"),
        ("<robot><link></robot>", "line 1, column 16: not valid XML"),
        ("<svg/>", "<svg> is neither MJCF (<mujoco>) nor URDF (<robot>)"),
        ("<robot/>", "no joint that turns or slides"),
        (ARM.replace('mass value="2"', 'mass value="two"'), 'mass value="two">: must be a number'),
        (ARM.replace('mass value="2"', 'mass value="nan"'), "must be a number"),
        (ARM.replace('mass value="2"', 'mass value="${m}"'), "must be a number; `xacro FILE` writes the URDF"),
        (ARM.replace('<child link="lower"/>', '<child link="upper"/>'), "hangs on itself"),
        (ARM.replace('<child link="lower"/>', '<child link="none"/>'), "there is no link none"),
        (ARM.replace('xyz="0 0.6 0.8"', 'xyz="0 0 0"'), "has an axis of length 0"),
        (ARM.replace('damping="0.7"', 'damping="-0.7"'), "joint shoulder: viscous_friction.coefficient = -0.7"),
        ("<mujoco><worldbody><body/></mujoco>", "not valid XML"),
        ("<mujoco><oops/></mujoco>", "does not read it"),
        ("", "no inertia in it"),
        ("inertia = -1\n", "model.inertia = -1"),
        ("inertia = 1\ncoulomb_friction.level = high\n", "x: line 2: coulomb_friction.level: must be a number"),
        ("part,parameter,value\ninertia", "line 2: must be part,parameter,value"),
        ("inertia = 1\nexternal_force.events = 3\n", "x: line 2: external_force.events: must be a list or a word"),
        ("inertia = 1\nexternal_force.events = [3]\n", "external_force"),
    ],
)
def test_what_cannot_be_read_is_one_line(text: str, line: str, tmp_path: Path) -> None:
    if text.startswith("<mujoco><o"):
        pytest.importorskip("mujoco", minversion="4.0", reason="dsd-cli[sim] is not installed")
    path = written(tmp_path, text, "x")
    refused(dsd("import", path.name, "--joint", "shoulder", "-o", "model.toml", cwd=tmp_path), 1, line)
    assert not (tmp_path / "model.toml").exists()


def test_nothing_that_is_no_text(tmp_path: Path) -> None:
    (tmp_path / "x").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(DataError, match="is not UTF-8"):
        read_joint(tmp_path / "x", None)
    with pytest.raises(DataError, match="no such file"):
        read_joint(tmp_path / "y", None)


def test_compare_says_what_the_simulators_joint_lacks(tmp_path: Path) -> None:
    """The joint of a robot without friction, on the log of an axis that has some."""
    text = ARM.replace('damping="0.7" friction="0.3"', "").replace('<mass value="2"/>', '<mass value="0.001"/>')
    light = text.replace('mass value="1"', 'mass value="0"').replace('mass value="0.5"', 'mass value="0"')
    written(tmp_path, light, "arm.urdf")
    ran = done("import", "arm.urdf", "--joint", "shoulder", "-o", "model.toml", cwd=tmp_path)
    assert "arm.urdf: not taken: end stops at -2 and 2 rad" in ran.stderr
    assert "# not taken: end stops" in (tmp_path / "model.toml").read_text()
    given = ("-c", "model.toml", "--set", "model.inertia=0.01", "--format", "json")  # the arm is five times heavier
    compared = done("compare", SAMPLES / "servo-friction.csv", *given, cwd=tmp_path)
    dependence = {one["on"]: one["explains"] for one in json.loads(compared.stdout)["dependence"]}
    assert dependence["direction"] > 0.3


@pytest.mark.parametrize(("u", "position"), [("N", "m"), ("N m", "rad"), ("A", "m"), ("mA rms", "rad"), ("", "m")])
def test_the_table_of_values_keeps_its_units(u: str, position: str, tmp_path: Path) -> None:
    first = f'[signals]\nu_unit = "{u}"\nposition_unit = "{position}"\n[model]\ninertia = 0.5\n'
    (tmp_path / "m.toml").write_text(first)
    done("export", "m.toml", "--to", "parameters", "-o", "e.csv", cwd=tmp_path)
    ran = done("import", "e.csv", "-o", "back.toml", cwd=tmp_path)
    assert ("slides" if position == "m" else "turns") in ran.stdout
    signals = tomllib.loads((tmp_path / "back.toml").read_text())["signals"]
    assert signals == ({"u_unit": u} if u else {}) | {"position_unit": position}


def test_a_table_without_units_says_so(tmp_path: Path) -> None:
    found = read_joint(written(tmp_path, "part,parameter,value,unit,meaning\ninertia,,0.5,u/(v/s),J\n", "e.csv"), None)
    assert not found.linear
    assert any("does not say whether" in note for note in found.notes)


@pytest.mark.parametrize("name", ["a.usda", "a.h", "a.mo", "a.py", "a.fmu"])
def test_a_format_that_is_not_read_is_named(name: str, tmp_path: Path) -> None:
    with pytest.raises(DataError, match="is not read: MJCF, URDF"):
        read_joint(written(tmp_path, "x", name), None)
