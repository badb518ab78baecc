"""The planned motion is run on the outside rig: what the log left open is settled, as was expected."""

import math
from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from dsd_cli.design.closed_loop import Loop, Run, UnstableLoopError, run_loop, usual_loops
from dsd_cli.design.explanations import explanation_of, held
from dsd_cli.design.impossible import able_to_move, beyond_u, not_by_motion, told_by_none
from dsd_cli.design.inverse import Path, command_for
from dsd_cli.design.limits import Limits, TooNarrowError, limits_of
from dsd_cli.design.measure import Measure
from dsd_cli.design.motions import Room
from dsd_cli.design.next_log import expected_of
from dsd_cli.design.optimise import Sized
from dsd_cli.design.plan import Wanted, _Asked, plan_next
from dsd_cli.design.results import Plan
from dsd_cli.design.targets import targets_of, within_reach
from dsd_cli.errors import DataError, UsageError
from dsd_cli.identify.fit.problem import pose
from dsd_cli.identify.fit.solve import Fit
from dsd_cli.identify.recordings.recording import Recording, prepare
from dsd_cli.identify.results import NONE, UNKNOWN, Diagnosis, Unexplained
from dsd_cli.identify.search.sets import Search
from dsd_cli.identify.search.task import searched_with
from dsd_cli.identify.verdict.diagnose import Settings, diagnose
from dsd_cli.plant.controllers import ControllerSettings, Gains
from dsd_cli.plant.model import EffectValues, ObserverSettings, PlantModel
from dsd_cli.plant.references import Planned
from dsd_cli.plant.simulation import SimulationSettings, simulate
from dsd_cli.signals.log import Array, Log
from tests.identify.comparison_rig import BELIEVED, MOVES, recorded
from tests.oracle.rig_cases import RigCase
from tests.oracle.rig_given import follow, poor_reference
from tests.oracle.rig_run import Motion
from tests.oracle.rig_trials import Trial, find_trial


@dataclass
class Asked:
    """A machine of the rig with a poor log of it, and what is said of that."""

    case: RigCase
    trial: Trial
    recording: Recording
    model: PlantModel
    observer: ObserverSettings
    diagnosis: Diagnosis
    search: Search
    whole: Fit

    @property
    def limits(self) -> dict[str, tuple[float, float]]:
        motion = self.trial.motion
        sizes = {"velocity": motion.v, "acceleration": motion.acceleration, "u": motion.u}
        found = {name: (0.0, float(np.abs(x).max())) for name, x in sizes.items()}
        return {**found, "position": (float(motion.q.min()), float(motion.q.max()))}

    def plan(self, **wanted: object) -> Plan:
        asked = Wanted(**{"limits": self.limits, **wanted})
        return plan_next(self.search, self.whole, self.diagnosis, self.observer, asked)

    def moved(self, plan: Plan) -> Motion:
        """What the machine does of a plan."""
        motion = plan.motion
        assert motion is not None
        t = np.arange(len(motion.position)) * motion.step
        return follow(self.case, self.trial, t, (motion.position, motion.velocity, motion.u), take=1)[1]

    def exceeded(self, plan: Plan, exact: Motion) -> dict[str, float]:
        width = round(0.02 / float(np.median(np.diff(exact.t))))
        smooth = np.convolve(exact.acceleration, np.ones(width) / width, "same")
        return plan.limits.exceeded(exact.q, exact.v, smooth, exact.u)


def poor_log(case: RigCase, kind: str) -> tuple[Recording, PlantModel, Trial]:
    trial = find_trial(case)
    log, _ = follow(case, trial, *poor_reference(trial, kind, 8.0))
    base = {name: values for name, values in trial.machine.effects.items() if name in trial.base}
    model = PlantModel(trial.beliefs["inertia"], trial.beliefs["delay"], base)
    return prepare(Log(log, case.sample_time, "log"), ObserverSettings(trial.design.inertia, 0.01)), model, trial


def poor(what: str, kind: str, seed: int, sensing: str = "enc4096") -> Asked:
    case = RigCase(what=(what,), seed=seed, sensing=sensing, duration=10.0)
    recording, model, trial = poor_log(case, kind)
    observer, kept = ObserverSettings(trial.design.inertia, 0.01), []
    said = diagnose([recording], model, observer, Settings(), on_found=lambda *found: kept.append(found))
    return Asked(case, trial, recording, model, observer, said, *kept[-1])


@pytest.fixture(scope="module")
def tied() -> Asked:
    """A constant load that a small motion cannot tell from gravity."""
    return poor("constant_load", "small", 70103)


@pytest.fixture(scope="module")
def slow() -> Asked:
    """One way and slow: friction is nearly all of u, which is evidence by the motion."""
    return poor("viscous_asymmetry", "one way", 81417, "speed40k")


@pytest.fixture(scope="module")
def settling(tied: Asked) -> Plan:
    """Of that tie, by what the code says in full."""
    return tied.plan(seconds=(6.0,))


@pytest.fixture(scope="module")
def for_inertia(tied: Asked) -> Plan:
    return tied.plan(names=("inertia",), seconds=(3.0,))


@pytest.fixture
def few_motions(monkeypatch: pytest.MonkeyPatch) -> None:
    """The best of 12 parts, hardly refined, is motion enough."""
    monkeypatch.setattr("dsd_cli.design.optimise._TRIED", 2)
    monkeypatch.setattr("dsd_cli.design.optimise._REFINED", 5)


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch, few_motions: None) -> None:
    """What is expected, of one plant each: enough where it is no matter."""
    monkeypatch.setattr("dsd_cli.design.plan._DRAWS_SAID", 1)


@pytest.fixture
def nothing_expected(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("dsd_cli.design.plan.expected_of", lambda told, *_: told.expected(told.nothing))


@pytest.fixture
def motion_only(nothing_expected: None, few_motions: None) -> None:
    """Enough where the limits of a motion are asked for."""


def test_a_tie_falls(tied: Asked, settling: Plan) -> None:
    (before,) = (c for c in tied.diagnosis.ranking if c.effect == "constant_load")
    assert "gravity" in before.indistinguishable_from
    plan, motion = settling, settling.motion
    assert motion is not None
    (pair,) = (p for p in plan.pairs if {p.a, p.b} == {"constant_load", "gravity"})
    assert 100.0 < pair.nats_low < pair.nats_expected < pair.nats_high
    t = np.arange(len(motion.position)) * motion.step
    log, exact = follow(tied.case, tied.trial, t, (motion.position, motion.velocity, motion.u), take=1)
    assert exact.q.min() > plan.limits.low
    assert exact.q.max() < plan.limits.high
    assert np.abs(exact.u).max() < plan.limits.u
    after = diagnose(
        [tied.recording, prepare(Log(log, tied.case.sample_time, "next"), tied.observer)],
        tied.model,
        tied.observer,
        Settings(),
    )
    (named,) = (c for c in after.ranking if c.effect == "constant_load")
    assert after.verdict == "constant_load"
    assert not named.indistinguishable_from


def test_the_motion_begins_with_the_u_that_holds_the_axis(tied: Asked, for_inertia: Plan) -> None:
    """What moves it at t = 0 would have to act a delay earlier, and held before that it would drive the axis away."""
    plan, motion = for_inertia, for_inertia.motion
    assert motion is not None
    fitted = targets_of(tied.search, tied.whole, tied.diagnosis, ("inertia",)).explanations[0].fitted
    rest = Path(motion.step, motion.position[:1], np.zeros(1), np.zeros(1))
    assert motion.u[0] == pytest.approx(float(command_for(fitted, rest)[0]), rel=1e-3)
    assert plan.stages[0].start > fitted.delay


def test_a_load_that_the_feedforward_lacks_is_held_by_an_integral_or_by_standing_off(tied: Asked) -> None:
    """The integral has settled when the motion begins; without one the axis rests where kp e is the load."""
    plant = PlantModel(0.01, 0.02, {"constant_load": {"force": 0.3}})
    settled, without = usual_loops(plant, tied.observer, 0.002)
    limits = limits_of([tied.recording], {"position": (-2.0, 2.0)}, math.nan, 10.0)
    rest = Path.of(np.full(2000, limits.start), settled.step)
    run, off = (run_loop(plant, loop, (rest, np.zeros(2000)), limits) for loop in (settled, without))
    assert run.path.position == pytest.approx(limits.start)
    assert run.u == pytest.approx(-0.3)
    assert off.path.position[-1] - limits.start == pytest.approx(0.3 / without.controller.gains.kp, rel=0.02)


def test_in_doubt_the_feedforward_holds_what_the_logs_had_to_hold(tied: Asked) -> None:
    """The model lacks the load of the rig's machine, which nobody names; how much of u was friction, counts that pass
    slowly do not say. Elsewhere it need not be as large: plants are drawn from half of it to half as much again."""
    load = tied.trial.machine.effects["constant_load"]["force"]
    first = targets_of(tied.search, tied.whole, tied.diagnosis, doubted=True).explanations[0]
    assert "constant_load" not in tied.model.effects
    held = [plant.effects["constant_load"]["force"] for plant in first.draws]
    assert 0.5 < held[0] / load < 1.5
    assert [min(held) / held[0], max(held) / held[0]] == pytest.approx([0.5, 1.5], abs=0.03)


def test_a_force_that_nobody_named_may_be_elsewhere_what_it_was_for_a_moment(tied: Asked) -> None:
    """In the mean of many valleys cogging is nothing; in one it is all of its amplitude, either way."""
    log = recorded({"cogging": {"periods": 12, "amplitude": 0.2, "phase": 0.4}}, duration=8.0)
    search = Search(pose([log], BELIEVED, Settings()))
    share = search.problem.errors.rmse(search.refit) / search.problem.errors.force
    nobody = replace(tied.diagnosis, verdict=UNKNOWN, unexplained=Unexplained(share, 1.0))
    targets = targets_of(search, search.refit, nobody, start=0.3)
    mean, *forces = (plant.effects["constant_load"]["force"] for plant in targets.explanations[0].draws)
    assert abs(mean) < 0.05
    assert min(forces) == pytest.approx(-0.2, rel=0.4)
    assert max(forces) == pytest.approx(0.2, rel=0.4)
    # over the place: half a wave as long as the log's way, and u has to hold the axis back on either side of the start
    wave, way = targets.beside[0].effects["cogging"], float(np.ptp(log.pieces[0]["position"]))
    assert wave["amplitude"] == pytest.approx(0.2, rel=0.4)
    assert wave["periods"] * way == pytest.approx(math.pi)
    for side in (-1.0, 0.0, 1.0):
        still = Path(0.01, np.full(3, 0.3 + 0.5 * side * way), np.zeros(3), np.zeros(3))
        u = command_for(targets.beside[0], still) - command_for(targets.explanations[0].fitted, still)
        assert u == pytest.approx(np.full(3, -side * wave["amplitude"]), abs=1e-9)


def test_counts_of_a_crawl_are_no_force_that_the_model_lacks() -> None:
    """Beside next to no inertia, as it is found, they leave little; times that of the model they were 5.2 where u is
    0.8, and no motion could be planned within the limits of a machine that has 4.2."""
    recording, model, _ = poor_log(
        RigCase(what=("constant_load",), seed=385001, sensing="enc4096", duration=10.0), "slow"
    )
    search = Search(pose([recording], model, Settings(effects=("constant_load",))))
    (option,) = search.options(search.refit)
    alone = explanation_of(search, NONE, search.refit, True, ())
    _, wave = held(search, alone, option.fit, 0.0, 0.0)
    assert search.problem.scale.model(option.fit).inertia < 0.1 * model.inertia
    assert wave.effects["cogging"]["amplitude"] < 2.0 * np.abs(recording.pieces[0]["u"]).max()


def test_plants_scatter_as_the_standard_errors_say(tied: Asked) -> None:
    """Two standard errors of a load are less than half of it, so that no draw is cut off there."""
    told = tied.search.problem.values(tied.whole).estimates["constant_load.force"]
    assert told.std_error < 0.25 * abs(told.value)
    draws = targets_of(tied.search, tied.whole, tied.diagnosis).explanations[0].draws
    forces = [plant.effects["constant_load"]["force"] for plant in draws]
    assert np.std(forces) == pytest.approx(told.std_error, rel=0.25)


#: Effects that are asked for after a motion, where all of them would take longer.
LIKELY = (
    "constant_load",
    "coulomb_friction",
    "viscous_friction",
    "gravity",
    "cubic_stiffness",
    "cogging",
    "quadratic_drag",
)


@pytest.mark.parametrize(
    ("what", "kind", "seed"),
    [
        # small moves against a spring: what is missing is not known
        ("stiffness", "small", 81902),
        # a crawl under a constant load: five effects are found, of which two are 250 N m and cancel
        ("constant_load", "slow", 81001),
    ],
)
@pytest.mark.usefixtures("motion_only")
def test_where_nobody_knows_what_is_missing_the_motion_is_for_the_whole_catalogue(
    what: str, kind: str, seed: int
) -> None:
    asked = poor(what, kind, seed)
    assert asked.diagnosis.verdict != what
    plan = asked.plan(seconds=(5.0,) if kind == "small" else ())
    motion = plan.motion
    assert motion is not None
    assert not plan.pairs
    assert motion.seconds == pytest.approx(5.0 if kind == "small" else 20.0, abs=0.1)
    t = np.arange(len(motion.position)) * motion.step
    log, exact = follow(asked.case, asked.trial, t, (motion.position, motion.velocity, motion.u), take=1)
    assert plan.limits.low < exact.q.min() < exact.q.max() < plan.limits.high
    if kind == "small":
        return
    next_log = prepare(Log(log, asked.case.sample_time, "next"), asked.observer)
    after = diagnose([asked.recording, next_log], asked.model, asked.observer, Settings(effects=LIKELY))
    assert after.found == (what,)


@pytest.mark.usefixtures("motion_only")
def test_forces_that_cancel_out_where_a_poor_log_has_been_are_not_planned_for() -> None:
    """Small moves on a slope of cogging: gravity of 53 and a load of -51 are found where u is 9.5 at most."""
    asked = poor("cogging", "small", 86059, "speed40k")
    plan = asked.plan(seconds=(5.0,))
    exact = asked.moved(plan)
    assert asked.exceeded(plan, exact) == {}
    # 1 of an axis that stands, or that a force which is not there drives
    t = np.arange(len(plan.motion.position)) * plan.motion.step
    planned = np.interp(exact.t, t, plan.motion.velocity)
    assert np.sqrt(np.mean((exact.v - planned) ** 2)) < 0.2 * np.sqrt(np.mean(planned**2))


LIMITS = [
    # small: a drag of 0.001 where u is 0.03 is friction over the speed as well, and 18 times too large beyond
    ("viscous_friction", "small", 110015, "speed40k", 1.0),
    # one way, where a load is dry friction: the model's own would be three times as large
    ("constant_load", "one way", 110031, "speed40k", 0.5),
    # a sixth of a wave: a weight of ten times u, well identified, that would be no weight at all where it may stand
    ("cogging", "small", 121019, "speed40k", (4.6702, 89.142, 31.197, (-0.8262, 0.8941))),
    # at a fiftieth of the speed of these limits (all of what it does), where a force that grows with the speed and
    # pushes one way is not seen
    ("viscous_asymmetry", "small", 360037, "speed40k", (6.14738, 192.4848, 0.25785, (-0.76041, 0.91685))),
]
#: These take the motion of the whole search.
LIMITS_OF_THE_BEST = [
    # one wave of a cogging that nobody believes: once out of its valley the axis is a fifth faster
    ("cogging", "small", 120019, "speed40k", (1.5950, 19.567, 0.07294, (-0.58205, 0.86810))),
    # friction that falls with the speed, of which 9 % too much was fed forward: in a loop as stiff as the machine's
    # the axis swings
    ("stribeck_friction", "one way", 121028, "enc4096", (3.9328, 60.640, 14.916, (-0.48704, 1.24975))),
]
#: Share of what the machine does; or its limits of velocity, acceleration, u and position.
Given = float | tuple[float, float, float, tuple[float, float]]


@pytest.mark.parametrize(("what", "kind", "seed", "sensing", "given"), LIMITS)
@pytest.mark.usefixtures("motion_only")
def test_limits_hold_with_what_explains_the_poor_log_as_well(
    what: str, kind: str, seed: int, sensing: str, given: Given
) -> None:
    limits_hold(poor(what, kind, seed, sensing), given, 5.0)


@pytest.mark.parametrize(("what", "kind", "seed", "sensing", "given"), LIMITS_OF_THE_BEST)
@pytest.mark.usefixtures("nothing_expected")
def test_limits_hold_in_the_best_motion(what: str, kind: str, seed: int, sensing: str, given: Given) -> None:
    limits_hold(poor(what, kind, seed, sensing), given, 10.0)


def limits_hold(asked: Asked, given: Given, seconds: float) -> None:
    if isinstance(given, float):
        limits: dict[str, tuple[float, float]] = {
            n: (given * low, given * high) for n, (low, high) in asked.limits.items()
        }
    else:
        velocity, acceleration, u, position = given
        sizes = {"velocity": velocity, "acceleration": acceleration, "u": u}
        limits = {"position": position, **{name: (0.0, size) for name, size in sizes.items()}}
    plan = asked.plan(limits=limits, seconds=(seconds,))
    assert asked.exceeded(plan, asked.moved(plan)) == {}


@pytest.mark.usefixtures("motion_only")
def test_limits_below_what_breaks_friction_away_are_refused() -> None:
    """The log reached twice the u of these limits, so that an effect that needs more than they allow is there yet."""
    asked = poor("stribeck_friction", "short", 117058, "speed40k")
    assert asked.diagnosis.verdict == "stribeck_friction"
    with pytest.raises(TooNarrowError, match="widen"):
        asked.plan(limits={name: (0.5 * low, 0.5 * high) for name, (low, high) in asked.limits.items()})


@pytest.mark.usefixtures("motion_only")
def test_what_needs_no_more_than_the_logs_reached_is_not_dropped(tied: Asked, monkeypatch: pytest.MonkeyPatch) -> None:
    """Beyond a limit, and within what the log had, every plant may be the axis, whatever the verdict is."""
    explained = likely_plants(tied)
    reached = limits_of([tied.recording], {}, math.nan, 10.0).u
    limits = {**tied.limits, "u": (0.0, 0.8 * reached)}

    def runs(plant: PlantModel, loop: Loop, planned: tuple[Path, Array], limits: Limits) -> Run:
        if plant not in explained:
            return run_loop(plant, loop, planned, limits)
        return Run(planned[0], np.full(len(planned[1]), 0.9 * reached))

    monkeypatch.setattr("dsd_cli.design.verified.run_loop", runs)
    for said in (tied.diagnosis, replace(tied.diagnosis, verdict=UNKNOWN)):
        with pytest.raises(TooNarrowError):
            plan_next(tied.search, tied.whole, said, tied.observer, Wanted(limits=limits, seconds=(3.0,)))


@pytest.mark.usefixtures("motion_only")
def test_other_values_of_what_nobody_believes_make_no_limit_too_narrow(
    tied: Asked, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With unknown, of a rival the fitted plant counts: its other values may be anything where a log hardly shows."""
    targets = targets_of(tied.search, tied.whole, tied.diagnosis, doubted=True)
    counted = [*targets.explanations[0].draws, *(e.fitted for e in targets.explanations)]
    others = [plant for e in targets.explanations for plant in e.draws if plant not in counted]
    reached = limits_of([tied.recording], {}, math.nan, 10.0).u

    def runs(plant: PlantModel, loop: Loop, planned: tuple[Path, Array], limits: Limits) -> Run:
        run = run_loop(plant, loop, planned, limits)
        return replace(run, u=np.full(len(run.u), 0.98 * reached)) if plant in others else run

    monkeypatch.setattr("dsd_cli.design.verified.run_loop", runs)
    wanted = Wanted(limits={**tied.limits, "u": (0.0, 1.2 * reached)}, seconds=(3.0,))  # a tenth and noise are off it
    nobody = replace(tied.diagnosis, verdict=UNKNOWN)
    plan = plan_next(tied.search, tied.whole, nobody, tied.observer, wanted)
    assert plan.motion is not None
    assert any("with other likely values of" in warning for warning in plan.warnings)


@pytest.mark.usefixtures("motion_only")
def test_a_motion_that_no_sensor_shows_is_refused(tied: Asked) -> None:
    with pytest.raises(TooNarrowError, match="no sensor shows it"):
        tied.plan(limits={**tied.limits, "jerk": (0.0, 1e-6)})


@pytest.mark.usefixtures("quick")
def test_the_next_log_is_read_at_the_delay_of_its_plant(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without its cubic spring the model would have 38 ms; from there the search for 20 ended at 26."""
    asked, found = poor("cubic_stiffness", "one way", 117013, "speed40k"), []

    def searched(*given: Any) -> tuple[Search, Fit]:
        search, fit = searched_with(*given)
        found.append((given[1].delay, search.problem.values(fit).estimates["delay"].value))
        return search, fit

    monkeypatch.setattr("dsd_cli.design.next_log.searched_with", searched)
    limits = {name: (0.4 * low, 0.4 * high) for name, (low, high) in asked.limits.items()}
    asked.plan(names=("inertia",), seconds=(4.0,), limits=limits)
    assert found
    for true, read in found:
        assert read == pytest.approx(true, abs=1e-4)


def test_one_log_more_tells_no_less(tied: Asked) -> None:
    """Of few blocks the standard error scatters."""
    targets = targets_of(tied.search, tied.whole, tied.diagnosis, ("inertia",))
    (value,) = targets.values
    known = replace(targets, values=(replace(value, error=1e-3 * value.error),))
    t = np.arange(0.0, 3.0, 0.004)
    path = Path.of(0.3 * np.sin(2.0 * np.pi * t) ** 2, 0.004)
    for one in (targets, known):
        expected = expected_of(Measure(tied.search, one, 1), {0: path}, 1e3, 1)
        assert expected.errors["inertia"] <= one.values[0].error


@pytest.mark.parametrize(
    ("effect", "values", "kept"),
    [
        ("flexible_coupling", {"frequency": 50.0, "load_share": 0.2, "damping": 0.02}, False),
        ("flexible_coupling", {"frequency": 5.0, "load_share": 0.2, "damping": 0.02}, True),
        ("backlash", {"gap": 0.01, "load_share": 0.2, "stiffness": 200.0}, True),
    ],
)
def test_the_plant_of_a_loop_is_late_by_whole_samples_and_swings_as_fast_as_the_loop_can_tell(
    tied: Asked, monkeypatch: pytest.MonkeyPatch, effect: str, values: dict[str, float], kept: bool
) -> None:
    """Two stretches of constant u in each sample are twice the work, a load at 50 Hz thirty times: beside a loop of 10
    rad/s it moves with its motor."""
    plant = PlantModel(0.01, 0.0209, {"viscous_friction": {"coefficient": 0.1}, effect: values})
    settled, _ = usual_loops(plant, tied.observer, 0.004)
    run: list[SimulationSettings] = []

    def simulated(settings: SimulationSettings) -> Log:
        run.append(settings)
        return simulate(settings)

    monkeypatch.setattr("dsd_cli.design.closed_loop.simulate", simulated)
    limits = limits_of([tied.recording], {}, math.nan, 10.0)
    run_loop(plant, settled, (Path.of(np.full(1000, limits.start), settled.step), np.zeros(1000)), limits)
    assert run[0].model.delay == pytest.approx(0.02)
    assert (effect in run[0].model.effects) == kept


@pytest.mark.usefixtures("motion_only")
def test_with_unknown_the_limits_hold_under_each_effect_that_unseen_blocks_speak_for(
    tied: Asked, monkeypatch: pytest.MonkeyPatch
) -> None:
    """No effect was found; the load and the weight that explain u where nobody fitted are plants all the same."""
    plants: list[PlantModel] = []

    def runs(plant: PlantModel, loop: Loop, planned: tuple[Path, Array], limits: Limits) -> Run:
        plants.append(plant)
        return run_loop(plant, loop, planned, limits)

    monkeypatch.setattr("dsd_cli.design.verified.run_loop", runs)
    nobody = replace(tied.diagnosis, verdict=UNKNOWN)
    plan_next(tied.search, tied.search.refit, nobody, tied.observer, Wanted(limits=tied.limits, seconds=(3.0,)))
    run = {name for plant in plants for name in plant.effects if name not in tied.model.effects}
    assert run >= {"constant_load", "gravity"}


@pytest.mark.usefixtures("motion_only")
def test_limits_hold_in_the_motion_as_often_as_it_is_made(tied: Asked, monkeypatch: pytest.MonkeyPatch) -> None:
    """An axis that cogging caught in another valley begins its second turn there: here five times as far."""

    def runs(plant: PlantModel, loop: Loop, planned: tuple[Path, Array], limits: Limits) -> Run:
        run = run_loop(plant, loop, planned, limits)
        far = np.where(run.path.times < 3.2, 1.0, 5.0)
        return replace(run, path=replace(run.path, position=limits.start + far * (run.path.position - limits.start)))

    monkeypatch.setattr("dsd_cli.design.verified.run_loop", runs)
    plan = tied.plan(seconds=(6.0,))
    assert plan.motion is not None
    far = plan.limits.start + 5.0 * (plan.motion.position - plan.limits.start)
    assert plan.limits.low < far.min() < far.max() < plan.limits.high


@pytest.mark.usefixtures("motion_only")
def test_where_nothing_is_missing_the_motion_goes_on_to_what_the_log_never_visited() -> None:
    """Within 0.1 rad a cubic spring is 1e-3 of u. Limits as wide as the log leave nothing to find out."""
    asked = poor("cubic_stiffness", "small", 87113, "speed40k")
    assert asked.diagnosis.verdict == "none"
    assert plan_next(asked.search, asked.whole, asked.diagnosis, asked.observer, Wanted()).motion is None
    plan = asked.plan(seconds=(5.0,))
    assert plan.motion is not None
    assert "nothing is left open where the logs have been" in plan.warnings[-1]
    t = np.arange(len(plan.motion.position)) * plan.motion.step
    log, _ = follow(asked.case, asked.trial, t, (plan.motion.position, plan.motion.velocity, plan.motion.u), take=1)
    next_log = prepare(Log(log, asked.case.sample_time, "next"), asked.observer)
    after = diagnose([asked.recording, next_log], asked.model, asked.observer, Settings(effects=LIKELY))
    assert (after.verdict, after.found) == ("cubic_stiffness", ("cubic_stiffness",))


def test_the_motion_begins_and_ends_at_rest_within_the_limits(for_inertia: Plan) -> None:
    plan = for_inertia
    motion, limits = plan.motion, plan.limits
    assert motion is not None
    assert 3.0 - 1e-9 <= motion.seconds < 3.1
    for end in (0, -1):
        assert motion.position[end] == pytest.approx(limits.start, abs=0.01)
        assert abs(motion.velocity[end]) < 0.01 * limits.velocity
    assert limits.low < motion.position.min()
    assert motion.position.max() < limits.high
    assert np.abs(motion.velocity).max() < limits.velocity
    assert np.abs(motion.acceleration).max() < limits.acceleration
    assert np.abs(motion.u).max() <= limits.u
    (value,) = plan.values
    assert value.std_error_expected < value.std_error_before


def test_the_gain_of_the_drive_is_no_matter_of_motion(tied: Asked) -> None:
    (gain,) = tied.plan(names=("gain",)).impossible
    assert "gain" in gain.what
    assert "mass" in gain.remedy


def test_what_no_motion_is_for_needs_no_axis_that_moves(tied: Asked, monkeypatch: pytest.MonkeyPatch) -> None:
    """What was found in a crawl no u could hold: of the gain of the drive, the limit of u was said to be too low."""

    def refused(*_: object, **__: object) -> None:
        raise DataError("u does not move this axis", "")

    monkeypatch.setattr("dsd_cli.design.plan.able_to_move", refused)
    plan = tied.plan(names=("gain",))
    assert plan.motion is None
    assert "gain" in plan.impossible[0].what


def test_what_the_next_motion_may_show_is_not_said_to_be_lost(slow: Asked, monkeypatch: pytest.MonkeyPatch) -> None:
    """Friction is nearly all of u in this log, and not in a faster one; a channel that is not there stays away."""
    problem = slow.search.problem
    assert problem.untestable
    targets = targets_of(slow.search, slow.whole, slow.diagnosis)
    assert not_by_motion(slow.search, targets, slow.diagnosis) == []
    why = "the log has no position"
    blind = replace(problem.recordings[0], missing={"position": why})
    lacking = replace(problem, recordings=(blind,), untestable={**problem.untestable, "stiffness": why})
    monkeypatch.setattr(slow.search, "problem", lacking)
    assert [one.what for one in not_by_motion(slow.search, targets, slow.diagnosis)] == ["stiffness"]


def test_what_no_motion_of_all_that_were_tried_tells_is_said(tied: Asked) -> None:
    targets = targets_of(tied.search, tied.whole, tied.diagnosis, ("constant_load", "gravity"))
    lost, rest = told_by_none(Measure(tied.search, targets, 1), [])
    assert not rest.open
    (one,) = lost
    assert set(one.what.split(" or ")) == {"gravity", "constant_load"}
    assert "half a turn" in one.remedy


@dataclass
class Nats:
    """A measure of targets: nats by the logs, and with a motion."""

    now: dict[str, float]
    then: dict[str, float]
    nothing: bool = False

    @property
    def open(self) -> frozenset[str]:
        return frozenset(self.now)

    def expected(self, planned: bool) -> bool:
        return planned

    def nats(self, planned: bool) -> dict[str, float]:
        return {name: (self.then if planned else self.now)[name] for name in self.now}

    def smallest(self, planned: bool) -> float:
        return min(self.nats(planned).values())

    def without(self, names: tuple[str, ...]) -> "Nats":
        return replace(self, now={name: nats for name, nats in self.now.items() if name not in names})


@pytest.mark.parametrize(("nats", "held"), [(9500.0, True), (20.0, False)])
@pytest.mark.parametrize("told", [0.0, 100.0])
def test_where_no_motion_settles_a_tie_and_the_logs_hold_the_rest_nothing_is_moved_for(
    nats: float, held: bool, told: float
) -> None:
    """A spring or a cubic one, beside "a spring, not nothing", which the logs hold: a further motion would be for what
    is sure already, unless it settles the tie."""
    measure = Nats({"spring, not cubic": 1.0, "spring, not none": nats}, {"spring, not cubic": told})
    measure.then["spring, not none"] = 2.0 * nats
    motion = SimpleNamespace(part=SimpleNamespace(seconds=120.0), products=True)
    lost, rest = told_by_none(cast(Measure, measure), cast(list[Sized], [motion]))
    assert [one.what for one in lost] == ([] if told else ["spring, not cubic"])
    assert len(rest.open) == (2 if told else 0 if held else 1)


def test_an_asked_pair_of_which_u_moves_one_side_only_is_said(tied: Asked) -> None:
    names = ("constant_load", "gravity")
    targets = targets_of(tied.search, tied.whole, tied.diagnosis, names)
    able = within_reach(targets, [i == 0 for i in range(len(targets.explanations))])
    (one,) = beyond_u(targets, able)
    assert set(one.what.split(" or ")) == set(names)
    assert not beyond_u(targets, targets)
    assert not beyond_u(replace(targets, asked=()), able)


def test_a_u_that_cannot_hold_the_axis_is_refused(tied: Asked) -> None:
    with pytest.raises(DataError, match="does not move this axis"):
        tied.plan(limits={**tied.limits, "u": (0.0, 0.01)})


def stiff_contact(share: float) -> EffectValues:
    return {"backlash": {"gap": 0.1, "load_share": share, "stiffness": share * (2.0 * math.pi * 600.0) ** 2}}


@pytest.mark.parametrize(
    ("effects", "plant"),
    [
        (stiff_contact(0.999999), False),
        (stiff_contact(0.5), True),
        ({"saturation": {"limit": 0.9}, "dead_zone": {"width": 1.0}}, False),
        ({"saturation": {"limit": 1.1}, "dead_zone": {"width": 0.01}}, True),
    ],
)
def test_a_motor_of_next_to_no_inertia_is_no_plant_nor_one_that_no_u_reaches(
    tied: Asked, effects: EffectValues, plant: bool
) -> None:
    """With a motor of a millionth of the inertia a second of its simulation took a minute; what a dead zone swallows
    after it saturates leaves a log of nothing. A stiff contact is a plant."""
    targets = targets_of(tied.search, tied.whole, tied.diagnosis)
    effects = {n: {k: x * (tied.model.inertia if k == "stiffness" else 1.0) for k, x in v.items()}
               for n, v in effects.items()}  # fmt: skip
    other = replace(tied.model, effects={**tied.model.effects, **effects})
    last = replace(targets.explanations[-1], name="other", draws=(other,))
    targets = replace(targets, explanations=(*targets.explanations[:-1], last), pairs=())
    room = Room(limits_of([tied.recording], tied.limits, math.nan, 10.0), 10.0, 0.004)
    able = able_to_move(targets, room, tied.model, 0.001).explanations
    assert ("other" in {one.name for one in able}) == plant
    assert targets.explanations[0] in able


@pytest.mark.parametrize(
    ("speed", "weak", "plant"),
    [
        # friction of 0.1 and u of 1 hold back an asymmetry of 0.5 |v| up to 2.2 rad/s
        (2.0, True, True),
        (2.5, True, False),
        # an asymmetry that is identified may be what the axis has
        (2.5, False, True),
    ],
)
def test_a_weak_force_that_u_could_not_hold_back_at_the_limit_of_speed_is_no_plant(
    tied: Asked, speed: float, weak: bool, plant: bool
) -> None:
    effects = {"coulomb_friction": {"level": 0.1}, "viscous_asymmetry": {"coefficient": 0.5}}
    pushed = replace(tied.model, effects=effects)
    targets = targets_of(tied.search, tied.whole, tied.diagnosis)
    last = replace(targets.explanations[-1], name="other", draws=(pushed,), weak=weak)
    targets = replace(targets, explanations=(*targets.explanations[:-1], last), pairs=())
    limits = limits_of([tied.recording], {**tied.limits, "velocity": (0.0, speed), "u": (0.0, 1.0)}, math.nan, 10.0)
    able = able_to_move(targets, Room(limits, 10.0, 0.004), tied.model, 0.001).explanations
    assert ("other" in {one.name for one in able}) == plant


def likely_plants(asked: Asked) -> list[PlantModel]:
    """Of all explanations that have what the model has not, in doubt or not."""
    targets = [targets_of(asked.search, asked.whole, asked.diagnosis, doubted=doubted) for doubted in (False, True)]
    return [plant for one in targets for e in one.explanations if e.name != NONE for plant in e.draws]


@pytest.mark.parametrize("times", [4.0, 1.05], ids=["beyond the limit", "in what is left to other gains"])
@pytest.mark.usefixtures("motion_only")
def test_what_no_motion_can_be_planned_for_is_said(tied: Asked, monkeypatch: pytest.MonkeyPatch, times: float) -> None:
    """All that the model has not runs away on any motion: neither the verdict nor an explanation stands."""
    explained = likely_plants(tied)

    def runs(plant: PlantModel, loop: Loop, planned: tuple[Path, Array], limits: Limits) -> Run:
        if plant not in explained:
            return run_loop(plant, loop, planned, limits)
        return Run(planned[0], np.full(len(planned[1]), times * limits.u))

    monkeypatch.setattr("dsd_cli.design.verified.run_loop", runs)
    plan = tied.plan(seconds=(3.0,))
    assert tied.diagnosis.verdict == "constant_load"
    (note,) = plan.warnings
    assert note.startswith("no motion keeps the limits if constant_load is right: ")
    assert "constant_load" in plan.not_counted
    assert "none" not in plan.not_counted
    assert plan.reached["u"] < plan.limits.u


@pytest.mark.usefixtures("motion_only")
def test_an_unstable_loop_ends_no_plan_while_nobody_knows_what_is_missing(
    tied: Asked, monkeypatch: pytest.MonkeyPatch
) -> None:
    explained = likely_plants(tied)

    def runs(plant: PlantModel, loop: Loop, planned: tuple[Path, Array], limits: Limits) -> Run:
        if plant not in explained:
            return run_loop(plant, loop, planned, limits)
        raise UnstableLoopError("the simulated loop is unstable (kp 3)", "")

    monkeypatch.setattr("dsd_cli.design.verified.run_loop", runs)
    plan = tied.plan(seconds=(3.0,))
    assert plan.motion is not None
    assert "constant_load" in plan.not_counted
    assert "the simulated loop is unstable (kp 3) with constant_load as the plant" in plan.warnings


@pytest.mark.usefixtures("quick")
def test_an_unstable_loop_with_other_likely_values_ends_no_plan(tied: Asked, monkeypatch: pytest.MonkeyPatch) -> None:
    """A draw is what the logs leave open; only the fitted plant must be held by the loop."""
    fitted = [e.fitted for e in targets_of(tied.search, tied.whole, tied.diagnosis).explanations]

    def runs(plant: PlantModel, loop: Loop, planned: tuple[Path, Array], limits: Limits) -> Run:
        if plant in fitted:
            return run_loop(plant, loop, planned, limits)
        raise UnstableLoopError("the simulated loop is unstable (kp 3)", "")

    monkeypatch.setattr("dsd_cli.design.verified.run_loop", runs)
    plan = tied.plan(seconds=(3.0,))
    assert "the simulated loop is unstable (kp 3) with other likely values of constant_load" in plan.warnings
    assert not plan.not_counted
    assert all(p.nats_expected > p.nats_before for p in plan.pairs)


def test_what_stands_beyond_a_limit_before_it_moves_ends_no_plan_for_the_catalogue(
    tied: Asked, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A force that may be there, and against which the simulated loop stands off, is no matter of the motion; each of
    these plants has its own turns, though there is but one explanation."""
    for others in ("left_open", "wave"):
        monkeypatch.setattr(f"dsd_cli.design.targets._Explanations.{others}", lambda *_, **__: [])
    targets = targets_of(tied.search, tied.whole, tied.diagnosis, doubted=True)
    (fitted,) = (e.fitted for e in targets.explanations)

    def runs(plant: PlantModel, loop: Loop, planned: tuple[Path, Array], limits: Limits) -> Run:
        run = run_loop(plant, loop, planned, limits)
        off = 2.0 * (limits.high - limits.low) * (plant != fitted)
        return replace(run, path=replace(run.path, position=run.path.position + off))

    monkeypatch.setattr("dsd_cli.design.verified.run_loop", runs)
    nobody = replace(tied.diagnosis, verdict=UNKNOWN)
    plan = plan_next(tied.search, tied.whole, nobody, tied.observer, Wanted(limits=tied.limits, seconds=(3.0,)))
    assert plan.motion is not None
    assert "no motion keeps the limits with other likely values of the model alone" in plan.warnings


@pytest.mark.usefixtures("motion_only")
def test_limits_hold_with_the_delay_of_the_model_too(tied: Asked, monkeypatch: pytest.MonkeyPatch) -> None:
    """A slow log may say that there is no delay; loops that nobody described are as slow as the longest one asks: at
    the crossover it turns the phase by half a radian at most."""
    seen: list[tuple[PlantModel, Loop]] = []

    def runs(plant: PlantModel, loop: Loop, planned: tuple[Path, Array], limits: Limits) -> Run:
        seen.append((plant, loop))
        return run_loop(plant, loop, planned, limits)

    monkeypatch.setattr("dsd_cli.design.verified.run_loop", runs)
    model = replace(tied.model, delay=0.04)
    search = Search(replace(tied.search.problem, model=model))
    plan_next(search, tied.whole, tied.diagnosis, tied.observer, Wanted(limits=tied.limits, seconds=(3.0,)))
    assert max(plant.delay for plant, _ in seen) == 0.04
    fastest = [loop.controller.gains.kd / seen[0][0].inertia for _, loop in seen]
    assert len(set(fastest)) == 2
    assert max(fastest) * 0.04 < 0.5


def test_in_doubt_the_delay_is_that_of_the_model(tied: Asked) -> None:
    """Beside effects that are not there a crawl has fitted 450 ms where 20 were."""
    wrong = replace(tied.whole, tap=tied.whole.tap + 300)
    sure, doubted = (
        targets_of(tied.search, wrong, tied.diagnosis, doubted=doubted).explanations[0] for doubted in (False, True)
    )
    assert all(plant.delay > tied.model.delay + 0.2 for plant in sure.draws)
    assert {plant.delay for plant in doubted.draws} == {tied.model.delay}


@pytest.mark.usefixtures("motion_only")
def test_gains_that_hold_no_plant_are_named(tied: Asked) -> None:
    with pytest.raises(DataError, match=r"unstable \(kp 1e\+06, kd 2e\+06\) with the model alone as the plant"):
        tied.plan(seconds=(3.0,), controller=ControllerSettings("pd", Gains(1e6, 2e6), "error"))


def test_what_one_half_shows_the_other_shows_again(settling: Plan) -> None:
    """The search judges by blocks that no fit saw: what is there once alone would be extrapolation."""
    plan, motion = settling, settling.motion
    assert motion is not None
    first, again = np.array_split(motion.position[round(plan.stages[0].start / motion.step) : -1], 2)
    assert again == pytest.approx(first, abs=1e-6 * float(np.ptp(motion.position)))


def test_limits_that_leave_no_room_are_refused(tied: Asked) -> None:
    for given, start in (({"position": (1.0, 1.0)}, 1.0), ({"velocity": (0.0, 0.0)}, 0.0), ({}, 99.0)):
        with pytest.raises(UsageError):
            limits_of([tied.recording], given, start, 10.0)


def by_the_search(search: Search, better: Fit, worse: Fit) -> float:
    """Nats, without prices and what stands against sines."""
    said = [search.evidence(fit) + search.price(fit.terms) for fit in (better, worse)]
    return said[0] - said[1]


@pytest.mark.parametrize(
    ("log", "pair"),
    [("tied", ("constant_load", "gravity")), ("slow", ("viscous_friction", "viscous_asymmetry"))],
)
def test_what_the_logs_already_say_is_what_the_search_says(
    log: str, pair: tuple[str, str], request: pytest.FixtureRequest
) -> None:
    """Whichever way round: of the slow one only u on the motion is evidence."""
    asked = request.getfixturevalue(log)
    targets = targets_of(asked.search, asked.whole, asked.diagnosis, pair)
    fits = [asked.search.converged(e.fit) for e in targets.explanations[:2]]
    assert asked.search.solver.inverse == (log == "slow")
    lead = Measure(asked.search, targets, 1).now[0, 1]
    assert lead == pytest.approx(by_the_search(asked.search, *fits), rel=0.01)


@pytest.mark.usefixtures("quick")
def test_nats_are_expected_in_the_band_and_the_form_of_both_logs(monkeypatch: pytest.MonkeyPatch) -> None:
    """One way and slow, friction is nearly all of u, which is evidence by the motion, up to 2 Hz; what is planned shows
    11 Hz, and there the motion by u is evidence. For J such a log may take anything."""
    asked = poor("viscous_asymmetry", "one way", 81417, "speed40k")
    monkeypatch.setattr(asked.search.solver, "inertia", 1e-4 * asked.model.inertia)
    plan = asked.plan(seconds=(6.0,))
    motion = plan.motion
    assert motion is not None
    t = np.arange(len(motion.position)) * motion.step
    log, _ = follow(asked.case, asked.trial, t, (motion.position, motion.velocity, motion.u), take=1)
    new = prepare(Log(log, asked.case.sample_time, "next"), asked.observer)
    both = Search(
        pose([asked.recording, new], asked.model, Settings(effects=("viscous_friction", "viscous_asymmetry")))
    )
    assert asked.search.solver.inverse
    assert not both.solver.inverse
    assert both.equations.band.hz > 3.0 * asked.search.equations.band.hz
    fits = {o.effect: o.fit for o in both.options(both.refit)}
    realised = by_the_search(both, fits["viscous_asymmetry"], fits["viscous_friction"])
    (pair,) = (p for p in plan.pairs if {p.a, p.b} == {"viscous_friction", "viscous_asymmetry"})
    assert 0.8 < pair.nats_if_b / realised < 1.25


def takes_of(friction: EffectValues, takes: int) -> tuple[Search, Fit, Fit]:
    """(search, with viscous friction, with gravity) of logs of an axis with that friction."""
    logs = [recorded(friction, reference=MOVES, duration=10.0, seed=seed) for seed in range(takes)]
    search = Search(pose(logs, BELIEVED, Settings(effects=("gravity", "viscous_friction"))))
    fits = {o.effect: o.fit for o in search.options(search.refit)}
    return search, fits["viscous_friction"], fits["gravity"]


def test_a_motion_counts_by_its_own_rows() -> None:
    """Of the same motion twice more is expected what the search says of three takes: three times as many rows."""
    friction = {"viscous_friction": {"coefficient": 0.3}}
    search, *fits = takes_of(friction, 1)
    measure = Measure(search, targets_of(search, fits[0], None, ("viscous_friction", "gravity")), 1)
    expected = measure.expected(2.0 * measure.of_logs).nats[0, 1]
    assert expected == pytest.approx(by_the_search(*takes_of(friction, 3)), rel=0.1)


def test_a_force_that_no_explanation_has_is_no_evidence_between_them() -> None:
    """What is left is some hundred times the noise. Of the same motion again is expected what the search says of two
    takes, but for what cross-validation makes of one and of two."""
    friction = {"coulomb_friction": {"level": 0.1}}
    search, *fits = takes_of(friction, 1)
    measure = Measure(search, targets_of(search, fits[0], None, ("viscous_friction", "gravity")), 1)
    assert [e.name for e in measure.targets.explanations] == ["viscous_friction", "gravity"]
    assert measure.now[0, 1] == pytest.approx(by_the_search(search, *fits))
    assert measure.now[1, 0] == -measure.now[0, 1]
    expected = measure.expected(measure.of_logs).nats[0, 1]
    assert measure.now[0, 1] < expected == pytest.approx(by_the_search(*takes_of(friction, 2)), rel=0.1)


def test_a_value_of_the_model_that_is_tied_to_a_force_is_asked_for_against_it(tied: Asked) -> None:
    """No effect was found: another weight than the model has, or a spring beside it."""
    first = tied.diagnosis.ranking[0]
    own = replace(first, effect="gravity", probability=0.5, indistinguishable_from=("stiffness",), untestable="")
    said = replace(
        tied.diagnosis, verdict="gravity", probability=0.5, found=(), ranking=(own,), unexplained=Unexplained(0.0, 0.01)
    )
    targets = targets_of(tied.search, tied.search.refit, said)
    names = [e.name for e in targets.explanations]
    assert {NONE, "stiffness"} in [{names[a], names[b]} for a, b in targets.pairs]


def test_a_diagnosis_that_says_nothing_of_what_is_left_doubts_all_of_it(tied: Asked) -> None:
    silent = replace(tied.diagnosis, unexplained=Unexplained())
    assert targets_of(tied.search, tied.whole, silent, ("constant_load", "gravity")).doubt == 1.0


def test_correlated_noise_of_a_motion_leaves_no_more_than_white_noise(
    tied: Asked, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A row of noise leaves its variance, however its neighbours lean; of that the search makes fewer nats."""
    targets = targets_of(tied.search, tied.whole, tied.diagnosis, ("constant_load", "gravity"))
    noise = tied.search.noise
    monkeypatch.setattr(tied.search, "noise", replace(noise, inflation=4.0))
    measure = Measure(tied.search, replace(targets, doubt=0.0), 1)
    rows = 1e6
    lead = 2.0 * rows * noise.variance
    loss = [e.fit.loss for e in targets.explanations[:2]]
    # up to the variance times the inflation the likelihood is that of the noise alone
    expected = (loss[1] + lead - loss[0]) / (2.0 * noise.variance * 4.0)
    assert measure._in_nats(loss, rows, lead, 0.0) == pytest.approx(expected, rel=1e-3)


def test_a_rival_has_one_choice_of_values_for_logs_and_motion() -> None:
    """A spring stands in for a load on either side of its rest, with another sign on each; u by the motion."""
    t = 0.001 * np.arange(8000)
    way = 0.01 * np.sin(4.0 * np.pi * t)
    places = [Planned(middle + way, np.gradient(way, t)) for middle in (1.0, -1.0)]
    load = {"constant_load": {"force": 0.3}}
    logs = [recorded(load, reference=place, duration=8.0, seed=i) for i, place in enumerate(places)]

    def asked(recordings: list[Recording]) -> tuple[Search, Fit, Fit]:
        search = Search(pose(recordings, BELIEVED, Settings(effects=("constant_load", "stiffness"), inverse=True)))
        fits = {o.effect: o.fit for o in search.options(search.refit)}
        return search, fits["constant_load"], fits["stiffness"]

    def measured(recordings: list[Recording]) -> Measure:
        search, right, _ = asked(recordings)
        return Measure(search, targets_of(search, right, None, ("constant_load", "stiffness")), 1)

    first, other = (measured([log]) for log in logs)
    search, *fits = asked(logs)
    right, spring = (search.nats(fit.squares) for fit in fits)
    assert first.expected(other.of_logs).nats[0, 1] == pytest.approx(spring - right, rel=0.1)


@pytest.mark.parametrize(
    ("kind", "kd", "inertia", "step"),
    [("pd", 4.0, 10.0, 0.005), ("pd", 4.0, 0.01, 0.001), ("pd", 0.0, 0.01, 0.001), ("observer", 4.0, 10.0, 0.001)],
)
def test_a_described_loop_has_samples_for_the_lightest_plant(kind, kd, inertia, step):
    """Gains of 4 on J = 0.01 cross over at 400 rad/s, 2 rad in 5 ms, whatever Jn the config has; on 10 at 0.6. Without
    a gain on the speed it swings at 20 rad/s. Of the standard observer the Q is the loop."""
    plants = [SimpleNamespace(fitted=PlantModel(j, 0.0, {})) for j in (10.0, inertia)]
    asked: Any = SimpleNamespace(
        wanted=SimpleNamespace(controller=ControllerSettings(kind, Gains(4.0, kd))),
        observer=ObserverSettings(10.0, 0.01),
        room=SimpleNamespace(step=0.001),
    )
    measure: Any = SimpleNamespace(targets=SimpleNamespace(explanations=plants), likely=(1,))
    (loop,) = _Asked._loops(asked, measure)
    assert loop.step == pytest.approx(step)
