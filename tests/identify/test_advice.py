"""What to do next: one sentence per rival, the right one, whatever the order; and no advice that the verdict denies."""

import pytest

from dsd_cli.effects import catalogue
from dsd_cli.effects.base import Effect, Parameter, Role
from dsd_cli.effects.catalogue import register, unregister
from dsd_cli.identify.results import DELAY, INERTIA, NONE, UNKNOWN, Candidate
from dsd_cli.identify.verdict.limits import advice_for


def leader(effect, *rivals):
    return Candidate(effect, 0.1, 0.2, 0.1, 0.9, {}, indistinguishable_from=rivals)


def advice(verdict, *rivals, more_unknown=False, depends_on=(), provenance=None):
    named = leader(verdict, *rivals) if verdict not in (NONE, UNKNOWN) else None
    return advice_for(verdict, named, more_unknown, depends_on, provenance or {})


@pytest.mark.parametrize(
    ("one", "other", "experiment"),
    [
        ("coulomb_friction", "viscous_friction", "only viscous friction grows with speed"),
        ("gravity", INERTIA, "gravity acts at rest, inertia does not"),
        ("actuator_lag", DELAY, "a lag rises gradually, a delay jumps"),
        ("backlash", "flexible_coupling", "only play depends on the amplitude"),
    ],
)
def test_two_that_a_log_cannot_tell_apart_get_their_experiment_in_either_order(one, other, experiment):
    for verdict, rival in ((one, other), (other, one)):
        lines = advice(verdict, rival)
        assert lines[0].startswith(f"{verdict} or {rival}? ")
        assert experiment in lines[0]


def test_an_effect_that_is_not_confirmed_gets_a_longer_log_first():
    lines = advice_for(UNKNOWN, None, True, (), {}, nearest="coulomb_friction")
    assert lines[0].startswith("to see whether it is coulomb_friction, record a longer log: ")
    assert not any("to see whether" in line for line in advice_for(UNKNOWN, None, True, (), {}))


def test_every_rival_has_a_line_and_a_pair_without_an_experiment_the_general_one():
    lines = advice("gravity", "stiffness", "cogging")
    assert lines[0].startswith("gravity or stiffness? ")
    assert "a spring keeps growing" in lines[0]
    assert lines[1].startswith("gravity or cogging? ")
    assert "with a rest between the moves" in lines[1]


def test_an_effect_of_the_user_brings_its_own_experiment():
    mine = Effect(
        id="eddy_brake",
        role=Role.APPLIED,
        law="-B v",
        summary="",
        pattern="",
        parameters=(Parameter("coefficient", "{u}/({v})", ""),),
        needs=("velocity",),
        columns=lambda channels, _: (-channels.velocity,),
        told_apart={"viscous_friction": "switch the magnet off"},
    )
    register([mine])
    try:
        assert advice("viscous_friction", "eddy_brake")[0] == "viscous_friction or eddy_brake? switch the magnet off"
    finally:
        unregister(["eddy_brake"])


def test_experiments_name_things_that_exist_and_each_pair_once():
    pairs = [frozenset((e.id, other)) for e in catalogue().values() for other in e.told_apart]
    assert len(pairs) == len(set(pairs)) >= 10
    assert {name for pair in pairs for name in pair} <= {*catalogue(), INERTIA, DELAY}


def test_a_sure_effect_is_put_into_the_model_by_a_command():
    assert advice("gravity")[0] == "dsd add LOG gravity -o FILE puts it into the model"
    assert not any("dsd add" in line for line in advice("gravity", "stiffness")), "while it may be another one"
    for verdict in (INERTIA, DELAY, NONE, UNKNOWN):
        assert not any("dsd add" in line for line in advice(verdict)), verdict


def test_what_remains_beside_a_named_effect_is_said():
    remains = "this is not all: something else remains that no effect of the catalogue explains"
    assert remains in advice("gravity", more_unknown=True)
    assert remains not in advice("gravity")
    assert remains not in advice(UNKNOWN, more_unknown=True)


def test_unknown_says_where_to_look():
    assert advice(UNKNOWN, depends_on=("velocity", "position"))[0].startswith(
        "look at the residual over velocity and pos"
    )
    assert advice(UNKNOWN)[0] == "look at the residual over time"
    assert any("--effects-from" in line for line in advice(UNKNOWN))


def test_that_values_are_per_unit_of_u_is_said_with_every_value_but_not_where_nothing_is_missing():
    assert advice(NONE) == ()
    for verdict in ("gravity", INERTIA, UNKNOWN):
        assert any("per unit of u" in line for line in advice(verdict))


def test_a_reconstructed_speed_is_a_reason_to_log_the_position():
    made = {"velocity": "reconstructed from u and d_hat"}
    assert any("log the position" in line for line in advice(NONE, provenance=made))
    assert not any("log the position" in line for line in advice("gravity", provenance={"velocity": "logged"}))
