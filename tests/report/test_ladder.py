"""Additions, ladders and histories as JSON, as tables and as a picture."""

import io
import json
from dataclasses import replace
from functools import partial

import pytest
from rich.console import Console

from dsd_cli.identify.compare.balance import Force
from dsd_cli.identify.results import Estimate, Missing, Score, Step, Unexplained
from dsd_cli.report.addition import AdditionReport, add_json, print_addition
from dsd_cli.report.diagnosis import named, plain_table
from dsd_cli.report.figure import rendered
from dsd_cli.report.history import history_json, print_history
from dsd_cli.report.ladder import (
    BAR,
    LadderReport,
    bar,
    final_line,
    improve_json,
    own,
    print_ladder,
    step_line,
)
from dsd_cli.report.plots_ladder import draw
from dsd_cli.report.two_numbers import two_answers
from tests.report.examples import ADDITION, DIAGNOSIS, ESTIMATES, GIVEN, INERTIA, LADDER, NAN, NOTHING, STEPS, UNKNOWN

REPORT = LadderReport(LADDER, ("a.csv",), "better.toml", {"gap": 2}, ("a.csv: odd",))
ADDED = AdditionReport(ADDITION, ("a.csv",), (), "better.toml", Force(0.38, 61.0, 12.0, 31.4, 0.02))
HISTORY = [
    {
        "effect": "coulomb_friction",
        "date": "2026-01-31T12:00:00Z",
        "logs": ["a [1].csv"],
        "heldout_rmse_before": 0.4,
        "heldout_rmse_after": 0.1,
        "values": {"level": 0.52, "events": [{"start": 1}]},
        "std_errors": {"level": 0.03},
    },
    {"effect": "refit", "date": "2026-02-01T12:00:00Z"},
]


class Ascii(io.StringIO):
    encoding = "ascii"


class Utf8(io.StringIO):
    encoding = "utf-8"


def test_json_has_the_keys_of_the_contract() -> None:
    result = json.loads(json.dumps(improve_json(REPORT), allow_nan=False))
    assert (result["schema_version"], result["command"], result["log"]) == (1, "improve", ["a.csv"])
    assert (result["unit"], result["band_hz"], result["floor"]) == ("unit of u", 31.4, 0.02)
    assert (result["verdict"], result["stopped"]) == ("none", "nothing significant is left")
    assert (result["config"], result["warnings"]) == ("better.toml", ["a.csv: odd", "the log is short"])
    assert [(s["step"], s["effect"], s["heldout_rmse"]) for s in result["ladder"]] == [
        (0, "as given", 0.402),
        (1, "coulomb_friction", 0.113),
        (2, "gravity", 0.054),
    ]
    assert result["ladder"][1]["rmse"] == 0.105
    assert result["ladder"][1]["fit_percent"] == 89.5
    assert result["ladder"][2]["values"]["phase"]["unit"] == "rad"
    nan = replace(LADDER, steps=(replace(STEPS[0], score=Score(NAN, NAN, NAN, NAN)),))
    assert improve_json(LadderReport(nan, ("a", "b")))["ladder"][0]["rmse"] is None


def test_a_step_owns_the_values_of_its_effect() -> None:
    assert list(own(STEPS[1])) == ["level"]
    assert list(own(STEPS[2])) == ["amplitude", "phase"]
    assert own(replace(STEPS[1], effect="inertia")) == {"inertia": INERTIA}
    assert own(replace(STEPS[1], effect="refit")) == ESTIMATES
    assert own(replace(STEPS[0], estimates=ESTIMATES)) == {}


def test_lines() -> None:
    assert step_line(STEPS[0], None) == "step 0: as given: held-out force error 0.402"
    assert step_line(STEPS[1], STEPS[0]) == (
        "step 1: coulomb_friction: held-out force error 0.113 (-72 %); level 0.52 u"
    )
    assert final_line(LADDER) == (
        "held-out force error below 31.4 Hz: 0.402 -> 0.054 unit of u (-87 %) in 2 steps; nothing is missing"
        " (probability 93 %): the held-out force error below 31.4 Hz, 0.054 (unit of u), is noise; stopped: nothing"
        " significant is left"
    )
    stopped = replace(LADDER, steps=STEPS[:1], verdict="unknown", last=UNKNOWN, stopped="")
    refitted = "in 0 steps (0.113 with the values of [model] fitted again); something is missing that no effect"
    assert refitted in final_line(stopped)


def test_a_lag_that_was_added_may_be_of_the_only_motion_channel() -> None:
    with_lag = STEPS[-1].model.changed(effects={"actuator_lag": {"time_constant": 0.02}})
    lag = replace(STEPS[-1], step=3, effect="actuator_lag", model=with_lag)
    last = replace(LADDER.last, provenance={"position": "integrated from velocity"})
    line = final_line(replace(LADDER, steps=(*STEPS, lag), last=last))
    assert "; or the measured velocity is filtered or late by as much as that (actuator_lag): " in line
    assert "filtered" not in final_line(replace(LADDER, last=last))
    taken_back = replace(STEPS[-1], step=4, effect="actuator_lag", kind="taken back")
    assert "filtered" not in final_line(replace(LADDER, steps=(*STEPS, lag, taken_back), last=last))


def test_what_was_added_is_not_called_missing() -> None:
    """Below "nothing is missing" stood "missing: coulomb_friction (99 %)"."""
    both = (Missing("coulomb_friction", 0.99), Missing("cogging", 0.7))
    last = replace(LADDER.last, unexplained=Unexplained(0.004, 0.01))
    file = Utf8()
    print_ladder(replace(REPORT, result=replace(LADDER, missing=both, last=last)), file)
    lines = file.getvalue().splitlines()
    assert "added: coulomb_friction (99 %)" in lines
    assert "missing: cogging (70 %)" in lines
    assert "unexplained: < 1 % of u (probability that more is missing: 1 %)" in lines
    doubted = (Missing("stiffness", 0.16), Missing("gravity", 0.5), Missing("coulomb_friction", 0.99))
    three = two_answers(doubted, replace(LADDER.last, missing=doubted), ("coulomb_friction",))
    assert three[:3] == [
        "added: coulomb_friction (99 %)",
        "missing: gravity (50 %)",
        "perhaps missing: stiffness (16 %)",
    ]


def test_a_part_of_u_that_is_too_small_to_count_is_no_noise_of_the_sensor() -> None:
    """0.3 % of u, twelve times the floor, was "probability that more is missing: 1 %" and no more was said; u is
    0.38 / 12 % = 3.17."""
    least = Unexplained(0.02, 0.01)  # 0.0633 of u beside a floor of 0.02: 0.0664
    left = replace(NOTHING, unexplained=least, refitted=Score(0.06, 0.065, 98.0, 2.0), ranking=DIAGNOSIS.ranking)
    lines = two_answers((), replace(left, verdict="inertia"))
    assert lines[1:] == [
        "too small to count: 0.0664 unit of u is left, of which the sensor's noise would leave 0.02; less than 3 % of u"
        " counts as what any model leaves"
    ]
    better = replace(DIAGNOSIS.ranking[0], heldout_rmse_after=0.013)
    (_, line) = two_answers((), replace(left, ranking=(better, *DIAGNOSIS.ranking[1:])))
    assert line.endswith("; coulomb_friction (level 0.52 +- 0.03 u) would take 80 % of it off")
    assert len(two_answers((), replace(left, unexplained=Unexplained(0.0078, 0.01)))) == 1, "1.6 times the floor"
    noisy = two_answers((), replace(left, floor=0.06, unexplained=Unexplained(0.02, 0.01)))
    said = "may be noise: the sensor's is measured as 0.06 unit of u, and up to 1.6 times that counts as such"
    assert noisy == ["unexplained: 2 % of u (probability that more is missing: 1 %)", said]


def test_values_beside_something_unexplained_are_said_to_be_off_by_more_than_their_errors() -> None:
    """A load that follows its own law was an inertia of 0.00509 +- 0.00007, and is 0.004."""
    said = "values: their +- count what is unexplained as noise; where an effect or J stands in for it they are off by"
    assert two_answers((), replace(DIAGNOSIS, unexplained=Unexplained(0.03, 0.82)))[1] == f"{said} more"
    assert not any("values" in line for line in two_answers((), replace(DIAGNOSIS, unexplained=Unexplained(0.03, 0.2))))


@pytest.mark.parametrize(("file", "full", "part"), [(Utf8(), "█", "▉"), (Ascii(), "#", "#")])
def test_the_ladder_has_bars_that_stdout_can_show(file: io.StringIO, full: str, part: str) -> None:
    print_ladder(REPORT, file)
    lines = file.getvalue().splitlines()
    bars = {line.strip("| ").split()[1]: line.count(full) for line in lines if f" {full}" in line or f" {part}" in line}
    assert bars == {"as": BAR, "coulomb_friction": 4 if full == "#" else 3, "gravity": 2 if full == "#" else 1}
    assert any(part in line for line in lines)
    assert full != "#" or file.getvalue().isascii()
    text = file.getvalue()
    assert max(map(len, lines[:-1])) <= 80
    assert lines[-1] == final_line(LADDER)
    for expected in (
        "held-out force error below 31.4 Hz (unit of u)",
        "72 %",
        "level 0.52 u",
        "phase 0.10 +- 0.02 rad",
        "89.5 %",
        "gap 2",
    ):
        assert expected in text


@pytest.mark.parametrize(
    ("value", "top", "encoding", "text"),
    [
        (1.0, 1.0, "ascii", "#" * BAR),
        (0.0, 1.0, "ascii", "#"),
        (0.0, 1.0, "utf-8", "▏"),
        (2.0, 1.0, "utf-8", "█" * BAR),
        (NAN, 1.0, "utf-8", ""),
        (1.0, 0.0, "utf-8", ""),
        (1.0, 1.0, "no such", "#" * BAR),
        (1.0, 1.0, "cp437", "#" * BAR),
    ],
)
def test_bars(value: float, top: float, encoding: str, text: str) -> None:
    assert bar(value, top, encoding) == text


def test_an_addition() -> None:
    result = json.loads(json.dumps(add_json(ADDED), allow_nan=False))
    assert (result["command"], result["log"], result["config"]) == ("add", ["a.csv"], "better.toml")
    assert (result["unit"], result["band_hz"], result["floor"]) == ("unit of u", 31.4, 0.02)
    assert [result[k] for k in ("rmse_before", "rmse_after", "heldout_rmse_before", "heldout_rmse_after")] == [
        0.38,
        0.105,
        0.402,
        0.113,
    ]
    level = {"value": 0.52, "std_error": None, "unit": "u", "at_bound": False}  # 0.113 is left over a floor of 0.02
    assert result["parameters"] == {"level": level}
    out = io.StringIO()
    print_addition(ADDED, out)
    first, *rest = out.getvalue().splitlines()
    assert first == "coulomb_friction added: held-out force error below 31.4 Hz: 0.402 -> 0.113 unit of u (-72 %)"
    (inertia,) = (line.split() for line in rest if line.split()[:1] == ["inertia"])
    assert inertia == ["inertia", "1.02", "-", "kg", "m2"]
    unknown = json.loads(json.dumps(add_json(replace(ADDED, force=None)), allow_nan=False))
    assert (unknown["unit"], unknown["band_hz"], unknown["floor"]) == ("unit of u", None, None)


def test_a_history() -> None:
    out = io.StringIO()
    print_history("dsd.toml", HISTORY, out)
    for part in ("2026-01-31 12:00", "0.4 -> 0.1 (-75 %)", "level 0.52\n", "from a [1].csv", "refit"):
        assert part in out.getvalue()
    empty = io.StringIO()
    print_history("a [b].toml", [], empty)
    assert empty.getvalue() == "a [b].toml: no steps yet\n"
    remembered = history_json("dsd.toml", HISTORY)
    assert (remembered["history"], remembered["log"]) == (HISTORY, [])


@pytest.mark.parametrize("steps", [1, 9])
def test_the_picture(steps: int) -> None:
    more = tuple(Step(i, "gravity", STEPS[2].score, STEPS[2].estimates, GIVEN) for i in range(3, 9))
    ladder = replace(LADDER, steps=(*STEPS, *more)[:steps])
    for name in ("a.csv", "$\\frac{$.csv", "$x$.csv", "a\x1b[2J.csv"):
        report = LadderReport(ladder, (name,))
        assert rendered(partial(draw, report), ".png").startswith(b"\x89PNG")


@pytest.mark.parametrize("width", [24, 27, 32, 80])
def test_what_has_no_room_goes_on_further_in(width: int) -> None:
    """The words of a cell in their order, none cut; what is broken off stands further in than what it is part of."""
    out = io.StringIO()
    values = {"amplitude": Estimate(0.2, 0.004, "{u}"), "phase": Estimate(0.1, 0.02, "rad")}
    table = plain_table("", "step", "error")
    table.add_row(named("gravity", values, ["a b [/x]"]), "0.402")
    Console(file=out, width=width).print(table)
    rows = [line.rstrip() for line in out.getvalue().replace("0.402", "").splitlines() if line.strip()][2:]
    assert " ".join(" ".join(rows).split()) == "gravity amplitude 0.200 +- 0.004 u phase 0.10 +- 0.02 rad a b [/x]"
    assert max(map(len, rows)) <= width
    begins = {"gravity": 2, "amplitude": 4, "phase": 4, "a": 4}
    for row in rows:
        first = row.split()[0]
        assert len(row) - len(row.lstrip()) == begins.get(first, 6), rows


def test_a_ladder_has_the_values_of_the_end() -> None:
    """Fitted before gravity was there, the level was biased by it."""
    end = {**STEPS[2].estimates, "coulomb_friction.level": Estimate(0.4, 0.001, "{u}")}
    result = replace(LADDER, values=end)
    assert improve_json(replace(REPORT, result=result))["ladder"][1]["values"]["level"]["value"] == 0.4
    out = io.StringIO()
    print_ladder(replace(REPORT, result=result), out)
    assert "level 0.4000 +- 0.0010 u" in out.getvalue()
    assert "0.52" not in out.getvalue()


@pytest.mark.parametrize(("left", "said"), [(0.113, True), (0.021, False)])
def test_an_addition_says_that_more_is_missing(left: float, said: bool) -> None:
    """The sensor alone would leave 0.02: beside what is left above that no standard error holds."""
    after = replace(ADDITION.after, heldout_rmse=left)
    added = replace(ADDED, result=replace(ADDITION, after=after))
    found = add_json(added)
    assert any("more is missing, and biases these values" in line for line in found["warnings"]) is said
    values = [*found["estimates"].values(), *found["parameters"].values()]
    assert all((one["std_error"] is None) is said for one in values if not one.get("held"))
    out = io.StringIO()
    print_addition(added, out)
    assert ("biased by what else is missing, so without +-" in out.getvalue()) is said
    assert ("0.52   0.03  u" in out.getvalue()) is not said
