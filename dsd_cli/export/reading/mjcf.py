"""A joint of MJCF as MuJoCo compiles it: what its attributes say, and by asking the compiled model for its forces."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from dsd_cli.effects.joint_terms import Bristle, Hung, JointTerms, Shaping, Sine, Stop
from dsd_cli.effects.memory import Coupling
from dsd_cli.errors import DataError, how_to_install
from dsd_cli.export.reading.found import Found, chosen, model_of
from dsd_cli.export.reading.mjcf_forces import (
    Actuator,
    actuators_of,
    passive_damping,
    remaining,
    symmetric,
    uneven,
)
from dsd_cli.signals.log import Array


class Axis(NamedTuple):
    """A joint of a compiled model: ids of the joint and of its degree of freedom, and the place of its position."""

    mujoco: Any
    model: Any
    joint: int
    dof: int
    place: int
    linear: bool


def read(path: Path, wanted: str | None) -> Found:
    """Raises DataError : MuJoCo is not installed, or does not read it. UsageError : see `chosen`."""
    try:
        import mujoco
    except ImportError:
        raise DataError(f"{path}: MJCF is read by MuJoCo, which is not installed", how_to_install("sim")) from None
    try:
        model = mujoco.MjModel.from_xml_path(str(path))
    except ValueError as error:
        why = " ".join(str(error).split())[:200]
        raise DataError(f"{path}: MuJoCo {mujoco.mj_versionString()} does not read it", why) from None
    slide = int(mujoco.mjtJoint.mjJNT_SLIDE)
    single = (int(mujoco.mjtJoint.mjJNT_HINGE), slide)
    joints = {_name(model, j): j for j in range(model.njnt) if int(model.jnt_type[j]) in single}
    load = _load_joint(mujoco, model)
    name = chosen(path, (n for n, j in joints.items() if j != load), wanted)
    j = joints[name]
    linear = int(model.jnt_type[j]) == slide
    axis = Axis(mujoco, model, j, int(model.jnt_dofadr[j]), int(model.jnt_qposadr[j]), linear)
    return _found(path, name, axis, load)


def _name(model: Any, joint: int) -> str:
    return str(model.joint(joint).name) or f"joint_{joint}"


def _found(path: Path, name: str, axis: Axis, load: int | None) -> Found:
    model, missed = axis.model, list[str]()
    actuators = actuators_of(axis)
    delay, command, said = _command(actuators, axis)
    terms = _of_joint(axis, missed) + _of_tendons(axis) + _of_motors(actuators)
    terms += JointTerms(command=_one_limit(command, missed))
    inertia = float(model.dof_M0[axis.dof])
    notes = list(said)
    if load is not None and load != axis.joint:
        terms += _hung(axis, load)
    elif model.nv > 1:
        notes.append("inertia with all other joints held where the file has them")
    terms += JointTerms(linear_damping=passive_damping(actuators))
    rest = remaining(axis, actuators, terms)
    missed += [f"actuator {a.name}: {why}" for a in actuators for why in ([a.servo] if a.servo else _uneven(a))]
    missed += uneven("actuators' force", _force_range(axis))
    if model.jnt_limited[axis.joint]:
        low, high = model.jnt_range[axis.joint]
        missed.append(f"end stops at {low:g} and {high:g} {'m' if axis.linear else 'rad'}")
    made = model_of(inertia, delay, terms + rest, f"{path}: joint {name}")
    return Found(name, axis.linear, made, tuple(notes), tuple(missed))


def _of_joint(axis: Axis, missed: list[str]) -> JointTerms:
    """Damping, springs and dry friction of the joint itself."""
    model, j, dof = axis.model, axis.joint, axis.dof
    damping = [float(model.dof_damping[dof]), *_poly(model, "dof_dampingpoly", dof)]
    spring = [float(model.jnt_stiffness[j]), *_poly(model, "jnt_stiffnesspoly", j)]
    if len(damping) > 2 and damping[2]:
        missed.append("damping that grows with the cube of the speed")
    reference = float(model.qpos_spring[axis.place])
    plain = reference == 0.0 or not any(spring[1:])  # else it is told by its forces
    return JointTerms(
        linear_damping=damping[0],
        square_damping=damping[1] if len(damping) > 1 else 0.0,
        linear_spring=spring[0] if plain else 0.0,
        cubic_spring=spring[2] if plain and len(spring) > 2 else 0.0,
        dry_friction=float(model.dof_frictionloss[dof]),
    )


def _poly(model: Any, name: str, i: int) -> list[float]:
    """Higher coefficients, which MuJoCo has from 3.7 on."""
    found = getattr(model, name, None)
    return [] if found is None else [float(x) for x in np.atleast_1d(found[i])]


def _of_tendons(axis: Axis) -> JointTerms:
    """Springs that slip, on this joint alone."""
    model = axis.model
    stops = []
    for t in range(model.ntendon):
        yields = float(getattr(model, "tendon_springyield", np.zeros(model.ntendon))[t])
        start, count = int(model.tendon_adr[t]), int(model.tendon_num[t])
        alone = count == 1 and int(model.wrap_objid[start]) == axis.joint and int(model.wrap_type[start]) == 1
        if yields > 0.0 and alone:
            ratio = abs(float(model.wrap_prm[start]))
            stops.append(Stop(yields / ratio, float(model.tendon_stiffness[t]) * ratio * ratio))
    return JointTerms(stops=tuple(stops))


def _of_motors(actuators: list[Actuator]) -> JointTerms:
    """Cogging and bristles of passive dcmotors."""
    motors = [a for a in actuators if a.motor]
    ripples = [
        Sine(a.bias[0] * a.gear, a.bias[1] * a.gear, a.bias[2]) for a in motors if a.bias[0] != 0.0 and a.bias[1] != 0.0
    ]
    bristles = [Bristle(a.bias[3] * abs(a.gear), a.dyn[5] * a.gear * a.gear) for a in motors if a.dyn[5] > 0.0]
    return JointTerms(ripples=tuple(ripples), bristles=tuple(bristles))


def _command(actuators: list[Actuator], axis: Axis) -> tuple[float, tuple[Shaping, ...], list[str]]:
    """(delay in s, what happens to the command, how it was taken); u is the force on the joint."""
    drives = [a for a in actuators if a.gain * a.gear > 0.0 and not a.passive and not a.servo]
    if not drives:
        return 0.0, (), ["u is the force on the joint: no actuator gives one in proportion to its control"]
    drive, model = drives[0], axis.model
    factor = drive.gain * drive.gear
    said = [] if len(drives) == 1 else [f"of {len(drives)} actuators {drive.name} is taken"]
    if factor != 1.0:
        said.append(f"u is the force on the joint, {factor:g} for each unit of the control of {drive.name}")
    dead = next((a for a in actuators if a.gain * a.gear == -factor), None)
    force = abs(drive.gear)
    command = _stage(drive.ctrl_limit, dead.ctrl_limit if dead else None, factor)
    command += [Shaping("lag", drive.lag)] * (drive.lag > 0.0)
    command += _stage(drive.force_limit, dead.force_limit if dead else None, force)
    if (own := symmetric(_force_range(axis))) is not None:
        command.append(Shaping("limit", own))
    delay = drive.delay
    if delay > 0.0 and drive.between and int(model.opt.integrator) == int(axis.mujoco.mjtIntegrator.mjINT_RK4):
        delay = max(delay - 0.5 * float(model.opt.timestep), 0.0)  # see `targets/mjcf.py`
    return delay, tuple(command), said


def _uneven(actuator: Actuator) -> tuple[str, ...]:
    """Of one that gives a force by its command; the pieces of a table have such limits by their nature."""
    return () if actuator.passive else actuator.uneven


def _force_range(axis: Axis) -> tuple[float, ...]:
    """Of all actuators of the joint together."""
    if not axis.model.jnt_actfrclimited[axis.joint]:
        return -math.inf, math.inf
    return tuple(map(float, axis.model.jnt_actfrcrange[axis.joint]))


def _one_limit(command: Sequence[Shaping], missed: list[str]) -> tuple[Shaping, ...]:
    """With the narrowest limit alone, for a model has one. What comes behind it is never reached: a lag and a dead zone
    let through less than they are given. One ahead of these that is wider is, and is said.
    """
    limits = [one for one in command if one.kind == "limit"]
    if len(limits) < 2:
        return tuple(command)
    kept = min(limits, key=lambda one: one.value)
    at = next(i for i, one in enumerate(command) if one is kept)
    for i, one in enumerate(command[:at]):
        if one.kind == "limit" and any(other.kind != "limit" for other in command[i:at]):
            missed.append(f"the limit of the command at {one.value:g}, ahead of a narrower one of the force")
    return tuple(one for one in command if one.kind != "limit" or one is kept)


def _stage(limit: float | None, dead: float | None, factor: float) -> list[Shaping]:
    """A limit and, by a second actuator that takes off what it lets through, a dead zone behind it."""
    found = [Shaping("limit", factor * limit)] if limit is not None else []
    return found + ([Shaping("dead", factor * dead)] if dead is not None else [])


def _load_joint(mujoco: Any, model: Any) -> int | None:
    """The joint of a load that hangs on the only other joint behind a spring or play: two bodies about one axis."""
    if model.njnt != 2 or model.nv != 2:
        return None
    matrix = mass_matrix(mujoco, model)
    rigid = math.isclose(matrix[0, 1], matrix[1, 1], rel_tol=1e-6)
    driven = any(int(model.actuator_trnid[a, 0]) == 1 for a in range(len(model.actuator_trntype)))
    sprung = model.jnt_stiffness[1] > 0.0 or (model.jnt_limited[1] and model.jnt_solref[1, 0] < 0.0)
    return 1 if rigid and sprung and not driven else None


def mass_matrix(mujoco: Any, model: Any) -> Array:
    """Joint-space inertia where the file has the joints, shape (nv, nv)."""
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    unit = np.eye(model.nv)
    out = np.zeros((model.nv, model.nv))
    for i in range(model.nv):
        mujoco.mj_mulM(model, data, out[i], unit[i])
    return out


def _hung(axis: Axis, load: int) -> JointTerms:
    model = axis.model
    matrix = mass_matrix(axis.mujoco, model)
    dof = int(model.jnt_dofadr[load])
    inertia, share = float(matrix[dof, dof]), float(matrix[dof, dof] / matrix[axis.dof, axis.dof])
    square, drag = float(model.jnt_stiffness[load]) / inertia, float(model.dof_damping[dof]) / inertia
    half_gap = 0.0
    if model.jnt_limited[load] and square == 0.0:
        half_gap = 0.5 * float(model.jnt_range[load, 1] - model.jnt_range[load, 0])
        square, drag = (-float(x) * (1.0 - share) for x in model.jnt_solref[load])
    coupling = Coupling(square, drag, half_gap, math.sqrt(square))
    return JointTerms(loads=(Hung(share, coupling),))
