"""Random but sensible machines per hidden effect: what is hidden, how the machine is run, what is believed and seen.

"plain", "moderate" and "faint" say how large the effect's rms force (or change of the command) is against the rms of
the drive that the motion alone needs.
"""

import zlib
from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from tests.oracle.machine_laws import EFFECTS, INPUTS, PLANT_VALUES, STRANGERS, STRUCTURES
from tests.oracle.machine_motion import Motion
from tests.oracle.machine_sizes import plan_of, size
from tests.oracle.machines import Case, bend, low_pass

Rng = np.random.Generator

AMPLITUDES = {"plain": (0.30, 0.60), "moderate": (0.10, 0.25), "faint": (0.03, 0.08)}
NOISE = (0.005, 0.03)  # noise of d_hat over rms of the drive
BASE = (0.08, 0.2)  # rms of each believed effect over rms of the drive
CLIPPED = {"plain": 1.6, "moderate": 1.3, "faint": 1.12}  # the controller's own limit over the hidden one: without
# a limit that it knows of, its integrator runs away
EFFECT_IDS = EFFECTS
STRANGER_IDS = STRANGERS


def pairs() -> list[tuple[str, str]]:
    """Pairs of effects that machines have together and that the recording can tell apart."""
    return [
        ("coulomb_friction", "viscous_friction"),
        ("coulomb_friction", "gravity"),
        ("viscous_friction", "constant_load"),
        ("gravity", "viscous_friction"),
        ("coulomb_friction", "cogging"),
        ("viscous_friction", "stiffness"),
        ("coulomb_friction", "constant_load"),
        ("quadratic_drag", "coulomb_friction"),
        ("periodic_disturbance", "viscous_friction"),
        ("actuator_lag", "coulomb_friction"),
        ("saturation", "viscous_friction"),
        ("external_force", "coulomb_friction"),
        ("inertia", "coulomb_friction"),
        ("delay", "viscous_friction"),
        ("flexible_coupling", "viscous_friction"),
    ]


def cases(
    what: str | Sequence[str],
    seeds: Iterable[int],
    amplitude: str = "plain",
    sensing: str = "all",
    base: Sequence[str] | None = None,
    duration: float = 10.0,
    sample_time: float = 0.001,
    noise: float | None = None,
) -> list[Case]:
    """One case per seed for an effect id, several ids, a stranger, "inertia", "delay" or "none".

    `base` are the ids that are there and believed; None chooses what such machines commonly have (Stribeck friction
    gets its Coulomb part, others viscous friction for every second seed). `noise` is that of d_hat over the drive.
    """
    names = () if what == "none" else (what,) if isinstance(what, str) else tuple(what)
    unknown = set(names) - {*EFFECTS, *STRANGERS}
    if unknown:
        raise ValueError(f"no such effect: {sorted(unknown)}")
    return [_case(names, seed, amplitude, sensing, base, duration, sample_time, noise) for seed in seeds]


def _case(
    names: tuple[str, ...],
    seed: int,
    amplitude: str,
    sensing: str,
    base: Sequence[str] | None,
    duration: float,
    sample_time: float,
    noise: float | None,
) -> Case:
    """The rig first, then the motion, then the effects sized by it, then the noise."""
    rng = np.random.default_rng([seed, zlib.crc32("+".join((*names, amplitude)).encode())])
    inertia = float(np.exp(rng.uniform(np.log(0.05), np.log(2.0))))
    delay = _delay(names, rng)
    ids = _usual_base(names, rng) if base is None else tuple(base)
    motion = _motion(names, inertia, rng)
    plan = plan_of(motion, inertia, duration, seed)
    known = tuple((name, size(name, rng.uniform(*BASE), plan, rng)) for name in ids)
    hidden = tuple((name, size(name, rng.uniform(*AMPLITUDES[amplitude]), plan, rng)) for name in names)
    case = Case(
        hidden,
        inertia,
        delay,
        inertia,
        delay,
        inertia * float(rng.choice([1.0, rng.uniform(0.8, 1.25)])),
        float(rng.uniform(0.005, 0.02)),
        motion,
        known,
        sample_time,
        duration,
        sensing,
        feedforward=float(rng.uniform(0.7, 1.0)),
        command_limit=CLIPPED[amplitude] * dict(hidden).get("saturation", {}).get("limit", 20.0 * plan.drive),
        seed=seed,
    )
    case = _misbelieve(case, amplitude, rng)
    floor = noise if noise is not None else float(np.exp(rng.uniform(*np.log(NOISE))))
    return _sensed(case, floor * plan.drive, rng)


def _delay(names: tuple[str, ...], rng: Rng) -> float:
    """Any real number; short where a second mass swings, or no loop could hold it."""
    return float(rng.uniform(0.0005, 0.0025) if set(names) & set(STRUCTURES) else rng.uniform(0.001, 0.012))


def _usual_base(names: tuple[str, ...], rng: Rng) -> tuple[str, ...]:
    if "stribeck_friction" in names and "coulomb_friction" not in names:
        return ("coulomb_friction",)
    viscous = {"viscous_friction", "growing_viscosity"} & set(names)
    return ("viscous_friction",) if not viscous and rng.uniform() < 0.5 else ()


def _motion(names: tuple[str, ...], inertia: float, rng: Rng) -> Motion:
    """Several radians, slow and fast, both ways; a second mass needs a drive that reaches its resonance."""
    speed, acceleration = float(rng.uniform(3.0, 9.0)), float(rng.uniform(25.0, 80.0))
    added = float(rng.uniform(0.1, 0.25)) if rng.uniform() < 0.5 else 0.0
    band = (0.5, 20.0)
    if "flexible_coupling" in names:
        added, band = float(rng.uniform(0.25, 0.45)), (2.0, 75.0)
    slowest = 0.015 if "stribeck_friction" in names else 0.05
    return Motion(
        speed,
        acceleration,
        span=float(rng.uniform(2.5, 6.0)),
        shortest=0.05,
        slowest=slowest,
        injection=added * 0.4 * acceleration * inertia,
        band=band,
        chirp=bool(rng.uniform() < 0.4),
    )


FACTORS = {"plain": (1.4, 1.8), "moderate": (1.12, 1.25), "faint": (1.03, 1.08)}  # true over believed inertia, or 1/
LATER = {"plain": (0.006, 0.012), "moderate": (0.003, 0.005), "faint": (0.001, 0.002)}  # s, true minus believed delay


def _misbelieve(case: Case, amplitude: str, rng: Rng) -> Case:
    """Hidden inertia and delay are true values far from the believed ones."""
    names = [name for name, _ in case.hidden]
    if "inertia" in names:
        factor = rng.uniform(*FACTORS[amplitude]) ** float(rng.choice([-1.0, 1.0]))
        case = replace(case, believed_inertia=case.inertia / factor, nominal_inertia=case.inertia / factor)
    if "delay" in names:
        case = replace(case, delay=case.believed_delay + float(rng.uniform(*LATER[amplitude])))
    true = {"inertia": {"inertia": case.inertia}, "delay": {"delay": case.delay}}
    return replace(case, hidden=tuple((name, true.get(name, values)) for name, values in case.hidden))


def _sensed(case: Case, floor: float, rng: Rng) -> Case:
    """Noise that leaves about `floor` (N m rms) in d_hat, by the observer's own gain for white noise."""
    T, p = case.sample_time, np.exp([-case.sample_time / case.observer_time_constant])
    impulse = np.zeros((2000, 1))
    impulse[2] = case.nominal_inertia
    if case.channels == "d_hat":
        return replace(case, d_hat_noise=floor, encoder_step=1e-4)
    if case.channels == "position":
        gain = float(np.linalg.norm(low_pass(bend(impulse, T), p)))
        return replace(case, encoder_step=floor * np.sqrt(12.0) / gain)
    rise = np.vstack([impulse[:1] * 0, np.diff(impulse, axis=0)]) / T
    gain = float(np.linalg.norm(low_pass(rise, p)))
    return replace(case, velocity_noise=floor / gain, encoder_step=2 * np.pi / 2 ** float(rng.integers(14, 18)))


__all__ = ["AMPLITUDES", "EFFECT_IDS", "INPUTS", "PLANT_VALUES", "STRANGER_IDS", "STRUCTURES", "cases", "pairs"]
