"""Which hidden-effect logs are made, and how one is turned into what the tool gets to see.

A job is one log: what is hidden, seed, amplitude, sensing. `cases(what, [seed], amplitude=..., sensing=...)` of
tests/oracle/machine_cases.py, as `Job.call` spells it, makes it again.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from dsd_cli.identify.recordings.recording import Recording, prepare
from dsd_cli.plant.model import ObserverSettings, PlantModel
from dsd_cli.signals.log import Log
from tests.oracle import machines
from tests.oracle.machine_cases import EFFECT_IDS, STRANGER_IDS, cases, pairs
from tests.oracle.machines import Case

#: "buried" is a faint effect under much noise: the true law gains 5 to 50 %, and some of these logs do not count.
AMPLITUDES = ("plain", "moderate", "faint", "buried")
BURIED = {"amplitude": "faint", "noise": 0.08}
SENSINGS = ("all", "velocity", "position", "d_hat")
#: Parts of the study, in the order of their report.
PARTS = ("singles", "none", "pairs", "strangers")
#: Peers see the measured acceleration, so they get logs with a speed.
PEER_SENSINGS = ("all", "velocity")


@dataclass(frozen=True)
class Job:
    """One log. `part` is one of `PARTS` or "peers"; `what` is empty where nothing is hidden."""

    part: str
    what: tuple[str, ...]
    seed: int
    amplitude: str = "plain"
    sensing: str = "all"

    @property
    def truth(self) -> str:
        return "+".join(self.what) or "none"

    @property
    def call(self) -> str:
        """The call that makes this log."""
        what = repr(self.what[0] if len(self.what) == 1 else self.what or "none")
        options = ", ".join(f"{name}={value!r}" for name, value in self.options.items())
        return f"cases({what}, [{self.seed}], {options})"

    @property
    def options(self) -> dict[str, Any]:
        """How `cases` is called."""
        level = BURIED if self.amplitude == "buried" else {"amplitude": self.amplitude}
        return {**level, "sensing": self.sensing}

    def case(self) -> Case:
        """The oracle's case."""
        return cases(self.what or "none", [self.seed], **self.options)[0]

    def as_json(self) -> dict[str, object]:
        return asdict(self) | {"truth": self.truth, "call": self.call}


def with_speed(seed: int, amplitude: int) -> str:
    """The sensings with a logged speed take turns: they differ in the d_hat that is logged along, or is not."""
    return PEER_SENSINGS[(seed + amplitude) % len(PEER_SENSINGS)]


def jobs(part: str, seeds: Sequence[int], clean: int) -> Iterator[Job]:
    """The logs of one part; `clean` is the number of logs with nothing missing."""
    if part == "singles":
        for seed in seeds:
            for k, amplitude in enumerate(AMPLITUDES):
                for sensing in (with_speed(seed, k), "position", "d_hat"):
                    yield from (Job(part, (name,), seed, amplitude, sensing) for name in EFFECT_IDS)
    elif part == "none":
        for seed in range(clean):
            yield Job(part, (), seed, sensing=SENSINGS[seed % len(SENSINGS)])
    elif part == "pairs":
        for seed in seeds:
            yield from (Job(part, pair, seed, sensing=SENSINGS[seed % 2]) for pair in pairs())
    elif part == "strangers":
        for seed in seeds:
            yield from (Job(part, (name,), seed, sensing=SENSINGS[seed % 3]) for name in STRANGER_IDS)
    else:
        raise ValueError(f"no such part: {part}")


def prepared(found: machines.Recording) -> tuple[Recording, PlantModel, ObserverSettings]:
    """What the tool gets: the log, the believed model and the observer's settings; nothing of the truth."""
    case = found.truth
    observer = ObserverSettings(case.nominal_inertia, case.observer_time_constant)
    model = PlantModel(case.believed_inertia, case.believed_delay, {name: dict(p) for name, p in case.base})
    return prepare(Log(found.channels, case.sample_time, source="log"), observer), model, observer
