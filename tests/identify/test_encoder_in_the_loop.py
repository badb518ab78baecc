"""Moves with dwells of an axis with dry friction, whose controller differentiates the counts of its encoder.

The plant is exact between samples: friction holds, and lets go, at the instant at which it does. What the encoder
rounds is in u as well, and the jolts of stops are in the motion alone; neither is anything that [model] lacks.
"""

import numpy as np
import pytest

from dsd_cli.identify.fit.testability import Settings
from dsd_cli.identify.recordings.recording import prepare
from dsd_cli.identify.verdict.diagnose import diagnose
from dsd_cli.plant.model import ObserverSettings, PlantModel
from dsd_cli.signals.log import Log

T, ROWS, J, LEVEL, COUNT = 1e-3, 10_000, 1.0, 2.0, 1e-6
TRAVEL, SPEED, STEEPEST, HERTZ = 0.3, 1.2, 6.0, 20.0


def after(q: float, v: float, u: float, level: float) -> tuple[float, float]:
    """Position and speed a sample later, under a force that is held and Coulomb friction, stops within it included."""
    left = T
    while True:
        if v == 0.0 and abs(u) <= level:
            return q, 0.0
        a = (u - level * np.sign(v or u)) / J
        stops = -v / a if a * v < 0.0 else np.inf
        if stops >= left:
            return q + v * left + 0.5 * a * left**2, v + a * left
        q, v, left = q + v * stops + 0.5 * a * stops**2, 0.0, left - stops


def moves(rng: np.random.Generator) -> np.ndarray:
    """Point to point by polynomials of degree 5, with dwells of 0.05 to 0.4 s."""
    wanted, at, here = np.zeros(ROWS), 300, 0.0
    while at < ROWS:
        there = rng.uniform(-TRAVEL, TRAVEL)
        way = abs(there - here)
        last = int(max(0.05, 1.875 * way / SPEED, np.sqrt(5.78 * way / STEEPEST)) / T)
        z = np.arange(last) / last
        part = here + (there - here) * (10.0 * z**3 - 15.0 * z**4 + 6.0 * z**5)
        wanted[at : at + last] = part[: ROWS - at]
        wanted[at + last :] = there
        here, at = there, at + last + int(rng.uniform(0.05, 0.4) / T)
    return wanted


def moved(seed: int, level: float = LEVEL, count: float = COUNT) -> Log:
    """A PID loop on the counts, with feedforward of the acceleration, a sample late."""
    rng = np.random.default_rng(seed)
    rng.uniform(size=12)
    wanted = moves(rng)
    speed = np.gradient(wanted, T)
    forward, gain = np.gradient(speed, T), 2.0 * np.pi * HERTZ
    q = v = integral = before = filtered = held = 0.0
    log = np.zeros((2, ROWS))
    for k in range(ROWS):
        seen = round(q / count) * count
        filtered += (1.0 - np.exp(-2.0 * np.pi * 200.0 * T)) * ((seen - before) / T - filtered)
        before = seen
        error = speed[k] + gain / 3.0 * (wanted[k] - seen) - filtered
        integral += J * gain**2 / 5.0 * error * T
        u = J * (forward[k] + gain * error) + integral
        log[:, k] = u, seen
        q, v = after(q, v, held, level)
        held = u
    return Log({"u": log[0], "position": log[1]}, T, "moves.csv")


@pytest.mark.parametrize("seed", [13, 14])
def test_counts_in_the_loop_and_stops_are_neither_a_filter_of_u_nor_a_load(seed):
    """u was "smoothed by 2.5 ms", so that the inertia was wrong at 99 %; a load swung at 144 Hz, 99 %."""
    model, observer = PlantModel(J, T, {"coulomb_friction": {"level": LEVEL}}), ObserverSettings(J, 0.01, 1)
    found = diagnose([prepare(moved(seed), observer)], model, observer, Settings())
    assert found.verdict == "none"
    assert found.mended is None


@pytest.mark.parametrize("seed", [51, 52])
def test_what_counts_that_stand_still_leave_is_no_play(seed):
    """Without friction the axis goes on within a count where its encoder rests: "the load may rattle", unknown 50 %."""
    model, observer = PlantModel(J, T, {}), ObserverSettings(J, 0.01, 1)
    found = diagnose([prepare(moved(seed, 0.0, 1e-4), observer)], model, observer, Settings())
    assert found.verdict == "none"
    assert not any("rattle" in said for said in found.warnings)
