"""What is left beyond a fit: nothing beside the truth, a law where one is missing, pushes where something pushed."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.signal import lfilter

from dsd_cli.identify.fit.bank import Term
from dsd_cli.identify.fit.problem import Settings, pose
from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.recordings.recording import prepare
from dsd_cli.identify.search.sets import Search
from dsd_cli.identify.verdict.diagnose import diagnose
from dsd_cli.identify.verdict.discrepancy import Discrepancy, before_climb, discrepancy_of, left_elsewhere, noise_of_u
from dsd_cli.plant.model import ObserverSettings, PlantModel
from dsd_cli.signals.log import Log
from tests.identify.search_rig import BELIEVED, MOVES, OBSERVER, SINES, T, posed, seen


def disturbed(force, names=(), seed=0, noise=0.002, duration=12.0):
    """A search over a log of an axis on which a force that no effect describes acts: t, v, q -> unit of u.

    The motion is the rig's; u is what the axis then needs, as a loop without delay would supply it.
    """
    bare = seen(noise=0.0, seed=seed, duration=duration).pieces[0]
    rng = np.random.default_rng(seed)
    extra = force(bare["t"], bare["velocity"], bare["position"])
    late = round(BELIEVED.delay / T)
    u = bare["u"] - np.append(extra[late:], np.full(late, extra[-1]))
    speed = bare["velocity"] + noise * rng.normal(size=len(bare))
    channels = {"t": bare["t"], "u": u, "velocity": speed, "position": bare["position"]}
    return Search(pose([prepare(Log(channels, T, "log.csv"), OBSERVER)], BELIEVED, Settings(effects=names)))


def test_beside_the_truth_nothing_is_left():
    """8 seeds: never unknown, and what the best of many functions gains by chance is small on average."""
    shares = []
    for seed in range(8):
        search = posed(None, (), seed=seed)
        found, plain = discrepancy_of(search, search.refit), search.problem.errors.rmse(search.refit)
        assert not found.unknown, f"seed {seed}"
        assert found.heldout_rmse <= plain
        assert 0.8 * plain < found.noise <= plain
        shares.append(found.heldout_rmse / plain)
    assert np.mean(shares) > 0.95


LAWS = {
    "speed times place": (lambda t, v, q: 0.4 * v * q, {"velocity", "position"}),
    "a power of the speed": (lambda t, v, q: -0.15 * np.sign(v) * np.sqrt(np.abs(v)), {"velocity"}),
    "a hill on the way": (lambda t, v, q: 0.2 * np.exp(-(((q - np.median(q)) / 0.05) ** 2)), {"position"}),
}


@pytest.mark.parametrize("name", LAWS)
def test_a_law_without_a_name_is_seen_with_what_it_depends_on(name):
    law, on = LAWS[name]
    search = disturbed(law)
    found = discrepancy_of(search, search.refit)
    assert found.unknown
    assert on <= set(found.on)
    assert found.heldout_rmse < 0.8 * search.problem.errors.rmse(search.refit)


@pytest.mark.parametrize(("believed", "missing"), [(1.5 * BELIEVED.inertia, ("inertia",)), (BELIEVED.inertia, ())])
def test_a_value_that_is_wrong_is_said_beside_what_is_unknown(believed, missing):
    """What is missing and whether that is all are two questions: a wrong value was in no answer but the ranking."""
    law, _ = LAWS["a power of the speed"]
    recordings = disturbed(lambda t, v, q: 0.3 * law(t, v, q)).problem.recordings
    found = diagnose(recordings, replace(BELIEVED, inertia=believed), OBSERVER, Settings(effects=()))
    assert found.verdict == "unknown"
    assert tuple(one.effect for one in found.missing) == missing
    likely = {one.effect: one.probability for one in found.ranking}
    assert all(one.probability == likely[one.effect] > 0.9 for one in found.missing)


def test_a_law_that_is_less_than_the_background_is_certain_and_not_unknown():
    """A fiftieth of one, less than 1 % of u; the sensor leaves less. Beside the truth no function is certain."""
    search = disturbed(lambda t, v, q: 0.02 * LAWS["a power of the speed"][0](t, v, q), noise=2e-4)
    found = discrepancy_of(search, search.refit)
    assert "velocity" in found.on
    assert (found.certain, found.unknown) == (True, False)
    truth = posed(None, ())
    assert not discrepancy_of(truth, truth.refit).certain


def behind_few_counts(seed, friction):
    """A search over a log of an axis that goes to and fro between the same places behind 1,024 counts a turn: its
    acceleration jumps at samples as a held u does, so that u is exact. friction : of J a, by tanh of the speed."""
    rng, step, inertia, count = np.random.default_rng(seed), 2e-3, 0.05, 2.0 * np.pi / 1024
    phase = np.arange(0.0, 10.0, step) / rng.uniform(1.2, 2.2) % 1.0
    in_half = 2.0 * (phase % 0.5)
    v = rng.uniform(0.5, 4.0) * np.where(phase < 0.5, 1.0, -1.0)
    v *= np.clip(np.minimum(in_half, 1.0 - in_half) / rng.uniform(0.15, 0.3), 0.0, 1.0)
    v = np.convolve(v, np.hanning(42)[1:-1] / np.hanning(42).sum(), "same")
    rng.uniform()
    q = rng.uniform() + np.concatenate([[0.0], np.cumsum(0.5 * (v[1:] + v[:-1]) * step)])
    a = np.diff(v, append=v[-1]) / step
    u = inertia * (a + friction * np.std(a) * np.tanh(3.0 * (v + 0.5 * a * step) / np.std(v)))
    seen = ObserverSettings(inertia, 0.02)
    recording = prepare(Log({"u": u, "position": count * np.round(q / count)}, step, "log.csv"), seen)
    return Search(pose([recording], PlantModel(inertia, 0.0, {}), Settings(effects=())))


@pytest.mark.parametrize("seed", [0, 3, 11])
def test_what_counts_leave_between_the_same_places_is_no_law(seed):
    """It is the same again each time, at each place: functions of it took 17 to 33 % off, certainly; and a law does."""
    for friction in (0.0, 0.3):
        search = behind_few_counts(seed, friction)
        found = discrepancy_of(search, search.refit)
        assert found.heldout_rmse < (1.0 - POLICY.unknown_fall) * found.plain
        assert found.certain == (friction > 0.0)


def test_a_load_that_wanders_is_unknown_over_time():
    rng = np.random.default_rng(5)
    walk = np.convolve(np.cumsum(rng.normal(size=6000)) * 0.01, np.ones(200) / 200, "same")
    search = disturbed(lambda t, v, q: walk[: len(t)])
    found = discrepancy_of(search, search.refit)
    assert found.unknown
    assert "time" in found.on


@pytest.mark.parametrize("seed", [0, 1])
def test_a_vibration_that_comes_and_goes_is_told_by_its_spectrum_alone(seed):
    """A band of noise around 3 Hz is no function of motion, u or time: none takes 4 % off. No sensor's noise falls with
    frequency, so the residual's spectrum tells."""
    damping, angle = np.exp(-np.pi * T), 2.0 * np.pi * 3.0 * T
    drawn = np.random.default_rng(40 + seed).normal(size=round(24.0 / T))
    shaken = lfilter([1.0], [1.0, -2.0 * damping * np.cos(angle), damping**2], drawn)
    shaken *= 0.03 / np.std(shaken)
    search = disturbed(lambda t, v, q: shaken[: len(t)], seed=seed, noise=5e-5, duration=24.0)
    found, plain = discrepancy_of(search, search.refit), search.problem.errors.rmse(search.refit)
    assert found.heldout_rmse > (1.0 - POLICY.unknown_fall) * plain
    assert found.unknown
    assert found.noise < 0.5 * plain


def test_the_effect_itself_leaves_nothing_beyond():
    """With gravity missing much is, with it nothing."""
    search = posed({"gravity": {"amplitude": 0.2, "phase": 0.4}}, ("gravity",))
    assert discrepancy_of(search, search.refit).unknown
    whole = search.fit((Term("gravity"),), search.refit.tap)
    assert not discrepancy_of(search, whole).unknown


@pytest.mark.parametrize("level", [0.5, 2.0])
def test_a_model_without_friction_leaves_all_of_it_at_a_steady_speed(level):
    """Of the acceleration, of which there is none, it leaves nothing: of u it leaves the level."""
    search = posed({"coulomb_friction": {"level": level}}, (), reference=MOVES)
    assert left_elsewhere(search, search.refit) > 0.95 * level


def test_an_excerpt_answers_for_motion_and_all_rows_for_time():
    """With an excerpt that is the whole log the answer is that without one."""
    search = disturbed(lambda t, v, q: 0.4 * v * q)
    whole = Search(search.problem)
    whole.excerpt = search
    there, here = discrepancy_of(whole, whole.refit), discrepancy_of(search, search.refit)
    assert there.unknown
    assert there.on == here.on
    assert replace(there, noise=0.0) == replace(here, noise=0.0)


def test_noise_that_pushes_as_hard_as_u_hides_no_spring():
    """In open loop white force that nobody logs moves an axis, too: far above the sensor, and no law."""
    rng, n, step, fine = np.random.default_rng(0), 3000, 0.005, 10
    t, q, v, place, speed = step * np.arange(n), 0.0, 0.0, np.zeros(n), np.zeros(n)
    u = sum(np.sin(2.0 * np.pi * f * t + rng.uniform(0.0, 6.0)) for f in (0.3, 0.7, 1.3, 2.1, 3.4))
    force = u + np.std(u) * rng.normal(size=n)
    for k in range(n):
        place[k], speed[k] = q, v
        for _ in range(fine):
            v += step / fine * (force[k] - 0.3 * q - 0.05 * v) / 0.01
            q += step / fine * v
    channels = {"t": t, "u": u, "velocity": speed + 1e-3 * rng.normal(size=n), "position": place}
    asked = Settings(effects=("stiffness", "viscous_friction", "coulomb_friction", "gravity", "saturation"))
    found = diagnose([prepare(Log(channels, step, "log.csv"), OBSERVER)], PlantModel(0.01, 0.0, {}), OBSERVER, asked)
    assert found.verdict == "stiffness"
    assert set(found.found) == {"stiffness", "viscous_friction"}


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_noise_of_u_is_no_function_of_u(seed):
    """It is a part of u, and a function of u takes some of it: more than what is left has of structure."""
    piece, rng = seen({}, reference=SINES, noise=2e-4, seed=seed).pieces[0], np.random.default_rng(seed)
    channels = {name: piece[name] for name in ("t", "velocity", "position")}
    channels["u"] = piece["u"] + 0.3 * np.std(piece["u"]) * rng.normal(size=len(piece))
    search = Search(pose([prepare(Log(channels, T, "log.csv"), OBSERVER)], BELIEVED, Settings(effects=())))
    assert "u" not in discrepancy_of(search, search.refit).on


@pytest.mark.parametrize(("white", "left", "wanted"), [(True, 1.7, True), (True, 1.5, False), (False, 1.7, False)])
def test_what_the_sensor_leaves_is_no_noise_of_u(white, left, wanted):
    """A clean log of an axis leaves what is white, too, and its u falls above the band."""
    errors = SimpleNamespace(rmse=lambda _fit: left, white=lambda _fit: white)
    search = SimpleNamespace(problem=SimpleNamespace(errors=errors, floor=1.0))
    assert noise_of_u(search, None) is wanted


def test_what_a_set_explains_is_counted_from_where_the_climb_began():
    """For an effect of the set of which the last rung took the first half; else from the model as it is. What an
    earlier set put into the model stays."""
    effects = {
        "stiffness": {"coefficient": 0.1},
        "viscous_friction": {"coefficient": 0.05},
        "coulomb_friction": {"level": 0.2},
    }
    model = replace(BELIEVED, effects={name: effects[name] for name in ("stiffness", "viscous_friction")})
    climbed = Settings(
        effects=("coulomb_friction",),
        taken=("stiffness", "viscous_friction"),
        begun=replace(BELIEVED, effects=effects),
        begun_with=("viscous_friction",),
    )
    search = Search(pose([seen(effects, duration=5.0)], model, climbed))
    whole = search.fit((*search.base, Term("coulomb_friction")), search.refit.tap)

    def begun(name="coulomb_friction", on=("position",), asked=climbed):
        return before_climb(search, whole, Discrepancy(on, 0.1, True, 0.1, 1.0), asked, name)

    assert begun().terms == search.before.terms == (Term("stiffness"),)
    assert begun(asked=Settings()) is search.refit
    assert begun("gravity", on=("velocity",)) is search.refit  # not of that set
    assert begun(on=("position", "velocity")) is search.refit  # stands in for another law of the velocity
