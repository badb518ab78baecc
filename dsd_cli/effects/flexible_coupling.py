"""Motor and load as two masses with a spring and a damper between them."""

import math
from itertools import product
from typing import Any

from dsd_cli.effects.base import Channels, Effect, Parameter, Ranges, Role, Shape, SpectralLines, Values, log_spaced
from dsd_cli.effects.joint_terms import Hung, JointTerms
from dsd_cli.effects.memory import Coupling, Load, load_acceleration

#: Own frequency of a load, times the end of the band, up to which a search starts; beyond it all is rigid to the band.
HIGHEST = 2.0
#: Damping ratio with which the search for a ringing load begins.
RINGING = 0.05


def _columns(channels: Channels, shape: Shape, state: Load | None) -> tuple[tuple[Any, ...], Load]:
    """Mean acceleration of the load in each interval: a_l = wa^2 (qm - ql) + 2 zeta wa (vm - vl)."""
    spring = _coupling(shape)
    column, state = load_acceleration(channels.position, channels.velocity, channels.interval, spring, state)
    return (column,), state


def _coupling(shape: Shape) -> Coupling:
    return Coupling.of(shape["frequency"], shape["damping"])


def _starts(ranges: Ranges) -> list[Shape]:
    if not (ranges.duration > 0.0 and ranges.sample_time > 0.0):
        return []
    highest = min(0.2 / ranges.sample_time, HIGHEST * ranges.band_hz)
    frequencies = log_spaced(min(max(2.0 / ranges.duration, 1.0), highest), highest, 10)
    return [{"frequency": f, "damping": zeta} for f, zeta in product(frequencies, (0.02, 0.2))]


def _seeds(lines: SpectralLines) -> list[Shape]:
    """A load that is hardly damped rings: its line lies at or above the frequency that it has alone."""
    return [{"frequency": f * below, "damping": RINGING} for f in lines.over_time for below in (1.0, 0.8)]


def _split(values: Values, _: float) -> tuple[tuple[float, ...], Shape]:
    share = float(values["load_share"])
    own = values["frequency"] * math.sqrt(1.0 - share)
    return (share,), {"frequency": own, "damping": values["damping"]}


def _join(coefficients: tuple[float, ...], shape: Shape, _: float) -> Values:
    (share,) = coefficients
    resonance = shape["frequency"] / math.sqrt(max(1.0 - share, 1e-12))
    return {"frequency": resonance, "load_share": share, "damping": shape["damping"]}


def _joint(values: Values, inertia: float) -> JointTerms:
    (share,), shape = _split(values, inertia)
    return JointTerms(loads=(Hung(share, _coupling(shape)),))


def _of_joint(terms: JointTerms, inertia: float) -> list[Values]:
    found = [h for h in terms.loads if h.coupling.half_gap == 0.0]
    return [_join((h.share,), h.coupling.shape, inertia) for h in found]


EFFECT = Effect(
    id="flexible_coupling",
    role=Role.STRUCTURE,
    law="a_l = wa^2 (qm - ql) + 2 zeta wa (vm - vl), wa = 2 pi f sqrt(1 - s)",
    summary="Motor and load are two masses with a spring between them: belts, long shafts, slender arms. "
    "position and velocity of the log are those of the motor.",
    pattern="the residual rings at one frequency after every quick change of the command, and fades",
    parameters=(
        Parameter("frequency", "Hz", "f, resonance of motor against load", lower=1e-6, linear=False),
        Parameter("load_share", "1", "s, the load's share of the inertia", lower=1e-6, upper=1.0 - 1e-6),
        Parameter("damping", "1", "zeta, ratio of the load swinging on a held motor", lower=0.0, linear=False),
    ),
    needs=("position",),
    columns=_columns,
    starts=_starts,
    seeds=_seeds,
    broad=("damping",),
    split=_split,
    join=_join,
    memory=True,
    coupling=_coupling,
    joint=_joint,
    of_joint=_of_joint,
)
