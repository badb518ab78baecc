"""OpenUSD (usda): a joint of UsdPhysics, with the dry friction of PhysX. Angular gains are per degree there.

PhysX takes what `PhysxJointAxisAPI` says in articulations alone, so that the joint is one; friction efforts are in N m.
"""

from __future__ import annotations

import math

from dsd_cli.export.arm import axis_of, body_of
from dsd_cli.export.base import Joint, Target, Verdict, number
from dsd_cli.export.joint_parts import all_terms, judged

_CARRIED = {
    "linear_damping": "PhysicsDriveAPI damping, target velocity 0",
    "linear_spring": "PhysicsDriveAPI stiffness, target position 0",
    "dry_friction": "PhysxJointAxisAPI static and dynamic friction effort",
    "weights": "mass and centre of the body",
}

_TEXT = """#usda 1.0
(
    defaultPrim = "{name}"
    kilogramsPerUnit = 1
    metersPerUnit = 1
    upAxis = "Z"
)

def Xform "{name}" (
    prepend apiSchemas = ["PhysicsArticulationRootAPI"]
)
{{
    def Xform "base" (
        prepend apiSchemas = ["PhysicsRigidBodyAPI", "PhysicsMassAPI"]
    )
    {{
        float physics:mass = 1
        float3 physics:diagonalInertia = (1, 1, 1)
    }}

    def PhysicsFixedJoint "ground"
    {{
        rel physics:body1 = </{name}/base>
    }}

    def Xform "body" (
        prepend apiSchemas = ["PhysicsRigidBodyAPI", "PhysicsMassAPI"]
    )
    {{
        float physics:mass = {mass}
        point3f physics:centerOfMass = ({centre})
        float3 physics:diagonalInertia = ({inertia}, {inertia}, {inertia})
    }}

    def {joint} "joint" (
        prepend apiSchemas = ["PhysicsDriveAPI:{kind}", "PhysxJointAxisAPI:{kind}"]
    )
    {{
        uniform token physics:axis = "{axis}"
        rel physics:body0 = </{name}/base>
        rel physics:body1 = </{name}/body>
        uniform token drive:{kind}:physics:type = "force"
        float drive:{kind}:physics:targetPosition = 0
        float drive:{kind}:physics:targetVelocity = 0
        float drive:{kind}:physics:damping = {damping}
        float drive:{kind}:physics:stiffness = {spring}
        float physxJointAxis:{kind}:staticFrictionEffort = {friction}
        float physxJointAxis:{kind}:dynamicFrictionEffort = {friction}
    }}
}}
"""


def _judge(joint: Joint, part: str) -> Verdict:
    return judged(joint, part, _CARRIED, "PhysicsMassAPI", "USD")


def _write(joint: Joint) -> bytes:
    terms, body = all_terms(joint), body_of(joint, all_terms(joint))
    per = 1.0 if joint.linear else math.pi / 180.0
    return _TEXT.format(
        name=joint.name,
        mass=number(body.mass),
        centre=", ".join(map(number, body.centre)),
        inertia=number(body.inertia),
        joint="PhysicsPrismaticJoint" if joint.linear else "PhysicsRevoluteJoint",
        kind="linear" if joint.linear else "angular",
        axis="XYZ"[axis_of(joint).index(1)],
        damping=number(per * terms.linear_damping),
        spring=number(per * terms.linear_spring),
        friction=number(max(terms.dry_friction, 0.0)),
    ).encode()


TARGET = Target(
    id="usd",
    summary="A joint of OpenUSD (Isaac Sim, Omniverse), as text.",
    suffix=".usda",
    judge=_judge,
    write=_write,
    not_run="no simulator of USD is there",
)
