"""SDFormat of Gazebo: what URDF has, and a spring."""

from __future__ import annotations

from typing import Any
from xml.etree import ElementTree as Xml

from dsd_cli.export.arm import Body, axis_of, body_of
from dsd_cli.export.base import Joint, Target, Verdict, number
from dsd_cli.export.joint_parts import all_terms, effort_limit, judged, only_a_limit

_CARRIED = {
    "linear_damping": "dynamics damping",
    "linear_spring": "dynamics spring_stiffness",
    "dry_friction": "dynamics friction",
    "weights": "mass and pose of the link's inertial",
    "command": "limit effort",
}


def _judge(joint: Joint, part: str) -> Verdict:
    return only_a_limit(joint, judged(joint, part, _CARRIED, "inertia of the link", "SDF"), "SDF")


def _write(joint: Joint) -> bytes:
    terms = all_terms(joint)
    root = Xml.Element("sdf", {"version": "1.9"})
    model = Xml.SubElement(root, "model", {"name": joint.name})
    _link(model, f"{joint.name}_link", body_of(joint, terms))
    axis = Xml.SubElement(model, "joint", {"name": joint.name, "type": "prismatic" if joint.linear else "revolute"})
    _text(axis, "parent", "world")
    _text(axis, "child", f"{joint.name}_link")
    along = Xml.SubElement(axis, "axis")
    _text(along, "xyz", " ".join(map(str, axis_of(joint))))
    effort = effort_limit(terms)
    if effort is not None:
        _text(Xml.SubElement(along, "limit"), "effort", number(effort))
    dynamics = Xml.SubElement(along, "dynamics")
    _text(dynamics, "damping", number(terms.linear_damping))
    _text(dynamics, "friction", number(max(terms.dry_friction, 0.0)))
    _text(dynamics, "spring_reference", "0")
    _text(dynamics, "spring_stiffness", number(terms.linear_spring))
    Xml.indent(root)
    return b'<?xml version="1.0"?>\n' + Xml.tostring(root, encoding="utf-8") + b"\n"


def _link(model: Any, name: str, body: Body) -> None:
    inertial = Xml.SubElement(Xml.SubElement(model, "link", {"name": name}), "inertial")
    _text(inertial, "pose", " ".join([*map(number, body.centre), "0 0 0"]))
    _text(inertial, "mass", number(body.mass))
    inertia = Xml.SubElement(inertial, "inertia")
    for name in ("ixx", "iyy", "izz", "ixy", "ixz", "iyz"):
        _text(inertia, name, number(body.inertia) if name[1] == name[2] else "0")


def _text(parent: Any, tag: str, text: str) -> None:
    Xml.SubElement(parent, tag).text = text


TARGET = Target(
    id="sdf",
    summary="A joint of SDFormat (Gazebo).",
    suffix=".sdf",
    judge=_judge,
    write=_write,
    not_run="no simulator of SDFormat is there",
)
