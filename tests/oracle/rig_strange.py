"""Laws that are in no catalogue, on a servo axis of its own: what drives, gears, bearings and cables do besides.

A law is a function `force(s, t, q, v, u)`, unit of u, positive accelerates; `s` is what it draws for one machine, and
what it remembers between the steps. Where it has a `friction`, the level of that opposes the motion, and holds at rest.
Nothing of the project is imported; the motion is integrated in plain floats with four steps of the midpoint rule a
sample. `LAWS` may be extended by anybody: a file with a dictionary `LAWS` of the same kind is all that the study needs.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from tests.oracle.rig_strange_laws import LAWS, Law, State
from tests.oracle.rig_strange_laws import Array as Array

#: counts per turn (0: none is logged) and noise of the speed in shares of its rms (None: none is logged).
SENSORS = {"speed40k": (40_000, 1e-3), "speedloud": (40_000, 1.5e-2), "enc40k": (40_000, None), "enc4096": (4096, None)}
STEPS = 4


@dataclass(frozen=True)
class StrangeLog:
    """A log with one law in it.

    channels : t, u, and position, velocity as logged. truth : force of the law per sample, mean over the interval that
    ends there, shape (n,). motion : exact position and speed. drawn : what the law drew, and remembers at the start.
    """

    channels: dict[str, Array]
    inertia: float
    delay: float
    believed: dict[str, Any]
    truth: Array
    motion: tuple[Array, Array]
    law: str
    values: dict[str, float] = field(default_factory=dict)
    drawn: dict[str, Any] = field(default_factory=dict)


def reference(rng: np.random.Generator, t: Array, kind: str) -> tuple[Array, Array, Array]:
    """Position, speed, acceleration: sines that never repeat, or moves with rests between them."""
    if kind == "sines":
        hz = np.sort(rng.uniform(0.15, 2.2, 5))
        size = rng.uniform(0.5, 1.0, 5) / hz
        size *= 1.1 / np.sum(size)
        w, phase = 2.0 * math.pi * hz, rng.uniform(0.0, 2.0 * math.pi, 5)
        angle = np.outer(t, w) + phase
        return (np.sin(angle) @ size, np.cos(angle) @ (size * w), -np.sin(angle) @ (size * w * w))
    q, v, a = (np.zeros_like(t) for _ in range(3))
    start, place = 0.1, 0.0
    while start < t[-1]:
        goal = float(rng.uniform(-1.2, 1.2))
        move, top = goal - place, rng.uniform(1.5, 6.0)
        last = max(1.875 * abs(move) / top, math.sqrt(5.8 * abs(move) / 60.0), 0.05)
        x = np.clip((t - start) / last, 0.0, 1.0)
        q += move * (10 * x**3 - 15 * x**4 + 6 * x**5)
        v += move / last * (30 * x**2 - 60 * x**3 + 30 * x**4)
        a += move / last**2 * (60 * x - 180 * x**2 + 120 * x**3)
        start, place = start + last + rng.uniform(0.02, 0.2), goal
    return q, v, a


def make(
    law: str,
    seed: int,
    sensor: str = "speed40k",
    motion: str = "sines",
    duration: float = 20.0,
    laws: dict[str, Law] | None = None,
    second: int = 0,
) -> StrangeLog:
    """One log; `second` gives further motions of the same machine. `law` "nothing" hides none."""
    laws = {**LAWS, **(laws or {})}
    machine, wanted = np.random.default_rng([seed, 1]), np.random.default_rng([seed, 2, second])
    inertia = float(np.exp(machine.uniform(math.log(2e-3), math.log(0.2))))
    delay = float(machine.uniform(0.0, 0.004))
    own = {"viscous": 0.6 * inertia * machine.uniform(0.3, 1.0), "dry": 1.5 * inertia * machine.uniform(0.3, 1.0)}
    state = State(machine, 15.0 * inertia * float(machine.uniform(0.35, 0.7)), inertia)
    found = laws[law] if law != "nothing" else Law("nothing", lambda s: {}, lambda s, t, q, v, u: 0.0)
    state.__dict__.update(found.draw(state))
    drawn = dict(vars(state))
    t = 1e-3 * np.arange(-1000, round(duration * 1e3))
    path = reference(wanted, t, motion)
    u, q, v, force = _run(found, state, (inertia, delay, own["viscous"], own["dry"]), t, path)
    log = t >= 0.0
    counts, noise = SENSORS[sensor]
    rng = np.random.default_rng([seed, 3, second, sorted(SENSORS).index(sensor)])
    step = 2.0 * math.pi / counts
    channels = {"t": t[log], "u": u[log], "position": (step * np.round(q / step))[log]}
    if noise is not None:
        size = noise * float(np.sqrt(np.mean(v**2)))
        channels["velocity"] = (v + size * rng.standard_normal(len(v)))[log]
    believed = {
        "viscous_friction": {"coefficient": own["viscous"]},
        "coulomb_friction": {"level": own["dry"]},
    }
    values = {k: x for k, x in vars(state).items() if isinstance(x, float)}
    return StrangeLog(channels, inertia, delay, believed, force[log], (q[log], v[log]), law, values, drawn)


def on_motion(log: StrangeLog, law: Law, motion: tuple[Array, ...], sign: Array) -> Array:
    """Force of the law of a log per sample, shape (n,), on any motion (t, q, v, a, u), with this direction, -1 to 1."""
    state = State(np.random.default_rng(0), 0.0, 0.0)
    state.__dict__.update(log.drawn)
    found = []
    for (t, q, v, a, u), side in zip(np.stack(motion, axis=1).tolist(), sign.tolist(), strict=True):
        force = law.force(state, t, q, v, u)
        if law.friction:
            force -= side * law.friction(state, t, q, v, u)
        if law.inertia and law.slope:
            force -= law.inertia(state, q) * a + 0.5 * law.slope(state, q) * v * v
        if law.after:
            law.after(state, q, v, 1e-3)
        found.append(force)
    return np.array(found)


def _run(
    law: Law, state: State, axis: tuple[float, float, float, float], t: Array, path: tuple[Array, Array, Array]
) -> tuple[Array, Array, Array, Array]:
    """PD with the wanted acceleration fed forward; the command is held, and delayed by a part of a sample or more."""
    inertia, delay, viscous, dry = axis
    band = 25.0
    kp, kd = inertia * band**2 * 0.5, inertia * band
    h = 1e-3 / STEPS
    behind = round(delay / h)
    sent = [0.0] * (behind + STEPS)
    q, v = float(path[0][0]), float(path[1][0])
    out = np.zeros((4, len(t)))
    wanted = np.stack(path, axis=1).tolist()
    step = _stepper(law, state, inertia, viscous, dry, h)
    for k, (rq, rv, ra) in enumerate(wanted):
        u = kp * (rq - q) + kd * (rv - v) + inertia * ra
        out[0, k], out[1, k], out[2, k] = u, q, v
        sent += [u] * STEPS
        total, at = 0.0, float(t[k])
        for i in range(STEPS):
            q, v, f = step(at + i * h, q, v, sent[len(sent) - STEPS - behind + i])
            total += f / STEPS
        if k + 1 < len(t):
            out[3, k + 1] = total
        if len(sent) > 4 * (behind + STEPS) + 4096:
            del sent[: -(behind + STEPS)]
    return out[0], out[1], out[2], out[3]


def _stepper(
    law: Law, state: State, inertia: float, viscous: float, dry: float, h: float
) -> Callable[[float, float, float, float], tuple[float, float, float]]:
    """One step: (q, v, force of the law with its share of the friction, that of an inertia too)."""
    force, friction, more, slope, after = law.force, law.friction, law.inertia, law.slope, law.after

    def push(t: float, q: float, v: float, u: float, direction: float) -> tuple[float, float]:
        """(acceleration, force of the law)."""
        f = force(state, t, q, v, u)
        level = friction(state, t, q, v, u) if friction else 0.0
        f -= direction * level
        net = u + f - viscous * v - direction * dry
        if more:
            net -= 0.5 * slope(state, q) * v * v
            a = net / (inertia + more(state, q))
            return a, f - 0.5 * slope(state, q) * v * v - more(state, q) * a
        return net / inertia, f

    def step(t: float, q: float, v: float, u: float) -> tuple[float, float, float]:
        direction = 1.0 if v > 0.0 else -1.0 if v < 0.0 else 0.0
        if direction == 0.0:
            a, f = push(t, q, 0.0, u, 0.0)
            level = dry + (friction(state, t, q, 0.0, u) if friction else 0.0)
            if abs(a) * (inertia + (more(state, q) if more else 0.0)) <= level:
                if after:
                    after(state, q, 0.0, h)
                return q, 0.0, f
            direction = 1.0 if a > 0.0 else -1.0
        a, _ = push(t, q, v, u, direction)
        a, f = push(t + 0.5 * h, q + 0.5 * h * v, v + 0.5 * h * a, u, direction)
        q, new = q + h * (v + 0.5 * h * a), v + h * a
        if new * direction < 0.0:
            new = 0.0
        if after:
            after(state, q, new, h)
        return q, new, f

    return step
