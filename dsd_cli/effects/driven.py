"""Two masses that a force drives, not a motion that a sensor measured."""

from __future__ import annotations

from typing import Any

import numpy as np

from dsd_cli.effects.memory import COMPILED, Coupling, over
from dsd_cli.signals.log import Array

#: Share of the rms acceleration of a load by which two that began apart may differ and move alike.
ALIKE = 0.01


def driven_motor(
    push: Array, interval: float, coupling: Coupling, share: float, velocity: Array | None = None
) -> Array:
    """Mean acceleration of the motor per interval, s_m J a = F - (1 - s_m) J pull; parameters as `driven_load`."""
    return np.asarray(push - share / (1.0 - share) * driven_load(push, interval, coupling, share, velocity=velocity))


def forgotten(push: Array, interval: float, coupling: Coupling, share: float, velocity: Array | None = None) -> int:
    """Intervals after which a load with play moves alike from either flank and from between them: where it began, which
    nobody knows, it has forgotten; parameters as `driven_load`."""
    begun = (0.0, coupling.half_gap, -coupling.half_gap)
    here, *others = (driven_load(push, interval, coupling, share, x, velocity=velocity) for x in begun)
    alike = np.max(np.abs(np.subtract(others, here)), axis=0) <= ALIKE * np.sqrt(np.mean(here**2))
    return int(np.max(np.flatnonzero(~alike), initial=-1)) + 1  # what is no number is like nothing


def driven_load(
    push: Array,
    interval: float,
    coupling: Coupling,
    share: float,
    apart: float = 0.0,
    compiled: Any = COMPILED,
    velocity: Array | None = None,
) -> Array:
    """Mean pull on the load per interval where a force drives the motor: two masses, no sensor, from rest.

        c' = F / (s_m J) - pull / s_m + what its friction slows the load,    s_m = 1 - share

    A load without friction of its own knows no speed but c. The friction of another goes by its speed, the motor's as
    measured less c.

    Parameters
    ----------
    push : F / (s_m J), what the motor would do alone, constant in each interval, shape (n,), of equal intervals in s.
    share : the load's, of the inertia J of both. apart : motor less load at the begin, at which both rest.
    velocity : of the motor as each interval begins, shape (n,); a load without friction needs none.
    """
    own = 1.0 - share
    steps = coupling.steps(interval, 1.0 / own)  # the free vibration is quicker than the load's own
    velocity = np.zeros(len(push)) if velocity is None else velocity
    push, velocity = (np.ascontiguousarray(x, dtype=np.float64) for x in (push, velocity))
    out = np.empty_like(push)
    if compiled is not None:
        compiled.driven(push, velocity, tuple(coupling), own, interval, steps, apart, out)
        return out
    lighter, closing = 1.0 / own, 0.0
    for k, (f, v) in enumerate(zip(push.tolist(), velocity.tolist(), strict=True)):
        apart, closing, taken, _ = over(coupling, f, lighter, interval, steps, apart, closing, v - closing)
        out[k] = taken / (lighter * interval)
    return out
