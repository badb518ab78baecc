"""Labels that one wrong value of u decides, beside both ways computed for every state in plain loops."""

import csv
import math
import re
import subprocess
from pathlib import Path

import numpy as np
import pytest

from dsd_cli.detect import DetectorSettings, Engine, Grid
from dsd_cli.detect.coloured import SensorNoise
from dsd_cli.detect.engine import Labels, Measurement
from dsd_cli.detect.plan import Plan
from dsd_cli.detect.rows import Inputs
from dsd_cli.detect.rows import cut as part
from dsd_cli.detect.spikes import Spikes, _Asked
from dsd_cli.plant.model import ObserverSettings, PlantModel
from tests.warm import DSD

ROOT = Path(__file__).parents[2]
T, TAU, WINDOW, RHO, CONFIDENCE = 0.001, 0.004, 40, 0.1, 3.0
DELAYS, INERTIAS = (0.0, 0.005, 0.03), (0.5, 1.0, 2.0)
TRUE_DELAY, TRUE_INERTIA = 0.005, 2.0


def filtered(x: np.ndarray, late: int) -> np.ndarray:
    """Q { x(t - late) }, x held from the sample on, 0 before the first."""
    pole = math.exp(-T / TAU)
    out = np.zeros(len(x))
    for k in range(1, len(x)):
        out[k] = pole * out[k - 1] + (1.0 - pole) * (x[k - 1 - late] if k > late else 0.0)
    return out


def likelihoods(u: np.ndarray, d_hat: np.ndarray) -> np.ndarray:
    """log p over the window of every state (delay outside, inertia inside; Jn = 1)."""
    columns = []
    for delay in DELAYS:
        for inertia in INERTIAS:
            left = d_hat - (filtered(u, round(delay / T)) / inertia - filtered(u, 0))
            sums = [float(np.sum(left[max(k - WINDOW + 1, 0) : k + 1] ** 2)) for k in range(len(u))]
            columns.append(-np.array(sums) / (2.0 * RHO**2) - math.log(math.sqrt(2.0 * math.pi) * RHO))
    return np.array(columns).T


def resting_on(u: np.ndarray, instead: np.ndarray, d_hats: tuple, state: np.ndarray, row: int) -> np.ndarray:
    """The rule in words: the state does not lead the others by 3 nats without the spike, and nothing has shown it."""
    logged, without = likelihoods(u, d_hats[0]), likelihoods(instead, d_hats[1])
    wrong = np.zeros(len(u), dtype=bool)
    for k in range(row, len(u)):
        rivals = [s for s in range(without.shape[1]) if s != state[k]]
        lead = logged[k, state[k]] - max(logged[k, rivals])
        less = logged[k, state[k]] - max(without[k, rivals])
        decides = less < CONFIDENCE <= max(lead, lead - less)
        wrong[k] = decides and np.abs(logged[k] - without[k]).max() > 1e-3
        explains = logged[k].max() >= -math.log(math.sqrt(2.0 * math.pi) * RHO) - 2.0 * WINDOW - 2.0
        if explains and logged[k].max() - without[k].max() >= CONFIDENCE:
            break  # it was commanded
    return wrong


def ordinary(seed: int) -> tuple[np.ndarray, np.ndarray]:
    """u that reaches 1 and is quiet from the sample 200 on, and noise of d_hat; 600 samples."""
    rng, k = np.random.default_rng(seed), np.arange(600)
    u = np.where(k < 200, 1.0, 0.1) * np.sign(np.sin(0.11 * k)) + 0.05 * rng.normal(size=600)
    return u, 0.05 * rng.normal(size=600)


@pytest.mark.parametrize("cut", [600, 1, 37])
@pytest.mark.parametrize(("size", "commanded"), [(3.0, False), (-40.0, False), (40.0, True), (-3.0, True)])
@pytest.mark.parametrize("source", ["logged", "velocity"])
def test_a_label_rests_on_a_spike_where_both_ways_say_so(source: str, size: float, commanded: bool, cut: int) -> None:
    row = 301
    instead, noise = ordinary(int(abs(size)))
    u = instead.copy()
    u[row], instead[row] = size, instead[row - 1]
    happened = u if commanded else instead
    d_hat = filtered(happened, round(TRUE_DELAY / T)) / TRUE_INERTIA - filtered(happened, 0) + noise
    if source == "velocity":  # computed from the u of the log, right or wrong
        acceleration = d_hat + filtered(happened, 0)
        d_hats = acceleration - filtered(u, 0), acceleration - filtered(instead, 0)
    else:
        d_hats = d_hat, d_hat
    settings = DetectorSettings(window=WINDOW, rho=RHO, confidence=CONFIDENCE)
    plan = Plan(Grid(DELAYS, INERTIAS), settings, PlantModel(1.0, 0.0), ObserverSettings(1.0, TAU), source)
    engine = Engine(plan.grid, settings, Measurement(T, 1.0, TAU))
    spikes, found, states = Spikes(plan, engine.spec), [], []
    for begin in range(0, 600, cut):
        piece = slice(begin, begin + cut)
        labels = engine.run(u[piece], d_hats[0][piece])
        labels = Labels(plan.grid, *(labels.state, labels.log_likelihood, labels.probability, labels.state >= 0))
        wrong = spikes.unfounded(Inputs(u[piece], d_hats[0][piece], T * np.arange(600)[piece], None), labels)
        found.append(np.zeros(len(labels.state), dtype=bool) if wrong is None else wrong)
        states.append(labels.state)
    expected = resting_on(u, instead, d_hats, np.concatenate(states), row)
    assert expected.any() or commanded
    # the level of u settles in the first rows
    np.testing.assert_array_equal(np.concatenate(found)[150:], expected[150:])


def doubted(u: np.ndarray, d_hat: np.ndarray, grid: Grid, cut: int, noise: float = 0.0, begin: int = 0) -> tuple:
    """(labels, which of them rest on a spike), d_hat computed from a velocity with that noise.

    begin : so many rows before a spike, at least, the kernels that are asked begin.
    """
    settings = DetectorSettings(window=150, rho=RHO, confidence=CONFIDENCE, sensor_noise=SensorNoise(noise))
    plan = Plan(grid, settings, PlantModel(1.0, 0.0), ObserverSettings(1.0, TAU), "velocity")
    engine = Engine(plan.grid, settings, Measurement(T, 1.0, TAU))
    spikes, found, t = Spikes(plan, engine.spec), [], T * np.arange(len(u))
    spikes._ways.memory = max(spikes._ways.memory, begin)
    labels = engine.run(u, d_hat)
    for first in range(0, len(u), cut):
        end = min(first + cut, len(u))
        wrong = spikes.unfounded(Inputs(u[first:end], d_hat[first:end], t[first:end], None), part(labels, first, end))
        found.append(np.zeros(end - first, dtype=bool) if wrong is None else wrong)
    return labels, np.concatenate(found)


def stepped(commanded: dict, wrong: dict, delay: float, rows: int, noise: float) -> tuple[np.ndarray, np.ndarray]:
    """(u as logged, d_hat computed from it); u is quiet from the sample 200 on but for these values; J = Jn = 1."""
    k = np.arange(rows)
    happened = np.where(k < 200, 1.0, 0.02) * np.sign(np.sin(0.11 * k))
    happened[list(commanded)] = list(commanded.values())
    u = happened.copy()
    u[list(wrong)] = list(wrong.values())
    d_hat = filtered(happened, round(delay / T)) - filtered(u, 0)
    return u, d_hat + noise * np.random.default_rng(3).normal(size=rows)


@pytest.mark.parametrize("cut", [600, 1])
def test_a_value_that_the_motion_has_shown_says_nothing_of_one_that_no_delay_has_seen_yet(cut: int) -> None:
    """The first is shown after 30 ms, when the second, which is wrong, has just been logged."""
    u, d_hat = stepped({301: 2.0}, {328: 5.0}, 0.03, 600, 0.05)
    labels, wrong = doubted(u, d_hat, Grid((0.03, 0.05), (1.0,)), cut)
    mistaken = labels.confident & (labels.delay != 0.03)
    assert mistaken[300:].any()
    assert not (mistaken & ~wrong)[300:].any()


def test_kernels_that_are_asked_begin_early_enough_for_a_filter_that_forgets_late() -> None:
    """Noise of the velocity as large as this is made white by a filter with a memory of hundreds of rows."""
    u, d_hat = stepped({}, {2300: 60.0}, 0.03, 3000, 0.05)
    grid = Grid((0.0, 0.03), (1.0,))
    _, expected = doubted(u, d_hat, grid, 100, 0.05, begin=2300)
    assert expected.any()
    np.testing.assert_array_equal(doubted(u, d_hat, grid, 100, 0.05)[1], expected)


def test_many_spikes_cost_as_much_each_as_few(monkeypatch: pytest.MonkeyPatch) -> None:
    """Rows that kernels take for one wrong value in 50 of one chunk, and how many at once."""
    taken, counted = [], _Asked.likelihoods
    monkeypatch.setattr(
        _Asked, "likelihoods", lambda self, rows: taken.append(len(rows.inputs.u)) or counted(self, rows)
    )
    work = []
    for rows in (4000, 16000):
        taken.clear()
        u, d_hat = stepped({}, dict.fromkeys(range(1000, rows, 50), 3.0), 0.03, rows, 0.05)
        doubted(u, d_hat, Grid((0.0, 0.03), (1.0,)), rows)
        work.append(sum(taken) / (rows - 1000))
        assert max(taken) < 300
    assert work[1] < 1.2 * work[0]


def test_no_label_rests_on_a_value_of_u_that_it_would_see_later_than_others(tmp_path: Path) -> None:
    """d_hat computed from a u with one corrupt value: all delays have its energy, the long one later."""
    config = ROOT / "sample_logs" / "servo-friction.toml"
    text = re.sub(r"\n\[model.effects[^[]*", "\n", config.read_text())
    text = text.replace("[0.0, 0.002, 0.004]", "[0.002, 0.03]").replace("[0.008, 0.01, 0.0125]", "[0.01]")
    text = re.sub(r"initial = .*", "initial = { delay = 0.002, inertia = 0.01 }", text)
    text = re.sub(r"hold = .*", "", text).replace("window = 300", "window = 30")
    text = re.sub(r"\nnoise = .*", "\nnoise = 0.0", text)
    text = re.sub(r"encoder_step = .*", "", text)
    (tmp_path / "dsd.toml").write_text(text)
    run("simulate", "-c", tmp_path / "dsd.toml", "-o", tmp_path / "simulated.csv")
    rows = list(csv.DictReader((tmp_path / "simulated.csv").open()))
    for k in (653, 841):  # in a motion, and at rest
        spoilt = [f"{r['t']},{float(r['u']) + 1.5 * (i == k)},{r['velocity']}" for i, r in enumerate(rows)]
        (tmp_path / "log.csv").write_text("\n".join(["t,u,velocity", *spoilt]) + "\n")
        labels = csv.DictReader(
            run("detect", tmp_path / "log.csv", "-c", tmp_path / "dsd.toml", "-o", "-").splitlines()
        )
        sure = [r for r in labels if r["confident"] == "true"]
        assert len(sure) > 500
        assert {r["delay"] for r in sure} == {"0.002"}


def run(*arguments: object) -> str:
    """What the command writes to stdout."""
    done = subprocess.run([*DSD, *map(str, arguments)], capture_output=True, text=True, check=True)
    return done.stdout
