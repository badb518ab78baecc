"""Models as joints of simulators: what they carry runs like `dsd simulate`, and reads back as it was written."""

import math
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from dsd_cli.effects import catalogue
from dsd_cli.effects.general import GENERAL
from dsd_cli.errors import UsageError
from dsd_cli.export.base import Joint
from dsd_cli.export.joint_parts import Chain, Stage, chain_of
from dsd_cli.export.making import make, verify
from dsd_cli.export.motion import built_in, simulated
from dsd_cli.export.targets import get_target
from dsd_cli.plant.model import PlantModel
from tests.cli.rig import done

INERTIA, STEP = 0.01, 1e-3
TABLE = {"factor": "one", "scale": 1.0}
#: Every effect there is, in a size that matters for an axis of 0.01 kg m2.
VALUES = {
    "actuator_lag": {"time_constant": 0.01},
    "backlash": {"gap": 0.05, "load_share": 0.4, "stiffness": 20.0},
    "cogging": {"amplitude": 0.1, "periods": 7.3, "phase": 0.4},
    "constant_load": {"force": 0.2},
    "coulomb_friction": {"level": 0.2},
    "cubic_stiffness": {"coefficient": 0.3},
    "dead_zone": {"width": 0.1},
    "external_force": {"events": [{"start": 0.5, "end": 0.7, "force": 0.2}]},
    "flexible_coupling": {"frequency": 30.0, "load_share": 0.4, "damping": 0.05},
    "gain_droop": {"droop": 0.2},
    "gravity": {"amplitude": 0.3, "phase": 0.5},
    "load_friction": {"coefficient": 0.2},
    "periodic_disturbance": {"amplitude": 0.1, "frequency": 3.0, "phase": 0.0},
    "presliding_friction": {"level": 0.2, "stiffness": 20.0},
    "quadratic_drag": {"coefficient": 0.01},
    "saturation": {"limit": 0.4},
    "stiffness": {"coefficient": 0.5},
    "stribeck_friction": {"excess": 0.1, "velocity": 0.5},
    "viscous_asymmetry": {"coefficient": 0.02},
    "viscous_friction": {"coefficient": 0.05},
    "curve": {"channels": ["position"], "knots": [[-0.5, 0.3, 0.6, 2.0]], "values": [0.1, -0.1, 0.2, 0.0], **TABLE},
    "friction_curve": {"channels": ["speed"], "knots": [[0.0, 1.0, 3.0]], "values": [0.2, 0.1, 0.2], **TABLE},
    "hysteresis": {"radii": [0.05, 0.2], "stiffnesses": [2.0, 1.0], "scale": 1.0},
    "inertia_curve": {"channels": ["position"], "knots": [[0.0, 1.0]], "values": [0.0, 0.002], **TABLE},
    "lagged_friction": {"of": "velocity", "time_constants": [0.1], "levels": [0.1], "scale": 1.0},
    "bouc_wen": {"level": 0.2, "stiffness": 10.0, "exponent": 2.0, "unloading": 1.2},
    "lugre_friction": {"level": 0.2, "damping": 0.01, "stiffness": 20.0, "excess": 0.1, "velocity": 0.5},
}
#: What no joint of MuJoCo has.
NOT_IN_MUJOCO = {
    *("bouc_wen", "external_force", "gain_droop", "inertia_curve", "lagged_friction", "load_friction"),
    *("lugre_friction", "periodic_disturbance"),
}


def joint(effects: dict, delay: float = 0.0, linear: bool = False) -> Joint:
    return Joint(PlantModel(INERTIA, delay, effects), STEP, linear=linear)


def beside(effect: str) -> dict:
    """That effect on an axis that does not run away without a controller."""
    damped = (
        {} if effect.endswith("friction") or effect == "friction_curve" else {"viscous_friction": {"coefficient": 0.05}}
    )
    return {**damped, effect: VALUES[effect]}


def percent(target: str, one: Joint) -> float:
    """rms of the speed error of what was written, in percent of the rms speed."""
    motion = built_in(one.model, STEP)
    checked = verify(get_target(target), make(get_target(target), one, motion, drop=False), motion)
    assert checked.ran, checked.how
    return checked.rms_percent


def test_every_effect_is_tried() -> None:
    assert set(VALUES) == {*catalogue(), *GENERAL}


@pytest.mark.parametrize("effect", sorted(VALUES))
def test_mujoco_moves_as_dsd_simulate_or_says_what_it_lacks(effect: str) -> None:
    pytest.importorskip("mujoco", minversion="4.0", reason="mujoco is not installed")
    one = joint(beside(effect), delay=0.0023)
    if effect in NOT_IN_MUJOCO:
        with pytest.raises(UsageError, match=rf"mjcf does not carry {effect} \(a joint of MJCF has no "):
            make(get_target("mjcf"), one, built_in(one.model, STEP), drop=False)
    else:
        assert percent("mjcf", one) <= 1.0


@pytest.mark.parametrize(
    "effects",
    [
        {"gravity": VALUES["gravity"], "viscous_friction": VALUES["viscous_friction"]},
        {"constant_load": VALUES["constant_load"], "curve": VALUES["curve"], "cogging": VALUES["cogging"],
         "quadratic_drag": {"coefficient": 0.01}, "viscous_friction": {"coefficient": 0.05}},
        {"coulomb_friction": {"level": 0.1}, "stribeck_friction": VALUES["stribeck_friction"],
         "flexible_coupling": VALUES["flexible_coupling"]},
    ],
    ids=["weight of a sliding axis", "forces", "friction and load"],
)  # fmt: skip
def test_effects_together_on_a_sliding_axis(effects: dict) -> None:
    pytest.importorskip("mujoco", minversion="4.0", reason="mujoco is not installed")
    assert percent("mjcf", joint(effects, linear=True)) <= 1.0


def test_mujoco_reads_back_what_was_written() -> None:
    mujoco = pytest.importorskip("mujoco", minversion="4.0", reason="mujoco is not installed")
    effects = {
        name: VALUES[name]
        for name in ("viscous_friction", "quadratic_drag", "stiffness", "coulomb_friction", "gravity")
    }
    content = make(get_target("mjcf"), joint(effects, 0.004), built_in(PlantModel(INERTIA), STEP), False).content
    model = mujoco.MjModel.from_xml_string(content.decode())
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    assert model.dof_M0[0] == pytest.approx(INERTIA, rel=1e-12)  # the arm of the weight is in it
    assert (model.dof_damping[0], model.dof_dampingpoly[0][0]) == (0.05, 0.01)
    assert (model.jnt_stiffness[0], model.dof_frictionloss[0]) == (0.5, 0.2)
    assert data.qfrc_bias[0] == pytest.approx(0.3 * math.sin(0.5), rel=1e-12)
    assert model.actuator(0).name == "u"


@pytest.mark.parametrize("order", [("saturation", "dead_zone"), ("dead_zone", "saturation")])
@pytest.mark.parametrize("lag", [0, 1, 2])
def test_limit_dead_zone_and_lag_in_any_order(order: tuple[str, str], lag: int) -> None:
    pytest.importorskip("mujoco", minversion="4.0", reason="mujoco is not installed")
    names = [*order]
    names.insert(lag, "actuator_lag")
    one = joint({**{name: VALUES[name] for name in names}, "viscous_friction": {"coefficient": 0.05}})
    if names == ["dead_zone", "actuator_lag", "saturation"]:
        with pytest.raises(UsageError, match="no such order of lag, limit and dead zone"):
            percent("mjcf", one)
    else:
        assert percent("mjcf", one) <= 1.0


def test_a_chain_by_hand() -> None:
    from dsd_cli.effects.joint_terms import Shaping

    dead, limit, lag = Shaping("dead", 0.1), Shaping("limit", 0.4), Shaping("lag", 0.02)
    assert chain_of([dead, limit]) == Chain(Stage(0.5, 0.1), 0.0, Stage())
    assert chain_of([limit, dead, lag]) == Chain(Stage(0.4, 0.1), 0.02, Stage())
    assert chain_of([lag, dead, limit]) == Chain(Stage(), 0.02, Stage(0.5, 0.1))
    assert chain_of([dead, lag, limit]) is None


@pytest.mark.parametrize("name", ['a"/><evil', "a b", "joint\n", "", "1a", "x" * 64, "ü", "a<!--"])
def test_hostile_names_never_become_xml(name: str) -> None:
    with pytest.raises(UsageError, match="letters, digits and _"):
        Joint(PlantModel(INERTIA), STEP, name=name)


#: What a joint of these has, and what each calls it in the file that was written.
PLAIN = ("viscous_friction", "coulomb_friction", "gravity")


@pytest.mark.parametrize(
    ("target", "more"), [("urdf", {"saturation"}), ("sdf", {"saturation", "stiffness"}), ("usd", {"stiffness"})]
)
def test_what_other_simulators_carry(target: str, more: set[str]) -> None:
    found = get_target(target)
    carried = {e for e in VALUES if found.judge(joint({e: VALUES[e]}), e).carried}
    assert carried == {*PLAIN, *more}
    assert not found.judge(joint({}, delay=0.002), "delay").carried
    assert all(found.judge(joint({e: VALUES[e]}), e).how for e in VALUES)


@pytest.mark.parametrize("effect", [*PLAIN, "saturation"])
def test_a_urdf_read_by_mujoco_moves_as_dsd_simulate(effect: str) -> None:
    pytest.importorskip("mujoco", minversion="4.0", reason="mujoco is not installed")
    assert percent("urdf", joint(beside(effect))) <= 1.0


@pytest.mark.parametrize("linear", [False, True])
@pytest.mark.parametrize("target", ["urdf", "sdf"])
def test_xml_reads_back_as_it_was_written(target: str, linear: bool) -> None:
    weight = {} if linear else {"gravity": VALUES["gravity"]}
    effects = {
        "viscous_friction": VALUES["viscous_friction"],
        "coulomb_friction": {"level": 0.2},
        "saturation": {"limit": 0.4},
    }
    one = joint({**effects, **weight}, linear=linear)
    root = ElementTree.fromstring(make(get_target(target), one, built_in(one.model, STEP), False).content)
    (axis,) = root.iter("joint")
    assert axis.get("type") == ("prismatic" if linear else {"urdf": "continuous", "sdf": "revolute"}[target])

    def value(tag: str, name: str) -> float:
        (found,) = axis.iter(tag)
        return float(found.get(name) or found.findtext(name))

    assert (value("dynamics", "damping"), value("dynamics", "friction"), value("limit", "effort")) == (0.05, 0.2, 0.4)
    link = next(link for link in root.iter("link") if link.get("name") == "joint_link")
    mass = float(link.find("inertial/mass").get("value") or link.findtext("inertial/mass"))
    if linear:
        assert mass == INERTIA
    else:  # about the axis it is J, and the weight is G sin(phi) at q = 0
        pose = link.find("inertial/origin").get("xyz") if target == "urdf" else link.findtext("inertial/pose")
        x, _, z = map(float, pose.split()[:3])
        own = link.find("inertial/inertia")
        about = float(own.get("iyy") or own.findtext("iyy"))
        assert about + mass * (x * x + z * z) == pytest.approx(INERTIA, rel=1e-12)
        assert -x * mass * 9.81 == pytest.approx(0.3 * math.sin(0.5), rel=1e-12)


@pytest.mark.parametrize("linear", [False, True])
def test_usd_reads_back_per_degree(linear: bool, tmp_path: Path) -> None:
    pxr = pytest.importorskip("pxr", reason="usd-core is not installed")
    assert pxr
    from pxr import Usd, UsdPhysics

    one = joint({e: VALUES[e] for e in ("viscous_friction", "coulomb_friction", "stiffness")}, linear=linear)
    (tmp_path / "joint.usda").write_bytes(make(get_target("usd"), one, built_in(one.model, STEP), False).content)
    stage = Usd.Stage.Open(str(tmp_path / "joint.usda"))
    prim = stage.GetPrimAtPath("/joint/joint")
    kind, per = ("linear", 1.0) if linear else ("angular", 180.0 / math.pi)
    assert prim.IsA(UsdPhysics.PrismaticJoint if linear else UsdPhysics.RevoluteJoint)
    drive = UsdPhysics.DriveAPI.Get(prim, kind)
    assert drive.GetDampingAttr().Get() * per == pytest.approx(0.05, rel=1e-6)
    assert drive.GetStiffnessAttr().Get() * per == pytest.approx(0.5, rel=1e-6)
    assert prim.GetAttribute(f"physxJointAxis:{kind}:dynamicFrictionEffort").Get() == pytest.approx(0.2, rel=1e-6)
    mass = UsdPhysics.MassAPI(stage.GetPrimAtPath("/joint/body"))
    found = mass.GetMassAttr().Get() if linear else mass.GetDiagonalInertiaAttr().Get()[1]
    assert found == pytest.approx(INERTIA, rel=1e-6)


def moved(values: dict[str, float], u: np.ndarray, effort: float = math.inf) -> np.ndarray:
    """Speed at each sample of J a = u - B v - k q - m g arm sin(q + phase) - friction, by steps of 20 us."""
    q = v = 0.0
    speeds, h = [], 2e-5
    for command in np.clip(u, -effort, effort).tolist():
        speeds.append(v)
        for _ in range(round(STEP / h)):
            force = command - values["damping"] * v - values["spring"] * q
            force -= values["weight"] * math.sin(q + values["phase"])
            friction = values["friction"]
            if v == 0.0 and abs(force) <= friction:
                continue
            after = v + h * (force - math.copysign(friction, v or force)) / values["inertia"]
            v = after if v * after >= 0.0 else 0.0
            q += h * v
    return np.array(speeds)


def of_sdf(content: bytes) -> dict[str, float]:
    """By the element's names in the specification of SDFormat."""
    root = ElementTree.fromstring(content)
    link, axis = root.find("model/link"), root.find("model/joint/axis")
    x, _, z = map(float, link.findtext("inertial/pose").split()[:3])
    mass, arm = float(link.findtext("inertial/mass")), math.hypot(x, z)
    dynamics = {name: float(axis.findtext(f"dynamics/{name}")) for name in ("damping", "friction", "spring_stiffness")}
    return {
        "inertia": float(link.findtext("inertial/inertia/iyy")) + mass * arm * arm,
        "weight": mass * 9.81 * arm,
        "phase": math.atan2(-x, -z),
        "spring": dynamics.pop("spring_stiffness"),
        **dynamics,
    }


def of_usd(content: bytes, folder: Path) -> dict[str, float]:
    """By usd-core; its angular gains are per degree."""
    pytest.importorskip("pxr", reason="usd-core is not installed")
    from pxr import Usd, UsdPhysics

    (folder / "joint.usda").write_bytes(content)
    stage = Usd.Stage.Open(str(folder / "joint.usda"))
    mass, prim = UsdPhysics.MassAPI(stage.GetPrimAtPath("/joint/body")), stage.GetPrimAtPath("/joint/joint")
    drive = UsdPhysics.DriveAPI.Get(prim, "angular")
    x, _, z = mass.GetCenterOfMassAttr().Get()
    m, arm = mass.GetMassAttr().Get(), math.hypot(x, z)
    return {
        "inertia": mass.GetDiagonalInertiaAttr().Get()[1] + m * arm * arm,
        "weight": m * 9.81 * arm,
        "phase": math.atan2(-x, -z),
        "damping": math.degrees(drive.GetDampingAttr().Get()),
        "spring": math.degrees(drive.GetStiffnessAttr().Get()),
        "friction": prim.GetAttribute("physxJointAxis:angular:dynamicFrictionEffort").Get(),
    }


@pytest.mark.parametrize("target", ["sdf", "usd"])
def test_who_reads_sdf_or_usd_simulates_the_same(target: str, tmp_path: Path) -> None:
    """What no simulator here runs, moved by a plain loop from what an independent reader finds in the file."""
    names = [
        "viscous_friction",
        "coulomb_friction",
        "gravity",
        "stiffness",
        *(["saturation"] if target == "sdf" else []),
    ]
    one = joint({name: VALUES[name] for name in names})
    motion = built_in(one.model, STEP)
    content = make(get_target(target), one, motion, drop=False).content
    found = of_sdf(content) if target == "sdf" else of_usd(content, tmp_path)
    effort = math.inf
    if target == "sdf":
        effort = float(ElementTree.fromstring(content).findtext("model/joint/axis/limit/effort"))
    wanted = simulated(one.model, motion).velocity
    assert np.ptp(wanted) > 1.0
    off = moved(found, motion.u, effort) - wanted
    assert np.sqrt(np.mean(off**2)) < 0.01 * np.sqrt(np.mean(wanted**2))


def test_the_picture_has_both_speeds_or_says_why_not(tmp_path: Path) -> None:
    pytest.importorskip("mujoco", minversion="4.0", reason="dsd-cli[sim] is not installed")
    rig = Path(__file__).parents[2] / "sample_logs" / "servo-friction.toml"
    done("export", rig, "--to", "mjcf", "-o", "joint.xml", "--plot", "both.svg", cwd=tmp_path)
    drawn = (tmp_path / "both.svg").read_text()
    assert "dsd simulate" in drawn
    assert "MuJoCo" in drawn
    ran = done("export", rig, "--to", "sdf", "-o", "joint.sdf", "--drop", "--plot", "none.svg", cwd=tmp_path)
    assert "none.svg is not drawn: sdf not run" in ran.stderr
    assert not (tmp_path / "none.svg").exists()


def test_an_effect_of_a_user_says_what_it_is_in_a_joint_or_is_refused() -> None:
    from dataclasses import replace

    from dsd_cli.effects import get_effect, register, unregister
    from dsd_cli.effects.joint_terms import JointTerms

    twice = JointTerms(linear_damping=0.1)
    known = replace(get_effect("viscous_friction"), id="oil", joint=lambda values, _: twice)
    unknown = replace(known, id="grease", joint=None)
    register([known, unknown])
    try:
        one = joint({"oil": {"coefficient": 0.05}, "grease": {"coefficient": 0.05}})
        assert get_target("urdf").judge(one, "oil").carried
        found = get_target("urdf").judge(one, "grease")
        assert (found.carried, "does not say what it is in a joint" in found.how) == (False, True)
    finally:
        unregister(["oil", "grease"])


@pytest.mark.parametrize("delay", [0.0023, 0.0125])
def test_a_delay_is_no_part_of_a_step_off(delay: float) -> None:
    """Half a step of it would be 0.4 % of the speed; a command with jumps is read on a line between two of them."""
    pytest.importorskip("mujoco", minversion="4.0", reason="dsd-cli[sim] is not installed")
    assert percent("mjcf", joint({"viscous_friction": {"coefficient": 0.05}}, delay=delay)) < 0.05
