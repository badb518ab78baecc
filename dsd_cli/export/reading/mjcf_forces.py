"""What drives a joint of a compiled MuJoCo model, and which of its forces nothing has named yet."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from dsd_cli.effects.joint_terms import JointTerms, Ramps, Sine
from dsd_cli.signals.log import Array

#: Affine bias, and that of a dcmotor (mjtBias).
_AFFINE, _MOTOR = 1, 3
#: Gain below which a control does nothing.
_NO_GAIN = 1e-9
#: Share of the largest force that is rounding; positions at which the force is asked for, and rad or m of them.
_ROUNDING, _COUNT, _REACH = 1e-5, 41, 1.0


@dataclass(frozen=True)
class Actuator:
    """One that acts on the joint; forces before the gear.

    lag, delay : s. ctrl_limit, force_limit : symmetric ones, None without. force_range : any, infinite without.
    between : it reads the line between two commands. passive : its control does nothing. servo : why it is a
    controller; "". uneven : of its limits those that are not alike on either side, in words.
    """

    index: int
    name: str
    gain: float
    gear: float
    bias: tuple[float, ...]
    dyn: tuple[float, ...]
    lag: float
    delay: float
    between: bool
    ctrl_limit: float | None
    force_limit: float | None
    force_range: tuple[float, float]
    motor: bool
    passive: bool
    servo: str
    uneven: tuple[str, ...]


def actuators_of(axis: Any) -> list[Actuator]:
    """Those on this joint, in the order of the file."""
    model = axis.model
    found = range(len(model.actuator_trntype))
    return [_actuator(axis.mujoco, model, i) for i in found if _on(model, i, axis.joint)]


def _on(model: Any, i: int, joint: int) -> bool:
    return int(model.actuator_trntype[i]) in (0, 1) and int(model.actuator_trnid[i, 0]) == joint


def _actuator(mujoco: Any, model: Any, i: int) -> Actuator:
    name = mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_ACTUATOR, i) or f"actuator_{i}"
    dynamics = mujoco.mjtDyn(int(model.actuator_dyntype[i])).name
    bias = tuple(map(float, model.actuator_biasprm[i]))
    kind, gain = int(model.actuator_biastype[i]), float(model.actuator_gainprm[i, 0])
    motor = kind == _MOTOR
    passive = motor or abs(gain) < _NO_GAIN
    servo = ""
    if not passive and kind == _AFFINE and any(bias[1:3]):
        servo = f"a servo (kp {0.0 - bias[1]:g}, kv {0.0 - bias[2]:g}) is a controller, not a joint"
    elif dynamics not in ("mjDYN_NONE", "mjDYN_FILTER", "mjDYN_FILTEREXACT") and not motor:
        servo = f"dynamics {dynamics.removeprefix('mjDYN_').lower()}"
    limited = bool(model.actuator_forcelimited[i])
    low, high = map(float, model.actuator_forcerange[i]) if limited else (-math.inf, math.inf)
    ctrl = (-math.inf, math.inf) if motor else _ctrl_range(model, i)
    history = getattr(model, "actuator_history", None)
    return Actuator(
        index=i,
        name=str(name),
        gain=0.0 if passive else gain,
        gear=float(model.actuator_gear[i, 0]),
        bias=bias,
        dyn=tuple(map(float, model.actuator_dynprm[i])),
        lag=float(model.actuator_dynprm[i, 0]) if "FILTER" in dynamics else 0.0,
        delay=float(model.actuator_delay[i]) if history is not None else 0.0,
        between=history is not None and int(history[i][1]) == 1,
        ctrl_limit=symmetric(ctrl),
        force_limit=symmetric((low, high)),
        uneven=(*uneven("command", ctrl), *uneven("force", (low, high))),
        force_range=(low, high),
        motor=motor,
        passive=passive,
        servo=servo,
    )


def _ctrl_range(model: Any, i: int) -> tuple[float, ...]:
    """Of its first control; an actuator has one, or from MuJoCo 3.12 on none or several."""
    places = getattr(model, "actuator_ctrladr", None)
    k = i if places is None else int(places[i])
    limited = k >= 0 and bool(model.actuator_ctrllimited[k])
    return tuple(map(float, model.actuator_ctrlrange[k])) if limited else (-math.inf, math.inf)


def symmetric(limits: tuple[float, ...]) -> float | None:
    """The limit on either side; None where there is none, or it is another on one side."""
    low, high = limits
    return high if math.isfinite(high) and math.isclose(-low, high, rel_tol=1e-9) else None


def uneven(what: str, limits: tuple[float, ...]) -> list[str]:
    """That limits are not alike on either side, which no effect is."""
    one_sided = any(map(math.isfinite, limits)) and symmetric(limits) is None
    return [f"limits of the {what}, {limits[0]:g} and {limits[1]:g}: not alike on either side"] * one_sided


def passive_damping(actuators: list[Actuator]) -> float:
    """Of passive actuators without a limit of their force."""
    return sum(-a.bias[2] * a.gear * a.gear for a in _lines(actuators) if math.isinf(a.force_range[1]))


def _lines(actuators: list[Actuator]) -> list[Actuator]:
    """Passive actuators whose force is a straight line, clipped or not."""
    return [a for a in actuators if a.passive and not a.motor]


def remaining(axis: Any, actuators: list[Actuator], terms: JointTerms) -> JointTerms:
    """A constant, a weight and tables: the forces at rest and in motion that the terms do not have."""
    q = _positions(axis)
    springs = _springs(q, terms)
    static = _asked(axis, actuators, positions=q) - springs
    least = _ROUNDING * float(np.max(np.abs(static)) + np.max(np.abs(springs)))
    constant, weights, ramps = _over_position(axis, q, static, least)
    if ramps and (knees := _knees(actuators, 1)):
        at = np.array(knees)
        exact = _asked(axis, actuators, positions=at) - _springs(at, terms)
        if np.allclose(np.interp(q, at, exact), static, rtol=0.0, atol=least):
            ramps = (Ramps("position", knees, tuple(map(float, exact))),)
    if knees := _knees(actuators, 2):
        v = np.array(knees)
        moving = _asked(axis, actuators, speeds=v) - _asked(axis, actuators, speeds=np.zeros(1))
        moving += terms.linear_damping * v + terms.square_damping * v * np.abs(v)
        ramps += (Ramps("velocity", knees, tuple(map(float, moving))),)
    return JointTerms(constant=constant, weights=weights, ramps=ramps)


def _positions(axis: Any) -> Array:
    """Where the force is asked for: within end stops, else a turn or a metre to both sides."""
    limited = bool(axis.model.jnt_limited[axis.joint])
    reach = _REACH if axis.linear else math.pi
    low, high = map(float, axis.model.jnt_range[axis.joint]) if limited else (-reach, reach)
    return np.linspace(low, high, _COUNT)


def _asked(axis: Any, actuators: list[Actuator], positions: Array | None = None, speeds: Array | None = None) -> Array:
    """Force on the joint without a command, at rest at these positions, or in motion at the first one."""
    mujoco, model = axis.mujoco, axis.model
    data = mujoco.MjData(model)
    at = positions if positions is not None else speeds
    assert at is not None
    out = np.empty(len(at))
    for k, x in enumerate(at):
        mujoco.mj_resetData(model, data)
        if positions is not None:
            data.qpos[axis.place] = x
        else:
            data.qvel[axis.dof] = x
        mujoco.mj_forward(model, data)
        driven = sum(a.gear * float(data.actuator_force[a.index]) for a in _lines(actuators))
        out[k] = float(data.qfrc_passive[axis.dof] - data.qfrc_bias[axis.dof]) + driven
    return out


def _springs(positions: Array, terms: JointTerms) -> Array:
    stops = sum(stop.stiffness for stop in terms.stops)
    return np.asarray(-(terms.linear_spring + stops) * positions - terms.cubic_spring * positions**3)


def _over_position(
    axis: Any, q: Array, force: Array, least: float
) -> tuple[float, tuple[Sine, ...], tuple[Ramps, ...]]:
    """A constant and, of what turns, a weight; else a table. `least` : force that is none."""
    columns = np.stack([np.ones(len(q))] if axis.linear else [np.ones(len(q)), np.sin(q), np.cos(q)], 1)
    solved, *_ = np.linalg.lstsq(columns, force, rcond=None)
    if float(np.max(np.abs(force - columns @ solved))) > least:
        return 0.0, (), (Ramps("position", tuple(map(float, q)), tuple(map(float, force))),)
    parts = [float(x) if abs(x) > least else 0.0 for x in solved]
    if axis.linear or not (parts[1] or parts[2]):
        return parts[0], (), ()
    return parts[0], (Sine(-math.hypot(*parts[1:]), 1.0, math.atan2(-parts[2], -parts[1])),), ()


def _knees(actuators: list[Actuator], of: int) -> tuple[float, ...]:
    """Positions (of = 1) or speeds (2) at which a passive actuator begins to give a force, or gives no more."""
    found: list[float] = []
    for a in _lines(actuators):
        slope = a.bias[of] * a.gear
        found += [(limit - a.bias[0]) / slope for limit in a.force_range if slope and math.isfinite(limit)]
    kept: list[float] = []
    for x in sorted(found):
        if not kept or x - kept[-1] > 1e-9 * max(abs(x), 1e-9):
            kept.append(x)
    return tuple(kept)
