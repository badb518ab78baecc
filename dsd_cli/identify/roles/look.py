"""What is known so far of the channels of a log, while their roles are being found."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from dsd_cli.identify.roles.causes import Cause
from dsd_cli.identify.roles.slopes import lag_of
from dsd_cli.signals.log import Array

#: Two channels are one quantity, asked for and measured, where one leaves less than this share of the other.
TWINS = 0.05
#: And their variances are alike within this factor.
ALIKE = 2.0
#: Longest time by which a measured position comes after the one that was asked for, samples.
LONGEST = 200
AS_TOLD, ONLY_CAUSE = "as you say", "only what makes it move says so"


@dataclass(frozen=True)
class Guess:
    """A channel's column, why it is taken for that, and what speaks against it ("" for nothing)."""

    column: str
    reason: str
    doubt: str = ""


class Motion(NamedTuple):
    """A column and the role that it has or may have, position or velocity."""

    column: str
    kind: str


@dataclass
class Look:
    """What is known so far: values without holes, on steps of `dt` (1 where there is no clock).

    `rivals` : columns that could be u as well as the one that is called so.
    """

    values: dict[str, Array]
    t: Array
    dt: float
    found: dict[str, Guess]
    never_motion: frozenset[str] = frozenset()
    never_cause: frozenset[str] = frozenset()
    rivals: frozenset[str] = frozenset()
    causes: dict[str, Cause] = field(default_factory=dict)

    def free(self) -> list[str]:
        taken = {guess.column for guess in self.found.values()}
        return [name for name in self.values if name not in taken]


def lead_of(x: Array, y: Array) -> int | None:
    """By how many samples x is ahead of y; None: they are not one quantity, asked for and measured."""
    power = float(np.var(x))
    if power <= 0.0 or not 1.0 / ALIKE < float(np.var(y)) / power < ALIKE:
        return None
    lag = lag_of(x - x.mean(), y - y.mean(), LONGEST)
    a, b = (x[: x.size - lag], y[lag:]) if lag >= 0 else (x[-lag:], y[:lag])
    return lag if float(np.mean((b - a) ** 2)) < TWINS * power else None
