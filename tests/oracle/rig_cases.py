"""What the outside rig can be asked for, and what it hands back.

The rig writes logs of servo axes with hidden effects, as another laboratory would: the physics of the catalogue, but
other controllers, references, sensors and habits than `machines.py`. `rig.make` is the door.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Values = dict[str, Any]

#: Everything that one log can lack: the effects of the catalogue, and a wrong inertia or delay.
SINGLES = (
    "actuator_lag",
    "backlash",
    "cogging",
    "constant_load",
    "coulomb_friction",
    "cubic_stiffness",
    "dead_zone",
    "external_force",
    "flexible_coupling",
    "gravity",
    "load_friction",
    "periodic_disturbance",
    "presliding_friction",
    "quadratic_drag",
    "saturation",
    "stiffness",
    "stribeck_friction",
    "viscous_asymmetry",
    "viscous_friction",
    "inertia",
    "delay",
)

#: Effects of no catalogue that may be looked at while the identification is developed ...
STRANGERS_SEEN = ("random_walk_load", "friction_growing_with_time", "friction_over_position", "root_drag")
#: ... and those that are kept for the examination.
STRANGERS_UNSEEN = (
    "end_stop",
    "eddy_brake",
    "play_hysteresis",
    "gain_drift",
    "gain_asymmetry",
    "swinging_inertia",
    "slew_limit",
)

#: So many cogging lines at once, of different periods and sizes: one hidden cause, as they come from one motor.
RIPPLES = {"two_cogging_lines": 2, "three_cogging_lines": 3, "five_cogging_lines": 5}

#: Two causes at once, as they meet in machines.
PAIRS = (
    ("coulomb_friction", "viscous_friction"),
    ("coulomb_friction", "stribeck_friction"),
    ("coulomb_friction", "gravity"),
    ("coulomb_friction", "cogging"),
    ("coulomb_friction", "actuator_lag"),
    ("viscous_friction", "gravity"),
    ("viscous_friction", "stiffness"),
    ("viscous_friction", "inertia"),
    ("viscous_friction", "dead_zone"),
    ("quadratic_drag", "constant_load"),
    ("gravity", "load_friction"),
    ("gravity", "delay"),
    ("cogging", "constant_load"),
    ("presliding_friction", "stiffness"),
    ("external_force", "viscous_friction"),
    ("periodic_disturbance", "coulomb_friction"),
    ("viscous_asymmetry", "coulomb_friction"),
    ("flexible_coupling", "viscous_friction"),
    ("cubic_stiffness", "coulomb_friction"),
    ("saturation", "gravity"),
)

#: Share of the drive that each hidden effect has, (least, most), by the rms of the forces below `rig_sizes.BAND`.
STRENGTHS = {"plain": (0.20, 0.60), "moderate": (0.08, 0.20), "faint": (0.03, 0.08)}

SENSINGS = ("speed40k", "speedloud", "enc40k", "enc4096", "enc1024", "enc8192jitter500", "udhat")
LOOPS = ("position", "velocity", "weak", "open")


@dataclass(frozen=True)
class RigCase:
    """One log to be made; equal cases give equal logs.

    what : effects of the catalogue, strangers, "inertia", "delay"; () if nothing is missing.
    sample_time : s, of the drive; `enc8192jitter500` logs every other time on the average.
    believed_inertia_factor : believed over true; 1 lets the rig choose where "inertia" is in `what`.
    believed_delay_error : s, believed less true; 0 lets the rig choose where "delay" is in `what`.
    delay : s, true; None draws 0 to 25 ms.
    """

    what: tuple[str, ...]
    seed: int
    sensing: str
    duration: float = 20.0
    sample_time: float = 0.001
    loop: str = "position"
    tau: float = 0.01
    u_sign: int = 1
    believed_inertia_factor: float = 1.0
    believed_delay_error: float = 0.0
    strength: str = "plain"
    delay: float | None = 0.02


@dataclass(frozen=True)
class RigLog:
    """A log, what its owner believes, and the truth.

    channels : t, u and what else this sensing logs, each of shape (n,), SI. sample_time : s, the mean where it jitters.
    believed : inertia, delay, effects {id: {parameter: value}} that are believed and true.
    observer : nominal_inertia, time_constant.
    truth : inertia, delay, effects {id: values} of all that is there, hidden and believed.
    floor : hidden_rms_force and drive_rms in the unit of u, and more (see `rig.make`).
    """

    channels: dict[str, Array]
    sample_time: float
    believed: dict[str, Any]
    observer: dict[str, float]
    truth: dict[str, Any]
    case: RigCase
    floor: dict[str, Any]
