"""A line that is none is named; one without end is bounded; live and files read the same numbers."""

import resource

import pytest

from dsd_cli.files import csv_cells, growing_lines
from dsd_cli.files.line_stream import LineStream
from tests.cli.rig import CONFIG, csv_text, dsd, json, make_log, refused, summary


@pytest.fixture
def rig(tmp_path):
    (tmp_path / "dsd.toml").write_text(CONFIG)
    return tmp_path


@pytest.mark.parametrize("at", [3, 300, 2999])
@pytest.mark.parametrize(
    ("change", "text"),
    [
        (lambda line: '"' + line, "a quote that is not closed"),
        (lambda line: line.replace(",", ',"', 1), "a quote that is not closed"),
        (lambda line: line.replace(",", "\r,", 1), "a carriage return inside the line"),
        (lambda line: line.replace(",", ",1_0", 1), "is not a number"),
    ],
)
def test_the_line_is_named(rig, change, text, at):
    lines = csv_text(make_log(3000)).splitlines()
    lines[at - 1] = change(lines[at - 1])
    (rig / "log.csv").write_bytes(("\n".join(lines) + "\n").encode())
    refused(dsd("detect", "log.csv", cwd=rig), 1, f"log.csv, line {at}", text)
    live = dsd("detect", "-", "--format", "json", cwd=rig, stdin=(rig / "log.csv").read_bytes())
    assert live.returncode == 0, live.stderr
    dropped = {entry["reason"]: entry["count"] for entry in json.loads(live.stdout)["dropped"]}
    assert dropped["unreadable line"] in (1, 2)
    assert live.stderr.count(b"<stdin>") == live.stderr.count(b"warning")


@pytest.mark.parametrize("text", ["1_000", "\uff11\uff12", "0x10", "1e", "1 2"])
def test_only_what_both_parsers_read_is_a_number(text):
    with pytest.raises(ValueError):  # noqa: PT011 (float says it in many ways)
        csv_cells.plain_number(text)


def processor_time_of_children() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def test_a_line_without_end_costs_its_length_and_no_more(rig):
    lines = csv_text(make_log(600)).splitlines()
    giant = ",".join(["1"] * (10 << 20))
    text = "\n".join([*lines[:300], giant, *lines[300:]]) + "\n"
    began = processor_time_of_children()
    found = json.loads(dsd("detect", "-", "--format", "json", cwd=rig, stdin=text.encode()).stdout)
    assert processor_time_of_children() - began < 20
    assert found["samples"] == 601
    assert {"reason": "unreadable line", "count": 1} in found["dropped"]
    assert growing_lines.LONGEST_LINE <= 1 << 20


def test_a_sidecar_that_is_a_fifo_or_nested_is_none(rig):
    import os

    (rig / "log.csv").write_text(csv_text(make_log(300)))
    os.mkfifo(rig / "log.csv.meta.json")
    assert summary("log.csv", cwd=rig)["samples"] == 300
    (rig / "log.csv.meta.json").unlink()
    (rig / "log.csv.meta.json").write_text('{"a":' * 5000 + "1" + "}" * 5000)
    assert summary("log.csv", cwd=rig)["samples"] == 300


def test_a_followed_file_that_was_cut_and_has_grown_past_its_old_size(tmp_path):
    log, rows = tmp_path / "log.csv", make_log(3000)
    text = csv_text(rows).splitlines()
    log.write_text("\n".join(text[:301]) + "\n")
    state = {"turn": 0}

    def stop() -> bool:
        state["turn"] += 1
        if state["turn"] == 1:  # copytruncate: the same file, cut, and longer than before when it is looked at again
            with open(log, "r+") as file:
                file.truncate(0)
                file.write("\n".join([text[0], *text[301:1201]]) + "\n")
        return state["turn"] > 2

    stream = LineStream(log, {"t": "t", "u": "u"}, stop=stop)
    batches = list(stream.batches())
    assert sum(batch.rows for batch in batches) == 300 + 900
    assert stream.unreadable == 0
    assert sum(batch.restart for batch in batches) == 1
