"""Plants that the logs leave as likely."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from dsd_cli.design import left_open
from dsd_cli.design.closed_loop import usual_loops
from dsd_cli.design.expectation import ranges_within
from dsd_cli.design.explanations import explanation_of, falling, grown, held
from dsd_cli.design.left_open import Left
from dsd_cli.design.limits import Limits
from dsd_cli.design.reach import other_shapes
from dsd_cli.design.targets import targets_of
from dsd_cli.effects import Ranges
from dsd_cli.identify.fit.bank import Term
from dsd_cli.identify.fit.problem import pose
from dsd_cli.identify.recordings.recording import Recording, prepare
from dsd_cli.identify.results import NONE
from dsd_cli.identify.search.sets import Search
from dsd_cli.identify.verdict.diagnose import Settings
from dsd_cli.plant.model import PlantModel
from dsd_cli.plant.references import Planned
from dsd_cli.plant.simulation import Measurement, SimulationSettings, simulate
from tests.identify.comparison_rig import BELIEVED, CONTROLLER, MOVES, OBSERVER, T, recorded

#: Moved one way, of friction and a load only the sum is known; a third value is another matter.
_SUM = np.array([1.0, 1.0, 0.0])


def known_sum() -> Left:
    """Covariance of two values of 1.0 each whose sum is known to 0.01, by the inverse of what is known of them."""
    return Left(np.linalg.inv(np.diag([1.0, 1.0, 4.0]) + np.outer(_SUM, _SUM) / 0.01**2), np.zeros(3))


def test_a_value_that_is_given_takes_those_along_that_only_add_up_with_it() -> None:
    first = np.array([1.0, 0.0, 0.0])
    given = known_sum().where(first, 0.4)
    assert given.mean == pytest.approx([0.4, -0.4, 0.0], abs=1e-3)
    assert np.sqrt(np.diag(given.covariance)) == pytest.approx([0.0, 0.01, 0.5], abs=1e-3)


def test_what_the_logs_say_is_there_may_not_be_away() -> None:
    first, both = np.array([1.0, 0.0, 0.0]), _SUM
    assert known_sum().may_be(first, 1.0)
    assert not known_sum().may_be(first, 2.0)
    assert not known_sum().may_be(both, 0.1)
    assert not known_sum().where(first, 0.4).may_be(np.array([0.0, 1.0, 0.0]), 0.0)


def test_what_the_logs_say_nothing_of_is_open_as_far_as_their_forces_go(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two forces, of 0.08 and 0.03, of which the logs say the sum alone, to 0.001: what one has more the other has
    less, by up to the largest of them, and the inverse of what the logs say has no such change."""
    said = np.outer(_SUM, _SUM) / 0.001**2
    fit = SimpleNamespace(total=np.array([0.08, 0.03, 0.0]))
    monkeypatch.setattr(left_open, "information", lambda *_: SimpleNamespace(normal=said))
    values = SimpleNamespace(fit=fit, covariance=np.linalg.pinv(said), model=PlantModel())
    left = Left.by(SimpleNamespace(solver=SimpleNamespace(known=SimpleNamespace(fixed={}))), values)
    first, both = np.array([1.0, 0.0, 0.0]), _SUM
    assert left.may_be(first, 0.08)
    assert left.may_be(first, -0.08)
    assert left.where(first, 0.05).mean == pytest.approx([0.05, -0.05, 0.0], abs=1e-4)
    assert not left.may_be(both, 0.004)


def test_shapes_of_a_rival_reach_as_far_as_the_motion_may() -> None:
    """A poor log of 0.1 rad/s knows no Stribeck speed of 1 rad/s, and the next motion shows it."""
    found = Ranges(0.05, 0.1, 0.2, 0.1, 0.3, 0.001, 8.0)
    limits = Limits(-1.0, 1.0, 6.0, 50.0, 800.0, 1.0, 0.0)
    term = Term.of("stribeck_friction", {"velocity": 0.02})
    near, far = ([t.shape["velocity"] for t in other_shapes(term, r)] for r in (found, ranges_within(found, limits)))
    assert max(near) < 0.1
    assert max(far) > 1.0
    assert max(far) / min(far) > 10.0
    assert other_shapes(Term.of("viscous_friction", {}), found) == []


@pytest.mark.parametrize(
    ("effect", "value", "size"), [("coulomb_friction", "level", 0.2), ("constant_load", "force", -0.2)]
)
def test_what_the_model_lacks_may_be_friction_that_is_gone_beyond_the_speeds_of_the_logs(
    effect: str, value: str, size: float
) -> None:
    """Of a load no sine says whether it is friction, but that nothing holds a faster motion back either way."""
    log = recorded({effect: {value: size}}, duration=4.0)
    search = Search(pose([log], BELIEVED, Settings()))
    found = search.fit((Term.of(effect, {}),), search.refit.tap)
    (plant,) = falling(search, search.problem.scale.model(found), found, 0.0)
    gone = plant.effects["stribeck_friction"]
    assert plant.effects.keys() == {"stribeck_friction"}
    assert gone["excess"] == pytest.approx(abs(size), rel=0.25)
    assert gone["velocity"] == pytest.approx(np.abs(log.pieces[0]["velocity"]).max(), rel=0.02)


def test_friction_that_falls_within_the_speeds_of_the_logs_is_as_large_as_it_breaks_away() -> None:
    """One way, up to 1 rad/s: its mean is two thirds of what another way has to overcome."""
    t = T * np.arange(3000)
    log = recorded(
        {"stribeck_friction": {"excess": 0.1, "velocity": 1.0}},
        reference=Planned(0.5 * t - 0.05 * np.sin(10.0 * t), 0.5 - 0.5 * np.cos(10.0 * t)),
        duration=6.0,
        noise=0.001,
    )
    search = Search(pose([log], BELIEVED, Settings()))
    found = search.fit((Term.of("coulomb_friction", {}),), search.refit.tap)
    plant, _ = falling(search, search.problem.scale.model(found), found, 0.0)
    assert plant.effects["stribeck_friction"]["excess"] == pytest.approx(0.1, rel=0.1)


def test_a_drag_in_one_fast_move_is_no_load_where_the_log_rests() -> None:
    """At rest u and friction together are twice the friction at most; what slides there is faster, by 0.3."""
    friction = {"coulomb_friction": {"level": 0.05}}
    t = T * np.arange(2000)
    q = 1.5 * np.clip((t - 1.8) / 0.4, 0.0, 1.0) ** 2 * (3.0 - 2.0 * np.clip((t - 1.8) / 0.4, 0.0, 1.0))
    drag = {**friction, "viscous_friction": {"coefficient": 0.1}}
    log = recorded(drag, reference=Planned(q, np.gradient(q, T)), duration=4.0, noise=0.001)
    search = Search(pose([log], replace(BELIEVED, effects=friction), Settings()))
    alone = explanation_of(search, NONE, search.refit, True, ())
    first, _ = held(search, alone, search.refit, 1.0, 0.0)
    assert abs(first.fitted.effects["constant_load"]["force"]) < 0.1


def growing(speed: float, limit: float) -> dict[str, list[float]]:
    """Share of u, at a limit of speed, that a force of each kind takes which a log of moves at another leaves open."""
    settings = SimulationSettings(
        model=BELIEVED,
        duration=6.0,
        sample_time=T,
        observer=OBSERVER,
        controller=CONTROLLER,
        reference=replace(MOVES, speed=speed, distance=0.2 * speed, acceleration=20.0 * speed),
        measurement=Measurement(position_noise=1e-5),
    )
    search = Search(pose([prepare(simulate(settings), OBSERVER)], BELIEVED, Settings()))
    limits = Limits(-1.0, 1.0, limit, 50.0, 800.0, 2.0, 0.0)
    loop = usual_loops(BELIEVED, OBSERVER, 0.005)[-1]
    found: dict[str, list[float]] = {}
    for plant in grown(search, explanation_of(search, "none", search.refit, False, ()), limits, loop):
        ((name, values),) = plant.effects.items()
        force = values["coefficient"] * limit ** (2 if name == "quadratic_drag" else 1)
        found.setdefault(name, []).append(force / limits.u)
    return found


def test_a_force_that_grows_with_the_speed_is_as_large_as_slow_logs_leave_it_open() -> None:
    """Sixty times faster a quarter of u, either way; none at a speed that was shown."""
    slow, fast = growing(0.1, 6.0), growing(6.0, 6.0)
    assert slow.keys() == fast.keys() == {"viscous_friction", "quadratic_drag", "viscous_asymmetry"}
    assert slow["viscous_asymmetry"] == pytest.approx([-0.25, 0.25])
    assert max(np.abs(fast["viscous_asymmetry"])) < 0.01


def test_half_of_the_damping_of_the_loop_is_all_that_such_a_force_takes_off_it() -> None:
    """Of kd = 0.01 x 25 rad/s at 1 rad/s: 0.125 of 2."""
    assert growing(0.02, 1.0)["viscous_asymmetry"] == pytest.approx([-0.0625, 0.0625])


def moved_in(force: PlantModel, way: float, *, duration: float = 4.0) -> Recording:
    """A log of moves so far to and fro."""
    moves = replace(MOVES, speed=4.0 * way, distance=way, acceleration=80.0 * way, start=0.0)
    return recorded(dict(force.effects), reference=moves, duration=duration, noise=0.001)


def test_friction_and_a_load_that_only_add_up_have_their_sum_in_every_plant() -> None:
    """Moves one way: what is fitted has no friction at all, and the model knows that there is 0.05 of it."""
    friction = {"coulomb_friction": {"level": 0.05}}
    t = T * np.arange(3000)
    log = recorded(
        {**friction, "constant_load": {"force": 0.08}},
        reference=Planned(t + 0.02 * np.sin(9.0 * t), 1.0 + 0.18 * np.cos(9.0 * t)),
        duration=6.0,
        noise=0.001,
    )
    search = Search(pose([log], replace(BELIEVED, effects=friction), Settings()))
    found = search.fit((*search.base, Term.of("constant_load", {})), search.refit.tap)
    plants = explanation_of(search, "constant_load", found, False, ("constant_load",)).draws
    forces = [plant.effects["constant_load"]["force"] for plant in plants]
    assert all(plant.effects["coulomb_friction"]["level"] == 0.05 for plant in plants)
    assert forces == pytest.approx([0.08] * len(forces), rel=0.05)


VALLEY = {"cogging": {"amplitude": 0.05, "periods": 20.0, "phase": 0.3}}
WEIGHT = {"gravity": {"amplitude": 0.01, "phase": 0.5}}
#: Of a wave of 0.31.
WAY = 0.1


def test_what_a_spring_does_where_the_logs_have_been_a_wave_may_do() -> None:
    """A spring in one valley of a cogging: beyond it nothing says that it goes on."""
    log = moved_in(replace(BELIEVED, effects=VALLEY), WAY)
    search = Search(pose([log], BELIEVED, Settings()))
    spring = search.fit((Term.of("stiffness", {}), Term.of("constant_load", {})), search.refit.tap)
    targets = targets_of(search, spring, None, ("stiffness", "none"))
    (wave,) = [e.fitted for e in targets.explanations if "cogging" in e.name]
    assert wave.effects["cogging"]["periods"] == pytest.approx(20.0, rel=0.05)
    assert wave.effects["cogging"]["amplitude"] == pytest.approx(0.05, rel=0.1)


def test_where_nobody_knows_what_is_missing_forces_of_the_model_are_as_it_has_them() -> None:
    """In one valley of a cogging the weight is fitted as eighty times its own, and that would be fed forward."""
    log = moved_in(replace(BELIEVED, effects={**VALLEY, **WEIGHT}), 0.02)
    model = replace(BELIEVED, effects=WEIGHT)
    search = Search(pose([log], model, Settings()))
    alone = explanation_of(search, NONE, search.refit, True, ())
    assert alone.draws[1].effects["gravity"]["amplitude"] > 0.2
    first, wave = held(search, alone, search.refit, 0.0, 0.0)
    assert first.fitted.effects["gravity"] == wave.effects["gravity"] == WEIGHT["gravity"]
    assert 0.02 < wave.effects["cogging"]["amplitude"] < 0.1
