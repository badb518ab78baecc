"""What studies write between the marks of a page, and the rows of real machines with a learnt law."""

import json

import pytest

from bench.learn import PAGE
from bench.learn_machines import CASES, ask, table
from bench.machines import PAGE as MACHINES
from bench.machines_cases import RECORDED
from bench.marked import put
from bench.plan_page import PAGE as PLAN


def test_a_part_of_the_page_is_written_and_the_rest_stays(tmp_path):
    page = tmp_path / "learn.md"
    page.write_text(
        "# A\n\n<!-- rig -->\n\nold\n\n<!-- end of rig -->\n\nB\n\n<!-- machines -->\n<!-- end of machines -->\n"
    )
    for _ in range(2):
        put(page, "rig", ["new", "lines"])
    wanted = (
        "# A\n\n<!-- rig -->\n\nnew\nlines\n\n<!-- end of rig -->\n\nB\n\n<!-- machines -->\n<!-- end of machines -->\n"
    )
    assert page.read_text() == wanted


@pytest.mark.parametrize(("page", "part"), [(PAGE, "rig"), (PAGE, "machines"), (MACHINES, "machines"), (PLAN, "rig")])
def test_the_page_has_a_place_for_every_part(page, part):
    text = page.read_text(encoding="utf-8")
    assert text.count(f"<!-- {part} -->") == text.count(f"<!-- end of {part} -->") == 1


def test_a_machine_without_a_law_has_one_error_and_the_reason():
    rows = [
        {"name": "a", "said": "learnt: x | y", "learnt": "curve", "before": 2.0, "after": 1.0, "unit": "N"},
        {"name": "b", "said": "nothing", "learnt": "", "before": 0.5, "after": None, "unit": ""},
    ]
    assert table(rows)[2:] == ["| a | 2 N | 1 N | learnt: x / y |", "| b | 0.5 | - | nothing |"]
    assert all(set(case.logs).isdisjoint(unseen) for case, unseen in CASES)


def test_a_row_is_called_by_the_logs_that_it_uses():
    whole = {case.name: case.logs for case in RECORDED}
    assert [case.name for case, _ in CASES if whole.get(case.name, case.logs) != case.logs] == []


class Failing:
    """An engine whose `compare` fails once a law was learnt."""

    def run(self, *words, cwd):
        if words[0] == "compare":
            return {"code": 2, "out": "", "err": "dsd: error: a | b\nno force"}
        found = {"ladder": [{"kind": "learnt", "effect": "curve"}], "stopped": "learnt: x", "unit": "N"}
        return {"code": 0, "out": json.dumps(found), "err": ""}


def test_a_comparison_that_failed_is_said_in_its_row(tmp_path, monkeypatch):
    monkeypatch.setenv("DSD_RECORDINGS", str(tmp_path))
    case, unseen = next((case, unseen) for case, unseen in CASES if unseen)
    for log in (*case.logs, *unseen):
        (tmp_path / log).parent.mkdir(exist_ok=True)
        (tmp_path / log).touch()
    row = {"name": "a"} | ask(case, unseen, Failing())
    said = "failed: dsd: error: a / b no force"
    assert table([row])[2:] == [f"| a | {said} | {said} | learnt: x |"]
