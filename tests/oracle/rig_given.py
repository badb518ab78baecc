"""A machine of the outside rig that is told to follow a given reference, and references that show little."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy import signal

from tests.oracle.rig_cases import Array, RigCase
from tests.oracle.rig_designs import SETTLE, generator
from tests.oracle.rig_motion import GRID
from tests.oracle.rig_physics import Machine
from tests.oracle.rig_run import Motion, run
from tests.oracle.rig_sensors import Servo, Wanted, stamps
from tests.oracle.rig_trials import Trial

#: What makes a log poor, and the factor on the size or the pace of the motion that a case was made with.
POOR = ("small", "slow", "one way", "short")
_SMALL, _SLOW, _SHORT = 0.08, 8.0, 2.0


def follow(
    case: RigCase, trial: Trial, t: Array, wanted: tuple[Array, Array, Array], take: int = 0
) -> tuple[dict[str, Array], Motion]:
    """(what the log of that machine holds, the exact motion from the first row of the log on).

    Parameters
    ----------
    t : s, from 0 on, regular, shape (n,); wanted : position, speed and added u there. The axis stands at the first
        position while the loop settles. take : another one has other noise.

    Raises
    ------
    RuntimeError : the axis ran away.
    """
    plan = trial.design
    seen = generator(case, f"{case.sensing} take {take}", trial.attempt)
    rows = stamps(plan.sensing, case.sample_time, -SETTLE, float(t[-1]), seen)
    q, v, added = (np.interp(rows, t, x) for x in wanted)
    v[rows < 0.0], added[rows < 0.0] = 0.0, wanted[2][0]
    noise = None if plan.sensing.speed_noise is None else plan.speed_noise * seen.standard_normal(len(rows))
    servo = Servo(plan.gains, Wanted(q, v, added), rows, plan.sensing.counts, noise)
    machine = Machine(plan.inertia, plan.delay, trial.machine.effects)
    motion = run(machine, servo, rows, float(q[0]))
    if not np.all(np.isfinite(motion.q)) or np.ptp(motion.q) > 60.0:
        raise RuntimeError(f"{case} ran away")
    on = rows >= 0.0
    measured = {"t": rows, "u": motion.u, "velocity": np.array(servo.seen_v), "position": np.array(servo.seen_q)}
    logged = {name: measured[name][on] for name in ("t", *plan.sensing.logs) if name in measured}
    exact = replace(motion, **{name: getattr(motion, name)[on] for name in motion.__dataclass_fields__})
    return logged, exact


def poor_reference(trial: Trial, kind: str, duration: float) -> tuple[Array, tuple[Array, Array, Array]]:
    """(t, wanted) of a motion that shows little, made of the one that the machine was drawn with.

    small : a twelfth of its size. slow : an eighth of its pace. one way : the same way on, always forward. short : 2 s.
    """
    plan, inertia = trial.design, trial.design.inertia
    t = GRID * np.arange(round((_SHORT if kind == "short" else duration) / GRID) + 1)
    on = plan.t >= 0.0

    def moved(pace: float) -> Array:
        return np.interp(np.mod(t / pace, plan.t[-1]), plan.t[on], plan.wanted.q[on])

    makers: dict[str, Callable[[], Array]] = {
        "small": lambda: plan.start + _SMALL * (moved(1.0) - moved(1.0)[0]),
        "slow": lambda: moved(_SLOW),
        "one way": lambda: moved(1.0)[0] + np.cumsum(np.abs(np.gradient(moved(4.0)))),
        "short": lambda: moved(1.0),
    }
    q = signal.sosfiltfilt(signal.butter(2, 8.0, fs=1.0 / GRID, output="sos"), makers[kind]())
    v = np.gradient(q, GRID)
    return t, (q, v, 0.8 * inertia * np.gradient(v, GRID))
