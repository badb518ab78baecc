"""Hand-made results of the engine, for the tests of what is printed, drawn and written."""

import math
from dataclasses import replace

import numpy as np

from dsd_cli.identify.recordings.recording import Recording, prepare
from dsd_cli.identify.results import (
    Addition,
    Candidate,
    Ceiling,
    Diagnosis,
    Estimate,
    Ladder,
    Score,
    Step,
)
from dsd_cli.plant.model import ObserverSettings, PlantModel
from dsd_cli.signals.log import Log

NAN = math.nan
GIVEN = PlantModel(1.0, 0.01, {"viscous_friction": {"coefficient": 0.3}})
FRICTION = GIVEN.changed(inertia=1.02, effects={"coulomb_friction": {"level": 0.52}})
OBSERVER = ObserverSettings(1.0, 0.005)
INERTIA = Estimate(1.02, 0.002, "kg m2")
VISCOUS = Estimate(0.3, 0.02, "{u}/({v})")
LEVEL = Estimate(0.52, 0.03, "{u}")
BEFORE, AFTER = Score(0.38, 0.402, 61.0, 12.0), Score(0.105, 0.113, 89.5, 3.4)


def tried(effect: str, after: float, probability: float, **more: object) -> Candidate:
    parameters = more.pop("parameters", {})
    return Candidate(effect, 0.95 * after, 0.402, after, probability, parameters, **more)


RANKING = (
    tried(
        "coulomb_friction",
        0.113,
        0.97,
        parameters={"level": LEVEL},
        indistinguishable_from=("load_friction",),
        model=FRICTION,
    ),
    tried(
        "stribeck_friction",
        0.16,
        0.0001,
        parameters={"excess": Estimate(0.6, NAN, "{u}"), "velocity": Estimate(8.0, 3.0, "{v}", at_bound=True)},
        note="velocity stands on its bound",
    ),
    tried("viscous_asymmetry", 0.398, 0.0, parameters={"coefficient": Estimate(-3e-6, 2e-6, "{u}/({v})")}),
    tried("inertia", 0.41, 0.0, parameters={"inertia": Estimate(1.1, 0.1, "kg m2")}),
    Candidate("gravity", NAN, NAN, NAN, NAN, {}, untestable="the log has no position [yet]"),
)

DIAGNOSIS = Diagnosis(
    logs=("a.csv",),
    samples=4000,
    verdict="coulomb_friction",
    probability=0.97,
    score=BEFORE,
    refitted=Score(0.37, 0.402, 63.0, 11.5),
    ranking=RANKING,
    ceiling=Ceiling(0.108, ("velocity", "position")),
    advice=("`dsd add a.csv coulomb_friction` takes it in",),
    estimates={"inertia": INERTIA, "viscous_friction.coefficient": VISCOUS, "coulomb_friction.level": LEVEL},
    model=FRICTION,
    refitted_model=GIVEN,
    noise=0.1,
    found=("coulomb_friction", "gravity"),
    band_hz=31.4,
    floor=0.02,
    provenance={"u": "logged", "velocity": "reconstructed from u and d_hat"},
    warnings=("the log is short",),
)
NOTHING = replace(
    DIAGNOSIS,
    verdict="none",
    probability=0.93,
    model=GIVEN,
    refitted=AFTER,
    ranking=tuple(replace(c, probability=0.01) for c in RANKING[1:]),
    ceiling=Ceiling(NAN, ()),
    noise=NAN,
    found=(),
    advice=(),
)
UNKNOWN = replace(NOTHING, verdict="unknown", probability=0.8, depends_on=("velocity", "position"))

ESTIMATES = {"inertia": INERTIA, "viscous_friction.coefficient": VISCOUS, "coulomb_friction.level": LEVEL}
ADDITION = Addition("coulomb_friction", FRICTION, BEFORE, AFTER, ESTIMATES, ("a warning",))
BEST = FRICTION.changed(effects={"gravity": {"amplitude": 0.2, "phase": 0.1}})
STEPS = (
    Step(0, "as given", BEFORE, {}, GIVEN),
    Step(1, "coulomb_friction", AFTER, ESTIMATES, FRICTION),
    Step(
        2,
        "gravity",
        Score(0.05, 0.054, 95.0, 1.5),
        {
            **ESTIMATES,
            "gravity.amplitude": Estimate(0.2, 0.004, "{u}"),
            "gravity.phase": Estimate(0.1, 0.02, "rad"),
        },
        BEST,
    ),
)
LADDER = Ladder(STEPS, "none", "nothing significant is left", replace(NOTHING, refitted=STEPS[-1].score))


def recording() -> Recording:
    """To and fro under force noise, with 0.52 of friction that GIVEN does not have; the motion is known exactly."""
    count, step, turn = 8000, 0.001, 2.0 * np.pi
    t = step * np.arange(count)
    position, velocity = 5.0 / turn * (1.0 - np.cos(turn * t)), 5.0 * np.sin(turn * t)
    middle = t + 0.5 * step  # of the interval in which u[k] is held
    needed = 1.02 * 5.0 * turn * np.cos(turn * middle) + 5.0 * np.sin(turn * middle) * 0.3
    needed += 0.52 * np.sign(np.sin(turn * middle)) + np.random.default_rng(0).normal(0.0, 0.3, count)
    u = np.append(needed[10:], needed[:10])  # 10 ms early: the delay of GIVEN, and whole turns
    log = Log({"t": t, "u": u, "velocity": velocity, "position": position}, step, source="a.csv")
    return prepare(log, OBSERVER)
