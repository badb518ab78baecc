"""A diagnosis as a sentence, as JSON, as a table and as a picture."""

import io
import json
from dataclasses import replace

import numpy as np
import pytest

from dsd_cli.errors import DataError
from dsd_cli.files.config import parse_config
from dsd_cli.identify.results import Candidate, Estimate, Missing, Unexplained
from dsd_cli.report.diagnosis import DiagnosisReport, print_table, to_json
from dsd_cli.report.figure import rendered
from dsd_cli.report.in_units import in_units
from dsd_cli.report.names import moves, percent
from dsd_cli.report.plots_diagnosis import draw
from dsd_cli.report.verdict import advice_of, once_late, verdict_line
from dsd_cli.report.views_diagnosis import residual_views
from dsd_cli.signals.units import PER_UNIT, Units
from tests.report.examples import DIAGNOSIS, GIVEN, LEVEL, NAN, NOTHING, RANKING, UNKNOWN, recording

REPORT = DiagnosisReport(DIAGNOSIS, GIVEN, ("b.csv",), {"gap": 3})


def shown(report: DiagnosisReport, brief: bool = False) -> str:
    out = io.StringIO()
    print_table(report, out, brief)
    return out.getvalue()


def test_the_verdict_is_one_sentence() -> None:
    assert verdict_line(DIAGNOSIS) == (
        "coulomb_friction is missing: level 0.52 +- 0.03 u, probability 97 %; the held-out force error below 31.4 Hz"
        " falls from 0.402 to 0.113 (unit of u); from this log it is indistinguishable from load_friction"
    )
    assert verdict_line(NOTHING) == (
        "nothing is missing (probability 93 %): the held-out force error below 31.4 Hz, 0.113 (unit of u), is noise"
    )
    assert verdict_line(replace(NOTHING, probability=0.43)) == (
        "perhaps nothing is missing (probability 43 %): the held-out force error below 31.4 Hz, 0.113 (unit of u),"
        " may be noise"
    )
    assert verdict_line(replace(NOTHING, at_stops=True)) == (
        "nothing is missing (probability 93 %), as far as this log shows: most of what the fit leaves is from stops and"
        " creeping, where a missing effect would not show; the held-out force error below 31.4 Hz is 0.113 (unit of u)"
    )
    assert "the held-out force error falls" in verdict_line(replace(DIAGNOSIS, band_hz=NAN))
    assert verdict_line(UNKNOWN) == (
        "something is missing that no effect of the catalogue explains; it depends on velocity and position"
        " (probability 80 %): the held-out force error below 31.4 Hz is 0.113 (unit of u)"
    )
    assert "depends" not in verdict_line(replace(UNKNOWN, depends_on=()))


def test_what_comes_nearest_to_the_unknown_is_said_with_how_little_it_is_believed() -> None:
    """The headline was "constant_load may be missing, probability 1 %" of a log that misses something, 89 %."""
    doubted = replace(UNKNOWN, nearest="stribeck_friction", found=("stribeck_friction",))
    assert verdict_line(doubted) == verdict_line(UNKNOWN) + "; nearest in the catalogue: stribeck_friction, 1 %"
    assert "comes nearest (60 % less), but not in all parts" in verdict_line(replace(doubted, found=()))


def test_a_wrong_value_is_said_before_what_is_unknown() -> None:
    late = replace(RANKING[3], effect="delay", parameters={"delay": Estimate(0.0142, 0.003, "s")}, probability=0.89)
    late = replace(late, indistinguishable_from=("actuator_lag",), heldout_rmse_after=0.12)
    wrong = replace(UNKNOWN, missing=(Missing("delay", 0.89),), ranking=(late, *RANKING))
    assert verdict_line(wrong, GIVEN) == (
        "delay 0.01 of [model] is wrong: 0.0142 s, probability 89 %, and the held-out force error below 31.4 Hz falls"
        " from 0.402 to 0.12 (unit of u), indistinguishable from actuator_lag; besides, " + verdict_line(UNKNOWN)
    )
    assert "fits all values of the model again" in advice_of(wrong)[0]


def test_a_name_for_one_of_the_set_that_it_cannot_be_told_from_is_that_one() -> None:
    """The sentence was "gravity is missing, and so are stiffness and coulomb_friction": one too many."""
    values = {"stiffness.coefficient": Estimate(0.6, 0.006, "{u}"), "coulomb_friction.level": LEVEL}
    named = replace(RANKING[0], effect="gravity", indistinguishable_from=("stiffness",))
    found = replace(DIAGNOSIS, verdict="gravity", ranking=(named, *RANKING), whole_values=values)
    line = verdict_line(replace(found, found=("stiffness", "coulomb_friction"), whole_heldout_rmse=0.1))
    assert line.startswith("gravity or stiffness is missing: stiffness.coefficient 0.600 +- 0.006 u, probability")
    assert "and so is coulomb_friction;" in line
    assert line.endswith("indistinguishable from stiffness")


ONE_CHANNEL = {"u": "logged", "d_hat": "computed from velocity", "position": "integrated from velocity"}
BY_POSITION = {"u": "logged", "d_hat": "computed from position", "velocity": "from position", "position": "logged"}


@pytest.mark.parametrize(("channels", "only"), [(ONE_CHANNEL, "velocity"), (BY_POSITION, "position")])
def test_what_makes_u_late_may_be_of_the_only_motion_channel(channels: dict[str, str], only: str) -> None:
    late = replace(DIAGNOSIS.ranking[0], effect="delay", indistinguishable_from=("actuator_lag",))
    found = replace(DIAGNOSIS, verdict="delay", ranking=(late,), found=(), provenance=channels)
    said = (
        f"; or the measured {only} is filtered or late by as much as that (delay or actuator_lag): u and one motion"
        " channel cannot show which"
    )
    assert verdict_line(found).endswith("indistinguishable from actuator_lag" + said)
    both = {**channels, "velocity": "logged", "position": "logged"}
    assert "filtered" not in verdict_line(replace(found, provenance=both))
    beside = replace(DIAGNOSIS, found=("coulomb_friction", "actuator_lag"), provenance=channels)
    assert verdict_line(beside).endswith("(actuator_lag): u and one motion channel cannot show which")
    assert "filtered" not in verdict_line(replace(DIAGNOSIS, provenance=channels)), "friction makes nothing late"
    settled = f"is u late, or the measured {only}? log "
    for one in (found, beside):
        assert to_json(DiagnosisReport(one, GIVEN))["advice"][0].startswith(settled)
        assert f"-> {settled}" in shown(DiagnosisReport(one, GIVEN))
    for one in (replace(found, provenance=both), replace(DIAGNOSIS, provenance=channels)):
        assert to_json(DiagnosisReport(one, GIVEN))["advice"] == list(DIAGNOSIS.advice)


def test_where_an_axis_is_all_friction_a_dead_zone_of_volts_looks_like_coulomb_friction() -> None:
    volts, forces = Units("V"), Units("N m")
    creeping = replace(DIAGNOSIS, inverse=True, units=volts)
    assert "or a dead zone of the drive" in to_json(DiagnosisReport(creeping, GIVEN))["advice"][0]
    for one in (replace(creeping, units=forces), replace(creeping, inverse=False)):
        assert not any("dead zone" in said for said in to_json(DiagnosisReport(one, GIVEN))["advice"])


def test_a_doubtful_name_has_the_likelier_force_without_one_beside_it() -> None:
    doubtful = replace(DIAGNOSIS, probability=0.27, unexplained=Unexplained(0.1, 0.9, ("position",)))
    assert (
        "coulomb_friction may be missing: level 0.52 +- 0.03 u, probability 27 %, less than of a force over position"
        " that no effect of the catalogue describes, 90 %; the held-out"
    ) in verdict_line(doubtful)
    sure = replace(doubtful, probability=0.8)
    for other in (sure, replace(doubtful, unexplained=Unexplained(0.01, 0.1))):
        assert "less than of" not in verdict_line(other)


SEVERAL = replace(
    DIAGNOSIS,
    ranking=tuple(replace(c, probability=0.96) if c.effect == "viscous_asymmetry" else c for c in RANKING),
    found=("coulomb_friction", "viscous_asymmetry"),
    whole_values={
        "inertia": Estimate(1.0, 0.001, "kg m2"),
        "coulomb_friction.level": Estimate(0.4, 0.001, "{u}"),
        "viscous_asymmetry.coefficient": Estimate(0.2, 0.002, "{u}"),
    },
    whole_heldout_rmse=0.021,
)


def test_of_several_the_values_are_those_of_the_joint_fit() -> None:
    """Alone, friction takes 0.52, for what else is missing bends it; the standard error of that ignores the bias."""
    assert verdict_line(SEVERAL).startswith(
        "coulomb_friction is missing: level 0.4000 +- 0.0010 u, probability 97 %, and so is viscous_asymmetry;"
        " the held-out force error below 31.4 Hz falls from 0.402 to 0.021 with all of these in the model (unit of u);"
        " with coulomb_friction alone it falls from 0.402 to 0.113"
    )
    text = shown(DiagnosisReport(SEVERAL, GIVEN))
    ranking, together = text.split("found together:")
    assert "level 0.52 u" in ranking
    assert "+-" not in ranking.splitlines()[0].split("probability")[1]
    assert " +- " not in ranking.split("one effect more")[1].replace("without +-", "")
    assert "level 0.4000 +- 0.0010 u" in together
    first = to_json(DiagnosisReport(SEVERAL, GIVEN))
    assert first["found_heldout_rmse"] == 0.021
    assert first["found_values"]["coulomb_friction.level"]["std_error"] == 0.001
    assert first["ranking"][0]["parameters"]["level"] == {
        "value": 0.52,
        "std_error": None,
        "unit": "u",
        "at_bound": False,
    }


def test_lines_of_one_kind_that_are_rather_not_there_are_not_said_to_be() -> None:
    """Of several the ranking has the first alone."""
    lines = [Missing("cogging", 0.7), Missing("cogging_2", 0.6), Missing("cogging_3", 0.03)]
    found = (*SEVERAL.found, *(one.effect for one in lines))
    several = replace(SEVERAL, found=found, missing=(Missing("coulomb_friction", 0.97), *lines))
    said = verdict_line(several)
    assert ", and so are viscous_asymmetry, cogging and cogging_2;" in said
    assert "cogging_3" not in said


def test_others_of_the_set_that_may_be_missing_are_said_with_how_sure_they_are() -> None:
    """Backlash of 40 % of u, at 44 %, stood in the list of what was found, and not in the sentence."""
    found = (*SEVERAL.found, "backlash", "cogging")
    several = replace(SEVERAL, found=found, missing=(Missing("backlash", 0.44), Missing("cogging", 0.04)))
    said = verdict_line(several)
    assert ", and so is viscous_asymmetry, and perhaps backlash (44 %); the held-out" in said
    assert "cogging" not in said
    alone = verdict_line(replace(several, found=("coulomb_friction", "backlash")))
    assert "probability 97 %, and perhaps backlash (44 %); the held-out" in alone


def test_a_likely_force_is_missing_even_where_its_name_depends_on_an_open_unit() -> None:
    """ "gravity may be missing ... probability 98 %": the doubt is about the name, and stands apart."""
    gravity = replace(DIAGNOSIS.ranking[0], effect="gravity", indistinguishable_from=())
    likely = replace(DIAGNOSIS, verdict="gravity", ranking=(gravity,), found=(), units=Units(assumed=True))
    line = verdict_line(likely)
    assert line.startswith("gravity is missing: ")
    assert "which nothing says" in line
    assert verdict_line(replace(likely, probability=0.4)).startswith("gravity may be missing: ")


LATE = "a.csv: u is 18 ms later than the motion it causes: signals.u_shift = -0.018 (dsd check says more)"


@pytest.mark.parametrize(
    "found", ["u is later than the motion that it causes, by about 26 ms", "u is smoothed by about 24"]
)
def test_that_u_is_late_is_said_once_with_one_number(found: str) -> None:
    assert once_late([LATE, "a.csv: short"], [found, "other"]) == ("a.csv: short", found, "other")
    assert once_late([LATE], ["other"]) == (LATE, "other")


@pytest.mark.parametrize(
    ("column", "unit", "advised"),
    [
        ("torque", "", False), ("tau", "", False), ("force_cmd", "", False), ("motor_trq", "", False),
        ("u", "", True), ("torque_current", "", True), ("iq", "", True), ("torque", "A", True), ("iq", "N m", False),
    ],
)  # fmt: skip
def test_what_a_gain_does_is_no_advice_where_u_is_called_a_torque_or_a_force(column, unit, advised) -> None:
    units = parse_config(f'[signals]\nu = "{column}"\nu_unit = "{unit}"\n').signals.units
    advice = in_units(replace(DIAGNOSIS, advice=(PER_UNIT, "more")), units).advice
    assert (PER_UNIT in advice) is advised
    assert "more" in advice


def test_words_do_not_contradict_their_probability() -> None:
    """A set that is hardly believed: no "yes, 3 %", no "is missing" of what rather is not."""
    doubted = replace(RANKING[0], probability=0.03, indistinguishable_from=())
    result = replace(SEVERAL, probability=0.03, ranking=(doubted, *RANKING[1:]))
    line = verdict_line(result)
    assert line.startswith("coulomb_friction may be missing: level 0.4000 +- 0.0010 u, probability 3 %; the held-out")
    assert "and so" not in line
    wrong = replace(result, verdict="inertia", ranking=(replace(RANKING[3], probability=0.2),))
    assert verdict_line(wrong, GIVEN).startswith("inertia 1 of [model] may be wrong: ")
    text = shown(DiagnosisReport(result, GIVEN))
    assert "yes" not in text
    assert "yes, 97 %" in shown(DiagnosisReport(SEVERAL, GIVEN))
    tied = replace(result, ranking=(replace(doubted, indistinguishable_from=("load_friction",)), *RANKING[1:]))
    assert verdict_line(tied).startswith("coulomb_friction may be missing")


def test_beside_something_unknown_no_candidate_has_a_standard_error() -> None:
    assert "+-" not in shown(DiagnosisReport(replace(UNKNOWN, estimates={}), GIVEN))


def test_a_rise_is_never_called_a_fall() -> None:
    worse = replace(RANKING[0], heldout_rmse_before=9.46, heldout_rmse_after=12.0)
    line = verdict_line(replace(DIAGNOSIS, ranking=(worse,)))
    assert "rises from 9.46 to 12 (unit of u)" in line
    assert "falls" not in line
    refitted = replace(DIAGNOSIS.refitted, heldout_rmse=9.46)
    together = verdict_line(replace(SEVERAL, ranking=(worse,), refitted=refitted, whole_heldout_rmse=0.5))
    assert (
        "falls from 9.46 to 0.5 with all of these in the model (unit of u); with coulomb_friction alone it rises"
        " from 9.46 to 12" in together
    )
    assert moves(0.1131, 0.1132) == "stays at 0.113"
    assert moves(NAN, 0.1) == "goes from - to 0.1"


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
    assert (result["schema_version"], result["command"], result["log"]) == (1, "diagnose", ["a.csv"])
    assert (result["verdict"], result["probability"], result["rmse"]) == ("coulomb_friction", 0.97, 0.38)
    assert (result["samples"], result["noise"], result["warnings"]) == (4000, 0.1, ["the log is short"])
    assert (result["unit"], result["band_hz"], result["floor"]) == ("unit of u", 31.4, 0.02)
    assert result["found"] == ["coulomb_friction", "gravity"]
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
        "in_final_set": True,
        "parameters": {"level": {"value": 0.52, "std_error": 0.03, "unit": "u", "at_bound": False}},
        "indistinguishable_from": ["load_friction"],
    }
    assert last["not_testable"] == "the log has no position [yet]"
    assert (last["rmse_after"], last["probability"]) == (None, None)
    assert result["ranking"][1]["note"] == "velocity stands on its bound"
    assert to_json(DiagnosisReport(replace(NOTHING, logs=("a", "b"))))["log"] == ["a", "b"]
    nobody_knows = json.loads(
        json.dumps(to_json(DiagnosisReport(replace(NOTHING, probability=NAN, band_hz=NAN, floor=NAN))), allow_nan=False)
    )
    assert (nobody_knows["band_hz"], nobody_knows["floor"], nobody_knows["found"]) == (None, None, [])


def test_the_table_says_all_there_is_to_say() -> None:
    text = shown(REPORT)
    assert text.splitlines()[0] == verdict_line(DIAGNOSIS)
    for part in (
        "held out b.csv",
        "the model as given leaves a force error below 31.4 Hz of 0.38 (unit of u, rms)",
        "held-out force error below 31.4 Hz with one effect more (without: 0.402)",
        "found together: coulomb_friction and gravity",
        "floor: 0.02 (what the noise of the sensor alone would leave in the band)",
        "72 %",
        "level 0.52 +- 0.03 u",
        "(at its bound)",
        "rises 2.0 %",
        "indistinguishable from load_friction",
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


def test_the_residual_is_the_force_that_is_missing_and_the_effect_explains_it() -> None:
    """Where the axis is fast, 0.52 of friction against it is missing; with it, noise of 0.3 below the band's end."""
    view = residual_views(DIAGNOSIS, GIVEN, [recording(), recording()])[0]
    assert (view.on, view.effect) == ("velocity", "coulomb_friction")
    for side in (-1.0, 1.0):
        fast = side * view.x > 2.0
        np.testing.assert_allclose(view.residual[fast].mean(), -side * 0.52, atol=0.02)
        np.testing.assert_allclose(view.explained[fast].mean(), -side * 0.52, atol=0.01)
    fast = np.abs(view.x) > 2.0
    alone = residual_views(DIAGNOSIS, GIVEN, [recording()])[0]
    assert len(view.residual) == 2 * len(alone.residual) == len(view.x) == len(view.explained)
    left = (view.residual - view.explained)[fast]
    assert 0.05 < np.std(left) < 0.3
    assert np.corrcoef(left, view.explained[fast])[0, 1] ** 2 < 0.02


def test_without_a_winner_the_residual_is_against_what_it_depends_on() -> None:
    unnamed = residual_views(UNKNOWN, GIVEN, [recording()])[0]
    assert (unnamed.on, unnamed.effect, unnamed.explained) == ("velocity", "", None)
    assert residual_views(replace(UNKNOWN, depends_on=("time",)), GIVEN, [recording()])[0].on == "t"
    assert residual_views(NOTHING, GIVEN, [recording()])[0].on == "t"
    heavier = GIVEN.changed(inertia=1.3)
    named = replace(DIAGNOSIS, verdict="inertia", ranking=(replace(RANKING[3], model=heavier),))
    view = residual_views(named, GIVEN, [recording()])[0]
    assert view.on == "u"
    assert np.corrcoef(view.x, view.explained)[0, 1] < -0.99  # -0.3 a, and u is a but for friction


def test_a_log_too_short_for_a_picture_is_one_line() -> None:
    whole = recording()
    piece = whole.pieces[0]
    short = replace(piece, channels={name: x[:60] for name, x in piece.channels.items()})
    with pytest.raises(DataError, match="too short for a picture"):
        residual_views(DIAGNOSIS, GIVEN, [replace(whole, pieces=(short,))])[0]


@pytest.mark.parametrize("result", [DIAGNOSIS, NOTHING, UNKNOWN, replace(NOTHING, ranking=())])
def test_the_picture_is_a_png(result: object) -> None:
    views = residual_views(result, GIVEN, [recording()])
    content = rendered(lambda: draw(DiagnosisReport(result, GIVEN), views), ".png")
    assert content.startswith(b"\x89PNG")


def test_a_picture_of_an_axis_at_rest_is_drawn() -> None:
    view = residual_views(DIAGNOSIS, GIVEN, [recording()])[0]
    view = replace(view, x=np.zeros(len(view.x)))
    one = Candidate("coulomb_friction", 0.1, NAN, 0.1, NAN, {})
    report = DiagnosisReport(replace(DIAGNOSIS, ranking=(one,)))
    assert rendered(lambda: draw(report, [view]), ".png").startswith(b"\x89PNG")


def test_effects_that_are_not_testable_for_one_reason_are_one_line() -> None:
    last = DIAGNOSIS.ranking[-1]
    twice = replace(DIAGNOSIS, ranking=(*DIAGNOSIS.ranking, replace(last, effect="cogging")))
    assert "not testable: gravity, cogging: the log has no position [yet]" in shown(DiagnosisReport(twice))


def test_a_candidate_beside_what_is_missing_has_no_error() -> None:
    """Weight beside friction that the model lacks was "0.049 +- 0.009", of an axis that has none."""
    found = replace(DIAGNOSIS, found=("coulomb_friction",))
    errors = {one.effect: [e.std_error for e in found.alone(one).values()] for one in RANKING}
    assert errors["coulomb_friction"] == [0.03]
    assert errors["inertia"] == [0.1]
    assert all(map(np.isnan, [*errors["stribeck_friction"], *errors["viscous_asymmetry"]]))
    tied = replace(RANKING[2], indistinguishable_from=("coulomb_friction",))
    assert [e.std_error for e in found.alone(tied).values()] == [2e-6]
    assert [e.std_error for e in NOTHING.alone(RANKING[2]).values()] == [2e-6]
    out = io.StringIO()
    print_table(replace(REPORT, result=found), out)
    assert "values: of each effect alone; where what is missing biases them without +-" in out.getvalue()
