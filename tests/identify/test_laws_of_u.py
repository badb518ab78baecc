"""Friction by the load, and a gain that droops, of joints of which friction and weight are nearly all of u: found, not
by taking u away."""

from dataclasses import replace

import numpy as np
import pytest

from dsd_cli.effects import Parameter, get_effect, register, unregister
from dsd_cli.identify.fit.bank import Term
from dsd_cli.identify.fit.laws_of_u import is_law_of_u, shrinks
from dsd_cli.identify.fit.priors import PriorKnowledge
from dsd_cli.identify.fit.problem import pose
from dsd_cli.identify.fit.testability import Settings
from dsd_cli.identify.recordings.recording import prepare
from dsd_cli.identify.search.sets import Search
from dsd_cli.identify.verdict.diagnose import diagnose
from dsd_cli.plant.model import ObserverSettings, PlantModel
from dsd_cli.signals.log import Log, with_channels

T, J, LEVEL, DAMPING = 0.002, 0.15, 4.0, 2.0
OBSERVER = ObserverSettings(J, 0.01)
LAWS = (
    *("load_friction", "gain_droop", "coulomb_friction", "stribeck_friction", "viscous_asymmetry", "stiffness"),
    "constant_load",
)


def joint(seed: int, share: float, weight: float, more: float = 0.0, pace: float = 1.0, droop: float = 0.0):
    """A geared joint whose u is what its motion needs, 12 s: u (1 - mu sgn(u v)) = J a + d v + c sgn v + G sin q.

    more : dry friction beside c, unit of u. pace : of its motion. droop : share of its largest u that the drive loses.
    A ripple of the gear and noise are 1 % of u.
    """
    random, t = np.random.default_rng(seed), T * np.arange(6000)
    w = 2.0 * np.pi * pace * np.array([0.2, 0.5, 0.9, 1.6])
    size, turn = random.uniform(0.3, 0.5, 4) / np.array([0.7, 1.2, 2.0, 4.0]), random.uniform(0.0, 6.0, 4)
    angle = np.outer(t, w) + turn
    q, v, a = np.sin(angle) @ size, np.cos(angle) @ (size * w), -np.sin(angle) @ (size * w**2)
    needed = J * a + DAMPING * v + (LEVEL + more) * np.sign(v) + weight * np.sin(q)
    u = needed / (1.0 - share * np.sign(needed * v))
    if droop:
        c = droop * (1.0 - droop) / np.abs(u).max()
        u = np.sign(u) * (1.0 - np.sqrt(1.0 - 4.0 * c * np.abs(u))) / (2.0 * c)  # u (1 - c |u|) is what was needed
    u += 0.01 * u.std() * (np.sin(100.0 * q) + random.normal(size=t.size))
    return prepare(Log({"u": u, "position": np.round(q / 1e-5) * 1e-5}, T, "log.csv"), OBSERVER)


def model(weight: float) -> PlantModel:
    own = {"coulomb_friction": {"level": LEVEL}, "viscous_friction": {"coefficient": DAMPING}}
    return PlantModel(J, 0.0, own | ({"gravity": {"amplitude": weight, "phase": 0.0}} if weight else {}))


@pytest.mark.parametrize(("seed", "share"), [(839001, 0.08), (839002, 0.15), (839003, 0.25)])
def test_friction_by_the_load_of_a_joint_is_named(seed, share):
    """It was not testable there, and the weight of the model was "wrong", 94 %."""
    found = diagnose([joint(seed, share, 20.0)], model(20.0), OBSERVER, Settings(effects=LAWS))
    assert found.inverse
    assert found.verdict == "load_friction"
    assert found.probability > 0.9
    value = found.estimates["load_friction.coefficient"]
    assert abs(value.value - share) < 2.0 * value.std_error < 0.04
    assert found.estimates["gravity.amplitude"].value == pytest.approx(20.0, rel=0.02)


@pytest.mark.parametrize("weight", [0.0, 20.0])
@pytest.mark.parametrize(("more", "verdict"), [(0.0, "none"), (1.0, "coulomb_friction")])
def test_it_takes_the_place_of_nothing(weight, more, verdict):
    """u - |u| sgn v is 0 where u drives all the time: least squares of what is left go to a coefficient of 1."""
    found = diagnose([joint(839004, 0.0, weight, more)], model(weight), OBSERVER, Settings(effects=LAWS))
    assert found.verdict == verdict
    assert [one.effect for one in found.missing] == [verdict][verdict == "none" :]
    assert not any("load_friction" in one.indistinguishable_from for one in found.ranking)  # then others are off
    left = {one.effect: one.heldout_rmse_after for one in found.ranking}
    assert not left["load_friction"] <= 0.9 * found.refitted.heldout_rmse  # or not testable, where u always drives


@pytest.mark.parametrize(("seed", "droop"), [(839007, 0.25), (839007, 0.4), (960006, 0.3), (960025, 0.3)])
def test_a_drive_that_droops_has_no_friction_by_the_load(seed, droop):
    """A gain that falls with u makes friction beside a weight grow with the load, and the weight no sine: load friction
    was 58 to 79 %, then a stiffness and a cubic one 50 %."""
    log = joint(seed, 0.0, 20.0, droop=droop)
    found = diagnose([log], model(20.0), OBSERVER, Settings(effects=LAWS))
    assert [one.effect for one in found.missing] == ["gain_droop"]
    assert found.probability > 0.9
    value, most = found.estimates["gain_droop.droop"], max(float(np.abs(piece["u"]).max()) for piece in log.pieces)
    assert abs(value.value * most - droop) < 2.0 * value.std_error * most + 0.01 < 0.04


def test_a_drive_that_droops_beside_a_weight_is_no_stiffness():
    """They were a stiffness and friction by the load."""
    asked = Settings(effects=(*LAWS, "gravity"))
    found = diagnose([joint(960030, 0.0, 20.0, droop=0.2)], model(0.0), OBSERVER, asked)
    assert [one.effect for one in found.missing] == ["gravity", "gain_droop"]
    assert found.probability > 0.9


def test_two_laws_of_u_are_taken_off_together():
    """One after the other three times, the droop was 0.13 beside a friction of 0.19."""
    log = joint(839009, 0.15, 20.0, droop=0.2)
    found = diagnose([log], model(20.0), OBSERVER, Settings(effects=LAWS))
    assert {one.effect for one in found.missing if one.probability > 0.9} == {"gain_droop", "load_friction"}
    most = max(float(np.abs(piece["u"]).max()) for piece in log.pieces)
    assert found.whole_values["load_friction.coefficient"].value == pytest.approx(0.15, abs=0.02)
    assert found.whole_values["gain_droop.droop"].value * most == pytest.approx(0.2, abs=0.03)


@pytest.mark.parametrize(("seed", "share"), [(894902, 0.2), (894903, 0.2)])
def test_a_share_of_all_forces_is_not_one_wrong_value(seed, share):
    """Without a weight u drives all the time, and friction by the load makes all values look too large, by the same
    factor: one of them was "wrong", 97 %. With any one of them as given the log shows the friction."""
    found = diagnose([joint(seed, share, 0.0, pace=0.25)], model(0.0), OBSERVER, Settings(effects=LAWS))
    assert found.inverse
    (named,) = [c for c in found.ranking if c.effect == found.verdict]
    assert found.verdict in ("coulomb_friction", "viscous_friction", "inertia")
    assert "load_friction" in named.indistinguishable_from
    assert found.probability <= 0.5


def test_a_law_of_ones_own_may_have_either_sign():
    """u (1 + c q), c = -0.15: c was held at 0, the right model left ten times what it does, and all was unknown."""
    own = get_effect("gain_droop")
    by_place = replace(
        own,
        id="gain_by_place",
        parameters=(Parameter("gain", "1/({q})", "c of c u q"),),
        needs=("u", "position"),
        columns=lambda channels, _: (channels.u * channels.position,),
        split=None,
        join=None,
    )
    plain = joint(839010, 0.0, 20.0)
    place = [piece["position"] for piece in plain.pieces]
    pieces = [with_channels(p, u=p["u"] / (1.0 - 0.15 * q)) for p, q in zip(plain.pieces, place, strict=True)]
    log = replace(plain, pieces=tuple(pieces))
    register([by_place])
    try:
        found = diagnose([log], model(20.0), OBSERVER, Settings(effects=("gain_by_place", "stiffness")))
    finally:
        unregister(["gain_by_place"])
    assert found.verdict == "gain_by_place"
    value = found.estimates["gain_by_place.gain"]
    assert value.value == pytest.approx(-0.15, abs=3.0 * value.std_error)
    assert value.std_error < 0.02


def test_what_is_known_of_it_holds():
    known = PriorKnowledge(bounds={"load_friction.coefficient": (0.0, 0.1)})
    settings = Settings(effects=("load_friction",), known=known)
    found = diagnose([joint(839002, 0.15, 20.0)], model(20.0), OBSERVER, settings)
    assert found.estimates["load_friction.coefficient"].value == pytest.approx(0.1)


def test_a_table_over_the_speed_is_no_law_of_u():
    """Its scale was held below 0.9, at 0, and Coulomb friction took its place, 99 %."""
    table = {"channels": ["speed"], "knots": [[0.0, 1.0, 20.0]], "values": 3 * [LEVEL], "factor": "one", "scale": 1.0}
    own = {"friction_curve": table, "viscous_friction": {"coefficient": DAMPING}}
    own["gravity"] = {"amplitude": 20.0, "phase": 0.0}
    found = diagnose([joint(839008, 0.0, 20.0)], PlantModel(J, 0.0, own), OBSERVER, Settings(effects=LAWS))
    assert found.verdict == "none"
    assert found.estimates["friction_curve.scale"].value == pytest.approx(1.0, abs=0.05)


@pytest.mark.parametrize(
    ("name", "shares", "takes"),
    [("load_friction", 1, True), ("load_friction", 2, False), ("load_friction", 0, False), ("gain_droop", 1, True)],
)
def test_of_one_coefficient_alone_it_is_known_how_to_take_it_off(name, shares, takes):
    """Effects of one's own: with a share for each way they ended in an exception."""
    own = get_effect(name)
    made = tuple(replace(own.parameters[0], name=f"share_{i}") for i in range(shares))
    assert is_law_of_u(replace(own, parameters=made)) == takes


def test_the_slope_of_what_is_left_is_that_of_the_law():
    """d(u - c |u| sgn v)/du = 1 - c sgn(u v), by the signs of the log itself."""
    problem = pose([joint(839005, 0.2, 20.0, pace=0.4)], model(20.0), Settings(effects=LAWS))
    search = Search(problem)
    terms = (*search.base, Term("load_friction"))
    design = search.solver.bank.design(terms, 0)
    weights = np.zeros((1, len(design.rows)))
    weights[0, 0], weights[0, -1] = 1.0, -0.25  # the law comes last
    found = shrinks(search.solver.bank, terms, design.widths, 0, weights)
    equations, (log,) = search.equations, [s.log for s in search.equations.stretches]
    driven, around = np.sign(log["u"] * log["velocity"]), 150  # samples: a row averages over some of its neighbours
    mean = np.convolve(driven, np.ones(2 * around + 1) / (2 * around + 1), mode="same")
    steady = equations.of_rows([np.abs(mean) > 1.0 - 1e-9])
    assert np.count_nonzero(steady) > 10
    assert {*equations.of_rows([driven])[steady]} == {-1.0, 1.0}
    assert found[steady] == pytest.approx(1.0 - 0.25 * equations.of_rows([driven])[steady], abs=0.01)
