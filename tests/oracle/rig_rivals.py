"""Whether a hidden force could pass for another one in this log: how much of it one other law explains.

Inertia and delay, and the coefficients of what is there besides, are free in every comparison, as they are for anyone
who has nothing but the log. A log in which a rival explains all but a thousandth of the drive shows no single cause.
"""

import math
from collections.abc import Iterable

import numpy as np

from tests.oracle.rig_cases import Array
from tests.oracle.rig_run import Motion
from tests.oracle.rig_sizes import in_band

#: Rows of the comparison per Hz of the band and second.
_DENSITY = 4.0


def _rows(x: Array, motion: Motion, band: float) -> Array:
    """Below the band, thinned out, without mean of its own rate."""
    rate = 1.0 / float(np.mean(np.diff(motion.t)))
    return in_band(x, motion, band)[:: max(int(rate / (_DENSITY * band)), 1)]


def _columns(motion: Motion, u: Array) -> dict[str, list[Array]]:
    """Rivals by id, each a list of columns at the stamps; u is what the actuator is told, delayed."""
    q, v = motion.q, motion.v
    speed, way = np.abs(v), np.where(motion.stuck, 0.0, np.sign(v))
    top, levels = float(np.quantile(speed, 0.99)), np.quantile(np.abs(u), [0.3, 0.6, 0.93, 0.98])
    slow = [[way * np.exp(-((v / (share * top)) ** 2))] for share in (0.08, 0.16)]
    spans = [0.02 * float(np.ptp(q)), 0.06 * float(np.ptp(q))]
    columns: dict[str, list[list[Array]]] = {
        "viscous_friction": [[v]],
        "coulomb_friction": [[way]],
        "stribeck_friction": slow,
        "viscous_asymmetry": [[speed]],
        "quadratic_drag": [[v * speed]],
        "load_friction": [[way * np.abs(u)]],
        "constant_load": [[np.ones_like(v)]],
        "stiffness": [[q]],
        "cubic_stiffness": [[q**3]],
        "gravity": [[np.sin(q), np.cos(q)]],
        "presliding_friction": [[_built_up(q, span)] for span in spans],
        "dead_zone": [[np.clip(u, -w, w)] for w in levels[:2]],
        "saturation": [[u - np.clip(u, -w, w)] for w in levels[2:]],
        "actuator_lag": [[_lagged(u, motion.t, lag) - u] for lag in (0.01, 0.04)],
    }
    return {f"{e}#{i}": c for e, many in columns.items() for i, c in enumerate(many)}


def _built_up(q: Array, span: float) -> Array:
    """Dahl's friction over the way that was gone."""
    out, h = np.zeros_like(q), 0.0
    for k, step in enumerate(np.diff(q).tolist()):
        way = 1.0 if step > 0.0 else -1.0
        h = way + (h - way) * math.exp(-abs(step) / span)
        out[k + 1] = h
    return out


def _lagged(u: Array, t: Array, lag: float) -> Array:
    out, y = np.empty_like(u), float(u[0])
    for k, (x, dt) in enumerate(zip(u.tolist(), np.diff(t, append=t[-1]).tolist(), strict=True)):
        out[k] = y
        y += (x - y) * -math.expm1(-dt / lag)
    return out


def nearest(effect: str, forces: dict[str, Array], motion: Motion, u: Array, band: float) -> tuple[str, float]:
    """(id of the rival, share of the force's rms that even it leaves, 0 to 1); "inertia, delay" alone is one as well.

    forces : of all that acts, by id, each of shape (n,); those of other effects are free in size.
    """
    target = _rows(forces[effect], motion, band)
    whole = float(np.sqrt(np.mean(target**2)))
    if whole == 0.0:
        return "nothing", 0.0
    free = [motion.acceleration, np.gradient(u, motion.t), *(f for e, f in forces.items() if e != effect)]
    if effect in ("inertia", "delay"):
        free.pop(0 if effect == "inertia" else 1)
    base = [_rows(x, motion, band) for x in free]
    left = {"inertia, delay": _left(target, base)}
    for name, columns in _columns(motion, u).items():
        rival = name.split("#")[0]
        if rival not in (effect, *forces):
            left[name] = _left(target, [*base, *(_rows(x, motion, band) for x in columns)])
    best = min(left, key=left.__getitem__)
    return best.split("#")[0], left[best] / whole


def _left(target: Array, columns: Iterable[Array]) -> float:
    table = np.stack([c / max(float(np.max(np.abs(c))), 1e-300) for c in columns], axis=1)
    solution = np.linalg.lstsq(table, target, rcond=None)[0]
    return float(np.sqrt(np.mean((target - table @ solution) ** 2)))
