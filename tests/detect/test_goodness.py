"""A confident label explains its window: the verdicts against plain loops, and what they are for."""

import numpy as np
import pytest

from dsd_cli.cli.plan import detection_plan
from dsd_cli.cli.simulate import simulation_settings
from dsd_cli.detect.doubts import Doubts
from dsd_cli.detect.engine import Engine, Measurement
from dsd_cli.detect.goodness import make_goodness
from dsd_cli.detect.grid import Grid
from dsd_cli.detect.kernel import active_backend
from dsd_cli.detect.session import Session
from dsd_cli.detect.settings import DetectorSettings
from dsd_cli.files.template import load_template
from dsd_cli.plant.simulation import simulate
from dsd_cli.signals.cleaning import Cleaner

T, RHO, WINDOW = 0.001, 0.3, 64
SIZE = WINDOW // 16
GRID = Grid((0.0, 0.004), (0.5, 1.0, 2.0))
NEED = 3.0


def nats(square: float) -> float:
    return square / (2.0 * RHO**2)


def plain_lead(y, z, state: int) -> float:
    """Lead over the best of the others."""
    squares = [sum((y - alpha * z[:, g]) ** 2) for g in range(z.shape[1]) for alpha in (2.0, 1.0, 0.5)]
    return nats(min(s for i, s in enumerate(squares) if i != state) - squares[state])


def plain_gain(y, z, slope, state: int) -> float:
    """What another inertia and delay near the label would gain."""
    residual = y - (2.0, 1.0, 0.5)[state % 3] * z[:, state // 3]
    columns = np.column_stack([z[:, state // 3], slope])
    return nats(sum(residual**2) - sum((residual - columns @ np.linalg.lstsq(columns, residual, rcond=None)[0]) ** 2))


def plain_nearest(y, z, group: int) -> bool:
    """No other delay does better by more than half a nat, both with their best inertia."""
    free = [
        sum((y - max(np.dot(z[:, g], y) / np.dot(z[:, g], z[:, g]), 0.0) * z[:, g]) ** 2) for g in range(z.shape[1])
    ]
    return nats(free[group] - min(free)) <= 0.5


def plain_verdict(model, x, k: int, state: int) -> tuple[bool, tuple[bool, ...], bool]:
    """(stands; lead, gain and delay beside x; more than the noise) of the label at sample k (docs/how/beyond.md)."""
    end = (k + 1) // SIZE * SIZE
    begin = end - 16 * SIZE
    y, z = model[begin:end, 0], model[begin:end, 1:]
    group, alpha = state // 3, (2.0, 1.0, 0.5)[state % 3]
    residual = y - alpha * z[:, group]
    worst = max(1.0, np.mean(residual**2) / RHO**2 / (1.0 + 3.0 / np.sqrt(len(y))))
    for blocks in (1, 2, 4):
        sums = [sum(residual[i : i + blocks * SIZE]) for i in range(0, len(y), blocks * SIZE)]
        ratio = np.mean(np.square(sums)) / (blocks * SIZE * RHO**2)
        worst = max(worst, ratio / (1.0 + 3.0 / np.sqrt(len(sums))))
    slope = np.array([model[i - 1, 1 + group] - model[i, 1 + group] for i in range(begin, end)])
    if begin == 0:
        slope[0] = -model[0, 1 + group]
    gain = plain_gain(y, z, slope, state)
    stands = plain_lead(y, z, state) - gain >= NEED * worst and plain_nearest(y, z, group)
    all_columns = np.column_stack([y, z, slope])
    left = all_columns - x[begin:end] @ np.linalg.lstsq(x[begin:end], all_columns, rcond=1e-6)[0]
    y, z, slope = left[:, 0], left[:, 1:-1], left[:, -1]
    ahead = plain_lead(y, z, state) - NEED * worst
    beside = [ahead >= gain, ahead >= max(gain, plain_gain(y, z, slope, state)), plain_nearest(y, z, group)]
    return stands, tuple(beside), worst > 1.0


def random_case(seed: int):
    """y and z of a plant whose inertia is between two candidates for a while, with noise that lasts for another."""
    rng = np.random.default_rng(seed)
    n = 900
    z = np.cumsum(rng.normal(size=(n, 2)), axis=0) * 0.1
    noise = RHO * rng.normal(size=n)
    noise[300:600] += 0.5 * np.sin(np.arange(300) / 9.0)
    alpha = np.where(np.arange(n) < 700, 1.0, 1.15)
    x = np.column_stack([np.ones(n), np.sin(np.arange(n) / 40.0), np.sign(np.sin(np.arange(n) / 40.0))])
    return np.column_stack([alpha * z[:, 0] + noise, z]), x


def hidden_case(seed: int):
    """y and z of a plant with a delay and an inertia between two candidates, and forces that the model lacks."""
    rng = np.random.default_rng(seed)
    n = 1200
    x = np.column_stack([np.ones(n), np.sin(np.arange(n) / 40.0), np.sign(np.sin(np.arange(n) / 40.0))])
    moved = np.sin(np.arange(n) / rng.uniform(4, 30)) * rng.uniform(0.2, 1.0)
    lag, force = int(rng.integers(1, 12)), x @ rng.uniform(-0.8, 0.8, 3)
    z = np.column_stack([force + moved, np.roll(force + moved, lag)])
    alpha = rng.choice([0.3, 0.6, 0.75, 0.9, 1.2, 1.4])
    y = alpha * np.roll(z[:, 0], lag // 2 + 1) - force * rng.uniform(-0.5, 0.5)
    return np.column_stack([y + RHO * rng.normal(size=n) * rng.choice([0.3, 1.0]), z]), x


def calm_case(seed: int):
    """The model is right; every other stretch is one that the unknown forces could explain as well."""
    n = 900
    x = np.column_stack([np.ones(n), np.sin(np.arange(n) / 40.0), np.sign(np.sin(np.arange(n) / 40.0))])
    moved = 3.0 * x[:, 1] + np.sin(np.arange(n) / 3.0) * (np.arange(n) % 300 < 40)
    noise = RHO * np.random.default_rng(seed).normal(size=n)
    return np.column_stack([moved + noise, moved, np.roll(moved, 4)]), x


def leading(model) -> np.ndarray:
    """The state that explains the window best, of every sample."""
    windows = [model[max(k - WINDOW + 1, 0) : k + 1] for k in range(len(model))]
    squares = [
        [sum((w[:, 0] - alpha * w[:, 1 + g]) ** 2) for g in range(2) for alpha in (2.0, 1.0, 0.5)] for w in windows
    ]
    return np.argmin(squares, axis=1).astype(np.int32)


def plain_unfounded(model, x, state, confident) -> tuple[list[bool], set]:
    """Which labels do not stand, sample by sample; and which combinations of the rules came up."""
    bad, expected, kinds = [], [], set()
    for k in range(len(model)):
        if not confident[k]:
            expected.append(False)
            continue
        stands, robust, more = plain_verdict(model, x, k, int(state[k]))
        if (k + 1) % SIZE == 0:
            bad.append(more)
        weights = (1.0 - 1.0 / 256.0) ** np.arange(len(bad))[::-1]
        trusted = len(bad) >= 64 and sum(weights * bad) <= 0.2 * sum(weights)
        expected.append(not (stands and (trusted or all(robust))))
        kinds.add((stands, robust, more, trusted))
    return expected, kinds


BACKENDS = ["numpy"] + (["compiled"] if active_backend() == "compiled" else [])


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize(
    ("case", "seed", "decides"),
    [  # (lead, gain, delay) beside the forces
        (random_case, 0, (False, False, True)),
        (random_case, 1, (False, False, True)),
        (hidden_case, 20, (True, False, True)),  # and there (True, True, False): another delay would be better
        (calm_case, 0, (False, False, True)),
    ],
)
def test_verdicts_are_those_of_plain_loops_in_any_cut(case, seed: int, decides: tuple[bool, ...], backend: str) -> None:
    model, x = case(seed)
    n = len(model)
    state = np.where(np.arange(n) % 160 < 150, 1, 4).astype(np.int32) if case is random_case else leading(model)
    confident = np.arange(n) >= WINDOW - 1
    expected, kinds = plain_unfounded(model, x, state, confident)
    assert any(stands and beside == decides for stands, beside, _, _ in kinds), kinds
    assert case is not calm_case or {bool(trusted) for *_, trusted in kinds} == {False, True}
    engine = Engine(GRID, DetectorSettings(rho=RHO, window=WINDOW, confidence=NEED), Measurement(T, 1.0, 0.0))
    for cut in (1, 63, 200, 900):
        checks = make_goodness(engine.spec, WINDOW, 3, backend)
        parts = [[array[begin : begin + cut] for array in (model, state, confident, x)] for begin in range(0, n, cut)]
        assert np.concatenate([checks.unfounded(*part) for part in parts]).tolist() == expected, cut


@pytest.mark.skipif(len(BACKENDS) < 2, reason="no compiled kernel")
@pytest.mark.parametrize("forces", [0, 3])
@pytest.mark.parametrize(
    "grid", [GRID, Grid((0.0,), (1.0, 2.0)), Grid((0.0, 0.001, 0.002), (1.0,)), Grid((0.0,), (1.0,))]
)
def test_the_compiled_verdicts_are_those_of_numpy(grid: Grid, forces: int) -> None:
    """30 random logs each: holes, steps, rests, forces that are sums of each other, windows that no block divides."""
    groups, flips = len(grid.delays), np.zeros(2, dtype=int)
    for seed in range(30):
        rng = np.random.default_rng(seed)
        n, window = 1500, int(rng.choice([16, 40, 64, 100]))
        z = np.cumsum(rng.normal(size=(n, groups)), axis=0) * 0.1
        z[800:900] = 0.0
        noise = RHO * rng.normal(size=n) + rng.choice([0.0, 0.3]) * np.sin(np.arange(n) / 9.0)
        model = np.column_stack([rng.choice([0.7, 1.0]) * z[:, 0] + noise, z])
        model[rng.integers(0, n, 5), 0] = np.nan
        model[: rng.integers(0, 60), 0] = np.nan
        moving = np.sin(np.arange(n) / 40.0)
        x = np.column_stack([np.ones(n), moving, np.sign(moving) * (rng.random() < 0.5)]) if forces else None
        state = np.repeat(rng.integers(0, len(grid), 30), 50).astype(np.int32)
        confident = rng.random(n) < rng.choice([0.3, 1.0])
        spec = Engine(grid, DetectorSettings(rho=RHO, window=window), Measurement(T, 1.0, 0.0)).spec
        both = [make_goodness(spec, window, forces, backend) for backend in ("compiled", "numpy")]
        for checks in both:
            checks.restart()
        cut = int(rng.integers(1, n))
        parts = [slice(0, cut), slice(cut, n)]
        wrong = [
            np.concatenate(
                [one.unfounded(model[p], state[p], confident[p], None if x is None else x[p]) for p in parts]
            )
            for one in both
        ]
        np.testing.assert_array_equal(*wrong)
        flips += [wrong[0].sum(), (confident & ~wrong[0]).sum()]
    assert (flips > 300).all(), flips


@pytest.mark.parametrize("aperture", [1, 2])
@pytest.mark.parametrize("timed", [False, True])
@pytest.mark.parametrize("method", ["dsd", "average"])
def test_both_kernels_hand_out_the_same_y_and_z_in_any_cut(aperture: int, timed: bool, method: str) -> None:
    rng = np.random.default_rng(3)
    n = 700
    u, d_hat = rng.normal(size=(2, n))
    u[200], d_hat[300:303] = np.nan, np.nan
    t = np.cumsum(rng.uniform(0.5, 1.5, n)) * T if timed else None
    settings = DetectorSettings(rho=RHO, window=50, method=method)

    def handed(backend: str, cuts: tuple[int, ...]) -> np.ndarray:
        engine = Engine(GRID, settings, Measurement(T, 1.0, 0.01, aperture=aperture, timed=timed), backend)
        model = np.full((n, 1 + len(GRID.delays)), 7.0)
        for a, b in zip((0, *cuts), (*cuts, n), strict=True):
            engine.run(u[a:b], d_hat[a:b], t=None if t is None else t[a:b], model=model[a:b])
        return model

    whole = handed("numpy", ())
    judged = np.isfinite(whole[:, 0])
    assert not judged[[200, 300, 301, 302]].any()
    assert judged.sum() > 600
    np.testing.assert_array_equal(handed("numpy", (1, 90, 401)), whole)
    if active_backend() == "compiled":
        compiled = handed("compiled", (3, 250))
        assert (np.isfinite(compiled[:, 0]) == judged).all()
        # on irregular stamps the poles are exponentials of two libraries, equal to the last bit but one
        np.testing.assert_allclose(compiled[judged], whole[judged], rtol=1e-12 if timed else 0.0, atol=1e-12 * timed)
        np.testing.assert_array_equal(handed("compiled", ()), compiled)


def labels(template: str, *overrides: str, columns: tuple[str, ...] = ("t", "u", "d_hat")):
    """(right or not, confident) of every row of a simulated log, and the states."""
    config = load_template(template).override(overrides)
    log = simulate(simulation_settings(config))
    kept = {name: np.array(log[name]) for name in columns}
    session = Session(detection_plan(config, {name: name for name in kept}, {}, "log"), Cleaner(None))
    parts = [*session.feed(kept["t"], kept), *session.finish()]
    state = np.concatenate([part.state for part in parts])
    return session.plan.grid, state, np.concatenate([part.confident for part in parts]), log, session


@pytest.mark.parametrize("rho", [0.3, 0.1])
def test_white_noise_of_rho_costs_hardly_a_label(rho: float) -> None:
    """10 seeds: of the labels that the engine alone calls confident, all but a few stay so."""
    kept, had = 0, 0
    for seed in range(10):
        config = load_template("paper-sine").override((f"simulate.noise={rho}", f"detector.rho={rho}"))
        log = simulate(simulation_settings(config.override((f"simulate.seed={seed}",))))
        columns = {name: np.array(log[name]) for name in ("t", "u", "d_hat")}
        plan = detection_plan(config, {name: name for name in columns}, {}, "log")
        session = Session(plan, Cleaner(None))
        sure = np.concatenate([p.confident for p in (*session.feed(columns["t"], columns), *session.finish())])
        alone = session.engine
        again = Engine(plan.grid, plan.settings, alone.measurement).run(columns["u"], columns["d_hat"]).confident
        assert not (sure & ~again).any()
        kept, had = kept + int(sure.sum()), had + int(again.sum())
    assert had > 10_000
    assert kept > 0.995 * had


@pytest.mark.parametrize(("inertia", "engine_alone"), [(0.6, 900), (0.7, 900), (0.8, 0), (0.9, 0)])
def test_an_inertia_between_the_candidates_makes_no_wrong_delay_confident(inertia: float, engine_alone: int) -> None:
    """The paper's step with its rho; by the engine alone labels of a wrong delay are confident for up to 1.2 s."""
    overrides = (f"model.inertia={inertia}", "simulate.noise=0.01", "detector.hold=3.0")
    grid, state, sure, log, session = labels("paper-step", *overrides)
    wrong = grid.axes["delay"][state] != np.asarray(log["true_delay"])
    engine = Engine(grid, session.plan.settings, session.engine.measurement)
    alone = engine.run(np.array(log["u"]), np.array(log["d_hat"]))
    np.testing.assert_array_equal(alone.state, state)
    assert (alone.confident & wrong).sum() >= engine_alone
    assert not (sure & wrong).any()


@pytest.mark.parametrize("level", [0.03, 0.1])
def test_dry_friction_that_the_model_lacks_makes_no_wrong_label_confident(
    level: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The servo to and fro; the model believes in viscous friction alone."""
    viscous = "viscous_friction={coefficient=0.01}"
    config = load_template("servo").override(
        ("states.inertias=[0.005,0.007,0.01,0.014,0.02]", "simulate.noise=0.01", "detector.rho=0.05")
    )
    truth = config.override((f"model.effects={{coulomb_friction={{level={level}}},{viscous}}}",))
    log = simulate(simulation_settings(truth))
    believed = config.override((f"model.effects={{{viscous}}}",))

    def wrong() -> int:
        columns = {name: np.array(log[name]) for name in ("t", "u", "d_hat", "velocity", "position")}
        session = Session(detection_plan(believed, {name: name for name in columns}, {}, "log"), Cleaner(None))
        parts = [*session.feed(columns["t"], columns), *session.finish()]
        state, sure = (np.concatenate([getattr(part, name) for part in parts]) for name in ("state", "confident"))
        axes = session.plan.grid.axes
        return int((sure & ((axes["inertia"][state] != 0.01) | (axes["delay"][state] != config.model.delay))).sum())

    assert wrong() == 0
    monkeypatch.setattr(Doubts, "model", lambda self, samples: None)
    assert wrong() > 100
