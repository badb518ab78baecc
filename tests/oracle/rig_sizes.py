"""How much a hidden effect pushes in a log, and whether the log shows it: the promises of the outside rig."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy import signal

from tests.oracle import rig_laws, rig_parts
from tests.oracle.rig_cases import RIPPLES, STRENGTHS, Array, Values
from tests.oracle.rig_physics import Machine
from tests.oracle.rig_run import Motion

#: Hz, below which force and drive are compared; a second mass is judged with its resonance.
BAND, BAND_STRUCTURE = 25.0, 100.0
STRUCTURES = ("flexible_coupling", "backlash")


#: Share of the time that a saturation is hit, (least, most).
HITS = (0.015, 0.10)


def band_of(effect: str) -> float:
    """Hz."""
    return BAND_STRUCTURE if effect in STRUCTURES else BAND


def rms(x: Array) -> float:
    return float(np.sqrt(np.mean(np.square(x)))) if len(x) else 0.0


def in_band(x: Array, motion: Motion, band: float = BAND) -> Array:
    """Without phase, at the mean sample rate; the rows of the log only."""
    rate = 1.0 / float(np.mean(np.diff(motion.t)))
    low = signal.butter(2, min(band, 0.45 * rate), fs=rate, output="sos")
    return np.asarray(signal.sosfiltfilt(low, x))[motion.t >= 0.0]


def delayed(motion: Motion, delay: float) -> Array:
    """The command held `delay` ago; 0 before the first."""
    j = np.searchsorted(motion.t + delay, motion.t + 1e-9, side="right") - 1
    return np.where(j >= 0, motion.u[np.maximum(j, 0)], 0.0)


def force(effect: str, values: Values, machine: Machine, motion: Motion) -> Array:
    """Force of one effect at the stamps, shape (n,): what the balance J a = u(t - L) + forces lacks without it."""
    rows = zip(motion.t.tolist(), motion.q.tolist(), motion.v.tolist(), strict=True)
    if effect in rig_laws.APPLIED:
        law = rig_laws.APPLIED[effect](values)
        if isinstance(law, rig_laws.Play):
            return np.array([_with_memory(law, *row) for row in rows])
        return np.array([law(*row) for row in rows])
    if effect in rig_laws.BUDGETS:
        return _friction(effect, machine, motion)
    if effect in rig_parts.COMMANDS:
        return motion.acting - delayed(motion, machine.delay)
    if effect in rig_parts.LOADS:
        load = rig_parts.LOADS[effect](values, machine.inertia)
        apart, closing = motion.q - motion.load_q, motion.v - motion.load_v
        pulled = np.array([load.pull(x, y) for x, y in zip(apart.tolist(), closing.tolist(), strict=True)])
        return load.share * machine.inertia * (motion.acceleration - pulled)
    if effect in rig_parts.MEMORIES:
        return -values["stiffness"] * motion.inner
    angle = 2.0 * motion.q + values["phase"]
    bend = np.cos(angle) * motion.acceleration - np.sin(angle) * motion.v**2
    return -machine.inertia * values["share"] * bend


def _with_memory(law: rig_laws.Play, t: float, q: float, v: float) -> float:
    value = law(t, q, v)
    law.commit(q)
    return value


def _friction(effect: str, machine: Machine, motion: Motion) -> Array:
    """Against the motion with its budget; at rest its share of what balances the others."""
    budgets = {e: _levels(e, p, motion) for e, p in machine.effects.items() if e in rig_laws.BUDGETS}
    own, total = budgets[effect], np.maximum(sum(budgets.values()), 1e-300)
    if not motion.stuck.any():
        return -own * np.sign(motion.v)
    others = motion.acting + sum(
        (force(e, p, machine, motion) for e, p in machine.effects.items() if e not in (*rig_laws.BUDGETS, *_INPUTS)),
        np.zeros_like(motion.v),
    )
    return np.where(motion.stuck, -others * own / total, -own * np.sign(motion.v))


_INPUTS = tuple(rig_parts.COMMANDS)


def _levels(effect: str, values: Values, motion: Motion) -> Array:
    level = rig_laws.BUDGETS[effect](values)
    columns = (motion.t, motion.q, motion.v, motion.acting)
    return np.array([level(*row) for row in zip(*(c.tolist() for c in columns), strict=True)])


def foreseen(effect: str, values: Values, machine: Machine, motion: Motion) -> float:
    """About the rms force that an effect would have on the motion of a machine that lacks it; nan if hard to tell."""
    if effect in rig_parts.COMMANDS:
        return rms(in_band(_commanded(rig_parts.COMMANDS[effect](values), motion) - motion.u, motion))
    if effect in rig_laws.BUDGETS:
        return rms(in_band(_levels(effect, values, motion) * np.sign(motion.v), motion))
    if effect in rig_parts.MEMORIES:
        return rms(in_band(values["level"] * np.sign(motion.v), motion))
    if effect in rig_laws.APPLIED or effect == "swinging_inertia":
        return rms(in_band(force(effect, values, machine, motion), motion))
    return float("nan")


def _commanded(command: rig_parts.Direct, motion: Motion) -> Array:
    out, start, last = [], 0.0, 0.0
    for u, interval in zip(motion.u.tolist(), np.diff(motion.t, prepend=motion.t[0]).tolist(), strict=True):
        start = command.value(start, last, interval)
        last = command.begin(u, interval)
        out.append(start if command.moving else last)
    return np.array(out)


def limits(effect: str, strength: str) -> tuple[float, float]:
    """(least, most) share of the drive. A limit that is hit rarely enough cannot take as much as other effects."""
    least, most = STRENGTHS[strength]
    return (0.35 * least, most) if effect == "saturation" else (least, most)


def promise(effect: str, values: Values, motion: Motion) -> bool:
    """Whether the log exercises what this effect does."""
    shown = Shown.of(motion)
    if not (shown.moving > 0.25 and np.ptp(shown.q) > 0.3 and shown.both_ways > 0.15):
        return False
    check = _PROMISES.get(effect)
    return True if check is None else bool(check(values, shown))


@dataclass(frozen=True)
class Shown:
    """What a log shows: position, speed, |speed| and |u| of shape (n,), motor less load, and shares of the time."""

    q: Array
    v: Array
    speed: Array
    command: Array
    apart: Array
    moving: float
    both_ways: float  # share of the moving time that the rarer direction has
    turns: int
    crossings: int  # of u through 0
    duration: float

    @classmethod
    def of(cls, motion: Motion) -> "Shown":
        log = motion.t >= 0.0
        q, v, u = motion.q[log], motion.v[log], motion.u[log]
        speed = np.abs(v)
        top = np.quantile(speed, 0.99)
        ways, forward = np.sign(v[speed > 0.05 * top]), v[speed > 0.02 * top] > 0.0
        share = float(np.mean(forward)) if len(forward) else 0.0
        return cls(
            q,
            v,
            speed,
            np.abs(u),
            (motion.q - motion.load_q)[log],
            len(forward) / len(v),
            min(share, 1.0 - share),
            int(np.sum(ways[1:] != ways[:-1])),
            int(np.sum(np.diff(np.sign(u)) != 0.0)),
            float(motion.t[-1]),
        )


def _stribeck(p: Values, shown: Shown) -> bool:
    relative = shown.speed / p["velocity"]
    slow, fast = np.mean((relative > 0.15) & (relative < 1.5)), np.mean(relative > 2.5)
    return bool(slow > 0.05 and fast > 0.15 and shown.turns >= 4)


def _dead_zone(p: Values, shown: Shown) -> bool:
    inside = np.mean(shown.command < p["width"])
    return bool(0.05 < inside < 0.8 and p["width"] < np.quantile(shown.command, 0.9) and shown.crossings >= 8)


def _backlash(p: Values, shown: Shown) -> bool:
    """Both flanks are met, and the load is free for a while."""
    touching = np.sign(shown.apart) * (np.abs(shown.apart) > 0.5 * p["gap"])
    sides = touching[touching != 0.0]
    return int(np.sum(sides[1:] != sides[:-1])) >= 4 and 0.01 < float(np.mean(touching == 0.0)) < 0.9


_PROMISES: dict[str, Callable[[Values, Shown], bool]] = {
    "saturation": lambda p, s: HITS[0] <= np.mean(s.command > p["limit"]) <= HITS[1],
    "dead_zone": _dead_zone,
    "stribeck_friction": _stribeck,
    "coulomb_friction": lambda p, s: s.turns >= 4,
    "presliding_friction": lambda p, s: s.turns >= 6,
    "load_friction": lambda p, s: s.turns >= 4,
    "cogging": lambda p, s: p["periods"] * np.ptp(s.q) >= 8.0 * 2.0 * np.pi,
    **dict.fromkeys(RIPPLES, lambda p, s: min(x["periods"] for x in p["lines"]) * np.ptp(s.q) >= 3.0 * 2.0 * np.pi),
    "gravity": lambda p, s: np.ptp(s.q) >= 1.0,
    "cubic_stiffness": lambda p, s: np.ptp(s.q) >= 0.8,
    "periodic_disturbance": lambda p, s: p["frequency"] * s.duration >= 8.0,
    "flexible_coupling": lambda p, s: 8.0 <= p["frequency"] <= 60.0,
    "backlash": _backlash,
    "end_stop": lambda p, s: 0.02 < np.mean(s.q > p["position"]) < 0.5,
    "eddy_brake": lambda p, s: np.mean(s.speed > 1.5 * p["speed"]) > 0.1,
}
