"""Cells of the study on the outside rig: which logs, how many of them right, how many are wanted."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import cycle
from typing import Any

from tests.oracle.rig import SINGLES, STRANGERS_SEEN, STRANGERS_UNSEEN, RigCase
from tests.oracle.rig_cases import PAIRS, RIPPLES

#: Effects that are hidden in logs of three days, and what differs between these: the effect, factors on its level.
HIDDEN_BY_DAYS = ("gravity", "cogging", "dead_zone", "saturation", "stribeck_friction", "stiffness", "quadratic_drag")
DAYS = (
    ("coulomb_friction", (0.7, 1.0, 1.3)),
    ("constant_load", (1.3, 0.7, 1.0)),
    ("viscous_friction", (1.3, 1.0, 0.7)),
)
#: First seed of the study; all lower ones were looked at while the search was written, or after an earlier run of it.
FROM = 76200


@dataclass(frozen=True)
class Cell:
    """Logs of one kind. kind : singles, none, pairs, lines, strangers, days, sign or units; wanted : share that is to
    be right."""

    name: str
    kind: str
    wanted: float
    sensing: str = "speed40k"
    more: dict[str, Any] = field(default_factory=dict)
    seeds: int = 2

    def whats(self) -> tuple[tuple[str, ...], ...]:
        """What is hidden in the logs of one seed."""
        if self.kind == "singles":
            return tuple((name,) for name in SINGLES)
        if self.kind == "pairs":
            return tuple(tuple(pair) for pair in PAIRS)
        if self.kind == "lines":
            return (*((name,) for name in RIPPLES), ("coulomb_friction", "two_cogging_lines"))
        if self.kind == "days":
            return tuple((hidden, kind) for hidden, (kind, _) in zip(HIDDEN_BY_DAYS, cycle(DAYS), strict=False))
        if self.kind == "strangers":
            return tuple((name,) for name in (*STRANGERS_SEEN, *STRANGERS_UNSEEN))
        return ((),) if self.kind == "none" else (("viscous_friction",),)

    def cases(self, seeds: int | None = None) -> Iterator[RigCase]:
        """The rig's cases; `seeds` in place of the cell's own number."""
        for seed in range(FROM, FROM + (seeds or self.seeds)):
            for what in self.whats():
                yield RigCase(what=what, seed=seed, sensing=self.sensing, **self.more)


CELLS = (
    Cell("speed and 40,000 counts", "singles", 0.98),
    Cell("loud speed", "singles", 0.98, "speedloud"),
    Cell("position only, 4096 counts", "singles", 0.95, "enc4096"),
    Cell("position only, 1024 counts", "singles", 0.0, "enc1024"),
    Cell("position only, 40,000 counts", "singles", 0.0, "enc40k"),
    Cell("position only, 8192 counts, 500 Hz, irregular stamps", "singles", 0.90, "enc8192jitter500"),
    Cell("u and d_hat only", "singles", 0.95, "udhat"),
    Cell("3 s", "singles", 0.95, more={"duration": 3.0}),
    Cell("1 s", "singles", 0.0, more={"duration": 1.0}),
    Cell("60 s", "singles", 0.0, more={"duration": 60.0}, seeds=1),
    Cell("weak loop", "singles", 0.97, more={"loop": "weak"}),
    Cell(
        "inertia 3 % and delay 1 ms off",
        "singles",
        0.98,
        more={"believed_inertia_factor": 1.03, "believed_delay_error": 1e-3},
    ),
    Cell("tau 1 ms", "singles", 0.0, more={"tau": 1e-3}),
    Cell("tau 200 ms", "singles", 0.0, more={"tau": 0.2}),
    Cell("u with the wrong sign", "sign", 1.0, more={"u_sign": -1}, seeds=20),
    Cell("speed in degrees per second", "units", 1.0, seeds=20),
    Cell("nothing missing, speed", "none", 0.99, seeds=100),
    Cell("nothing missing, 4096 counts", "none", 0.99, "enc4096", seeds=100),
    Cell("nothing missing, irregular stamps", "none", 0.99, "enc8192jitter500", seeds=50),
    Cell("nothing missing, u and d_hat", "none", 0.99, "udhat", seeds=50),
    Cell("two effects", "pairs", 0.90, seeds=3),
    Cell("several cogging lines, speed", "lines", 0.95, seeds=5),
    Cell("several cogging lines, 4096 counts", "lines", 0.95, "enc4096", seeds=5),
    Cell("several cogging lines, irregular stamps", "lines", 0.95, "enc8192jitter500", seeds=5),
    Cell("three days, speed", "days", 0.90, more={"duration": 10.0}),
    Cell("three days, 4096 counts", "days", 0.90, "enc4096", more={"duration": 10.0}),
    Cell("effects of no catalogue", "strangers", 0.90, seeds=4),
)


def chosen(names: Sequence[str]) -> list[Cell]:
    """Cells whose name contains one of these; all of them without names."""
    return [c for c in CELLS if not names or any(name in c.name for name in names)]
