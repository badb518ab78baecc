"""A log with what its owner believes and what is to be said of it, and tiers: families of such logs, one per seed."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from tests.oracle.rig_cases import Array

#: How a question is asked and judged:
#: "one" by `diagnose`: the verdict is what is hidden; "none": that nothing is missing; "stranger" by `improve`: the
#: ladder ends with "unknown"; "set" by `improve`: these effects and no other.
JUDGED = ("one", "none", "set", "stranger")


@dataclass(frozen=True)
class Question:
    """One log. Channels of shape (n,), SI, rotary.

    hidden : ids of what the belief lacks, "inertia" and "delay" among them. believed : inertia, delay, effects.
    observer : nominal_inertia, time_constant, of a logged d_hat (or for one to be made); filter and u if they are told.
    truth : inertia, delay, effects {id: values} of all that is there.
    judged : one of JUDGED. also : verdicts that are right as well, because the log cannot tell them apart.
    tied : whether it is enough that the verdict states what is hidden as indistinguishable.
    notes : what was drawn, plain values; "promised" 0.0 says that no machine of this seed shows what is hidden.
    """

    hidden: tuple[str, ...]
    channels: dict[str, Array]
    believed: dict[str, Any]
    observer: dict[str, Any]
    truth: dict[str, Any]
    judged: str = "one"
    also: tuple[str, ...] = ()
    tied: bool = False
    notes: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if self.judged not in JUDGED:
            raise ValueError(f"judged '{self.judged}' is none of {', '.join(JUDGED)}")


@dataclass(frozen=True)
class Tier:
    """One family: `draw(seed)` gives the same log for the same seed. weight : logs for each one of a usual tier."""

    name: str
    draw: Callable[[int], Question]
    weight: float = 1.0
