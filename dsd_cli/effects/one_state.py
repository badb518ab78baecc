"""Hysteresis with one state, which `dsd learn` writes: Bouc-Wen's law, and LuGre's bristles.

    h' = (v/delta) (1 - |h|^n (b + g sgn(v h))), b + g = 1       Bouc (1967), Wen (1976); h = z/delta
    h' = (v/delta) (1 - h sgn v/G(v)), G = 1 + (Fs/Fc) exp(-(v/vs)^2)       Canudas de Wit et al. (1995)

Dahl's law (`presliding_friction`) is the first with n = 1, b = 0, and the second without Fs. No cycle gives energy
where b <= g (Erlicher and Point 2004): the slope right after a turn, 2 g, is 1 at least.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from dsd_cli.effects.base import Channels, Effect, Parameter, Role, Shape, Values, decay
from dsd_cli.effects.joint_terms import JointTerms
from dsd_cli.effects.memory import COMPILED, before_each, one_pole
from dsd_cli.signals.log import Array


def build_up(way: Any, before: Any, exponent: Any, unloading: Any) -> tuple[Any, Any]:
    """(h at the end, mean h) after a way, in distances, for numbers: an exponential step (Rosenbrock-Euler), exact for
    n = 1; h never goes beyond the level, nor beyond where it was."""
    if way == 0.0:
        return before, before
    side = 1.0 if way > 0.0 else -1.0
    x, w = side * way, side * before
    size = abs(w)
    factor = 1.0 if w >= 0.0 else 1.0 - unloading
    power = size ** (exponent - 1.0)
    rate = 1.0 - factor * power * size
    bend = x * exponent * abs(factor) * power
    _, mean = decay(bend)
    half = (1.0 - mean) / bend if bend > _FLAT else 0.5 - bend / 6.0
    most = size if size > 1.0 else 1.0
    end, middle = w + x * mean * rate, w + x * half * rate
    return side * (most if end > most else end), side * (most if middle > most else middle)


#: Below which the step is a line: the next term of its series is 1e-13.
_FLAT = 1e-6


def built_up(moved: Array, before: float, shape: Shape, compiled: Any = COMPILED) -> tuple[Array, float]:
    """(mean h of every row, the last h); moved : way of each row, in distances, shape (n,)."""
    exponent, unloading = float(shape["exponent"]), float(shape["unloading"])
    out, h = np.empty(len(moved)), before
    if compiled is not None:
        return out, compiled.bouc_wen(np.ascontiguousarray(moved), exponent, unloading, before, out)
    for k, way in enumerate(moved.tolist()):
        h, out[k] = build_up(way, h, exponent, unloading)
    return out, h


def _bouc_wen(channels: Channels, shape: Shape, state: float | None) -> tuple[tuple[Any, ...], float]:
    """Minus the mean h over the interval; state: the last h."""
    moved = channels.velocity * channels.interval / shape["distance"]
    before = 0.0 if state is None else state
    if np.ndim(moved) == 0:
        end, mean = build_up(moved, before, shape["exponent"], shape["unloading"])
        return (-mean,), end
    mean, end = built_up(moved, before, shape)
    return (-mean,), end


def _lugre(channels: Channels, shape: Shape, state: float | None) -> tuple[tuple[Any, ...], float]:
    """Minus the mean h over the interval, and minus the mean z'; state: the last h. Exact for constant speed."""
    v, interval, before = channels.velocity, channels.interval, 0.0 if state is None else state
    relative = v / shape["velocity"]
    level = 1.0 + shape["ratio"] * np.exp(-relative * relative)
    moved = v * interval / shape["distance"]
    goal = np.sign(moved) * level
    left, mean_left = decay(abs(moved) / level)
    begun: Any = before
    if np.ndim(moved) == 0:
        last = goal + (before - goal) * left
    else:
        ends = one_pole(left, goal * (1.0 - left), before)
        begun, last = before_each(ends, before), float(ends[-1]) if ends.size else before
    mean = goal + (begun - goal) * mean_left
    rate = v - abs(v) * mean / level  # z' = v - |v| z/(delta G), and h is its mean
    return (-mean, -rate), last


def _split_bouc_wen(values: Values, _: float) -> tuple[tuple[float, ...], Shape]:
    shape = {name: values[name] for name in ("exponent", "unloading")}
    return (float(values["level"]),), {"distance": values["level"] / values["stiffness"], **shape}


def _join_bouc_wen(coefficients: tuple[float, ...], shape: Shape, _: float) -> Values:
    level = coefficients[0]
    return {"level": level, "stiffness": level / shape["distance"], "exponent": shape["exponent"],
            "unloading": shape["unloading"]}  # fmt: skip


def _split_lugre(values: Values, _: float) -> tuple[tuple[float, ...], Shape]:
    level = float(values["level"])
    shape = {"distance": level / values["stiffness"], "ratio": values["excess"] / level, "velocity": values["velocity"]}
    return (level, float(values["damping"])), shape


def _join_lugre(coefficients: tuple[float, ...], shape: Shape, _: float) -> Values:
    level = coefficients[0]
    return {"level": level, "damping": (*coefficients, 0.0)[1], "stiffness": level / shape["distance"],
            "excess": level * shape["ratio"], "velocity": shape["velocity"]}  # fmt: skip


_LEVEL = Parameter("level", "{u}", "Fc, the force when fully built up", lower=1e-12)
_STIFFNESS = Parameter("stiffness", "{u}/({q})", "slope from rest: Fc/delta", lower=1e-9, linear=False)


def _state_law(name: str, **others: Any) -> Effect:
    return Effect(
        id=name,
        role=Role.APPLIED,
        needs=("velocity",),
        starts=lambda _: [],
        memory=True,
        repeats=lambda _: False,
        rarity=9,
        joint=lambda _, __: JointTerms(missing="hysteresis with a state of its own"),
        **others,
    )


BOUC_WEN = _state_law(
    "bouc_wen",
    law="-Fc h, h' = (v/delta) (1 - |h|^n (1 - unloading/2 + unloading/2 sgn(v h)))",
    summary="Hysteresis with one state (Bouc-Wen), as `dsd learn` finds it: a spring that yields.",
    pattern="the residual over position runs in smooth loops, which do not depend on how fast the axis moves",
    parameters=(
        _LEVEL,
        _STIFFNESS,
        Parameter("exponent", "", "n, how suddenly it yields; 1 is Dahl's", lower=1.0, linear=False),
        Parameter("unloading", "", "slope right after a turn, of that from rest; 2 is Dahl's", lower=1.0, linear=False),
    ),
    columns=_bouc_wen,
    split=_split_bouc_wen,
    join=_join_bouc_wen,
)

LUGRE = _state_law(
    "lugre_friction",
    law="-(Fc h + d z'), z' = v (1 - h sgn v/(1 + Fs/Fc exp(-(v/vs)^2))), h = z/delta",
    summary="Dry friction of bristles (LuGre), as `dsd learn` finds it: builds up over a way, higher when slow.",
    pattern="a hysteresis loop after each turn, which bends over into a level that falls as the speed grows",
    parameters=(
        _LEVEL,
        Parameter("damping", "{u}/({v})", "d, of the bristles while they bend"),
        _STIFFNESS,
        Parameter("excess", "{u}", "Fs, what the level has more when slow", lower=0.0, linear=False),
        Parameter("velocity", "{v}", "vs, speed at which 37 % of the excess are left", lower=1e-9, linear=False),
    ),
    columns=_lugre,
    split=_split_lugre,
    join=_join_lugre,
)
