"""What an axis does around its stops, where friction is anything between its levels, is no evidence for another law."""

from __future__ import annotations

import numpy as np
import pytest

from dsd_cli.identify.fit.problem import pose
from dsd_cli.identify.fit.row_weights import weighed
from dsd_cli.identify.fit.testability import Settings
from dsd_cli.identify.recordings.recording import prepare
from dsd_cli.identify.search.sets import Search
from dsd_cli.identify.verdict.diagnose import diagnose
from dsd_cli.plant.model import ObserverSettings, PlantModel
from dsd_cli.signals.log import Log, with_channels

STEP, PARTS = 1e-2, 40


def _driven(
    speed: np.ndarray,
    inertia: float,
    level: float,
    damping: float,
    count: float,
    rate: float,
    load: float = 0.0,
    *,
    brake: bool = False,
):
    """Log of an axis that truly sticks (Moreau's time stepping), in a loop with an integrator, u a sample late. With a
    brake, that holds it at rest while the drive is off."""
    place, h = np.cumsum(speed) * STEP, STEP / PARTS
    kp, kd, ki = inertia * rate**2, 1.6 * inertia * rate, 0.1 * inertia * rate**3
    q = v = slow = before = 0.0
    total = late = -load  # held before it begins
    rows = []
    for target, wanted in zip(place, speed, strict=True):
        seen = count * round(q / count)
        slow += 0.4 * ((seen - before) / STEP - slow)
        before, total = seen, total + ki * (target - seen) * STEP
        u = kp * (target - seen) + kd * (wanted - slow) + total
        if brake and wanted == 0.0:
            total = late = -load
            v = slow = 0.0
            rows.append((0.0, seen))
            continue
        rows.append((u, seen))
        for _ in range(PARTS):
            free = v + h * (late + load - damping * v) / inertia
            now = 0.0 if abs(free) <= h * level / inertia else free - np.sign(free) * h * level / inertia
            q, v = q + 0.5 * h * (v + now), now
        late = u
    u, position = np.array(rows).T
    return Log({"t": STEP * np.arange(len(u)), "u": u, "position": position}, STEP, "log.csv")


def _held(speeds, seconds: float, most: float) -> np.ndarray:
    """One constant speed after the other, with ramps between them."""
    wanted, found, now = np.repeat(speeds, int(seconds / STEP)), [], 0.0
    for x in wanted:
        now += np.clip(x - now, -most * STEP, most * STEP)
        found.append(now)
    return np.array(found)


def _answer(log: Log, model: PlantModel):
    observer = ObserverSettings(model.inertia, 0.05)
    return diagnose([prepare(log, observer)], model, observer, Settings(linear=True))


def _pump(seed: int, rate: float, load: float = 0.0, *, brake: bool = False) -> Log:
    """One way, with rests; 300 of Coulomb and 4e4 of viscous friction."""
    strokes = np.column_stack([np.random.default_rng(seed).uniform(0.4, 3.0, 5), np.zeros(5)])
    speed = 1e-3 * _held([0.0, *strokes.ravel()], 1.5, 20.0)
    return _driven(speed, 3000.0, 300.0, 4e4, 5e-7, rate, load, brake=brake)


def test_a_complete_model_leaves_the_noise_and_no_less() -> None:
    """Functions without a law lean on what stops leave, and fit the sure rows less well than the model itself."""
    effects = {"coulomb_friction": {"level": 300.0}, "viscous_friction": {"coefficient": 4e4}}
    pump = prepare(_pump(640302, 23.0), ObserverSettings(3000.0, 0.05))
    problem = pose([pump], PlantModel(3000.0, STEP, effects), Settings(linear=True))
    search = Search(problem.measured_again(Search(problem).refit))
    left = weighed(search.refit, search.solver, search.problem.errors.bank).variance
    assert 0.5 * left < search.noise.variance < 1.5 * left


@pytest.mark.parametrize("known", [True, False])
def test_a_pump_that_rests_between_its_strokes_has_no_load_in_place_of_its_friction(known: bool) -> None:
    effects = {"coulomb_friction": {"level": 300.0}} if known else {"viscous_friction": {"coefficient": 4e4}}
    found = _answer(_pump(640202, 17.0), PlantModel(3000.0, STEP, effects))
    missing = {one.effect for one in found.missing if one.probability >= 0.5}
    assert missing == {"viscous_friction" if known else "coulomb_friction"}
    assert found.estimates["coulomb_friction.level"].value == pytest.approx(300.0, rel=0.01)


def test_the_error_of_friction_one_way_is_what_its_rests_leave_open_and_no_more() -> None:
    """By hand: it holds all u at rest, so that it is half of what is from the least of these to 300. Rows beside a load
    would have it anywhere: 144 for 77."""
    log = _pump(661301, 30.0)
    still = np.convolve(np.abs(np.gradient(log["position"])) < 1e-9, np.ones(21), "same") > 20.5
    least = 0.5 * (300.0 - float(log["u"][still].min()))
    model = PlantModel(3000.0, STEP, {"viscous_friction": {"coefficient": 4e4}})
    level = _answer(log, model).estimates["coulomb_friction.level"]
    assert level.std_error == pytest.approx((300.0 - least) / np.sqrt(3.0), rel=0.1)


def _of_pump(seed: int, load: float):
    """(effect -> probability, answer) of a pump with a load and neither in the model."""
    found = _answer(_pump(seed, 17.0, load), PlantModel(3000.0, STEP, {"viscous_friction": {"coefficient": 4e4}}))
    return {one.effect: one.probability for one in found.missing}, found


@pytest.mark.parametrize("seed", [700206, 700213])
def test_a_load_against_the_only_way_may_be_a_part_of_the_friction_that_rests_do_not_prove(seed: int) -> None:
    """Moving, friction and load are one force, 300 + 500; a rest shows as much friction as it takes, and no more."""
    missing, found = _of_pump(seed, -500.0)
    level = found.estimates["coulomb_friction.level"]
    assert level.value == pytest.approx(800.0, rel=0.01)
    assert 0.0 < level.value - np.sqrt(3.0) * level.std_error < 300.0  # from what holds it at rest on any level does
    named = next(c for c in found.ranking if c.effect == "coulomb_friction")
    assert "constant_load" in named.indistinguishable_from
    assert 0.0 < missing["constant_load"] < 0.5
    assert missing["coulomb_friction"] > 0.95  # 81 % of the second one where a load alone may be a rival at rest, too


def test_a_load_that_drives_the_only_way_is_named_beside_the_friction_that_holds_it() -> None:
    """The rests prove both, 600 together while it moves, and some of the level; nothing bounds that from above."""
    missing, found = _of_pump(700204, 900.0)
    assert min(missing["constant_load"], missing["coulomb_friction"]) > 0.8
    level, force = (found.estimates[name] for name in ("coulomb_friction.level", "constant_load.force"))
    assert force.value - level.value == pytest.approx(600.0, rel=0.01)
    assert 100.0 < level.value < 300.0
    assert not level.at_bound  # where the rows alone have it, at 0
    assert np.isnan([level.std_error, force.std_error]).all()


@pytest.mark.parametrize("seed", [661401, 661402])
def test_a_stop_that_an_axis_is_pressed_against_proves_no_load(seed: int) -> None:
    """The first rest holds 800 against the way, more than the friction of 300 could: that is the stop's force."""
    log = _pump(seed, 17.0, 0.0)
    begins = int(np.argmax(np.abs(log["position"] - log["position"][0]) > 1e-6))
    u = np.where(np.arange(len(log)) < begins - 5, -800.0, log["u"])
    model = PlantModel(3000.0, STEP, {"viscous_friction": {"coefficient": 4e4}})
    missing = {one.effect: one.probability for one in _answer(with_channels(log, u=u), model).missing}
    assert missing.get("constant_load", 0.0) < 0.5


@pytest.mark.parametrize("seed", [661501, 661502])
def test_a_brake_is_no_friction(seed: int) -> None:
    """800 against the way, 300 of it friction; the drive is off at rest: half of 800 was friction for certain."""
    log = _pump(seed, 17.0, -500.0, brake=True)
    found = _answer(log, PlantModel(3000.0, STEP, {"viscous_friction": {"coefficient": 4e4}}))
    level = found.estimates["coulomb_friction.level"]
    assert level.value == pytest.approx(800.0, rel=0.02)
    assert level.value - np.sqrt(3.0) * level.std_error < 300.0
