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
    "gain_droop": {"droop": 0.05},
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
    "lagged_friction": {"of": "velocity", "time_constants": [0.01, 0.3], "levels": [0.2, 0.4], "scale": 1.0},
    "bouc_wen": {"level": 0.5, "stiffness": 4.0, "exponent": 1.8, "unloading": 1.3},
    "lugre_friction": {"level": 0.5, "damping": 0.05, "stiffness": 5.0, "excess": 0.3, "velocity": 0.4},
}  # fmt: skip
EFFECTS = list(named_effects())
#: Learnt tables over other channels than those above: name in a model -> values.
OVER_TWO = {"channels": ["velocity", "position"], "knots": [[-2.0, 0.0, 3.0], [-1.0, 0.2]], "factor": "one",
            "values": [[0.5, 0.4], [0.0, 0.1], [-0.6, -0.3]], "scale": 1.0}  # fmt: skip
TABLES = {
    "curve over position": ("curve", {**VALUES["curve"], "channels": ["position"]}),
    "curve over u": ("curve", {**VALUES["curve"], "channels": ["u"]}),
    "curve over time": ("curve", {**VALUES["curve"], "channels": ["time"]}),
    "curve over velocity and position": ("curve", OVER_TWO),
    "curve over u times velocity": ("curve", {**VALUES["curve"], "channels": ["u"], "factor": "velocity"}),
    "friction_curve over position": ("friction_curve", {**VALUES["friction_curve"], "channels": ["position"]}),
    "friction_curve over u": ("friction_curve", {**VALUES["friction_curve"], "channels": ["u"]}),
    "friction_curve over time": ("friction_curve", {**VALUES["friction_curve"], "channels": ["time"]}),
    "friction_curve over velocity and position": (
        "friction_curve", {**OVER_TWO, "values": [[0.5, 0.4], [0.2, 0.1], [0.6, 0.3]]}),
}  # fmt: skip
#: Every effect, and every kind of table, alone: what it is -> (name in a model, values).
ALONE = {name: (name, values) for name, values in VALUES.items()} | TABLES

#: Models that together have every effect: one structure each.
TOGETHER = (
    ("backlash", "coulomb_friction", "viscous_friction", "dead_zone", "gravity", "external_force"),
    ("flexible_coupling", "load_friction", "stribeck_friction", "actuator_lag", "saturation", "cogging", "gain_droop"),
    (
        "presliding_friction",
        "hysteresis",
        "constant_load",
        "viscous_asymmetry",
        "quadratic_drag",
        "curve",
        "coulomb_friction",
    ),
    ("friction_curve", "periodic_disturbance", "stiffness", "cubic_stiffness", "inertia_curve", "lagged_friction"),
    ("bouc_wen", "lugre_friction", "coulomb_friction"),
)


def joint(*effects: str, delay: float = 0.0205, sample_time: float = 2e-3) -> Joint:
    """The model with these of `ALONE`."""
    return Joint(PlantModel(0.5, delay, dict(ALONE[name] for name in effects)), sample_time)


def motion(sample_time: float = 2e-3, seconds: float = 0.8) -> Motion:
    """A push each way and a hold below the friction."""
    t = np.arange(round(seconds / sample_time)) * sample_time
    u = np.where(t < 0.6, 3.0 * np.sin(2.0 * np.pi * 2.5 * t), 0.2)
    return Motion(u, sample_time, 0.1, 0.0)
