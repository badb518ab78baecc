"""Real recordings, what must be named in each and what must not, and what is published (recordings' README)."""

from __future__ import annotations

from dataclasses import dataclass, field

_XL330 = tuple(
    f"bam_xl330/kp{kp}_{kind}.csv"
    for kp in (100, 200, 400, 800)
    for kind in ("sin_sin", "sin_time_square", "up_and_down")
)
_RUNS = ("pos_0.06_1", "pos_0.065_1", "neg_0.04_1", "neg_0.045_1", "neg_0.045_2")
_J, _B, _FC, _F0, _G = (
    "inertia",
    "viscous_friction.coefficient",
    "coulomb_friction.level",
    "constant_load.force",
    "gravity.amplitude",
)
#: What explains by itself what it should not: acts on u, or fits any short or periodic motion.
STAND_INS = ("saturation", "dead_zone", "periodic_disturbance", "external_force", "flexible_coupling", "backlash")


@dataclass(frozen=True)
class Recorded:
    """One question to one machine.

    must : effects that the ladder must have, alternatives by "|", in any order; the first `first` of them before all
    others. must_not : effects that it must not have. open_values : values that must not be called identified.
    published : {name of a value: published value}, and `within` of it, a share. unknown : whether "unknown" at the end
    (or a step of inertia) is all that is asked for. regress, regress_hz, regress_signals : terms of a plain regression,
    which says what of these values is in the log at all (`machines_regression`), the end of its low-pass, and its
    columns where they are others. hold : `u_hold`, where it is known.
    """

    name: str
    logs: tuple[str, ...]
    signals: dict[str, str]
    inertia: float
    must: tuple[str, ...] = ()
    must_not: tuple[str, ...] = ()
    first: int = 0
    open_values: tuple[str, ...] = ()
    published: dict[str, float] = field(default_factory=dict)
    within: float = 0.1
    regress: tuple[str, ...] = ()
    regress_hz: float = 4.0
    regress_signals: dict[str, str] = field(default_factory=dict)
    hold: str = ""
    unknown: bool = False
    tau: float = 0.02

    def config(self) -> str:
        """dsd.toml: the columns, and a bare mass."""
        lines = ["[signals]", *(f'{name} = "{column}"' for name, column in self.signals.items())]
        lines += [f'u_hold = "{self.hold}"'] if self.hold else []
        lines += ["[observer]", f"nominal_inertia = {self.inertia!r}", f"time_constant = {self.tau!r}"]
        return "\n".join([*lines, "[model]", f"inertia = {self.inertia!r}"]) + "\n"


def _kuka(name: str, poses: str, **more: object) -> Recorded:
    logs = tuple(f"kuka_kr300/joint1_traj_{pose}.csv" for pose in poses)
    signals = {"time": "t_s", "u": "u_torque_motor_Nm", "velocity": "velocity_rad_s", "position": "position_rad"}
    return Recorded(f"kuka_kr300 {name}", logs, signals, 6.0, regress=(_J, _B, _FC), **more)  # type: ignore[arg-type]


def _odrive(run: str, **more: object) -> Recorded:
    signals = {"time": "t_s", "u": "u_current_A", "velocity": "", "position": "position_rad"}
    name = run.partition(".")[0]
    return Recorded(f"odrive_cogging {name}", (f"odrive_cogging/{run}",), signals, 3.52e-3, **more)  # type: ignore[arg-type]


def _hsm(name: str, runs: tuple[str, ...], must: tuple[str, ...]) -> Recorded:
    signals = {"time": "t_s", "u": "u_torque_ref_Nm", "velocity": "velocity_rad_s", "position": "position_rad"}
    published = {"inertia": 1.2e-4, "viscous_friction.coefficient": 7.0e-5, "coulomb_friction.level": 0.025}
    return Recorded(
        f"hsm150 {name}",
        tuple(f"hsm150/idf_{run}.parquet" for run in runs),
        signals,
        1.2e-4,
        must=must,
        must_not=("gravity", *STAND_INS),
        published=published,
        regress=(_J, _B, _FC) if len(runs) == 1 else (_J, _B, _FC, _F0),
        regress_hz=3.0,
    )


def _silverbox(run: str) -> Recorded:
    return Recorded(
        f"silverbox {run}",
        (f"silverbox/{run}.parquet",),
        {"time": "t_s", "u": "u_V", "velocity": "", "position": "position_V"},
        5e-6,
        must=("viscous_friction", "stiffness", "cubic_stiffness"),
        must_not=("gravity", *STAND_INS),
        regress=(_J, _B, "stiffness.coefficient", "cubic_stiffness.coefficient"),
        regress_hz=200.0,
        tau=0.005,
        hold="sampled",
    )


def _pendulum(name: str, **more: object) -> Recorded:
    signals = {"time": "t_s", "u": "torque_meas_Nm", "velocity": "velocity_rad_s", "position": "position_rad"}
    return Recorded(
        f"dfki_pendulum {name}",
        (f"dfki_pendulum/{name}.csv",),
        signals,
        0.15,
        must=("gravity",),
        must_not=STAND_INS,
        first=1,
        published={"gravity.amplitude": 2.98, "inertia": 0.15},
        regress=(_J, _G, _FC),
        regress_hz=6.0,
        tau=0.05,
        **more,  # type: ignore[arg-type]
    )


_COGGING = ("cogging",)
_SLOW = {
    "must": _COGGING,
    "must_not": STAND_INS,
    "first": 1,
    "open_values": ("inertia",),
    "published": {"cogging.periods": 7.0},
    "regress": (_FC, _F0, "cogging.sine", "cogging.cosine"),
}
_FRICTION = ("viscous_friction", "coulomb_friction")
_KUKA_NOT = ("gravity", *STAND_INS)

RECORDED = (
    _kuka(
        "A",
        "A",
        must=_FRICTION,
        must_not=_KUKA_NOT,
        first=2,
        published={"inertia": 7.9, "viscous_friction.coefficient": 7.55, "coulomb_friction.level": 1.36},
    ),
    _kuka("B", "B", must=_FRICTION, must_not=_KUKA_NOT, first=2, published={"inertia": 4.8}),
    _kuka("C", "C", must=_FRICTION, must_not=_KUKA_NOT, first=2, published={"inertia": 5.4}),
    _kuka("A, B, C together", "ABC", must_not=_KUKA_NOT, unknown=True),
    Recorded(
        "rack_pinion, as logged",
        ("rack_pinion/merged_raw_clock.csv",),
        {"time": "t_s", "u": "u_force_N", "velocity": "velocity_m_s", "position": ""},
        24.7,
        must=("viscous_friction|viscous_asymmetry", "coulomb_friction|constant_load"),
        must_not=STAND_INS,
        published={"inertia": 24.7, "viscous_friction.coefficient": 54.0, "delay": 0.007},
        regress=(_J, _B, _FC),
        regress_hz=30.0,
        tau=0.01,
    ),
    _odrive("slow2_nocomp_0.csv", **_SLOW),
    _odrive("slow2_slower_nocomp_0.csv", **_SLOW),
    _odrive("slow2_comp_0.csv", **_SLOW),
    _odrive("slow2_slower_comp_0.csv", **_SLOW),
    _odrive(
        "spinup_4_nocomp.parquet",
        must=("coulomb_friction",),
        published={"inertia": 3.52e-3, "coulomb_friction.level": 0.42},
        regress=(_J, _FC),
        regress_hz=10.0,
    ),
    _silverbox("test_multisine"),
    _silverbox("test_arrow"),
    _hsm("all five runs", _RUNS, ("coulomb_friction", "viscous_friction")),
    *(_hsm(run, (run,), ("coulomb_friction|constant_load", "viscous_friction|viscous_asymmetry")) for run in _RUNS),
    Recorded(
        "frc_drivetrain, four tests",
        tuple(f"frc_drivetrain/{n}.csv" for n in ("slow_forward", "slow_backward", "fast_forward", "fast_backward")),
        {"time": "t", "u": "u", "velocity": "velocity", "position": "position"},
        0.08,
        must=("coulomb_friction", "viscous_friction"),
        must_not=STAND_INS,
        first=2,
        published={"inertia": 0.08, "viscous_friction.coefficient": 1.20, "coulomb_friction.level": 0.806},
        within=0.4,
        regress=(_J, _B, _FC),
        regress_hz=3.0,
        tau=0.05,
    ),
    Recorded(
        "emps",
        ("emps/emps_train.csv",),
        {"time": "t_s", "u": "force_N", "position": "position_m"},
        95.0,
        must=("coulomb_friction", "viscous_friction", "viscous_asymmetry|constant_load"),
        must_not=STAND_INS,
        first=2,
        published={"inertia": 95.1089, "viscous_friction.coefficient": 203.5, "coulomb_friction.level": 20.39},
        within=0.05,
        regress=(_J, _B, _FC, _F0),
        regress_hz=20.0,
    ),
    Recorded(
        "bam_xl330, twelve runs",
        _XL330,
        {"time": "t_s", "u": "u_V", "velocity": "", "position": "position_rad"},
        0.07,
        must=("gravity", "viscous_friction", "coulomb_friction|load_friction|stribeck_friction"),
        must_not=("periodic_disturbance", "external_force", "flexible_coupling", "dead_zone"),
        first=1,
        published={"inertia": 6.7e-3 / 0.09627, "gravity.amplitude": 0.4805 / 0.09627},
        regress=(_J, _G, _B, _FC),
        tau=0.03,
    ),
    _pendulum("ddp"),
    _pendulum("dircol"),
)
