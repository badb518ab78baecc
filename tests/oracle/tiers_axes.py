"""Tiers of axes that no laboratory has: geared joints, crawls, cycles, small travel, one direction, play, background.

Each draws machines until one shows what is hidden (axes.LEFT of the drive that no other single law takes), eight at
most; `notes["promised"]` says whether one did.
"""

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from tests.oracle import axis_motion
from tests.oracle.axes import Axis, Ran, attempts, moved, question, rms, shown, stamps
from tests.oracle.questions import Question, Tier
from tests.oracle.rig_cases import Values

Rng = np.random.Generator
Drawn = tuple[Axis, tuple[str, ...]]  # an axis, and what of its effects is hidden

#: What a geared joint has beside Coulomb and viscous friction.
THIRD = ("gravity", "constant_load", "stribeck_friction", "cogging", "viscous_asymmetry", "stiffness")
#: Effects of no catalogue that make a background, each with this share of the drive.
SMALL = ("friction_over_position", "root_drag", "play_hysteresis", "eddy_brake", "random_walk_load", "swinging_inertia")
EACH = (0.005, 0.02)
OVER_BACKGROUND = (
    "viscous_friction",
    "coulomb_friction",
    "gravity",
    "stiffness",
    "cogging",
    "constant_load",
    "inertia",
)
POINT_TO_POINT = (
    *("viscous_friction", "coulomb_friction", "gravity", "stiffness", "cogging", "constant_load", "quadratic_drag"),
    *("viscous_asymmetry", "load_friction", "periodic_disturbance", "presliding_friction", "actuator_lag"),
)


def _drawn(
    tier: str,
    seed: int,
    axis_of: Callable[[Rng, int], Drawn],
    channels: Callable[[Rng], tuple[str, ...]] = lambda rng: ("velocity", "position"),
    **more: Any,
) -> Question:
    """The first axis of that seed that shows what it hides, or the last that ran."""
    last: tuple[Ran, Rng, tuple[str, ...]] | None = None
    for _, rng in attempts(tier, seed):
        axis, hidden = axis_of(rng, seed)
        ran = moved(axis, rng)
        apart = () if more.get("tied") else [h for h in hidden if h not in ("inertia", "backlash")]
        left = shown(ran, apart)
        if ran is not None:
            last = ran, rng, hidden
        if ran is not None and left is not None:
            return _asked(ran, rng, hidden, channels(rng), {"promised": 1.0, "left": left}, more)
    if last is None:
        raise RuntimeError(f"no axis of {tier}, seed {seed}, keeps to its reference")
    ran, rng, hidden = last
    return _asked(ran, rng, hidden, channels(rng), {"promised": 0.0}, more)


def _asked(
    ran: Ran, rng: Rng, hidden: tuple[str, ...], channels: tuple[str, ...], notes: Values, more: Values
) -> Question:
    made = question(ran, rng, hidden, channels, notes=notes, **more)
    if "inertia" in hidden:
        made.believed["inertia"] *= float(rng.choice([0.6, 1.6]))
    return made


def _inertia(rng: Rng) -> float:
    return float(np.exp(rng.uniform(np.log(2e-3), np.log(0.3))))


def _speed_noise(rng: Rng, q: np.ndarray, t: np.ndarray) -> float:
    """Of a speed sensor: 5e-4 to 3e-3 of the usual speed, rad/s."""
    return float(rng.uniform(5e-4, 3e-3) * rms(np.gradient(q, t)))


def _either(rng: Rng) -> tuple[str, ...]:
    return ("velocity", "position") if rng.random() < 0.5 else ("position",)


# -- geared joints --------------------------------------------------------------------------------------------------


def geared(rng: Rng, seed: int, believed: bool) -> Drawn:
    """Friction is most of the drive, inertia 3 to 12 % of it; motion as smooth as that of a robot."""
    t = stamps(float(rng.choice([0.001, 0.002, 0.004])), 20.0)
    q = axis_motion.smooth(rng, t, rng.uniform(0.6, 2.0), rng.uniform(0.5, 1.0))
    third = THIRD[seed % len(THIRD)]
    shares = {
        "inertia": float(rng.uniform(0.03, 0.12)),
        "coulomb_friction": float(rng.uniform(0.35, 0.7)),
        "viscous_friction": float(rng.uniform(0.2, 0.5)),
        third: float(rng.uniform(0.1, 0.35)),
    }
    axis = Axis(
        t=t,
        q=q,
        inertia=float(rng.uniform(0.5, 2.0)) * 0.02,
        delay=float(rng.uniform(0.0, 0.008)),
        shares=shares,
        bandwidth=float(rng.uniform(20.0, 45.0)),
        counts=int(rng.choice([40_000, 200_000])),
        speed_noise=_speed_noise(rng, q, t),
        u_noise=float(rng.choice([0.0, 0.003, 0.01])),
        feedforward=float(rng.choice([0.0, 1.0])),
    )
    return axis, (third,) if believed else ("coulomb_friction", "viscous_friction", third)


# -- crawls ---------------------------------------------------------------------------------------------------------


def crawl(rng: Rng, seed: int) -> Drawn:
    """At one slow speed through the cogging of a motor, to and fro."""
    t = stamps(float(rng.choice([0.002, 0.004])), 24.0)
    speed = float(rng.uniform(0.5, 1.5))
    q = axis_motion.crawl(rng, t, speed)
    axis = Axis(
        t=t,
        q=q,
        inertia=_inertia(rng),
        delay=float(rng.uniform(0.0, 0.006)),
        shares={
            "inertia": 0.004,
            "cogging": float(rng.uniform(0.4, 0.8)),
            "coulomb_friction": float(rng.uniform(0.3, 0.6)),
        },
        bandwidth=float(rng.uniform(40.0, 70.0)),
        counts=int(rng.choice([8192, 16_384, 40_000])),
        speed_noise=None,
        u_noise=float(rng.choice([0.0, 0.005])),
    )
    # with the whole drive nearly all cogging and friction, their sizes follow from an inertia that hardly counts
    periods = float(rng.choice([5, 6, 7, 12, 14, 20]))
    whole = axis.inertia * rms(np.gradient(np.gradient(q, t), t)) / axis.shares["inertia"]
    amplitude, phase = np.sqrt(2.0) * axis.shares["cogging"] * whole, float(rng.uniform(-np.pi, np.pi))
    given = {"cogging": {"amplitude": float(amplitude), "periods": periods, "phase": phase}}
    return Axis(**{**axis.__dict__, "given": given}), ("cogging", "coulomb_friction")


# -- periodic motion, small travel, one direction, moves -----------------------------------------------------------


def periodic(rng: Rng, seed: int) -> Drawn:
    """The same cycle again and again; what is missing repeats with it."""
    t = stamps(0.001, 20.0)
    q = axis_motion.cycle(rng, t, rng.uniform(0.4, 1.5), rng.uniform(0.2, 1.0))
    hidden = ("coulomb_friction", "viscous_friction", "gravity", "stiffness")[seed % 4]
    return _plain(rng, t, q, hidden), (hidden,)


def small(rng: Rng, seed: int) -> Drawn:
    """0.02 to 0.1 rad to either side."""
    t = stamps(0.001, 20.0)
    q = axis_motion.smooth(rng, t, rng.uniform(0.02, 0.1), rng.uniform(2.0, 5.0))
    hidden = ("stiffness", "coulomb_friction", "viscous_friction", "constant_load")[seed % 4]
    return _plain(rng, t, q, hidden, counts=200_000), (hidden,)


def one_way(rng: Rng, seed: int) -> Drawn:
    """Conveyor or spindle: forward only, at many speeds."""
    t = stamps(0.001, 20.0)
    q = axis_motion.one_way(rng, t, rng.uniform(2.0, 8.0))
    hidden = ("viscous_friction", "coulomb_friction", "quadratic_drag", "cogging", "periodic_disturbance")[seed % 5]
    return _plain(rng, t, q, hidden), (hidden,)


def point_to_point(rng: Rng, seed: int) -> Drawn:
    t = stamps(0.001, 20.0)
    q = axis_motion.moves(rng, t, rng.uniform(0.8, 2.4), rng.uniform(1.5, 5.0))
    hidden = POINT_TO_POINT[seed % len(POINT_TO_POINT)]
    return _plain(rng, t, q, hidden), (hidden,)


def _plain(rng: Rng, t: np.ndarray, q: np.ndarray, hidden: str, counts: int = 40_000) -> Axis:
    """One hidden effect of 20 to 55 % of the drive, beside inertia; half have a speed sensor as well."""
    share = float(rng.uniform(0.2, 0.55))
    return Axis(
        t=t,
        q=q,
        inertia=_inertia(rng),
        delay=float(rng.uniform(0.0, 0.012)),
        shares={"inertia": float(np.sqrt(1.0 - share**2)), hidden: share},
        bandwidth=float(rng.uniform(12.0, 35.0)),
        counts=counts,
        speed_noise=_speed_noise(rng, q, t),
        feedforward=float(rng.choice([0.0, 1.0])),
    )


# -- a background of many small effects -----------------------------------------------------------------------------


def background(rng: Rng, seed: int) -> Drawn:
    """One effect of 15 to 45 % over four to six that no catalogue has, together 1 to 5 % of the drive."""
    t = stamps(0.001, 20.0)
    make = axis_motion.moves if rng.random() < 0.4 else axis_motion.smooth
    q = make(rng, t, rng.uniform(0.9, 2.2), rng.uniform(0.9, 1.8))
    hidden = OVER_BACKGROUND[seed % len(OVER_BACKGROUND)]
    axis = _plain(rng, t, q, hidden if hidden != "inertia" else "viscous_friction")
    share = float(rng.uniform(0.15, 0.45))
    shares = {"inertia": float(np.sqrt(1.0 - share**2))} | ({} if hidden == "inertia" else {hidden: share})
    few = rng.permutation(SMALL)[: int(rng.integers(4, 7))]
    shares |= {str(e): float(rng.uniform(*EACH)) for e in few}
    return Axis(**{**axis.__dict__, "shares": shares}), (hidden,)


def _over_background(tier: str, seed: int) -> Question:
    """What makes the background is neither hidden nor known."""
    made = _drawn(tier, seed, background, _either)
    for effect in SMALL:
        made.believed["effects"].pop(effect, None)
    return made


# -- play -----------------------------------------------------------------------------------------------------------


def play(rng: Rng, seed: int, stiff: tuple[float, float]) -> Drawn:
    """Contact between motor and load `stiff` times as quick as the loop; the gap is crossed at every turn."""
    t = stamps(0.001, 20.0)
    travel, bandwidth = rng.uniform(0.8, 2.0), float(rng.uniform(8.0, 25.0))
    make = axis_motion.moves if rng.random() < 0.5 else axis_motion.smooth
    q = make(rng, t, travel, rng.uniform(1.5, 4.0) if make is axis_motion.moves else rng.uniform(0.8, 2.0))
    inertia, share = _inertia(rng), float(rng.uniform(0.25, 0.65))
    rate = bandwidth * float(np.exp(rng.uniform(*np.log(stiff))))
    gap = travel * float(np.exp(rng.uniform(np.log(0.004), np.log(0.03))))
    given = {"backlash": {"gap": gap, "load_share": share, "stiffness": share * inertia * rate**2}}
    axis = Axis(
        t=t,
        q=q,
        inertia=inertia,
        delay=float(rng.uniform(0.0, 0.008)),
        shares={"inertia": 0.95, "viscous_friction": 0.15},
        bandwidth=bandwidth,
        counts=40_000,
        speed_noise=_speed_noise(rng, q, t),
        given=given,
    )
    return axis, ("backlash",)


def _nothing(rng: Rng, seed: int) -> Drawn:
    """A geared joint, a crawl or a cycle of which everything is known."""
    axis, _ = (partial(geared, believed=True), crawl, periodic)[seed % 3](rng, seed)
    return axis, ()


def _tier(
    name: str, axis_of: Callable[[Rng, int], Drawn], channels: Any = _either, weight: float = 1.0, **more: Any
) -> Tier:
    return Tier(name, lambda seed: _drawn(name, seed, axis_of, channels, **more), weight)


def tiers() -> list[Tier]:
    """All of them."""
    joint, stiff, soft = partial(geared, believed=False), (10.0, 100.0), (2.5, 8.0)
    return [
        _tier("geared joint", joint, judged="set"),
        _tier("geared joint, friction believed", partial(geared, believed=True)),
        _tier("crawl through cogging", crawl, lambda rng: ("position",), judged="set"),
        Tier("over a background", lambda seed: _over_background("over a background", seed), 1.5),
        _tier("periodic motion", periodic, tied=True),
        _tier("small travel", small, tied=True),
        _tier("one direction", one_way, tied=True),
        _tier("point to point", point_to_point, weight=1.5),
        _tier("backlash, stiff contact", partial(play, stiff=stiff)),
        _tier("backlash, soft contact", partial(play, stiff=soft)),
        _tier("nothing missing, new axes", _nothing, judged="none"),
    ]
