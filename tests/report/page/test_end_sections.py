"""What the end of the page says is open is of the model at the end."""

from dataclasses import replace
from types import SimpleNamespace

from dsd_cli.report.diagnosis import DiagnosisReport
from dsd_cli.report.ladder import LadderReport
from dsd_cli.report.page.end_sections import _advice, _ties
from tests.report.examples import DIAGNOSIS, GIVEN, LADDER, NOTHING, STEPS


def story(*more: object) -> SimpleNamespace:
    """A first diagnosis with a tie and an advice, and a ladder with `more` steps at its end."""
    ladder = replace(LADDER, steps=(*STEPS, *more), last=replace(NOTHING, advice=()))
    first = DiagnosisReport(DIAGNOSIS, GIVEN)
    return SimpleNamespace(
        checks=[],
        diagnosis=SimpleNamespace(value=first),
        ladder=SimpleNamespace(value=LadderReport(ladder, ("a.csv",))),
    )


def test_what_was_taken_back_is_neither_tied_nor_advised_about() -> None:
    """Below "nothing is missing" stood how to distinguish an effect that the learnt law had made needless."""
    assert [one.effect for one in _ties(story())] == ["coulomb_friction"]
    assert len(_advice(story())) == len(DIAGNOSIS.advice) == 1
    back = replace(STEPS[1], step=3, kind="taken back")
    assert _ties(story(back)) == []
    assert _advice(story(back)) == []
