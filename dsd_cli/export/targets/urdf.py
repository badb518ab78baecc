"""URDF, the robot description of ROS: inertia, damping, dry friction, the limit of the effort, a weight."""

from __future__ import annotations

from typing import Any
from xml.etree import ElementTree as Xml

import numpy as np

from dsd_cli.effects.joint_terms import JointTerms
from dsd_cli.errors import how_to_install
from dsd_cli.export.arm import axis_of, body_of
from dsd_cli.export.base import Joint, Motion, NotRun, Target, Verdict, finite, number
from dsd_cli.export.joint_parts import all_terms, effort_limit, judged, only_a_limit
from dsd_cli.signals.log import Array

_CARRIED = {
    "linear_damping": "dynamics damping",
    "dry_friction": "dynamics friction",
    "weights": "mass and centre of the link",
    "command": "limit effort",
}
#: What `limit` must say of a sliding joint: m and m/s that it does not reach.
_FAR = 1e6


def _judge(joint: Joint, part: str) -> Verdict:
    return only_a_limit(joint, judged(joint, part, _CARRIED, "inertia of the link", "URDF"), "URDF")


def _write(joint: Joint) -> bytes:
    terms = all_terms(joint)
    robot = Xml.Element("robot", {"name": joint.name})
    _link(robot, f"{joint.name}_base", 1.0, (0.0, 0.0, 0.0), 1.0)
    body = body_of(joint, terms)
    _link(robot, f"{joint.name}_link", body.mass, body.centre, body.inertia)
    axis = Xml.SubElement(robot, "joint", {"name": joint.name, "type": "prismatic" if joint.linear else "continuous"})
    Xml.SubElement(axis, "parent", {"link": f"{joint.name}_base"})
    Xml.SubElement(axis, "child", {"link": f"{joint.name}_link"})
    Xml.SubElement(axis, "axis", {"xyz": " ".join(map(str, axis_of(joint)))})
    dynamics = {"damping": number(terms.linear_damping), "friction": number(max(terms.dry_friction, 0.0))}
    Xml.SubElement(axis, "dynamics", dynamics)
    if known := _limit(joint, terms):
        Xml.SubElement(axis, "limit", known)
    Xml.indent(robot)
    return b'<?xml version="1.0"?>\n' + Xml.tostring(robot, encoding="utf-8") + b"\n"


def _limit(joint: Joint, terms: JointTerms) -> dict[str, str]:
    """A sliding joint must have one; without a limit of the command it is out of reach."""
    effort = effort_limit(terms)
    known = {"effort": number(_FAR if effort is None else effort), "velocity": number(_FAR)}
    if joint.linear:
        return known | {"lower": number(-_FAR), "upper": number(_FAR)}
    return {} if effort is None else known


def _link(robot: Any, name: str, mass: float, centre: tuple[float, ...], inertia: float) -> None:
    inertial = Xml.SubElement(Xml.SubElement(robot, "link", {"name": name}), "inertial")
    Xml.SubElement(inertial, "origin", {"xyz": " ".join(map(number, centre)), "rpy": "0 0 0"})
    Xml.SubElement(inertial, "mass", {"value": number(mass)})
    products = dict.fromkeys(("ixy", "ixz", "iyz"), "0")
    Xml.SubElement(inertial, "inertia", dict.fromkeys(("ixx", "iyy", "izz"), number(inertia)) | products)


def _run(content: bytes, joint: Joint, motion: Motion) -> Array:
    """As MuJoCo reads it; URDF knows no actuator: u is put on the joint, within its effort."""
    try:
        import mujoco
    except ImportError:
        raise NotRun(f"MuJoCo is not installed: {how_to_install('sim')}") from None
    model = mujoco.MjModel.from_xml_string(content.decode())
    model.opt.timestep = motion.sample_time
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_RK4
    model.dof_solref[:] = (2.0 * motion.sample_time, 1.0)  # a friction that does not give way, as a solver may have it
    model.dof_solimp[:, :3] = (0.9999, 0.9999, 0.001)
    data = mujoco.MjData(model)
    data.qpos[0], data.qvel[0] = motion.position, motion.velocity
    effort = effort_limit(all_terms(joint))
    forces = motion.u if effort is None else np.clip(motion.u, -effort, effort)
    velocity = np.empty(len(forces))
    for k, force in enumerate(forces.tolist()):
        velocity[k] = data.qvel[0]
        data.qfrc_applied[0] = force
        mujoco.mj_step(model, data)
    return finite(velocity, "MuJoCo")


TARGET = Target(
    id="urdf",
    summary="A joint of a robot description (ROS).",
    suffix=".urdf",
    judge=_judge,
    write=_write,
    run=_run,
)
