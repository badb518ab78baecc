"""What the studies of `dsd learn` write into their page."""

from bench import learn_page
from bench.learn_machines import CASES, table


def test_a_part_of_the_page_is_written_and_the_rest_stays(tmp_path, monkeypatch):
    page = tmp_path / "learn.md"
    page.write_text(
        "# A\n\n<!-- rig -->\n\nold\n\n<!-- end of rig -->\n\nB\n\n<!-- machines -->\n<!-- end of machines -->\n"
    )
    monkeypatch.setattr(learn_page, "PAGE", page)
    for _ in range(2):
        learn_page.put("rig", ["new", "lines"])
    wanted = (
        "# A\n\n<!-- rig -->\n\nnew\nlines\n\n<!-- end of rig -->\n\nB\n\n<!-- machines -->\n<!-- end of machines -->\n"
    )
    assert page.read_text() == wanted


def test_the_page_has_a_place_for_every_part():
    text = learn_page.PAGE.read_text(encoding="utf-8")
    for part in ("rig", "machines"):
        assert text.count(f"<!-- {part} -->") == text.count(f"<!-- end of {part} -->") == 1


def test_a_machine_without_a_law_has_one_error_and_the_reason():
    rows = [
        {"name": "a", "said": "learnt: x | y", "learnt": "curve", "before": 2.0, "after": 1.0, "unit": "N"},
        {"name": "b", "said": "nothing", "learnt": "", "before": 0.5, "after": None, "unit": ""},
    ]
    assert table(rows)[2:] == ["| a | 2 N | 1 N | learnt: x / y |", "| b | 0.5 | - | nothing |"]
    assert all(set(case.logs).isdisjoint(unseen) for case, unseen in CASES)
