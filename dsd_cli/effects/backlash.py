"""Play between motor and load: gears, worn couplings, screws."""

import math
from itertools import product
from typing import Any

from dsd_cli.effects.base import Channels, Effect, Parameter, Ranges, Role, Shape, Values, log_spaced
from dsd_cli.effects.joint_terms import Hung, JointTerms
from dsd_cli.effects.memory import Coupling, Load, load_acceleration

#: Damping ratio of the contact: with it the load comes to rest after a few bounces. It is no parameter; where impacts
#: are simulated (`identify.search.play`) that of the log is found. With less damping a load that rattles between the
#: flanks cannot be followed from samples.
CONTACT_DAMPING = 0.3
#: Contacts are searched up to so many times the band in which forces are balanced: stiffer ones look as rigid.
HIGHEST = 4.0


def _columns(channels: Channels, shape: Shape, state: Load | None) -> tuple[tuple[Any, ...], Load]:
    """Mean pull on the load in each interval, per inertia of it; none while it is within the gap."""
    spring = _coupling(shape)
    column, state = load_acceleration(channels.position, channels.velocity, channels.interval, spring, state)
    return (column,), state


def _coupling(shape: Shape) -> Coupling:
    return Coupling.of(shape["frequency"], CONTACT_DAMPING, shape["gap"], shape["slowing"])


def _starts(ranges: Ranges) -> list[Shape]:
    if not (ranges.duration > 0.0 and ranges.sample_time > 0.0):
        return []
    gaps = log_spaced(1e-4 * ranges.travel, 0.2 * ranges.travel, 6)
    highest = min(0.1 / ranges.sample_time, HIGHEST * ranges.band_hz)
    frequencies = log_spaced(min(max(5.0 / ranges.duration, 2.0), highest), highest, 3)
    return [{"gap": gap, "frequency": f, "slowing": 0.0} for gap, f in product(gaps, frequencies)]


#: How far from the best gap and frequency the load still touches at about the same times, natural logarithm. From one
#: flank to the other it is on the way for long: a gap that is off by 5 % puts off each contact, and with it all that
#: follow, while the frequency is of a contact alone.
_VALLEY = {"gap": 0.04, "frequency": 0.3}


def _closely(ranges: Ranges) -> list[Shape]:
    """Gaps that the sensor resolves, and frequencies, so close that one is in the valley."""
    if not (ranges.duration > 0.0 and ranges.sample_time > 0.0):
        return []
    highest = min(0.1 / ranges.sample_time, HIGHEST * ranges.band_hz)
    ends = {
        "gap": (max(1e-3 * ranges.travel, ranges.resolution), 0.2 * ranges.travel),
        "frequency": (min(5.0, highest), highest),
    }
    gaps, frequencies = (
        log_spaced(a, b, math.ceil(math.log(b / a) / _VALLEY[name]) + 1) if a < b else []
        for name, (a, b) in ends.items()
    )
    return [{"gap": gap, "frequency": f, "slowing": 0.0} for gap, f in product(gaps, frequencies)]


def _split(values: Values, inertia: float) -> tuple[tuple[float, ...], Shape]:
    share = float(values["load_share"])
    rate = math.sqrt(values["stiffness"] / (share * inertia))
    slowing = values.get("load_level", 0.0) / (share * inertia)
    return (share,), {"gap": values["gap"], "frequency": rate / (2.0 * math.pi), "slowing": slowing}


def _join(coefficients: tuple[float, ...], shape: Shape, inertia: float) -> Values:
    (share,) = coefficients
    rate, slowing = 2.0 * math.pi * shape["frequency"], shape["slowing"]
    values = {"gap": shape["gap"], "load_share": share, "stiffness": share * inertia * rate * rate}
    return {**values, "load_level": share * inertia * slowing} if slowing > 0.0 else values


def _joint(values: Values, inertia: float) -> JointTerms:
    (share,), shape = _split(values, inertia)
    if shape["slowing"] > 0.0:
        return JointTerms(missing="friction of a load by its own speed")
    return JointTerms(loads=(Hung(share, _coupling(shape)),))


def _of_joint(terms: JointTerms, inertia: float) -> list[Values]:
    found = [h for h in terms.loads if h.coupling.half_gap > 0.0]
    return [_join((h.share,), h.coupling.shape, inertia) for h in found]


EFFECT = Effect(
    id="backlash",
    role=Role.STRUCTURE,
    law="a_l = wa^2 dz(qm - ql, gap/2), damped, - load_level sgn(vl)/s/J, wa^2=k/s/J",
    summary="Play between motor and load: worn gears, couplings and screws. position and velocity of the log are those "
    "of the motor. The contact has a fixed damping ratio of 0.3. The load may have Coulomb friction of its own.",
    pattern="after each reversal the axis feels light for a moment, then the residual kicks as the load is picked up",
    parameters=(
        Parameter("gap", "{q}", "total play of the load against the motor", lower=0.0, linear=False),
        Parameter("load_share", "1", "s, the load's share of the inertia", lower=1e-6, upper=1.0 - 1e-6),
        Parameter("stiffness", "{u}/({q})", "k of the contact", lower=1e-9, linear=False),
        Parameter(
            "load_level",
            "{u}",
            "Coulomb friction of the load itself; that of the motor is `coulomb_friction`",
            lower=0.0,
            linear=False,
            optional=True,
        ),
    ),
    needs=("position",),
    columns=_columns,
    starts=_starts,
    closely=_closely,
    valley=_VALLEY,
    hidden_by=("coulomb_friction", "viscous_friction"),
    split=_split,
    join=_join,
    memory=True,
    coupling=_coupling,
    told_apart={
        "flexible_coupling": "move with small and large amplitudes: only play depends on the amplitude",
    },
    joint=_joint,
    of_joint=_of_joint,
)
