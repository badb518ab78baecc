"""Logs of the independent machines, made once per process, and the same logs disturbed in one known way."""

from dataclasses import replace
from functools import cache

import numpy as np

from dsd_cli.identify.checks import CheckResult, Finding, check_log
from dsd_cli.plant.model import ObserverSettings, PlantModel
from dsd_cli.signals.log import Log
from tests.oracle import machines
from tests.oracle.machine_cases import cases

COARSE = 2.0 * np.pi / 4096
#: What is hidden: every kind of law, and machines that differ in nothing but their friction or weight.
LAWS = (
    "none",
    "viscous_friction",
    "coulomb_friction",
    "stribeck_friction",
    "load_friction",
    "gravity",
    "stiffness",
    "constant_load",
    "cogging",
    "periodic_disturbance",
    "external_force",
    "dead_zone",
    "saturation",
    "actuator_lag",
    "flexible_coupling",
    "random_load",
)
DOMINANT = ("coulomb_friction", "gravity", "constant_load", ("coulomb_friction", "gravity"))


def slowed(case, factor):
    """The same forces on a motion so slow that they are most of what the drive does."""
    motion = case.motion
    return replace(
        case,
        motion=replace(
            motion,
            speed=motion.speed * factor,
            acceleration=motion.acceleration * factor,
            injection=motion.injection * factor,
            span=motion.span * 0.4,
        ),
    )


@cache
def recordings(kind: str) -> tuple[machines.Recording, ...]:
    """ "motion": position and velocity, at times d_hat; "coarse": 4096 counts alone; "dominated": friction, weight."""
    made = []
    for i, what in enumerate(DOMINANT * 3 if kind == "dominated" else LAWS * 2):
        sensing = "position" if (kind != "motion" and i % 2 == 0) or kind == "coarse" else ("all", "velocity")[i % 2]
        case = cases(what, [900 + i], ("plain", "moderate", "faint")[i % 3], sensing, duration=5.0)[0]
        if kind == "coarse" or (kind == "dominated" and sensing == "position"):
            case = replace(case, encoder_step=COARSE)
        made.append(slowed(case, 0.2) if kind == "dominated" else case)
    return tuple(machines.run(made))


@cache
def _servos() -> dict[str, machines.Recording]:
    effects = ("coulomb_friction", "viscous_friction")
    made = [cases(effects, [7], "plain", sensing, duration=6.0)[0] for sensing in machines.SENSINGS]
    return dict(zip(machines.SENSINGS, machines.run(made), strict=True))


def servo(sensing: str = "all") -> machines.Recording:
    """One machine with Coulomb and viscous friction."""
    return _servos()[sensing]


def log_of(recording: machines.Recording, **changed) -> Log:
    """The log, with channels replaced (None: left out)."""
    channels = {**recording.channels, **changed}
    return Log({name: x for name, x in channels.items() if x is not None}, recording.truth.sample_time, "a.csv")


def observer_of(recording: machines.Recording) -> ObserverSettings:
    return ObserverSettings(recording.truth.nominal_inertia, recording.truth.observer_time_constant)


def model_of(recording: machines.Recording) -> PlantModel:
    """The true machine."""
    case = recording.truth
    return PlantModel(case.inertia, case.delay, {name: dict(p) for name, p in (*case.base, *case.hidden)})


def checked(recording: machines.Recording, **changed) -> CheckResult:
    """Without a model, so that signs, scales and sensors are all that is judged."""
    return check_log(log_of(recording, **changed), None, observer_of(recording))


def said(result: CheckResult, text: str) -> list[Finding]:
    return [one for one in result.findings if text in one.what]


def only_error(result: CheckResult) -> Finding:
    """The one error that there is."""
    assert len(result.errors) == 1, [one.what for one in result.findings]
    return result.errors[0]
