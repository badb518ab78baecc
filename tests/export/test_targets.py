"""Every effect through every target: carried and equal to the simulator, or refused with a reason."""

import shutil
from dataclasses import replace

import numpy as np
import pytest

from dsd_cli.errors import UsageError
from dsd_cli.export.base import Joint, Motion, NotRun, comment, number
from dsd_cli.export.computing import ran as ran_program
from dsd_cli.export.making import cost, make, percent, verify
from dsd_cli.export.motion import built_in, simulated
from dsd_cli.export.targets import get_target, targets
from dsd_cli.plant.model import PlantModel
from tests.export.cases import EFFECTS, TOGETHER, VALUES, joint, motion

GCC = pytest.mark.skipif(shutil.which("gcc") is None, reason="no gcc")


def test_every_effect_is_a_case() -> None:
    assert set(EFFECTS) == set(VALUES)
    assert {e for several in TOGETHER for e in several} == set(EFFECTS)


@pytest.mark.parametrize("target", sorted(targets()))
@pytest.mark.parametrize("effect", EFFECTS)
def test_each_effect_is_carried_or_refused_with_a_reason(effect: str, target: str) -> None:
    found, one = get_target(target), joint(effect)
    verdict = found.judge(one, effect)
    assert verdict.how
    if not verdict.carried:
        with pytest.raises(UsageError, match=f"{target} does not carry"):
            make(found, one, motion(), drop=False)
        return
    if found.judge(one, "delay").carried:
        assert found.write(one) == found.write(one)


@pytest.mark.parametrize("effect", [e for e in EFFECTS if e not in ("saturation", "dead_zone")])
def test_the_built_in_motion_moves_reverses_and_rests(effect: str) -> None:
    one = joint(effect, delay=0.0)
    speed = simulated(one.model, built_in(one.model, 5e-3)).velocity
    assert speed.max() > 0.1
    assert speed.min() < -0.1


def test_what_is_left_out_costs_what_a_hand_computes() -> None:
    """Viscous friction alone: the force that is missing is B v."""
    one = joint("viscous_friction", delay=0.0)
    given = motion()
    found = cost(one, ["viscous_friction"], given)
    speed = simulated(one.model, given).velocity
    by_hand = 0.3 * np.sqrt(np.mean(speed**2))
    assert found.force == pytest.approx(by_hand, rel=0.01)
    assert found.force_percent == pytest.approx(100 * by_hand / np.sqrt(np.mean(given.u**2)), rel=0.01)
    assert found.velocity_percent > 1.0


def test_a_wrong_model_is_seen() -> None:
    given = motion()
    bare, full = joint("coulomb_friction"), joint("coulomb_friction", "viscous_friction")
    off = percent(simulated(bare.model, given).velocity, simulated(full.model, given).velocity)
    assert off > 5.0


def test_a_target_that_cannot_be_run_here_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", "")
    found, one = get_target("c"), joint("viscous_friction")
    checked = verify(found, make(found, one, motion(), drop=False), motion())
    assert (checked.ran, checked.rms_percent) == (False, None)
    assert checked.how == "not run: gcc is not installed"


@pytest.mark.parametrize("name", ['x"; system("id"); //', "a*/", "a\nb", "%s%n", "", "1a", "a" * 99, "é"])
def test_a_hostile_name_is_refused(name: str) -> None:
    with pytest.raises(UsageError, match="letters, digits and _"):
        Joint(PlantModel(1.0), 1e-3, name)


ENDS = ("*/", "*)", "(*", "//", '"', "'", "\\", "\n", "%", "*")


@pytest.mark.parametrize("name", ["end", "model", "Function"])
def test_a_word_of_a_language_is_no_name(name: str) -> None:
    with pytest.raises(UsageError, match="take another"):
        Joint(PlantModel(1.0), 1e-3, name)


@pytest.mark.parametrize("text", ["*/ int x;", "*) x := 1", '"""\nimport os', "a // b", "%n\\", "']); end"])
def test_a_comment_holds_nothing_that_ends_it(text: str) -> None:
    assert not [end for end in ENDS if end in comment(text)]


def test_numbers_read_back_as_the_same_double() -> None:
    for value in (0.1, 1e-300, -2.5e17, 1 / 3):
        assert float(number(value)) == value
    with pytest.raises(UsageError):
        number(float("nan"))


def test_not_run_is_no_error_of_the_export() -> None:
    assert not issubclass(NotRun, UsageError)


def test_a_slow_target_is_run_on_the_first_moves_and_says_which() -> None:
    one, target = joint("viscous_friction", "coulomb_friction", delay=0.0), replace(get_target("python"), most=200)
    u = np.concatenate([np.zeros(300), motion().u])  # 0.6 s at rest, 2 ms a sample
    found = verify(target, make(target, one, motion(), False), Motion(u, 2e-3, source="log"))
    assert found.how.startswith("log, 0.6")
    assert found.how.endswith(" of 1.4 s")
    assert len(found.u) == len(found.wanted) == 200
    assert np.ptp(found.wanted) > 0.1
    assert found.rms_percent < 1e-9


def test_a_program_that_never_ends_is_ended() -> None:
    with pytest.raises(NotRun, match=r"took longer than 0\.2 s"):
        ran_program(["sleep", "300"], longest=0.2)
