"""Every effect with values, and a motion with reversals, a rest and slow parts."""

import numpy as np

from dsd_cli.effects import named_effects
from dsd_cli.export.base import Joint, Motion
from dsd_cli.plant.model import PlantModel

VALUES = {
    "viscous_friction": {"coefficient": 0.3},
    "coulomb_friction": {"level": 0.5},
    "stribeck_friction": {"excess": 0.3, "velocity": 0.2},
    "viscous_asymmetry": {"coefficient": 0.1},
    "quadratic_drag": {"coefficient": 0.1},
    "presliding_friction": {"level": 0.5, "stiffness": 50.0},
    "load_friction": {"coefficient": 0.1},
    "constant_load": {"force": 0.2},
    "gravity": {"amplitude": 1.0, "phase": 0.1},
    "stiffness": {"coefficient": 1.0},
    "cubic_stiffness": {"coefficient": 0.2},
    "cogging": {"amplitude": 0.3, "periods": 7.0, "phase": 0.2},
    "dead_zone": {"width": 0.3},
    "saturation": {"limit": 1.2},
    "actuator_lag": {"time_constant": 0.015},
    "backlash": {"gap": 0.05, "load_share": 0.4, "stiffness": 3000.0},
    "flexible_coupling": {"frequency": 12.0, "load_share": 0.4, "damping": 0.05},
    "external_force": {"events": [{"start": 0.2, "end": 0.3011, "force": 0.7}]},
    "periodic_disturbance": {"amplitude": 0.4, "frequency": 3.0, "phase": 0.3},
    "curve": {"channels": ["velocity"], "knots": [[-2.0, 0.0, 3.0]], "values": [0.5, 0.0, -0.6], "factor": "one",
              "scale": 1.0},
    "friction_curve": {"channels": ["speed"], "knots": [[0.0, 1.0, 3.0]], "values": [0.5, 0.2, 0.6], "factor": "one",
                       "scale": 1.0},
    "inertia_curve": {"channels": ["position"], "knots": [[0.0, 1.0, 3.0]], "values": [0.05, 0.02, 0.06],
                      "factor": "one", "scale": 1.0},
    "hysteresis": {"radii": [0.1, 0.2], "stiffnesses": [1.0, 2.0], "scale": 1.0},
}  # fmt: skip
EFFECTS = list(named_effects())

#: Models that together have every effect: one structure each.
TOGETHER = (
    ("backlash", "coulomb_friction", "viscous_friction", "dead_zone", "gravity", "external_force"),
    ("flexible_coupling", "load_friction", "stribeck_friction", "actuator_lag", "saturation", "cogging"),
    (
        "presliding_friction",
        "hysteresis",
        "constant_load",
        "viscous_asymmetry",
        "quadratic_drag",
        "curve",
        "coulomb_friction",
    ),
    ("friction_curve", "periodic_disturbance", "stiffness", "cubic_stiffness"),
)


def joint(*effects: str, delay: float = 0.0205, sample_time: float = 2e-3) -> Joint:
    return Joint(PlantModel(0.5, delay, {name: VALUES[name] for name in effects}), sample_time)


def motion(sample_time: float = 2e-3, seconds: float = 0.8) -> Motion:
    """A push each way and a hold below the friction."""
    t = np.arange(round(seconds / sample_time)) * sample_time
    u = np.where(t < 0.6, 3.0 * np.sin(2.0 * np.pi * 2.5 * t), 0.2)
    return Motion(u, sample_time, 0.1, 0.0)
