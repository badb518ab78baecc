"""A log that says nothing of the inertia: what its verdict is worth, and how large a value it is to be known to."""

from dataclasses import replace
from types import SimpleNamespace

import pytest

from dsd_cli.cli.plan_loop import left_open
from dsd_cli.design.explanations import explanation_of, values_of
from dsd_cli.design.targets import nobody_knows
from dsd_cli.identify.fit.problem import pose
from dsd_cli.identify.recordings.recording import prepare
from dsd_cli.identify.results import INERTIA, NONE, Diagnosis, Estimate, Unexplained
from dsd_cli.identify.search.sets import Search
from dsd_cli.identify.verdict.diagnose import Settings
from dsd_cli.plant.model import ObserverSettings, PlantModel
from dsd_cli.signals.log import Log
from tests.oracle.rig_cases import RigCase
from tests.oracle.rig_given import follow, poor_reference
from tests.oracle.rig_trials import find_trial


def test_a_value_is_to_be_small_against_what_the_plant_has() -> None:
    """A twelfth of the usual motion, most of it within counts: the fit has an inertia of next to nothing, which no
    motion identifies to a tenth of itself. The rig's machine has 0.00136, and so its owner believes."""
    case = RigCase(what=("gravity",), seed=831040, sensing="enc4096", duration=10.0)
    trial = find_trial(case)
    log, _ = follow(case, trial, *poor_reference(trial, "small", 8.0))
    base = {name: values for name, values in trial.machine.effects.items() if name in trial.base}
    model = PlantModel(trial.beliefs["inertia"], trial.beliefs["delay"], base)
    recording = prepare(Log(log, case.sample_time, "log"), ObserverSettings(trial.design.inertia, 0.01))
    search = Search(pose([recording], model, Settings()))
    estimate = search.values(search.refit).estimates[INERTIA]
    assert estimate.grade == "not"
    assert estimate.value < 0.1 * trial.design.inertia
    told = {v.name: v for v in values_of(search, explanation_of(search, NONE, search.refit, False, ()), None)}
    assert told[INERTIA].size == pytest.approx(trial.design.inertia)


def said(verdict: str, grade: str) -> Diagnosis:
    """That a value is wrong, or nothing is missing."""
    known = {INERTIA: replace(Estimate(1e-6, 1e-3, ""), grade=grade)}
    few = {"verdict": verdict, "found": (), "ranking": (), "whole_values": {}, "estimates": known}
    return SimpleNamespace(**few, probability=0.6, unexplained=Unexplained(0.01, 0.3))  # type: ignore[return-value]


@pytest.mark.parametrize(("grade", "known"), [("not", False), ("weak", True), ("identified", True)])
def test_a_verdict_about_a_value_of_which_the_logs_say_nothing_is_none(grade: str, known: bool) -> None:
    assert nobody_knows(said(INERTIA, grade)) is not known


@pytest.mark.parametrize(("grade", "still"), [("not", ("inertia",)), ("identified", ())])
def test_no_loop_ends_while_nothing_is_missing_in_logs_that_do_not_show_the_inertia(
    grade: str, still: tuple[str, ...]
) -> None:
    """It ended after the first motion: "none, left open: nothing", where the second named the rig's gravity."""
    assert left_open(said(NONE, grade)) == still
