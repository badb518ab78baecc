"""Axes of which the motion is chosen first: forces get their share of the drive on the motion that is wanted.

The rig (rig.py) draws a machine and tries sizes; here friction, weight or cogging may be all of the drive and inertia
hardly any, and the motion may be a crawl, periodic, small, or in one direction. Integrator and loop are the rig's.
"""

import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from tests.oracle import rig_rivals, rig_sizes
from tests.oracle.questions import Question
from tests.oracle.rig_cases import SINGLES, Array, Values
from tests.oracle.rig_draws import Seen, draw
from tests.oracle.rig_parts import COMMANDS
from tests.oracle.rig_physics import Machine
from tests.oracle.rig_run import Motion, run
from tests.oracle.rig_sensors import Gains, Servo, Wanted
from tests.oracle.rig_sizes import in_band, rms

#: s of running before the log; machines that are drawn before the last one is taken as it is.
SETTLE, MACHINES = 1.0, 8
#: Jn of the observer over the true J, tau of the observer in s.
NOMINAL, TAU = (0.7, 1.4), 0.01
#: Least share of the drive that other causes must leave of a hidden one, and that it must have beside sensor noise.
LEFT = 0.02
Rng = np.random.Generator


def generator(tier: str, seed: int, attempt: int) -> Rng:
    """Depends on nothing but these."""
    return np.random.default_rng([seed, attempt, zlib.crc32(tier.encode())])


@dataclass(frozen=True)
class Axis:
    """What is drawn for one log, before it runs. SI, rotary.

    t, q : stamps from -SETTLE on, and the position wanted at them. shares : {cause: rms of its force over the drive's},
    "inertia" with the rest. bandwidth : of the speed loop, rad/s. counts : of the encoder a turn. speed_noise : rad/s,
    None for a loop that differentiates its encoder. u_noise : of the logged command, share of its rms.
    given : values of effects whose shape is not drawn by the rig.
    """

    t: Array
    q: Array
    inertia: float
    delay: float
    shares: dict[str, float]
    bandwidth: float
    counts: int = 40_000
    speed_noise: float | None = None
    u_noise: float = 0.0
    feedforward: float = 1.0
    given: dict[str, Values] | None = None


@dataclass(frozen=True)
class Ran:
    """An axis that has run: exact motion, what its sensors said, forces {cause: (n,)} at the stamps."""

    axis: Axis
    machine: Machine
    motion: Motion
    seen_q: Array
    seen_v: Array
    forces: dict[str, Array]

    @property
    def logged(self) -> Array:
        return self.motion.t >= -1e-9

    def share(self, effect: str) -> float:
        """rms of its force over that of the drive, in the band in which the rig compares them."""
        band = rig_sizes.band_of(effect)
        drive = rms(in_band(self.motion.u, self.motion, band))
        return rms(in_band(self.forces[effect], self.motion, band)) / max(drive, 1e-300)

    def left(self, effect: str) -> tuple[str, float]:
        """(nearest other law, share of the drive that even it leaves of this force), inertia and delay being free."""
        told = rig_sizes.delayed(self.motion, self.axis.delay)
        known = {e: f for e, f in self.forces.items() if e in SINGLES}
        name, left = rig_rivals.nearest(effect, known, self.motion, told, rig_sizes.band_of(effect))
        return name, left * self.share(effect)


def stamps(sample_time: float, duration: float) -> Array:
    """From -SETTLE on, 0 among them."""
    before = round(SETTLE / sample_time)
    return sample_time * np.arange(-before, round(duration / sample_time))


def moved(axis: Axis, rng: Rng) -> Ran | None:
    """The axis under a P-PI loop that follows its reference; None if it ran away."""
    v = np.gradient(axis.q, axis.t)
    a = np.gradient(v, axis.t)
    effects = _sized(axis, rng, _as_wanted(axis, v, a))
    machine = Machine(axis.inertia, axis.delay, effects)
    w = axis.bandwidth
    kd = axis.inertia * w
    gains = Gains(kp=kd * w * 0.25, kd=kd, ki=0.0, kiv=0.0, speed_filter=0.25 / w if axis.speed_noise is None else 0.0)
    gains = replace(gains, ki=gains.kp * w * 0.06)
    noise = None if axis.speed_noise is None else axis.speed_noise * rng.standard_normal(len(axis.t))
    wanted = Wanted(axis.q, v, axis.feedforward * axis.inertia * a)
    servo = Servo(gains, wanted, axis.t, axis.counts, noise)
    try:
        motion = run(machine, servo, axis.t, float(axis.q[0]))
    except (OverflowError, ValueError):
        return None
    if not np.all(np.isfinite(motion.q)) or np.ptp(motion.q) > 3.0 * np.ptp(axis.q) + 1.0:
        return None
    forces = {e: rig_sizes.force(e, p, machine, motion) for e, p in effects.items()}
    return Ran(axis, machine, motion, np.array(servo.seen_q), np.array(servo.seen_v), forces)


def _as_wanted(axis: Axis, v: Array, a: Array) -> Motion:
    """The motion as it is wanted, of an axis that has nothing but its mass."""
    u, zero = axis.inertia * a, np.zeros_like(v)
    return Motion(axis.t, u, axis.q, v, a, u, axis.q, v, zero, zero > 1.0)


def _sized(axis: Axis, rng: Rng, motion: Motion) -> dict[str, Values]:
    """Values by which each force has its share of a drive of which the inertia has its own."""
    whole = rms(in_band(motion.u, motion)) / axis.shares["inertia"]
    driven = replace(motion, u=motion.u * (1.0 / axis.shares["inertia"]), acting=motion.acting / axis.shares["inertia"])
    seen = Seen.of(driven, axis.inertia)
    bare, found = Machine(axis.inertia, axis.delay, {}), dict(axis.given or {})
    for effect, share in axis.shares.items():
        if effect == "inertia" or effect in found:
            continue
        sized = draw(effect, rng, seen)
        source = driven if effect in COMMANDS else motion
        for _ in range(3):
            force = rig_sizes.foreseen(effect, sized.values(sized.size), bare, source)
            if np.isfinite(force) and force > 0.0:
                sized = sized.scaled(float(np.clip(share * whole / force, 1e-9, 1e9)))
        found[effect] = sized.values(sized.size)
    return found


def question(
    ran: Ran, rng: Rng, hidden: Sequence[str], channels: Sequence[str] = ("velocity", "position"), **more: Any
) -> Question:
    """The log of an axis that has run, and its owner's belief: the true inertia and delay, and what is not hidden."""
    axis, log = ran.axis, ran.logged
    noise = axis.u_noise * rms(ran.motion.u[log]) * rng.standard_normal(int(np.sum(log)))
    every = {"velocity": ran.seen_v[log], "position": ran.seen_q[log]}
    known = {e: p for e, p in ran.machine.effects.items() if e not in hidden}
    notes = {"shares": {e: round(ran.share(e), 4) for e in ran.forces}} | more.pop("notes", {})
    return Question(
        hidden=tuple(hidden),
        channels={"t": ran.motion.t[log], "u": ran.motion.u[log] + noise} | {name: every[name] for name in channels},
        believed={"inertia": axis.inertia, "delay": axis.delay, "effects": known},
        observer={"nominal_inertia": axis.inertia * float(rng.uniform(*NOMINAL)), "time_constant": TAU},
        truth={"inertia": axis.inertia, "delay": axis.delay, "effects": dict(ran.machine.effects)},
        notes=notes,
        **more,
    )


def attempts(tier: str, seed: int) -> Iterator[tuple[int, Rng]]:
    """Generators of the machines of one seed, in turn."""
    for attempt in range(MACHINES):
        yield attempt, generator(tier, seed, attempt)


def shown(ran: Ran | None, hidden: Sequence[str], least: float = LEFT) -> dict[str, float] | None:
    """{cause: share that its nearest rival leaves} if every hidden cause leaves enough, else None."""
    if ran is None:
        return None
    left = {e: round(ran.left(e)[1], 4) for e in hidden}
    return left if all(x >= least for x in left.values()) else None
