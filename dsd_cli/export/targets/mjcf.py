"""MJCF of MuJoCo: one joint with all that a joint of MuJoCo can have, one actuator `u`.

Runge-Kutta steps: the semi-implicit Euler method takes half a step of damping and of ripple for granted, 0.2 to 4 %.
"""

from __future__ import annotations

import math
from typing import Any
from xml.etree import ElementTree as Xml

import numpy as np

from dsd_cli.effects.joint_terms import JointTerms, Ramps
from dsd_cli.errors import how_to_install
from dsd_cli.export.arm import GRAVITY, Body, axis_of, body_of
from dsd_cli.export.base import DELAY, Joint, Motion, NotRun, Target, Verdict, finite, number
from dsd_cli.export.joint_parts import Chain, Stage, all_terms, chain_of, judged, terms_of
from dsd_cli.signals.log import Array

#: s and rad: steps of the simulation are at most that long, the latter of the fastest oscillation of a load.
LONGEST, OSCILLATION = 1e-3, 0.1
#: s, where springs slip: MuJoCo lets them slip once per step.
LONGEST_WITH_SLIP = 2.5e-4
#: Gain of an actuator that has no use for its control; with 0 MuJoCo takes its damping for a ratio.
NO_GAIN = "1e-12"

_CARRIED = {
    DELAY: "actuator delay (MuJoCo 3.5)",
    "linear_damping": "joint damping",
    "square_damping": "joint damping, second coefficient (MuJoCo 3.7)",
    "linear_spring": "joint stiffness",
    "cubic_spring": "joint stiffness, third coefficient (MuJoCo 3.7)",
    "dry_friction": "joint frictionloss",
    "constant": "a tendon with a far spring",
    "weights": "the mass of an arm",
    "ripples": "passive dcmotor, cogging (MuJoCo 4)",
    "ramps": "passive actuators, one for each straight piece",
    "bristles": "passive dcmotor, lugre (MuJoCo 4)",
    "stops": "tendons with springyield (MuJoCo 4)",
    "command": "ctrlrange, forcerange, filter; with a dead zone a second actuator, to be given the same u",
    "loads": "a second body on a joint with stiffness and damping, or with a limit as soft as the contact",
}


def _judge(joint: Joint, part: str) -> Verdict:
    found = judged(joint, part, _CARRIED, "inertial", "MJCF")
    terms = all_terms(joint)
    own = terms_of(joint, part) if found.carried else JointTerms()
    if own.command and chain_of(terms.command) is None:
        return Verdict(part, False, "MJCF has no such order of lag, limit and dead zone")
    if own.loads and len(terms.loads) > 1:
        return Verdict(part, False, "only one load is carried")
    return found


def _write(joint: Joint) -> bytes:
    terms = all_terms(joint)
    step = _timestep(joint, terms)
    root = Xml.Element("mujoco", model=joint.name)
    _add(root, "compiler", angle="radian")
    _add(root, "option", timestep=number(step), integrator="RK4", gravity=_numbers(0.0, 0.0, -GRAVITY))
    axis = _add(_add(root, "worldbody"), "body", name=joint.name)
    _axis(axis, joint, terms, step)
    _actuators(_add(root, "actuator"), joint, terms, step)
    _tendons(root, joint, terms)
    Xml.indent(root)
    return Xml.tostring(root, encoding="utf-8") + b"\n"


def _timestep(joint: Joint, terms: JointTerms) -> float:
    """A whole part of the controller's clock."""
    rates = [hung.coupling.rate / math.sqrt(1.0 - hung.share) for hung in terms.loads]
    longest = min([LONGEST_WITH_SLIP if terms.stops else LONGEST, *(OSCILLATION / rate for rate in rates)])
    return joint.sample_time / math.ceil(joint.sample_time / longest * (1.0 - 1e-9))


def _axis(body: Any, joint: Joint, terms: JointTerms, step: float) -> None:
    shares = sum(hung.share for hung in terms.loads)
    known: dict[str, str] = {}
    if terms.linear_damping or terms.square_damping:
        known |= {"damping": _numbers(terms.linear_damping, *_higher(terms.square_damping))}
    if terms.linear_spring or terms.cubic_spring:
        known |= {"stiffness": _numbers(terms.linear_spring, *_higher(0.0, terms.cubic_spring))}
    if terms.dry_friction > 0.0:
        # the velocity is gone within a step, and what is left of it does not creep
        known |= {"frictionloss": number(terms.dry_friction), "solreffriction": _numbers(2.0 * step, 1.0),
                      "solimpfriction": "0.9999 0.9999 0.001"}  # fmt: skip
    _add(body, "joint", name=joint.name, **_kind(joint), **known)
    _inertial(body, body_of(joint, terms, 1.0 - shares))
    for hung in terms.loads:
        load = _add(body, "body", name=f"{joint.name}_load")
        inertia = joint.model.inertia * hung.share
        square, drag, half_gap = hung.coupling.square, hung.coupling.drag, hung.coupling.half_gap
        if half_gap == 0.0:
            spring = {"stiffness": number(inertia * square), "damping": number(inertia * drag)}
        else:  # of a limit that gives way, MuJoCo takes stiffness and damping per mass of both bodies together
            both = (1.0 - hung.share) or 1.0
            spring = {"range": _numbers(-half_gap, half_gap), "limited": "true", "solimplimit": "0.0001 0.0001 0.001",
                          "solreflimit": _numbers(-square / both, -drag / both)}  # fmt: skip
        _add(load, "joint", name=f"{joint.name}_coupling", **_kind(joint), **spring)
        _inertial(load, body_of(joint, JointTerms(), hung.share))


def _add(parent: Any, tag: str, **known: str) -> Any:
    return Xml.SubElement(parent, tag, known)


def _higher(*coefficients: float) -> tuple[float, ...]:
    """Coefficients beyond the first, none where they are 0: MuJoCo before 3.7 has but the first."""
    return coefficients if any(coefficients) else ()


def _kind(joint: Joint) -> dict[str, str]:
    return {"type": "slide" if joint.linear else "hinge", "axis": _numbers(*axis_of(joint))}


def _inertial(parent: Any, body: Body) -> None:
    inertia = _numbers(body.inertia, body.inertia, body.inertia)
    _add(parent, "inertial", pos=_numbers(*body.centre), mass=number(body.mass), diaginertia=inertia)
    shown = {"fromto": "0 0 0 0 0 0.1", "size": "0.01", "contype": "0", "conaffinity": "0"}
    _add(parent, "geom", type="capsule", **shown)


def _actuators(parent: Any, joint: Joint, terms: JointTerms, step: float) -> None:
    """`u` first, so that it is ctrl[0]."""
    chain = chain_of(terms.command) or Chain(Stage(), 0.0, Stage())
    common: dict[str, str] = {}
    if joint.model.delay > 0.0:
        # a step of Runge-Kutta reads the line between two commands half a step too early
        late = joint.model.delay + 0.5 * step
        common |= {"delay": number(late), "nsample": str(math.ceil(late / step) + 2), "interp": "linear"}
    if chain.lag > 0.0:
        exact = chain.lag < 0.5 * step  # then a step of Runge-Kutta would grow
        common |= {"dyntype": "filterexact" if exact else "filter", "dynprm": number(chain.lag)}
        common |= {"actearly": "true"} if exact else {}
    limits = {**_range("ctrlrange", chain.before.limit), **_range("forcerange", chain.after.limit)}
    _add(parent, "general", name="u", joint=joint.name, **common, **limits)
    if chain.before.dead or chain.after.dead:
        limits = {**_range("ctrlrange", chain.before.dead), **_range("forcerange", chain.after.dead)}
        _add(parent, "general", name="u_dead", joint=joint.name, gainprm="-1", **common, **limits)
    weights = terms.weights if joint.linear else ()
    for i, sine in enumerate((*terms.ripples, *weights), 1):  # torque A/n at n turns of the motor
        ripple = _numbers(sine.amplitude / sine.periods, 1.0, sine.phase)
        _passive_motor(parent, f"ripple_{i}", joint, gear=number(sine.periods), cogging=ripple)
    for i, bristle in enumerate(terms.bristles, 1):
        lugre = _numbers(bristle.stiffness, 0.0, bristle.level, bristle.level, 1.0)
        _passive_motor(parent, f"bristle_{i}", joint, lugre=lugre)
    for i, ramps in enumerate(terms.ramps, 1):
        _passive_ramps(parent, f"ramp_{i}", joint, ramps)


def _range(name: str, limit: float | None) -> dict[str, str]:
    return {} if limit is None else {name: _numbers(-limit, limit)}


def _passive_motor(parent: Any, name: str, joint: Joint, **known: str) -> None:
    none = {"input": "none", "motorconst": "0", "resistance": "1"}
    _add(parent, "dcmotor", name=name, joint=joint.name, **none, **known)


def _passive_ramps(parent: Any, name: str, joint: Joint, ramps: Ramps) -> None:
    """A clipped line for each piece: those right of 0 grow from 0 on, those left of it towards it."""
    pieces = zip(ramps.knots, ramps.knots[1:], ramps.values, ramps.values[1:], strict=False)
    for i, (x0, x1, y0, y1) in enumerate(((*p,) for p in pieces if p[2] != p[3]), 1):
        slope = (y1 - y0) / (x1 - x0)
        at, low, high = (x0, 0.0, y1 - y0) if x0 >= 0.0 else (x1, y0 - y1, 0.0)
        bias = (-slope * at, 0.0, slope) if ramps.over == "velocity" else (-slope * at, slope, 0.0)
        clipped = {"biasprm": _numbers(*bias), "forcerange": _numbers(min(low, high), max(low, high))}
        _add(parent, "general", name=f"{name}_{i}", joint=joint.name, gainprm=NO_GAIN, biastype="affine",
                       **clipped)  # fmt: skip


def _tendons(root: Any, joint: Joint, terms: JointTerms) -> None:
    constant = terms.constant + sum(_at_zero(ramps) for ramps in terms.ramps)
    springs = [{"name": f"stop_{i}", "stiffness": number(stop.stiffness), "springyield": number(stop.radius)}
               for i, stop in enumerate(terms.stops, 1)]  # fmt: skip
    if constant:
        far = math.copysign(FAR, constant)
        springs.append({"name": "constant", "stiffness": number(constant / far), "springlength": number(far)})
    if springs:
        parent = _add(root, "tendon")
        for spring in springs:
            _add(_add(parent, "fixed", **spring), "joint", joint=joint.name, coef="1")


#: rad or m: so far off is the end of a spring that stands for a constant force; it is off by that share of the travel.
FAR = 1e6


def _at_zero(ramps: Ramps) -> float:
    """What its pieces are counted from: the value at the knot where those right and left of 0 meet."""
    return next((y for x, y in zip(ramps.knots, ramps.values, strict=True) if x >= 0.0), ramps.values[-1])


def _numbers(*values: float) -> str:
    return " ".join(map(number, values))


def _run(content: bytes, joint: Joint, motion: Motion) -> Array:
    try:
        import mujoco
    except ImportError:
        raise NotRun(f"MuJoCo is not installed: {how_to_install('sim')}") from None
    try:
        model = mujoco.MjModel.from_xml_string(content.decode())
    except ValueError as error:
        why = " ".join(str(error).split())[:150]
        raise NotRun(f"MuJoCo {mujoco.mj_versionString()} does not read it ({why})") from None
    data = mujoco.MjData(model)
    data.qpos[0], data.qvel[0] = motion.position, motion.velocity
    commands = [i for i in range(model.nu) if model.actuator(i).name in ("u", "u_dead")]
    substeps = round(motion.sample_time / model.opt.timestep)
    velocity = np.empty(len(motion.u))
    for k, u in enumerate(motion.u.tolist()):
        velocity[k] = data.qvel[0]
        data.ctrl[commands] = u
        mujoco.mj_step(model, data, substeps)
    return finite(velocity, "MuJoCo")


TARGET = Target(
    id="mjcf",
    summary="A joint of MuJoCo.",
    suffix=".xml",
    judge=_judge,
    write=_write,
    run=_run,
)
