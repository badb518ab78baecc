"""The outside rig: logs of servo axes with hidden effects, made by none of the project's own code.

`make(cases)` draws a machine per case, hides the effects in it, sizes them until their force has the wanted share of
the drive and the log exercises them, and measures with the sensors of the case. Row k of a log holds what was measured
at t_k and the command that is held from t_k to t_(k+1) and reaches the plant `delay` seconds later.

| file | what |
|---|---|
| rig_cases | what can be asked for, what comes back |
| rig_laws, rig_parts | forces, one function each; actuators, second masses, friction with an inner state |
| rig_physics, rig_run | the integrator; a machine under a loop, with its delay |
| rig_motion, rig_sensors, rig_designs | references; sensors, loops, observer; a whole machine drawn at random |
| rig_draws, rig_sizes, rig_rivals, rig_trials | parameters; what a log must show; what may be taken for it; sizing |
| rig_days | one machine on several days |
"""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from tests.oracle.rig_cases import (
    LOOPS,
    RIPPLES,
    SENSINGS,
    SINGLES,
    STRANGERS_SEEN,
    STRANGERS_UNSEEN,
    STRENGTHS,
    Array,
    RigCase,
    RigLog,
)
from tests.oracle.rig_designs import generator
from tests.oracle.rig_parts import COMMANDS, LOADS
from tests.oracle.rig_physics import Machine
from tests.oracle.rig_run import Motion
from tests.oracle.rig_sensors import observe
from tests.oracle.rig_sizes import in_band, rms
from tests.oracle.rig_trials import Trial, find_trial

#: Jn of the observer over the true J; noise of a logged d_hat over the rms of u.
NOMINAL, D_HAT_NOISE = (0.7, 1.4), (0.005, 0.02)
#: Hz, below which `floor["sensor_rms_force"]` counts: where the faster and the slower axes move.
SENSOR_BANDS = (5.0, 15.0)


@dataclass(frozen=True)
class Exact:
    """What no log tells: the exact motion (also of the time before the log), the machine, and forces {cause: (n,)}."""

    motion: Motion
    machine: Machine
    forces: dict[str, Array]


def make(cases: Iterable[RigCase]) -> list[RigLog]:
    """One log per case, the same for the same case.

    Raises
    ------
    ValueError : a case that names what the rig does not know.

    `floor` of each log, in the unit of u where it is a force:
        hidden_rms_force, drive_rms : over the whole band, with spikes and the noise of u
        shares : {cause: rms of its force over the drive's, both below 25 Hz, 100 Hz for a second mass}, base as well
        rivals : {hidden cause: [nearest other law, share of the drive that it leaves]}, inertia and delay free
        sensor_rms_force : {Hz: J times the error of the acceleration below it that the best logged sensor makes}
        spike : top |u| over its 99 % quantile
        kind : of reference or injection; travel : rad; speed_noise : rad/s
        promised : 1.0 if sizes and excitation are as asked, else the log is the best that was found
        attempts : machines that were drawn
    """
    return [make_exact(case)[0] for case in cases]


def make_exact(case: RigCase) -> tuple[RigLog, Exact]:
    """The log of one case with its exact signals."""
    _check(case)
    trial = find_trial(case)
    return _log(case, trial), Exact(trial.motion, trial.machine, trial.forces)


def _check(case: RigCase) -> None:
    unknown = set(case.what) - {*SINGLES, *RIPPLES, *STRANGERS_SEEN, *STRANGERS_UNSEEN}
    for name, value, known in (
        ("sensing", case.sensing, SENSINGS),
        ("loop", case.loop, LOOPS),
        ("strength", case.strength, STRENGTHS),
    ):
        if value not in known:
            raise ValueError(f"{name} '{value}' is none of {', '.join(known)}")
    if unknown:
        raise ValueError(f"the rig cannot hide {', '.join(sorted(unknown))}")
    for family in (COMMANDS, LOADS):
        if len(set(case.what) & set(family)) > 1:
            raise ValueError(f"the rig cannot hide more than one of {', '.join(family)} at a time")


def _log(case: RigCase, trial: Trial) -> RigLog:
    plan, motion = trial.design, trial.motion
    rng = generator(case, case.sensing + " observer", trial.attempt)
    nominal = plan.inertia * float(rng.uniform(*NOMINAL))
    sigma = rms(motion.u[motion.t >= 0.0]) * rng.uniform(*D_HAT_NOISE)
    noise = sigma * rng.standard_normal(len(motion.t))
    channels = _channels(case, trial, observe(motion.t, motion.u, motion.v, nominal, case.tau) + noise)
    effects = trial.machine.effects
    return RigLog(
        channels=channels,
        sample_time=case.sample_time * plan.sensing.rate,
        believed={**trial.beliefs, "effects": {e: p for e, p in effects.items() if e in trial.base}},
        observer={"nominal_inertia": nominal, "time_constant": case.tau},
        truth={"inertia": plan.inertia, "delay": plan.delay, "effects": dict(effects)},
        case=case,
        floor=_floor(trial, noise * plan.inertia / nominal, case.tau),
    )


def _channels(case: RigCase, trial: Trial, d_hat: Array) -> dict[str, Array]:
    """What this sensing logs; a reference is one of speed in a speed loop."""
    plan, motion = trial.design, trial.motion
    measured = {
        "t": motion.t,
        "u": case.u_sign * motion.u,
        "velocity": np.array(trial.servo.seen_v),
        "position": np.array(trial.servo.seen_q),
        "d_hat": d_hat,
        "reference": plan.wanted.v if case.loop == "velocity" else plan.wanted.q,
    }
    logged = ("t", *plan.sensing.logs, *(("reference",) if plan.logged and "position" in plan.sensing.logs else ()))
    return {name: measured[name][motion.t >= 0.0] for name in logged}


def _floor(trial: Trial, observer_noise: Array, tau: float) -> dict[str, Any]:
    motion, log = trial.motion, trial.motion.t >= 0.0
    hidden = sum((f for e, f in trial.forces.items() if e not in trial.base), np.zeros_like(motion.u))
    u = np.abs(motion.u[log])
    return {
        "hidden_rms_force": rms(hidden[log]),
        "drive_rms": rms(u),
        "shares": trial.shares,
        "rivals": {e: list(r) for e, r in trial.rivals.items()},
        "sensor_rms_force": {band: _sensor_force(trial, observer_noise, tau, band) for band in SENSOR_BANDS},
        "spike": float(np.max(u) / np.quantile(u, 0.99)),
        "kind": trial.design.kind,
        "travel": float(np.ptp(motion.q[log])),
        "speed_noise": trial.design.speed_noise,
        "promised": float(trial.miss == 0.0),
        "attempts": trial.attempt + 1,
    }


def _sensor_force(trial: Trial, observer_noise: Array, tau: float, band: float) -> float:
    """J times the error of a, below the band in Hz, from whichever logged sensor tells a best; N m."""
    motion, inertia, logs = trial.motion, trial.design.inertia, trial.design.sensing.logs
    t = motion.t[motion.t >= 0.0]

    def below(x: Array) -> Array:
        return in_band(x, motion, band)

    if "d_hat" in logs:
        return rms(below(observer_noise) + tau * np.gradient(below(observer_noise), t))
    errors = [np.gradient(np.gradient(below(np.array(trial.servo.seen_q) - motion.q), t), t)]
    if "velocity" in logs:
        errors.append(np.gradient(below(np.array(trial.servo.seen_v) - motion.v), t))
    return inertia * min(rms(e) for e in errors)
