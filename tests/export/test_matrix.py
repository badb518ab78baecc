"""All effects through all targets: each is run and equals the simulator, or is read back by another reader, or is
refused with a reason. What is written for a PLC and for MATLAB is run by interpreters that know nothing of the tool.
"""

import csv
import io
import json
import re
import shutil
from collections.abc import Callable
from functools import cache

import numpy as np
import pytest

from dsd_cli.errors import UsageError
from dsd_cli.export.base import Joint, Motion
from dsd_cli.export.making import MOST_PERCENT, make, verify
from dsd_cli.export.motion import Path, built_in, simulated
from dsd_cli.export.targets import get_target, targets
from dsd_cli.plant.model import PlantModel
from dsd_cli.plant.motion import Plant
from tests.export.cases import ALONE, TABLES, TOGETHER, joint, motion
from tests.export.test_page import PROGRAMS
from tests.oracle.matlab_text import StateEquation
from tests.oracle.structured_text import Block, blocks

GCC = pytest.mark.skipif(shutil.which("gcc") is None, reason="no gcc")
#: Targets that are run as joints, and those that are read back.
JOINTS, VALUES = ("mjcf", "urdf"), ("parameters", "table")
#: Every effect alone, and several together.
MODELS = {name: (name,) for name in ALONE} | {f"{names[0]} and others": names for names in TOGETHER}
#: Asked of what `TOGETHER` lacks: an FMU is the header of C with a description, a model of Modelica takes a second.
SLOW = {"fmu": set(ALONE), "modelica": {name for names in TOGETHER for name in names}}
#: What cannot be run here though it is written, and why.
NOT_RUN = {("modelica", "backlash"): "rumoca has no loop within an if"}


@cache
def plc(text: str) -> dict[str, Callable[[], Block]]:
    """Function blocks of a file, read once."""
    return blocks(text)


def structured_text(one: Joint, given: Motion) -> np.ndarray:
    """Speed of the axis' function block, called once a sample."""
    axis = plc(get_target("st").write(one).decode())["joint_Axis"]()
    return np.array([axis(u=u, q=given.position, v=given.velocity)[0] for u in given.u.tolist()])


def matlab(one: Joint, given: Motion) -> np.ndarray:
    """Speed of the state equation, stepped from the start that its help text gives."""
    text = get_target("matlab").write(one).decode()
    (start,) = re.findall(r"^% +start = @\(q, v\) \[(.*)\];$", text, re.M)
    x = [eval(part, {"q": given.position, "v": given.velocity}) for part in start.split(";")]
    step, speeds = StateEquation(text), []
    for u in given.u.tolist():
        x, (speed, _) = step(x, u)
        speeds.append(speed)
    return np.array(speeds)


@pytest.fixture(autouse=True)
def once(monkeypatch: pytest.MonkeyPatch) -> None:
    """What the simulator makes of a model and a motion is the same for every target."""
    monkeypatch.setattr("dsd_cli.export.making.simulated", simulated_once)


_KNOWN: dict[tuple[str, str, bytes], Path] = {}


def simulated_once(model: PlantModel, given: Motion, *further: object) -> Path:
    key = repr(model), repr(given), given.u.tobytes()
    if further:
        return simulated(model, given, *further)
    if key not in _KNOWN:
        _KNOWN[key] = simulated(model, given)
    return _KNOWN[key]


INTERPRETED = {"st": structured_text, "matlab": matlab}


@GCC
@pytest.mark.parametrize(
    ("model", "target"),
    [(model, target) for model in MODELS for target in PROGRAMS if model not in SLOW.get(target, ())],
)
def test_each_model_in_each_program_is_that_of_the_simulator(model: str, target: str) -> None:
    one, given = joint(*MODELS[model]), motion(seconds=0.4)
    if target in INTERPRETED:
        found = INTERPRETED[target](one, given)
        wanted = simulated_once(one.model, given).velocity
        assert np.abs(found - wanted).max() <= 1e-12 * np.abs(wanted).max()
        return
    if why := NOT_RUN.get((target, MODELS[model][0])):
        pytest.skip(why)
    checked = verify(get_target(target), make(get_target(target), one, given, drop=False), given)
    if not checked.ran and "not installed" in checked.how:
        pytest.skip(checked.how)
    assert checked.ran, checked.how
    assert np.abs(checked.found - checked.wanted).max() <= 1e-12 * np.abs(checked.wanted).max()


@pytest.mark.parametrize("table", TABLES)
def test_each_table_in_a_joint_is_within_a_percent_or_refused(table: str) -> None:
    """Effects alone are in test_simulators.py. Damped, so that the axis does not run away without a controller."""
    pytest.importorskip("mujoco", minversion="4.0", reason="dsd-cli[sim] is not installed")
    found, one = get_target("mjcf"), joint("viscous_friction", table, delay=0.0, sample_time=1e-3)
    given = built_in(one.model, 1e-3)
    if not found.judge(one, TABLES[table][0]).carried:
        with pytest.raises(UsageError, match=r"a joint of MJCF has no (force|dry friction) over "):
            make(found, one, given, drop=False)
        return
    checked = verify(found, make(found, one, given, drop=False), given)
    assert checked.ran, checked.how
    assert checked.rms_percent <= MOST_PERCENT


@pytest.mark.parametrize("effect", ALONE)
def test_each_value_is_read_back_as_it_was(effect: str) -> None:
    one = joint(effect)
    rows = list(csv.DictReader(io.StringIO(get_target("parameters").write(one).decode())))
    name, values = ALONE[effect]
    found = {row["parameter"]: json.loads(row["value"]) for row in rows if row["part"] == name}
    assert found == values
    assert {row["part"] for row in rows} == {"inertia", "delay", name}


@pytest.mark.parametrize("effect", ALONE)
def test_a_table_of_friction_keeps_each_speed_or_is_refused(effect: str) -> None:
    """Under the force that it says the plant of the simulator does not accelerate."""
    found, one = get_target("table"), joint(effect, delay=0.0)
    if not found.judge(one, ALONE[effect][0]).carried:
        return
    rows = list(csv.DictReader(io.StringIO(found.write(one).decode())))
    assert len(rows) > 100
    for row in rows:
        speed, force = float(row["speed"]), float(row["force"])
        left = Plant(one.model, velocity=speed).acceleration(0.0, force)
        assert abs(left) <= 1e-12 * max(abs(force), 1.0)


def test_every_target_is_in_one_of_these() -> None:
    """SDF and USD are read back in test_simulators.py."""
    assert set(targets()) == {*PROGRAMS, *JOINTS, *VALUES, "sdf", "usd"}


@pytest.mark.parametrize("effect", ALONE)
def test_what_a_plc_is_given_is_what_python_is(effect: str) -> None:
    one = joint(effect)
    known: dict = {}
    exec(get_target("python").write(one).decode(), known)
    axis = plc(get_target("st").write(one).decode())
    for block, names in {
        "Feedforward": "tqva",
        "Compensation": ("t", "u", "q", "v", "direction"),
        "Friction": "tuqv",
    }.items():
        law, there = getattr(known["Effects"](0.1, 0.0), block.lower()), axis[f"joint_{block}"]()
        rng = np.random.default_rng(3)
        for k in range(60):
            v = 0.0 if k % 7 == 0 else float(np.sin(0.3 * k))
            given = {"t": k * 2e-3, "u": rng.normal(), "q": 0.1, "v": v, "a": rng.normal(), "direction": rng.normal()}
            begin = {"q": 0.1, "v": 0.0} if k == 0 else {}
            values = {name: float((given | begin)[name]) for name in names}
            (found,) = there(**values)
            assert found == pytest.approx(law(**values), rel=1e-12, abs=1e-12), block
