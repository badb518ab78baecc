"""Axes whose u is friction or cogging nearly all through, made here: u on the motion is evidence, not a on u."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from dsd_cli.identify.fit.direction import NEEDS_ACCELERATION, best_delay
from dsd_cli.identify.fit.laws_of_u import ONE_COLUMN
from dsd_cli.identify.fit.problem import pose
from dsd_cli.identify.fit.row_weights import weighed
from dsd_cli.identify.fit.values import whole_inertia
from dsd_cli.identify.improve import improve
from dsd_cli.identify.recordings.recording import prepare
from dsd_cli.identify.search.sets import Search
from dsd_cli.identify.search.task import Task
from dsd_cli.identify.verdict import diagnose as diagnose_module
from dsd_cli.identify.verdict.diagnose import Settings, diagnose
from dsd_cli.plant.model import ObserverSettings, PlantModel
from dsd_cli.signals.log import Log, with_channels
from tests.identify.search_rig import BELIEVED, seen
from tests.identify.search_rig import OBSERVER as RIG
from tests.oracle.tiers_axes import tiers

STEP = 0.005
OBSERVER = ObserverSettings(1.0, 0.02)
#: V s2/m, V s/m, V: a wheel drive.
INERTIA, VISCOUS, COULOMB = 0.05, 1.2, 0.8


def recorded(u: np.ndarray, velocity: np.ndarray, position: np.ndarray) -> list:
    return [prepare(Log({"u": u, "velocity": velocity, "position": position}, STEP, "log.csv"), OBSERVER)]


def slow_drive(inertia: float = INERTIA, viscous: float = VISCOUS, coulomb: float = COULOMB) -> list:
    """40 s to and fro, speeds by sums of sines; 1 % of u is a force that no effect has."""
    random, t = np.random.default_rng(5), np.arange(0.0, 40.0, STEP)
    lines = [(0.05, 1.5, 0.3), (0.13, 0.8, 1.1), (0.31, 0.3, 2.0)]
    velocity = sum(a * np.sin(2 * math.pi * f * t + p) for f, a, p in lines)
    acceleration = sum(2 * math.pi * f * a * np.cos(2 * math.pi * f * t + p) for f, a, p in lines)
    position = sum(-a / (2 * math.pi * f) * np.cos(2 * math.pi * f * t + p) for f, a, p in lines)
    unknown = 0.02 * np.interp(t, np.arange(0.0, 41.0, 0.4), random.normal(size=103))
    u = inertia * acceleration + viscous * velocity + coulomb * np.sign(velocity) + unknown
    return recorded(u, velocity + 2e-3 * random.normal(size=t.size), position + 1e-5 * random.normal(size=t.size))


def crawl() -> list:
    """Constant slow speed there and back over two and a half turns, through cogging of seven periods a turn."""
    random, t = np.random.default_rng(6), np.arange(0.0, 60.0, STEP)
    speed = 0.5 * np.where(t < 30.0, 1.0, -1.0) * np.minimum(1.0, np.abs(t - 30.0) / 0.5)
    position = np.cumsum(speed) * STEP
    u = 0.8 * np.sin(7 * position + 0.4) + 0.3 * np.sign(speed) + 0.05 * random.normal(size=t.size)
    return recorded(u, speed + 2e-3 * random.normal(size=t.size), position + 1e-4 * random.normal(size=t.size))


def climbed(recordings: list, inertia: float):
    model = PlantModel(inertia, 0.0, {})
    return improve(recordings, model, OBSERVER, Settings(), choose=lambda found: found.verdict)


@pytest.fixture(scope="module")
def drive():
    return climbed(slow_drive(), INERTIA)


def test_the_frictions_of_an_axis_that_is_all_friction_are_named_first(drive):
    assert {step.effect for step in drive.steps[1:]} - {"refit"} == {"viscous_friction", "coulomb_friction"}
    found = {name: one.value for name, one in drive.values.items()}
    assert found["viscous_friction.coefficient"] == pytest.approx(VISCOUS, rel=0.02)
    assert found["coulomb_friction.level"] == pytest.approx(COULOMB, rel=0.02)
    assert drive.values["inertia"].grade == "not"  # as the diagnosis of the same log says


def test_what_was_missing_and_what_is_left_are_two_numbers(drive):
    assert [one.effect for one in drive.missing] == ["viscous_friction", "coulomb_friction"]
    assert all(one.probability > 0.9 for one in drive.missing)
    assert 0.0 <= drive.last.unexplained.share_of_u < 0.03


def test_what_would_explain_u_by_u_is_not_asked():
    problem = pose(slow_drive(), PlantModel(INERTIA, 0.0, {}), Settings())
    assert problem.solver.inverse
    for name in ("dead_zone", "saturation", "actuator_lag", "backlash", "external_force"):
        assert problem.untestable[name] == NEEDS_ACCELERATION
    assert problem.untestable["load_friction"] == ONE_COLUMN  # else it is asked: see test_laws_of_u.py


def test_an_axis_whose_inertia_is_a_fair_part_of_u_is_asked_the_other_way_round():
    problem = pose(slow_drive(inertia=2.0, viscous=0.5, coulomb=0.2), PlantModel(2.0, 0.0, {}), Settings())
    assert not problem.solver.inverse
    assert "dead_zone" in problem.candidates


def test_a_crawl_tells_its_cogging_and_no_inertia():
    model = PlantModel(3.5e-3, 0.0, {})
    found = diagnose(crawl(), model, OBSERVER, Settings())
    assert found.verdict == "cogging"
    values = next(c for c in found.ranking if c.effect == "cogging").parameters
    assert values["periods"].value == pytest.approx(7.0, abs=0.1)
    assert values["amplitude"].value == pytest.approx(0.8, rel=0.05)
    assert "does not seem to drive" not in " ".join(found.warnings)
    assert found.estimates["inertia"].grade == "not"
    assert found.estimates["inertia"].value < 1e3 * model.inertia
    assert found.refitted_model.inertia > 1e-9  # no inertia of 1e-99


@pytest.mark.parametrize("given", [1e-2, 1e-5])
def test_an_inertia_far_too_large_for_the_log_hides_no_law_of_an_axis_without_any(given):
    """The shaft torque of a propeller at levels of speed: with J a of what was given every law raised the error."""
    random, t = np.random.default_rng(8), np.arange(0.0, 40.0, 0.025)
    level = np.repeat(random.uniform(200.0, 1200.0, 16), 100)
    speed = np.empty(t.size)
    speed[0] = level[0]
    for k in range(1, t.size):
        speed[k] = speed[k - 1] + 0.1 * (level[k] - speed[k - 1])
    torque = 2.2e-7 * speed**2 + 2e-4 * random.normal(size=t.size)
    log = Log({"u": torque, "velocity": speed + 0.5 * random.normal(size=t.size)}, 0.025, "log.csv")
    found = diagnose([prepare(log, OBSERVER)], PlantModel(given, 0.0, {}), OBSERVER, Settings())
    assert (found.verdict, found.probability > 0.9) == ("quadratic_drag", True)
    drag = next(c for c in found.ranking if c.effect == "quadratic_drag")
    assert drag.parameters["coefficient"].value == pytest.approx(2.2e-7, rel=0.01)
    assert drag.heldout_rmse_after < 0.1 * drag.heldout_rmse_before
    assert found.estimates["inertia"].grade == "not"


def test_of_an_axis_that_sticks_and_slips_the_way_that_explains_it_is_taken():
    """J a is more than a fifth of u, for moments; the motion by u leaves a fifth of that, u by the motion nothing."""
    question = next(t for t in tiers() if t.name == "crawl through cogging").draw(91001)
    log = Log(
        {n: question.channels[n] for n in ("u", "position")}, float(np.diff(question.channels["t"])[0]), "log.csv"
    )
    logs, model = [prepare(log, OBSERVER)], PlantModel(question.believed["inertia"], question.believed["delay"], {})
    assert not pose(logs, model, Settings()).solver.inverse
    found = diagnose(logs, model, OBSERVER, Settings())
    assert found.inverse
    assert set(found.found) == set(question.hidden)
    inertia = found.estimates["inertia"]
    assert abs(inertia.value - question.truth["inertia"]) < 2.0 * inertia.std_error
    assert inertia.std_error < 0.1 * inertia.value


@pytest.mark.parametrize(("named", "taken"), [(0, True), (1, False)])
def test_a_way_that_names_no_force_has_explained_nothing(monkeypatch, named, taken):
    """Of an arm on a spring the motion by u named nothing and left 94 % of J a, which is 39 % of u and J a together; u
    by the motion named friction and the spring and left 22 % of u."""

    def found(inverse: bool, terms: tuple, left: float) -> SimpleNamespace:
        errors = SimpleNamespace(
            force=3.54, accelerates=1.71, moving=lambda _: math.hypot(3.54, 1.71), rmse=lambda _: left, bank=None
        )
        solver = SimpleNamespace(inverse=inverse, inertia=1.0)
        problem = SimpleNamespace(errors=errors, reconstructed=lambda _: False)
        search = SimpleNamespace(problem=problem, solver=solver, added=lambda _: ())
        return SimpleNamespace(search=search, whole=SimpleNamespace(terms=terms, tap=0))

    ways = {None: found(False, ("any",) * named, 1.6), True: found(True, ("any",) * 3, 0.77)}
    monkeypatch.setattr(diagnose_module, "levelled", lambda task: ways[task.settings.inverse])
    monkeypatch.setattr(diagnose_module, "tells_by_motion", lambda *_: True)
    monkeypatch.setattr(diagnose_module, "above_floor", lambda *_: True)
    monkeypatch.setattr(diagnose_module, "noise_of_u", lambda *_: False)
    assert diagnose_module._either_way(Task((), PlantModel(1.0), Settings())).search.solver.inverse is taken


def test_friction_in_one_direction_is_named_by_its_commonest_name():
    """A run up in two steps of u, in open loop: a load, and an asymmetry of viscous friction, are the same columns."""
    inertia, random, t = 2.4, np.random.default_rng(7), np.arange(0.0, 20.0, STEP)
    level = np.where(t < 10.0, 1.4, 2.0)
    speed = np.zeros(t.size)
    for k in range(1, t.size):
        speed[k] = speed[k - 1] + STEP / inertia * (level[k - 1] - VISCOUS * speed[k - 1] - COULOMB)
    place = np.cumsum(speed) * STEP
    log = recorded(level, speed + 1e-3 * random.normal(size=t.size), place)
    found = climbed(log, inertia)
    assert {"viscous_friction", "coulomb_friction"} == {step.effect for step in found.steps[1:]} - {"refit"}


def swing_up() -> list:
    """A pendulum of 0.15 kg m2 and 3 N m, pushed along its motion with 0.25 N m: u follows the speed as friction
    does: beside functions of the motion no inertia is seen."""
    random, count, fine = np.random.default_rng(8), round(12.0 / STEP), 20
    place, speed, q, v = np.zeros(count), np.zeros(count), 0.05, 0.0
    u = np.zeros(count)
    for k in range(count):
        u[k] = 0.25 * (1.0 if v >= 0.0 else -1.0) * (-1.0 if abs(q) > 3.0 else 1.0)
        place[k], speed[k] = q, v
        for _ in range(fine):
            v += STEP / fine * (u[k] - 3.0 * math.sin(q) - 0.05 * np.sign(v)) / 0.15
            q += STEP / fine * v
    return recorded(u, speed + 2e-3 * random.normal(size=count), place + 1e-4 * random.normal(size=count))


@pytest.mark.parametrize("effects", [{}, {"coulomb_friction": {"level": 0.1}}], ids=["bare", "friction believed"])
def test_a_controller_that_pushes_along_the_motion_is_no_friction(effects):
    model, logs = PlantModel(0.15, 0.0, effects), swing_up()
    assert not pose(logs, model, Settings()).solver.inverse
    assert diagnose(logs, model, OBSERVER, Settings()).verdict == "gravity"


@pytest.mark.parametrize("factor", [0.1, 0.3, 3.0, 10.0])
def test_a_wrong_belief_in_the_inertia_turns_nothing_round(factor):
    """J a is 0.02 of u on the slow drive, 0.9 of it with a heavy load: far from a fifth, on both sides."""
    drive, heavy = slow_drive(), slow_drive(inertia=2.0, viscous=0.5, coulomb=0.2)
    assert pose(drive, PlantModel(factor * INERTIA, 0.0, {}), Settings()).solver.inverse
    assert not pose(heavy, PlantModel(factor * 2.0, 0.0, {}), Settings()).solver.inverse


def test_which_way_round_does_not_depend_on_what_is_asked():
    heavy = slow_drive(inertia=2.0, viscous=0.5, coulomb=8.0)
    asked = [pose(heavy, PlantModel(2.0, 0.0, {}), Settings(effects=names)) for names in ((), ("gravity",), None)]
    assert len({problem.solver.inverse for problem in asked}) == 1


def test_where_no_inertia_is_found_the_held_out_error_is_that_of_the_one_given():
    """As it would be written: residuals of u - J a - friction by hand, friction by the folds' own least squares."""
    model = PlantModel(0.15, 0.0, {"coulomb_friction": {"level": 0.1}})
    search = Search(pose(swing_up(), model, Settings()))
    problem, fit = search.problem, search.refit
    assert whole_inertia(fit) == 0.0
    u, acceleration, later, sign = problem.errors.bank.design(fit.terms, fit.tap).rows
    fold, kept = problem.blocks.fold[problem.blocks.block_of_rows()], problem.errors.equations.kept
    left = u - 0.15 * acceleration - fit.folds[fold, 1] * later - fit.folds[fold, 2] * sign
    assert problem.score(fit).heldout_rmse == pytest.approx(float(np.sqrt(np.mean(left[kept] ** 2))))


def test_a_sine_motion_leaves_no_delay_of_a_part_of_its_period():
    """At one frequency u of a quarter of a period ago stands for friction: J a + B v is a sine that is late."""
    random, t, omega = np.random.default_rng(3), np.arange(0.0, 12.0, STEP), math.pi
    speed, unknown = 0.5 * np.sin(omega * t + 0.3), np.interp(t, np.arange(0.0, 13.0, 0.4), random.normal(size=33))
    u = 7.9 * 0.5 * omega * np.cos(omega * t + 0.3) + 7.5 * speed + 1.4 * np.sign(speed) + 0.3 * unknown
    place = -0.5 / omega * np.cos(omega * t + 0.3)
    logs = recorded(u, speed + 2e-3 * random.normal(size=t.size), place + 1e-5 * random.normal(size=t.size))
    search = Search(pose(logs, PlantModel(7.9, 0.0, {}), Settings()))
    assert search.problem.scale.model(search.refit).delay < 0.01


@pytest.mark.parametrize(
    ("colour", "own", "near", "delay"), [(200, 0, None, 0), (200, 3, None, 3), (200, 3, 90, 3), (1, 3, None, 120)]
)
def test_a_far_delay_is_taken_for_more_than_chance_explains_of_what_is_left(colour, own, near, delay):
    """A force that is alike for seconds is explained in part by u of a while ago; white noise is not. The likeliest one
    near by, to a step, is taken in the place of one by chance."""
    force = np.random.default_rng(0).normal(size=800 // colour).repeat(colour)
    dips = ((0.2, 120, 20.0), (0.1, own, 2.0))
    rows = [[force * (1.0 - sum(a * math.exp(-(((tap - b) / c) ** 2)) for a, b, c in dips))] for tap in range(200)]
    equations = SimpleNamespace(counted=float(force.size), kept=np.ones(force.size, dtype=bool))
    bank = SimpleNamespace(tap_time=STEP, equations=equations, rows=lambda _, tap: rows[tap])
    solver = SimpleNamespace(
        bank=bank,
        taps=lambda most: range(most + 1),
        squares=lambda _terms, tap, keep=False: float(rows[tap][0] @ rows[tap][0]),
        fit=lambda _terms, tap: SimpleNamespace(tap=tap, forward=np.ones(1)),
    )
    assert best_delay(solver, (), 199, near) == delay


def run_up(levels: tuple[float, ...]) -> list:
    """Logs of a motor that one level of u speeds up from rest, against viscous and dry friction."""
    random, t, found = np.random.default_rng(12), np.arange(0.0, 8.0, STEP), []
    for u in levels:
        top, tau = (u - 0.03 * math.copysign(1.0, u)) / 1.3e-4, 1.2e-4 / 1.3e-4
        velocity = top * (1.0 - np.exp(-t / tau))
        position = top * (t - tau * (1.0 - np.exp(-t / tau)))
        seen = velocity + 0.05 * random.normal(size=t.size), position + 1e-3 * random.normal(size=t.size)
        found += recorded(np.full(t.size, u), *seen)
    return found


@pytest.mark.parametrize("levels", [(0.06,), (0.06, -0.04)], ids=["one way", "both ways"])
def test_one_level_of_u_a_direction_is_not_explained_by_friction_of_that_size(levels):
    """Dry friction and a load left 1e-7 % of u (99 %), and of one way alone the command ended in an OverflowError."""
    logs, model = run_up(levels), PlantModel(1.2e-4, 0.0, {})
    assert not pose(logs, model, Settings()).solver.inverse
    found = diagnose(logs, model, OBSERVER)
    dry = {"coulomb_friction", "constant_load"}
    assert all(one.probability < 0.9 for one in found.missing if one.effect in dry)
    assert found.verdict not in {*dry, "none"}
    assert found.blocked.startswith("u is constant") == (len(levels) == 1)


def test_what_leaves_nothing_of_u_explains_nothing_and_each_effect_has_one_probability():
    """A step of a first-order motor: friction of the size of u left 6e-9 of it, by an inertia of 1e-13."""
    random, t = np.random.default_rng(909), np.arange(283) * 0.01
    on = t >= 1.2
    speed = 187.0 * (1.0 - np.exp(-np.maximum(t - 1.2, 0.0) / 0.1)) + 0.7 * on * random.normal(size=t.size)
    log = prepare(Log({"u": 0.2 * on, "velocity": speed}, 0.01, "log.csv"), ObserverSettings(0.01, 0.05))
    found = diagnose([log], PlantModel(0.01, 0.0, {}), OBSERVER)
    left = {one.effect: one.heldout_rmse_after for one in found.ranking if not one.untestable}
    assert min(left, key=left.__getitem__) in {"viscous_friction", "viscous_asymmetry"}
    assert min(left["load_friction"], left["coulomb_friction"]) > found.refitted.heldout_rmse / 2
    likely = {one.effect: one.probability for one in found.ranking}
    assert [one.effect for one in found.missing] == ["viscous_friction"]
    assert all(likely[one.effect] == one.probability for one in found.missing)


def test_a_command_that_is_one_ramp_leaves_no_delay_beyond_the_rows():
    """A ramp that is late is a ramp and a constant: the share of a step grew to 1e15, and the command ended."""
    random, t = np.random.default_rng(13), np.arange(0.0, 8.0, STEP)
    u = 0.8 + 0.4 * t
    velocity = (u - 0.8) / VISCOUS - 0.4 * INERTIA / VISCOUS**2 * (1.0 - np.exp(-t * VISCOUS / INERTIA))
    position = np.cumsum(velocity) * STEP
    log = recorded(u, velocity + 2e-3 * random.normal(size=t.size), position + 1e-5 * random.normal(size=t.size))
    problem = pose(log, PlantModel(INERTIA, 0.0, {}), Settings())
    fit = problem.solver.fit((), 0)
    far = weighed(replace(fit, total=np.array([INERTIA, 1e12])), problem.solver, problem.errors.bank).fit
    assert far.tap * problem.solver.bank.delay_step < problem.equations.startup
    assert np.isfinite(far.total).all()


@pytest.mark.parametrize("share", [0.1, 0.3])
@pytest.mark.parametrize("friction", [0.0, 0.1], ids=["nothing missing", "friction missing"])
def test_noise_that_the_logged_u_alone_has_is_no_force(friction, share):
    """A duty, or a current without a filter: it was "unknown", a gain of u that varies, a lag, or doubt; and the delay
    ended between two steps, where a mean of two samples of u has the least noise."""
    effects = {"coulomb_friction": {"level": friction}} if friction else {}
    recording, random = seen(effects, noise=2e-5, duration=8.0), np.random.default_rng(70)
    (piece,) = recording.pieces
    u = piece["u"] + share * float(np.sqrt(np.mean(piece["u"] ** 2))) * random.normal(size=len(piece))
    noisy = replace(recording, pieces=(with_channels(piece, u=u),))
    asked = Settings(("coulomb_friction", "viscous_friction", "actuator_lag", "gravity"))
    found = diagnose([noisy], BELIEVED, RIG, asked)
    assert found.found == tuple(effects)
    assert found.verdict == ("coulomb_friction" if friction else "none")
    assert found.probability > 0.85
    assert found.unexplained.share_of_u == 0.0
    assert any("it counts as noise of u" in said for said in found.warnings)
    delay = found.estimates["delay"]
    assert delay.value == pytest.approx(BELIEVED.delay, abs=3.0 * delay.std_error)
    if friction:
        assert found.estimates["coulomb_friction.level"].value == pytest.approx(friction, rel=0.07)
    else:  # parts are asked in the form of the verdict there as well
        last = improve([noisy], BELIEVED, RIG, asked, choose=lambda one: one.verdict).last
        assert last.probability == pytest.approx(found.probability, abs=0.02)


@pytest.mark.parametrize("friction", ["load_friction", "coulomb_friction"])
@pytest.mark.parametrize("seed", [31, 32])
def test_what_holds_a_weight_all_along_hides_no_acceleration(friction, seed):
    """A hoist: J a is a tenth of u and most of what u is beside the weight. Asked by u alone, friction that goes with
    the load was Coulomb's: the weight is u, and a law of u was not asked."""
    random, step = np.random.default_rng(seed), 1e-3
    weight, inertia, share, count = random.uniform(8, 20), random.uniform(0.02, 0.05), random.uniform(0.05, 0.15), 3e-4
    lines = [(f, random.uniform(0.5, 1.5) * weight / inertia * 0.05, random.uniform(0, 6)) for f in (0.4, 1.1, 1.9)]
    t = np.arange(0.0, 8.0, step)
    position = sum(-a * np.sin(2 * math.pi * f * t + p) / (2 * math.pi * f) ** 2 for f, a, p in lines)
    middle = t + 0.5 * step  # u of a sample acts until the next one
    velocity = sum(-a * np.cos(2 * math.pi * f * middle + p) / (2 * math.pi * f) for f, a, p in lines)
    carried = weight + inertia * sum(a * np.sin(2 * math.pi * f * middle + p) for f, a, p in lines)
    dry = {"load_friction": carried / (1.0 - share * np.sign(velocity)), "coulomb_friction": carried}
    u = dry[friction] + (friction == "coulomb_friction") * share * weight * np.sign(velocity)
    log = Log({"u": u, "position": np.round(position / count) * count}, step, "log.csv")
    observer, asked = ObserverSettings(inertia, 0.02), ("constant_load", "coulomb_friction", "load_friction")
    found = diagnose([prepare(log, observer)], PlantModel(1.1 * inertia), observer, Settings(effects=asked))
    assert set(found.found) == {"constant_load", friction}
    assert found.estimates["inertia"].value == pytest.approx(inertia, rel=0.02)


WIDTH = 1.1


def coasting(law: str, seed: int) -> list:
    """A wheel of 0.06 V s2, 0.5 V s that someone steers by volts: 20 s in open loop, a position of 2000 counts. A dead
    zone lets it coast where dry friction stops it; either is all of u but a sixth."""
    random, step, fine = np.random.default_rng(seed), 0.01, 20
    wanted = np.repeat(random.choice([0.0, 8.0, -8.0, 5.0, -5.0, 2.4, -2.4], 25), 80)[: round(20.0 / step)]
    u, q, v, place = np.zeros(wanted.size), 0.0, 0.0, np.zeros(wanted.size)
    for k in range(1, wanted.size):
        u[k] = u[k - 1] + 0.03 * (wanted[k] - u[k - 1])
        place[k] = 2 * math.pi / 2000 * round(q * 2000 / (2 * math.pi))
        for _ in range(fine):
            drive = math.copysign(max(abs(u[k]) - WIDTH, 0.0), u[k]) if law == "dead_zone" else u[k]
            free = v + step / fine / 0.06 * (drive - 0.5 * v)
            stop = step / fine / 0.06 * WIDTH if law == "coulomb_friction" else 0.0
            v = math.copysign(max(abs(free) - stop, 0.0), free)
            q += step / fine * v
    return [prepare(Log({"u": u, "position": place}, step, "log.csv"), OBSERVER)]


@pytest.mark.parametrize("law", ["dead_zone", "coulomb_friction"])
def test_what_u_by_the_motion_leaves_is_asked_of_the_motion_by_u(law):
    """Coulomb friction took a dead zone's place, 92 %, and 7 % of u stayed unexplained: nobody had asked the motion."""
    logs, model = coasting(law, 3), PlantModel(0.06, 0.0, {"viscous_friction": {"coefficient": 0.5}})
    assert pose(logs, model, Settings()).solver.inverse
    found = diagnose(logs, model, OBSERVER, Settings())
    assert found.verdict == law
    assert found.probability > 0.9
    assert found.inverse == (law == "coulomb_friction")
    one = next(c for c in found.ranking if c.effect == law)
    assert next(iter(one.parameters.values())).value == pytest.approx(WIDTH, rel=0.02)
