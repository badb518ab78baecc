"""What `init` and `check` say of channels that rest at another value than 0, and of values that stand alone."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from dsd_cli.files.config.signals import Signals
from dsd_cli.identify.checks import Finding
from dsd_cli.signals.log import Log, with_channels
from dsd_cli.signals.outliers import standing_alone
from dsd_cli.signals.zero_offset import zero_offset

#: Times the largest of the rest of u beyond which no drive gives a single sample.
_NO_KICK = 100.0


def zero_offsets(log: Log, signals: Signals) -> list[Finding]:
    """Channels that rest at what may be the zero of their sensor; u holds a weight there as well."""
    found = [(name, zero_offset(log[name])) for name in ("u", "velocity") if name in log]
    factor, off = signals.factors(), signals.offsets()

    def in_column(name: str, zero: float) -> float:
        """To 1e-4 of the range: of an analogue input of 24 bits the zero has more digits than the signal."""
        scale = factor.get(name, 1.0)
        span = float(np.ptp(log[name])) / abs(scale)
        return round(zero / scale + off.get(name, 0.0), 4 - math.floor(math.log10(span)))

    return [
        Finding(
            f"{name} never comes to 0, begins at {zero:.4g} and goes to both sides of it:"
            f" {'a weight that it holds, or ' if name == 'u' else ''}its sensor's zero?",
            name,
            "note",
            0.8,
            f"if of the sensor, set signals.{name}_offset = {in_column(name, zero):.12g}",
        )
        for name, zero in found
        if zero is not None
    ]


def lone_spikes(log: Log) -> list[int]:
    """Single samples of u far beyond what it usually reaches, as of a wrong cell: no change of the speed answers."""
    if "u" not in log or not log.channels.keys() & {"velocity", "position"}:
        return []
    at, speed = standing_alone(log["u"]).tolist(), log["velocity"] if "velocity" in log else np.diff(log["position"])
    return [] if not at or standing_alone(np.diff(speed)).size else at


def said_of_spikes(log: Log, at: Sequence[int]) -> list[Finding]:
    """What is said of those."""
    if not at:
        return []
    largest = max((float(log["u"][k]) for k in at), key=abs)
    what = f"{len(at)} value(s) of u stand alone, up to {largest:.4g}, first in sample {at[0]}: are these cells wrong?"
    remedy = "signals.u_range = [low, high] leaves such rows out"
    return [Finding(what, "u", "warning", 0.8, remedy)]


def without_impossible(log: Log, at: Sequence[int]) -> Log:
    """The log with u as it is around those of its lone spikes that no drive gives; a kick of a few times the rest may
    have acted, though a coarse sensor shows nothing of it. The same log where there are none."""
    usual = float(np.max(np.abs(np.delete(log["u"], at)), initial=0.0)) if at else 0.0
    at = [k for k in at if abs(log["u"][k]) > _NO_KICK * usual]
    if not at:
        return log
    u, there = log["u"].copy(), np.ones(log["u"].size, dtype=bool)
    there[at] = False
    u[at] = np.interp(at, np.flatnonzero(there), u[there])
    return with_channels(log, u=u)
