"""A diagnosis as a sentence, as JSON, as a table and as a picture."""

import io
import json
from dataclasses import replace

import numpy as np
import pytest

from dsd_cli.identify.results import Candidate
from dsd_cli.plant.model import ObserverSettings
from dsd_cli.report.diagnosis import DiagnosisReport, percent, print_table, to_json, verdict_line
from dsd_cli.report.plots_diagnosis import draw, residual_view
from tests.report.examples import DIAGNOSIS, FRICTION, GIVEN, NAN, NOTHING, OBSERVER, RANKING, UNKNOWN, recording

REPORT = DiagnosisReport(DIAGNOSIS, GIVEN, ("b.csv",), {"gap": 3})


def shown(report: DiagnosisReport, brief: bool = False) -> str:
    out = io.StringIO()
    print_table(report, out, brief)
    return out.getvalue()


def test_the_verdict_is_one_sentence() -> None:
    assert verdict_line(DIAGNOSIS) == (
        "coulomb_friction is missing: level 0.52 +- 0.03 u, probability 97 %; the held-out error falls from 0.402 to"
        " 0.113; this log cannot tell it from load_friction"
    )
    assert verdict_line(NOTHING) == "nothing is missing (probability 93 %): the held-out error 0.113 is noise"
    assert verdict_line(UNKNOWN) == (
        "something is missing that no effect of the catalogue explains; it depends on velocity and position"
        " (probability 80 %)"
    )
    assert "depends" not in verdict_line(replace(UNKNOWN, depends_on=()))


def test_a_wrong_inertia_is_not_missing_but_wrong() -> None:
    wrong = replace(DIAGNOSIS, verdict="inertia", ranking=RANKING[3:])
    assert verdict_line(wrong, GIVEN).startswith("inertia 1 of [model] is wrong: 1.10 +- 0.10 kg m2, probability 97 %")
    assert "[model]" in shown(DiagnosisReport(wrong, GIVEN))


@pytest.mark.parametrize(
    ("share", "text"), [(0.0, "< 1 %"), (1e-9, "< 1 %"), (0.5, "50 %"), (0.994, "99 %"), (1.0, "> 99 %"), (NAN, "-")]
)
def test_no_probability_is_0_or_100_percent(share: float, text: str) -> None:
    assert percent(share) == text


def test_json_has_the_keys_of_the_contract_and_no_nan() -> None:
    result = json.loads(json.dumps(to_json(REPORT), allow_nan=False))
    assert (result["schema_version"], result["command"], result["log"]) == (1, "diagnose", "a.csv")
    assert (result["verdict"], result["probability"], result["rmse"]) == ("coulomb_friction", 0.97, 0.38)
    assert (result["samples"], result["noise"], result["warnings"]) == (4000, 0.1, ["the log is short"])
    assert result["ceiling"] == {"heldout_rmse": 0.108, "on": ["velocity", "position"]}
    assert result["dropped"] == [{"reason": "gap", "count": 3}]
    assert result["estimates"]["inertia"]["value"] == 1.02
    first, *_, last = result["ranking"]
    assert first == {
        "effect": "coulomb_friction",
        "rmse_after": 0.95 * 0.113,
        "heldout_rmse_before": 0.402,
        "heldout_rmse_after": 0.113,
        "probability": 0.97,
        "parameters": {"level": {"value": 0.52, "std_error": 0.03, "unit": "u", "at_bound": False}},
        "indistinguishable_from": ["load_friction"],
    }
    assert last["not_testable"] == "the log has no position [yet]"
    assert (last["rmse_after"], last["probability"]) == (None, None)
    assert result["ranking"][1]["note"] == "velocity stands on its bound"
    assert to_json(DiagnosisReport(replace(NOTHING, logs=("a", "b"))))["log"] == ["a", "b"]
    json.dumps(to_json(DiagnosisReport(replace(NOTHING, probability=NAN))), allow_nan=False)


def test_the_table_says_all_there_is_to_say() -> None:
    text = shown(REPORT)
    assert text.splitlines()[0] == verdict_line(DIAGNOSIS)
    for part in (
        "held out b.csv",
        "72 %",
        "level 0.52 +- 0.03 u",
        "(at its bound)",
        "rises 2.0 %",
        "not to be told from load_friction",
        "inertia 1.020 +- 0.002 kg m2",
        "velocity and position reaches 0.108",
        "velocity reconstructed from u and d_hat",
        "not testable: gravity: the log has no position [yet]",
        "gap 3",
        "-> `dsd add a.csv coulomb_friction` takes it in",
    ):
        assert part in text
    assert "u logged" not in text
    assert "\x1b" not in text


def test_a_long_ranking_is_cut_on_the_screen_only() -> None:
    many = replace(DIAGNOSIS, ranking=tuple(replace(RANKING[0], effect=f"e{i:02}") for i in range(20)))
    text = shown(DiagnosisReport(many))
    assert "e11" in text
    assert "e12" not in text
    assert "and 8 more candidates" in text
    assert len(to_json(DiagnosisReport(many))["ranking"]) == 20
    brief = shown(DiagnosisReport(DIAGNOSIS), brief=True)
    assert "ceiling" not in brief
    assert "coulomb_friction" in brief


def test_the_residual_is_that_without_the_effect_and_the_effect_explains_it() -> None:
    view = residual_view(DIAGNOSIS, GIVEN, [recording(), recording()], ObserverSettings(1.0, 0.005, sign=-1))
    assert (view.on, view.effect) == ("velocity", "coulomb_friction")
    assert len(view.x) == len(view.residual) == 2 * (4000 - 35)
    np.testing.assert_allclose(np.abs(view.residual[view.x < -1.0]).mean(), 0.51, atol=0.02)
    assert np.std(view.residual - view.explained) < 0.11


def test_without_a_winner_the_residual_is_against_what_it_depends_on() -> None:
    unnamed = residual_view(UNKNOWN, GIVEN, [recording()], OBSERVER)
    assert (unnamed.on, unnamed.effect, unnamed.explained) == ("velocity", "", None)
    assert residual_view(replace(UNKNOWN, depends_on=("time",)), GIVEN, [recording()], OBSERVER).on == "t"
    assert residual_view(NOTHING, GIVEN, [recording()], OBSERVER).on == "t"
    named = replace(DIAGNOSIS, verdict="inertia", ranking=(replace(RANKING[3], model=FRICTION),))
    view = residual_view(named, GIVEN, [recording()], OBSERVER)
    assert view.on == "u"
    assert np.corrcoef(view.x, view.explained)[0, 1] ** 2 > 0.9


@pytest.mark.parametrize("result", [DIAGNOSIS, NOTHING, UNKNOWN, replace(NOTHING, ranking=())])
def test_the_picture_is_a_png(result: object) -> None:
    content = draw(DiagnosisReport(result, GIVEN), residual_view(result, GIVEN, [recording()], OBSERVER))
    assert content.startswith(b"\x89PNG")


def test_a_picture_of_an_axis_at_rest_is_drawn() -> None:
    view = replace(residual_view(DIAGNOSIS, GIVEN, [recording()], OBSERVER), x=np.zeros(3965))
    one = Candidate("coulomb_friction", 0.1, NAN, 0.1, NAN, {})
    assert draw(DiagnosisReport(replace(DIAGNOSIS, ranking=(one,))), view).startswith(b"\x89PNG")
