"""A joint of URDF: inertia and weight of all that hangs on it while the other joints stay where they are."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree.ElementTree import Element

import numpy as np

from dsd_cli.effects.joint_terms import JointTerms, Shaping, Sine
from dsd_cli.errors import DataError
from dsd_cli.export.arm import GRAVITY
from dsd_cli.export.reading.found import Found, chosen, model_of
from dsd_cli.export.reading.xml_text import numbers
from dsd_cli.signals.log import Array

_TURNING, _SLIDING = ("revolute", "continuous"), ("prismatic",)
#: A share of the weight, and of the largest force that an effort names, below which it is rounding or no limit.
_ROUNDING, _NO_LIMIT = 1e-9, 1e6


class Robot(NamedTuple):
    """links and joints by name; joints by the link that they carry, and those that a link carries."""

    path: Path
    links: dict[str, Element]
    joints: dict[str, Element]


class Hanging(NamedTuple):
    """Mass, first moment and inertia about the origin of the frame that they are given in."""

    mass: float
    moment: Array
    inertia: Array


def read(path: Path, root: Element, wanted: str | None) -> Found:
    """The joint of that name, or the only one that turns or slides."""
    links = {str(e.get("name")): e for e in root.findall("link")}
    robot = Robot(path, links, {str(e.get("name")): e for e in root.findall("joint")})
    moving = {n: e for n, e in robot.joints.items() if e.get("type") in (*_TURNING, *_SLIDING)}
    name = chosen(path, moving, wanted)
    joint = moving[name]
    linear = joint.get("type") in _SLIDING
    held = [n for n, e in moving.items() if n != name and _below(robot, name, n)]
    hanging = _carried(robot, _child(robot, joint), {_child(robot, joint)})
    axis = np.array(_vector(robot, joint.find("axis"), "xyz", "1 0 0"))
    size = float(np.linalg.norm(axis))
    if size == 0.0:
        raise DataError(f"{path}: joint {name} has an axis of length 0")
    axis = axis / size
    inertia = hanging.mass if linear else float(axis @ hanging.inertia @ axis)
    if not inertia > 0.0:
        raise DataError(f"{path}: nothing with an inertia hangs on joint {name}", "its links have no <inertial>")
    terms, missed = _forces(robot, joint, linear)
    terms += _weight(_down(robot, joint), axis, hanging, linear)
    missed += _coupled(root, robot, name)
    notes = [f"inertia with {', '.join(held)} held where the file has them"] if held else []
    notes.append("u is the force on the joint; URDF says nothing of delays and lags")
    return Found(name, linear, model_of(inertia, 0.0, terms, f"{path}: joint {name}"), tuple(notes), tuple(missed))


def _forces(robot: Robot, joint: Element, linear: bool) -> tuple[JointTerms, list[str]]:
    damping = friction = 0.0
    missed = []
    if (dynamics := joint.find("dynamics")) is not None:
        (damping,) = numbers(robot.path, dynamics, "damping", "0", 1)
        (friction,) = numbers(robot.path, dynamics, "friction", "0", 1)
    command: tuple[Shaping, ...] = ()
    if (limit := joint.find("limit")) is not None:
        (effort,) = numbers(robot.path, limit, "effort", "0", 1)
        command = (Shaping("limit", effort),) if 0.0 < effort < _NO_LIMIT else ()
        (speed,) = numbers(robot.path, limit, "velocity", "0", 1)
        missed += [f"limit of the speed, {speed:g}"] if 0.0 < speed < _NO_LIMIT else []
        (low,), (high,) = (numbers(robot.path, limit, side, "0", 1) for side in ("lower", "upper"))
        if joint.get("type") != "continuous" and (abs(low) < _NO_LIMIT or abs(high) < _NO_LIMIT):
            missed.append(f"end stops at {low:g} and {high:g} {'m' if linear else 'rad'}")
    missed += [f"<{tag}>" for tag in ("mimic", "safety_controller") if joint.find(tag) is not None]
    return JointTerms(linear_damping=damping, dry_friction=friction, command=command), missed


def _coupled(root: Element, robot: Robot, name: str) -> list[str]:
    """Joints that follow this one, and gears between it and its motor: the inertia of both is not in the joint's."""
    mimics = {n: e.find("mimic") for n, e in robot.joints.items()}
    said = [
        f"{n}, which follows it (<mimic>)" for n, one in mimics.items() if one is not None and one.get("joint") == name
    ]
    for one in root.findall("transmission"):
        if any(joint.get("name") == name for joint in one.findall("joint")):
            reduction = (one.findtext(".//mechanicalReduction") or "").strip()
            if re.fullmatch(r"1(\.0*)?", reduction):  # the motor turns as the joint does
                continue
            said.append(f"<transmission>{f', a reduction of {reduction}' if reduction else ''}")
    return said


def _weight(down: Array, axis: Array, hanging: Hanging, linear: bool) -> JointTerms:
    """Of what slides a constant force, of what turns G sin(q + phi): the torque at q = 0 and a quarter turn on."""
    if linear:
        force = float(hanging.mass * GRAVITY * (down @ axis))
        return JointTerms(constant=force if abs(force) > _ROUNDING * hanging.mass * GRAVITY else 0.0)
    now = GRAVITY * float(axis @ np.cross(hanging.moment, down))
    quarter = GRAVITY * float(axis @ np.cross(np.cross(axis, hanging.moment), down))
    size = math.hypot(now, quarter)
    if size <= _ROUNDING * GRAVITY * float(np.linalg.norm(hanging.moment)):
        return JointTerms()
    return JointTerms(weights=(Sine(-size, 1.0, math.atan2(-now, -quarter)),))


def _carried(robot: Robot, link: str, seen: set[str]) -> Hanging:
    """A link and all that its joints carry, in the link's own frame."""
    total = _of_link(robot, link)
    for joint in robot.joints.values():
        if _parent(robot, joint) != link:
            continue
        child = _child(robot, joint)
        if child in seen:
            raise DataError(f"{robot.path}: link {child} hangs on itself")
        seen.add(child)
        total = _sum(total, _moved(_carried(robot, child, seen), *_origin(robot, joint)))
    return total


def _of_link(robot: Robot, link: str) -> Hanging:
    inertial = robot.links[link].find("inertial")
    if inertial is None:
        return Hanging(0.0, np.zeros(3), np.zeros((3, 3)))
    body = inertial.find("inertia")
    (mass,) = numbers(robot.path, _needed(robot, inertial, "mass"), "value", "0", 1)
    values = dict.fromkeys(("ixx", "ixy", "ixz", "iyy", "iyz", "izz"), 0.0)
    if body is not None:
        values = {name: numbers(robot.path, body, name, "0", 1)[0] for name in values}
    xx, xy, xz, yy, yz, zz = values.values()
    own = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    return _moved(Hanging(mass, np.zeros(3), own), *_origin(robot, inertial))


def _moved(one: Hanging, turn: Array, shift: Array) -> Hanging:
    """Given in a frame in which its own frame is turned and shifted (Steiner)."""
    moment, inertia = turn @ one.moment, turn @ one.inertia @ turn.T
    if one.mass > 0.0:
        centre = moment / one.mass
        inertia = inertia - one.mass * _square(centre) + one.mass * _square(centre + shift)
    return Hanging(one.mass, moment + one.mass * shift, inertia)


def _sum(one: Hanging, other: Hanging) -> Hanging:
    return Hanging(one.mass + other.mass, one.moment + other.moment, one.inertia + other.inertia)


def _square(r: Array) -> Array:
    """|r|^2 1 - r r': what a unit mass at r has about the origin."""
    return np.asarray(float(r @ r) * np.eye(3) - np.outer(r, r))


def _down(robot: Robot, joint: Element) -> Array:
    """Down (-z of the root link) in the joint's frame at rest."""
    down, seen = np.array([0.0, 0.0, -1.0]), 0
    turns = []
    above: Element | None = joint
    while above is not None and (seen := seen + 1) <= len(robot.joints):
        turns.append(_origin(robot, above)[0])
        parent = _parent(robot, above)
        above = next((e for e in robot.joints.values() if _child(robot, e) == parent), None)
    for turn in reversed(turns):
        down = turn.T @ down
    return down


def _below(robot: Robot, joint: str, other: str) -> bool:
    """Whether the other joint hangs on that one."""
    above, steps = robot.joints[other], 0
    while steps <= len(robot.joints):
        parent = _parent(robot, above)
        carrier = next((n for n, e in robot.joints.items() if _child(robot, e) == parent), None)
        if carrier is None or carrier == joint:
            return carrier == joint
        above, steps = robot.joints[carrier], steps + 1
    return False


def _child(robot: Robot, joint: Element) -> str:
    return _link(robot, joint, "child")


def _parent(robot: Robot, joint: Element) -> str:
    return _link(robot, joint, "parent")


def _link(robot: Robot, joint: Element, end: str) -> str:
    name = str(_needed(robot, joint, end).get("link"))
    if name not in robot.links:
        raise DataError(f"{robot.path}: joint {joint.get('name')}: there is no link {name}")
    return name


def _needed(robot: Robot, element: Element, tag: str) -> Element:
    found = element.find(tag)
    if found is None:
        raise DataError(f'{robot.path}: <{element.tag} name="{element.get("name", "")}"> lacks <{tag}>')
    return found


def _vector(robot: Robot, element: Element | None, key: str, default: str) -> list[float]:
    return numbers(robot.path, Element("axis") if element is None else element, key, default, 3)


def _origin(robot: Robot, element: Element) -> tuple[Array, Array]:
    """(turn, shift) of the frame that `<origin>` says."""
    origin = element.find("origin")
    roll, pitch, yaw = _vector(robot, origin, "rpy", "0 0 0")
    turn: Any = np.eye(3)
    for angle, (i, j) in ((roll, (1, 2)), (pitch, (2, 0)), (yaw, (0, 1))):
        one = np.eye(3)
        one[i, i] = one[j, j] = math.cos(angle)
        one[i, j], one[j, i] = -math.sin(angle), math.sin(angle)
        turn = one @ turn
    return turn, np.array(_vector(robot, origin, "xyz", "0 0 0"))
