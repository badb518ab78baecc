"""What no tool here runs: tables are read back, texts are checked for their structure."""

import csv
import io
import json
import math

import numpy as np
import pytest

from dsd_cli.export.emit import statements
from dsd_cli.export.targets import get_target
from tests.export.cases import joint


def test_the_table_is_the_force_that_keeps_a_speed() -> None:
    one = joint("coulomb_friction", "viscous_friction", "stribeck_friction", "constant_load", delay=0.0)
    rows = list(csv.DictReader(io.StringIO(get_target("table").write(one).decode())))
    v = np.array([float(row["speed"]) for row in rows])
    force = np.array([float(row["force"]) for row in rows])
    by_hand = np.sign(v) * (0.5 + 0.3 * np.exp(-((v / 0.2) ** 2))) + 0.3 * v - 0.2
    assert np.abs(force - by_hand).max() < 1e-12
    between = np.linspace(0.002, 50.0, 20_000)
    true = 0.5 + 0.3 * np.exp(-((between / 0.2) ** 2)) + 0.3 * between - 0.2
    assert np.abs(np.interp(between, v, force) / true - 1.0).max() < 0.01  # a drive draws lines in between


@pytest.mark.parametrize(
    ("effect", "why"),
    [
        ("gravity", "it depends on position"),
        ("load_friction", "it depends on command"),
        ("external_force", "it depends on time"),
        ("presliding_friction", "it is more than a force over the speed"),
    ],
)
def test_the_table_has_nothing_that_is_no_function_of_the_speed(effect: str, why: str) -> None:
    verdict = get_target("table").judge(joint(effect), effect)
    assert (verdict.carried, verdict.how) == (False, why)


def test_values_are_read_back_as_they_were() -> None:
    one = joint("gravity", "curve", "external_force")
    rows = list(csv.DictReader(io.StringIO(get_target("parameters").write(one).decode())))
    found = {(row["part"], row["parameter"]): json.loads(row["value"]) for row in rows}
    assert found[("inertia", "")] == one.model.inertia
    assert found[("delay", "")] == one.model.delay
    for name, values in one.model.effects.items():
        assert {p: found[(name, p)] for p in values} == dict(values)


def test_values_that_hang_on_one_condition_share_an_if() -> None:
    from dsd_cli.export.expression import make, symbol, where
    from dsd_cli.export.targets.matlab import MATLAB

    a, b = symbol("a"), symbol("b")
    later = where(make("<", a, b), make("exp", make("exp", a)), make("exp", b))
    outputs = {"first": where(make("<", a, b), a / b, b / a), "second": later, "third": make("sin", later)}
    lines = statements(outputs, MATLAB, {}, 0).lines
    assert sum(line.strip().startswith("if") for line in lines) == 1
    scope = {"exp": math.exp, "sin": math.sin, "a": 1.0, "b": 2.0}
    exec("\n".join(lines).replace("if (a < b)", "if a < b:").replace("else", "else:").replace("end", ""), scope)
    assert (scope["first"], scope["second"]) == (0.5, math.exp(math.e))
    assert scope["third"] == math.sin(math.exp(math.e))


def test_what_a_branch_and_the_rest_need_is_computed_once() -> None:
    """The load behind a play is stepped on in a loop: once in each function, though friction asks for it at rest."""
    friction = get_target("c").write(joint("backlash")).decode().split("_friction(joint_effects")[-1].split("_init")[0]
    assert friction.count("for (int") == 2  # its steps, and the parts of one in which the contact begins or ends


def test_instants_that_are_asked_for_after_each_other_are_each_solved_once() -> None:
    """Not once for each case of those before: a load may touch either flank at three instants, and leave at one."""
    friction = get_target("c").write(joint("backlash")).decode().split("_friction(joint_effects")[-1].split("_init")[0]
    assert 2 * 3 + 1 <= friction.count("sqrt(") <= 2 * (2 * 3 + 1)  # a root has two forms, by the sign of the rate
