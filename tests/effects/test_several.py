"""Several effects of one kind in one model: their names, and that each is the same law with values of its own."""

from dataclasses import replace

import numpy as np
import pytest

from dsd_cli.effects import catalogue, find_effect, free_name, get_effect, kind_of, load_effects, register, unregister
from dsd_cli.errors import UsageError
from dsd_cli.plant.model import ObserverSettings, PlantModel
from dsd_cli.plant.prediction import predict_d_hat
from dsd_cli.signals.log import Log

REPEATING = sorted(name for name, effect in catalogue().items() if effect.repeats is not None)
LINES = {
    "cogging": {"amplitude": 0.3, "periods": 5.0, "phase": 0.2},
    "cogging_2": {"amplitude": 0.1, "periods": 11.0, "phase": -1.0},
    "cogging_12": {"amplitude": 0.05, "periods": 23.0, "phase": 2.0},
}


def test_those_that_repeat_are_told_apart_by_their_periods():
    assert REPEATING == ["cogging", "periodic_disturbance"]
    assert all(get_effect(name).periods is not None for name in REPEATING)


@pytest.mark.parametrize("kind", REPEATING)
def test_a_number_is_a_name_and_nothing_else(kind):
    further = get_effect(f"{kind}_7")
    assert further == replace(get_effect(kind), id=f"{kind}_7")
    assert kind_of(f"{kind}_7") == kind_of(kind) == kind
    assert f"{kind}_7" not in catalogue()


@pytest.mark.parametrize("name", ["cogging_1", "cogging_0", "cogging_02", "cogging_100", "cogging_x", "cogging_", "_2"])
def test_other_endings_are_no_names(name):
    assert find_effect(name) is None
    assert kind_of(name) == name


def test_of_most_effects_there_is_one():
    with pytest.raises(UsageError, match="no effect 'gravity_2'") as refused:
        get_effect("gravity_2")
    assert refused.value.hint == "a model has one gravity"
    assert free_name("gravity", {"gravity"}) == ""
    assert free_name("gravity", ()) == "gravity"


def test_the_first_free_name():
    assert free_name("cogging", ()) == "cogging"
    assert free_name("cogging", {"cogging"}) == "cogging_2"
    assert free_name("cogging", {"cogging", "cogging_3", "cogging_2"}) == "cogging_4"
    assert free_name("cogging", {"cogging_2"}) == "cogging"
    assert free_name("cogging", {"cogging", *(f"cogging_{n}" for n in range(2, 100))}) == ""


def test_the_prediction_is_the_sum_of_all_lines():
    """Against the formula at the middle of each interval."""
    q = np.linspace(0.0, 3.0, 400)
    log = Log({"u": np.zeros(400), "position": q}, 1e-3)
    predicted = predict_d_hat(PlantModel(effects=LINES), log, ObserverSettings(time_constant=0.0))
    middle, moved = 0.5 * (q[1:] + q[:-1]), q[1] - q[0]
    wanted = sum(
        p["amplitude"] * np.sin(p["periods"] * middle + p["phase"]) * np.sinc(p["periods"] * moved / (2.0 * np.pi))
        for p in LINES.values()
    )
    np.testing.assert_allclose(predicted[1:], wanted, atol=1e-9)


FILE = """
import numpy as np
from dsd_cli.effects import Effect, Parameter, Role


def ripple(name, **more):
    return Effect(
        id=name, role=Role.APPLIED, law="A |sin(n q)|", summary="Ripple.", pattern="humps over position",
        parameters=(Parameter("amplitude", "{u}", "A"), Parameter("periods", "1", "n", 1e-6, linear=False)),
        needs=("position",), columns=lambda c, shape: (np.abs(np.sin(shape["periods"] * c.position)),),
        starts=lambda ranges: [{"periods": 5.0}], **more,
    )


"""
PERIODS = "periods=lambda shape, ranges: shape['periods'] * ranges.travel / np.pi"


def loaded(tmp_path, text):
    path = tmp_path / "mine.py"
    path.write_text(FILE + text)
    return load_effects(path)


def test_an_effect_of_the_user_may_repeat_and_its_own_number_comes_first(tmp_path):
    mine = loaded(tmp_path, f"EFFECTS = [ripple('hump', repeats=lambda _: True, {PERIODS}), ripple('cogging_2')]")
    register(mine)
    try:
        assert get_effect("hump_3").law == "A |sin(n q)|"
        assert get_effect("cogging_2") is mine[1]
        assert (kind_of("cogging_2"), kind_of("hump_3")) == ("cogging_2", "hump")
        assert free_name("cogging", {"cogging"}) == "cogging_3"
    finally:
        unregister([one.id for one in mine])
    assert find_effect("hump_3") is None
    assert get_effect("cogging_2").law == get_effect("cogging").law


def test_what_repeats_must_say_its_periods(tmp_path):
    with pytest.raises(UsageError, match="effect 'hump': repeats without periods"):
        loaded(tmp_path, "EFFECT = ripple('hump', repeats=lambda _: True)")
