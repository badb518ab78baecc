"""What is confident where the model lacks one force: logs of the outside rig, which shares no code with the package."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from unittest import mock

import numpy as np

from bench.beyond._runs import percent, table
from bench.beyond.servo import Score, cells
from dsd_cli.detect.doubts import Doubts
from dsd_cli.detect.grid import Grid
from dsd_cli.detect.plan import Plan
from dsd_cli.detect.session import Session
from dsd_cli.detect.settings import DetectorSettings
from dsd_cli.plant.model import ObserverSettings, PlantModel
from dsd_cli.signals.cleaning import Cleaner
from tests.oracle.rig import make
from tests.oracle.rig_cases import SINGLES, STRANGERS_SEEN, STRANGERS_UNSEEN, RigCase, RigLog

SEEDS = (7301, 7302)
SENSINGS = ("speed40k", "enc40k", "enc4096", "enc8192jitter500")
HIDDEN = (*(name for name in SINGLES if name not in ("inertia", "delay")), *STRANGERS_SEEN, *STRANGERS_UNSEEN)
#: rho as a share of the rms of u; window, s.
RHOS, WINDOWS = (0.02, 0.05, 0.15), (0.1, 0.3)


def logs(hidden: tuple[str, ...]) -> Iterator[RigLog]:
    """Of every seed and sensor."""
    for seed in SEEDS:
        for sensing in SENSINGS:
            yield make([RigCase(what=hidden, seed=seed, sensing=sensing, duration=10.0)])[0]


def plan(log: RigLog, rho: float, window: float) -> Plan:
    """Candidates 40 % and 10 ms apart, around the truth; the forces that the owner of the log knows."""
    inertia, delay, effects = log.truth["inertia"], log.truth["delay"], log.believed["effects"]
    found = log.channels
    motion = tuple(name for name in ("velocity", "position") if name in found)
    return Plan(
        Grid(
            tuple(sorted({max(delay + k * 0.01, 0.0) for k in (-2, -1, 0, 1, 2)})),
            tuple(inertia * 1.4**k for k in (-2, -1, 0, 1, 2)),
        ),
        DetectorSettings(rho=rho * float(np.std(found["u"])), window=max(int(window / log.sample_time), 16), hold=3.0),
        PlantModel(inertia, delay, effects),
        ObserverSettings(log.observer["nominal_inertia"], log.observer["time_constant"]),
        d_hat_source="velocity" if "velocity" in found else "position",
        channels=motion if effects else (),
    )


def score(log: RigLog, rho: float, window: float) -> Score:
    wanted = plan(log, rho, window)
    session, axes = Session(wanted, Cleaner(None)), wanted.grid.axes
    sure, wrong, rows = 0, 0, 0
    for part in (*session.feed(log.channels["t"], log.channels), *session.finish()):
        right = np.isclose(axes["inertia"][part.state], log.truth["inertia"])
        right &= np.isclose(axes["delay"][part.state], log.truth["delay"])
        sure, wrong = sure + int(part.confident.sum()), wrong + int((part.confident & ~right).sum())
        rows += part.state.size
    return Score(sure, wrong, rows)


def scored(hidden: tuple[str, ...]) -> tuple[Score, Score]:
    """By the lead alone, and with all checks."""
    alone, checked = np.zeros(3, dtype=int), np.zeros(3, dtype=int)
    for log in logs(hidden):
        for rho in RHOS:
            for window in WINDOWS:
                checked += score(log, rho, window)
                with mock.patch.object(Doubts, "model", return_value=None):
                    alone += score(log, rho, window)
    return Score(*alone.tolist()), Score(*checked.tolist())


def section(pictures: Path) -> str:
    """One line per hidden effect; `pictures` gets none."""
    rows, total = [], np.zeros((2, 3), dtype=int)
    for hidden in ((), *((name,) for name in HIDDEN)):
        found = scored(hidden)
        total += np.array(found)
        rows.append((hidden[0] if hidden else "nothing", *cells(found[0]), *cells(found[1])))
    rows.append(("all", *cells(Score(*total[0].tolist())), *cells(Score(*total[1].tolist()))))
    head = ("hidden", "confident by the lead alone", "of these wrong", "confident", "of these wrong")
    share = percent(int(total[1][1]) / int(total[1][0]))
    return table(head, rows) + f"\n\n{total[1][1]:,} of {total[1][0]:,} confident labels are wrong: {share}."
