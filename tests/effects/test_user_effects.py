"""`--effects-from`: a user's effect is known like ours, and every mistake in its file is one clear line."""

import subprocess
import sys

import numpy as np
import pytest

from dsd_cli.effects import catalogue, get_effect, load_effects, register, unregister
from dsd_cli.errors import UsageError
from dsd_cli.plant.model import ObserverSettings, PlantModel
from dsd_cli.plant.prediction import predict_d_hat
from dsd_cli.signals.log import Log

GOOD = """
import numpy as np
from dsd_cli.effects import Effect, Parameter, Role

EFFECT = Effect(
    id="soft_spring", role=Role.APPLIED, law="-a tanh q", summary="A spring.", pattern="an S over position",
    parameters=(Parameter("coefficient", "{u}", "a"),), needs=("position",),
    columns=lambda channels, shape: (-np.tanh(channels.position),),
)
"""


def write(tmp_path, text, name="mine.py"):
    path = tmp_path / name
    path.write_text(text)
    return path


@pytest.fixture
def registered(tmp_path):
    effects = load_effects(write(tmp_path, GOOD))
    register(effects)
    yield effects
    unregister([effect.id for effect in effects])


def test_a_registered_effect_is_one_like_ours(registered):
    assert get_effect("soft_spring") is registered[0]
    assert list(catalogue())[-1] == "soft_spring"
    q = np.linspace(0, 1, 20)
    log = Log({"u": np.zeros(20), "position": q}, 1e-3)
    model = PlantModel(effects={"soft_spring": {"coefficient": 2.0}})
    predicted = predict_d_hat(model, log, ObserverSettings(time_constant=0.0))
    np.testing.assert_allclose(predicted[1:], -2.0 * np.tanh(0.5 * (q[1:] + q[:-1])))
    with pytest.raises(UsageError, match="there already"):
        register(registered)


def test_unregistering_leaves_nothing(tmp_path):
    before = list(catalogue())
    register(load_effects(write(tmp_path, GOOD)))
    unregister(["soft_spring"])
    assert list(catalogue()) == before
    with pytest.raises(UsageError, match="no effect 'soft_spring'"):
        get_effect("soft_spring")


def test_several_effects_in_one_file(tmp_path):
    two = GOOD + "\nfrom dataclasses import replace\nEFFECTS = [EFFECT, replace(EFFECT, id='other')]\n"
    assert [effect.id for effect in load_effects(write(tmp_path, two))] == ["soft_spring", "other"]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("x = 1\n", "defines no EFFECT"),
        ("EFFECT = 3\n", "of type int"),
        ("x = 1\ny = unknown\n", r"mine\.py:2: NameError: name 'unknown'"),
        ("x = (\n", r"mine\.py:1: SyntaxError"),
        ("raise ValueError\n", r"mine\.py:1: ValueError"),
        (GOOD.replace("soft_spring", "gravity"), "'gravity' is there already"),
        (GOOD + "EFFECTS = [EFFECT, EFFECT]", "'soft_spring' is there already"),
        (GOOD.replace("(-np.tanh(channels.position),)", "()"), "returned 0 arrays"),
        (GOOD.replace("(-np.tanh(channels.position),)", "(channels.t, channels.t)"), "returned 2 arrays"),
        (GOOD.replace("-np.tanh(channels.position)", "1.0"), r"shape \(\)"),
        (GOOD.replace("-np.tanh(channels.position)", "np.ones(5)"), "where the channels are numbers"),
        (GOOD.replace("channels.position", "channels.place"), r"mine\.py:8: effect 'soft_spring': AttributeError"),
        (GOOD.replace("columns=", "split=lambda v, j: ((2 * v['coefficient'],), {}), columns="), "does not undo split"),
    ],
)
def test_mistakes_are_named(tmp_path, text, said):
    with pytest.raises(UsageError, match=said) as error:
        load_effects(write(tmp_path, text))
    assert "mine.py" in str(error.value)
    assert "\n" not in str(error.value)


def test_files_that_are_not_there(tmp_path):
    with pytest.raises(UsageError, match="no such file"):
        load_effects(tmp_path / "none.py")
    with pytest.raises(UsageError, match="cannot be read"):
        load_effects(tmp_path)


def test_on_the_command_line(tmp_path):
    path = write(tmp_path, GOOD)
    run = [sys.executable, "-m", "dsd_cli", "simulate", "--template", "servo", "--duration", "0.1"]
    run += ["-o", str(tmp_path / "log.csv"), "--effects-from", str(path), "--effect", "soft_spring:coefficient=0.1"]
    done = subprocess.run(run, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (0, ""), done.stderr
    path.write_text("EFFECT = oops")
    done = subprocess.run(run, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert "mine.py:1: NameError" in done.stderr
