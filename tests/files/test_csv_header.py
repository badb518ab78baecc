"""Which line above the numbers names the columns: comments, titles and rows of units are told from each other."""

from pathlib import Path

import numpy as np
import pytest

from dsd_cli.errors import DataError
from dsd_cli.files.csv_dialect import read_header
from dsd_cli.files.csv_layout import CsvLayout, Found, look
from dsd_cli.files.csv_rate import sample_time_of
from dsd_cli.files.tables_in import open_table

TIME, OTHER, UNITS = ["t", "u", "q", "v"], ["time", "1", "2", "3"], ["ms", "Nm", "deg", "deg/s"]
ROWS = [f"{k / 250},{0.5 + k / 8},{-k / 16},{k / 32}" for k in range(12)]
WITH_WORDS = [f"{k / 250},,j1,{k / 32}" for k in range(12)]
LOOSE = [row.replace(",", " ") for row in ROWS]


def seen(*lines: str) -> Found:
    return look("log.csv", lines, CsvLayout())


@pytest.mark.parametrize("comment", ["# log of the arm", "# Servo log: run 3", "# made at lab on Tuesday", "# arm"])
@pytest.mark.parametrize(("header", "rows"), [("t u q v", LOOSE), ("t,u,q,v", ROWS)])
def test_a_sentence_above_a_header_is_none(comment: str, header: str, rows: list[str]) -> None:
    assert seen(comment, header, *rows).header.names == TIME
    assert seen("Log of run 3", comment, header, *rows).header.names == TIME
    below = seen(header, comment, "# and more", *rows)
    assert (below.header.names, below.units) == (TIME, None)


def test_a_header_that_names_more_than_the_rows_have_is_doubted() -> None:
    """The name of a clock that was never written moves all others by one; a delimiter at its end does nothing."""
    assert "line 1 names 5 columns, the rows have 4: the last is left out" in seen("t,u,q,v,w", *ROWS).notes
    assert seen("t,u,q,v,", *ROWS).notes == []


COUNTED = [f"{k} {row}" for k, row in enumerate(LOOSE, start=1)]


@pytest.mark.parametrize(
    ("header", "rows"),
    [
        ("    t       u      q     v", COUNTED),  # pandas' to_string
        ('"t" "u" "q" "v"', [f'"{row.replace(" ", chr(34) + " ", 1)}' for row in COUNTED]),  # R's write.table
        ('"t","u","q","v"', [row.replace(" ", ",") for row in COUNTED]),
        ('"t" "u" "q" "v" "run"', [f'{row} "A"' for row in COUNTED]),  # a word at the end is no delimiter there
    ],
)
def test_the_number_of_the_row_has_no_name_where_the_header_is_one_short(header: str, rows: list[str]) -> None:
    """The first name is not that of the numbers of the rows: time would be a count, and torque the time."""
    assert seen(header, *rows).header.names[:5] == ["row", *TIME]


@pytest.mark.parametrize(
    ("header", "rows"),
    [
        ("t_ms;u;q", [f"{k};{0.5 + k / 8};{-k / 16};" for k in range(12)]),  # a delimiter at the end of rows
        ("t_ms,u,q", [f"{k},{(-1) ** k},{-k / 16},{k / 32}" for k in range(12)]),
        ("n,t,u", [f"{k},{k / 250},{-k / 16},{k / 32}" for k in range(12)]),
        ("sample,t,u", [f"{k},{k / 250},{-k / 16},{k / 32}" for k in range(12)]),
    ],
)
def test_a_time_or_a_count_that_rises_by_one_keeps_its_name(header: str, rows: list[str]) -> None:
    """The header is one short at its end: a delimiter there, or a column without a name."""
    names = header.replace(";", ",").split(",")
    assert seen(header, *rows).header.names == [*names, "4"]


def test_a_column_without_a_name_at_the_end_stays_at_the_end() -> None:
    """Rows that do not begin with their number."""
    assert seen("t,u,q", *ROWS).header.names == ["t", "u", "q", "4"]


def test_a_comment_of_more_or_fewer_words_names_no_columns() -> None:
    found = seen("# made at lab on Tuesday", *LOOSE)
    assert found.header.names == ["1", "2", "3", "4"]
    assert any("no header" in note for note in found.notes)


@pytest.mark.parametrize(("comment", "rows"), [("# t u q v", LOOSE), ("# t,u,q,v", ROWS), ("%t,u,q,v", WITH_WORDS)])
def test_a_comment_that_is_the_header_is_said(comment: str, rows: list[str]) -> None:
    for lines, at in (((comment,), 1), (("# made by a tool", comment), 2)):
        found = seen(*lines, *rows)
        assert (found.header.names, found.skip) == (TIME, at)
        assert f"the comment in line {at} is taken as the header" in found.notes


@pytest.mark.parametrize("header", ["time,1,2,3", "1,2,3,time"])
def test_a_header_of_numbers_and_a_word_is_the_header(header: str) -> None:
    found = seen("# rig, arm, run, x", header, *ROWS)
    assert (found.header.names, found.skip) == (header.split(","), 2)


def test_of_a_stream_the_next_row_has_not_come() -> None:
    comment = "# t,u,q,v"
    assert read_header("-", comment, "time,1,2,3").names == OTHER
    assert read_header("-", comment, WITH_WORDS[1]).names == TIME
    assert read_header("-", comment, "run,0.1,2,3").names == TIME


def test_one_column_is_named_by_one_word() -> None:
    alone = [row.split(",")[1] for row in ROWS]
    assert seen("#u", *alone).header.names == ["u"]
    with pytest.raises(DataError, match="has no header"):
        read_header("log.csv", "# made at lab", alone[0], alone[1])


@pytest.mark.parametrize(
    "above",
    [
        ("#t,u,q,v", "#ms,Nm,deg,deg/s"),
        ("t,u,q,v", "# ms,Nm,deg,deg/s"),
        ("# t,u,q,v", "ms,Nm,deg,deg/s"),
        ("t,u,q,v", "ms,Nm,deg,deg/s"),
        ("# made, with, a, tool", "t,u,q,v", "# [ms],[Nm],[deg],[deg/s]"),
    ],
)
@pytest.mark.parametrize("loose", [False, True])
def test_units_in_a_comment_are_units(above: tuple[str, ...], loose: bool) -> None:
    lines = [*above, *ROWS]
    found = seen(*(line.replace(", ", "_").replace(",", " ") if loose else line for line in lines))
    assert (found.header.names, found.units) == (TIME, UNITS)


def test_a_comment_behind_the_one_with_the_names() -> None:
    assert seen("# t,u,q,v", "# made by tool", *ROWS).header.names == TIME
    assert seen("t,u,q,v", "# made, with, a, tool", *ROWS).units is None


def test_names_that_are_units_too() -> None:
    """Position, velocity and acceleration: s, v, a."""
    rows = [row.rpartition(",")[0] for row in ROWS]
    assert seen("s,v,a", *rows).header.names == ["s", "v", "a"]
    assert seen("# log of run 3", "s,v,a", *rows).header.names == ["s", "v", "a"]


@pytest.mark.parametrize(
    ("said", "step"),
    [
        ('"Sampling Time","500","us"', 5e-4),
        ("Sampling Time,500,us", 5e-4),
        ("Abtastzeit;0,5;ms", 5e-4),
        ("Sampling time;500", None),
        ("Sampling time;0.002", 2e-3),
        ("# fs = 500 Hz", 2e-3),
        ("Sampling: 2 kHz", 5e-4),
        ("Sampling: 2 A", None),
        ("Sampling(us),500", 5e-4),
        ("Sampling cycle[us],500", 5e-4),
        ("Sampling;2 ms", 2e-3),
        ("# Sampling rate [kHz]: 2.5", 4e-4),
        ("# Abtastrate;250", 4e-3),
        ("# fs = 5 A", None),
        ("SAMPLING,1,msec", 1e-3),
        ("Sampling interval [µsec];250", 2.5e-4),
        ("Sampling time: 2 milliseconds", 2e-3),
        ("Sampling time: 2 secs", 2.0),
    ],
)
def test_a_rate_above_the_numbers_says_how_far_rows_are_apart(said, step):
    lines = [said, "u,q", *(f"{k}.5,{k * k}" for k in range(50))]
    assert sample_time_of(lines, seen(*lines)) == (None if step is None else pytest.approx(step))


def test_groups_above_the_names_are_no_names():
    """pandas writes columns of two levels so: `drive` stood for two columns, whose units were `t` and `tau`."""
    rows = [f"{k},{k / 250},{k / 8},{k / 16}" for k in range(12)]
    assert seen(",drive,drive,axis", ",t,tau,q", *rows).header.names == ["", "t", "tau", "q"]


@pytest.mark.parametrize(
    ("above", "names"),
    [
        ((",elbow,,wrist", ",tau,q,tau"), ["", "elbow/tau", "q", "wrist/tau"]),
        (("joint,elbow,elbow,wrist", "signal,tau,q,tau", "time,,,"), ["time", "elbow/tau", "q", "wrist/tau"]),
    ],
)
def test_groups_above_names_that_come_again_are_part_of_them(above: tuple[str, ...], names: list[str]) -> None:
    assert seen(*above, *ROWS).header.names == names


@pytest.mark.parametrize("line", [0, 1])
@pytest.mark.parametrize(
    ("header", "names"),
    [
        ("time,torque", ["time", "torque", "3", "4"]),
        ("torque,angle", ["torque/time", "torque", "angle/time", "angle"]),
        ("angle,torque,,", ["angle", "torque", "", ""]),
        ("cycle,current", ["cycle", "current", "3", "4"]),
        ("torque,,angle,", ["torque/time", "torque", "angle/time", "angle"]),
        ("Test 4,24 V", ["1", "2", "3", "4"]),
        ("Rate: 250,Mode: speed", ["1", "2", "3", "4"]),
    ],
)
def test_names_of_some_columns_alone(header: str, names: list[str], line: int) -> None:
    """A logger that names the first of them, or each pair of a time and a value: they were as good as no names."""
    found = seen(*["# a rig"] * line, header, *(f"{k / 250},{0.5 - k % 3},{k / 250},{k % 5}" for k in range(12)))
    assert found.header.names == names
    few = f"line {line + 1} names 2 of 4 columns, the others are called by number"
    assert (few in found.notes) == (names[0] in ("time", "cycle"))
    pairs = f"line {line + 1} names pairs of columns, a time and a value each"
    assert (pairs in found.notes) == (names[0] == "torque/time")


@pytest.mark.parametrize("units", ["", "s,Nm,s,rad\n"])
def test_one_clock_beside_each_channel_is_one(units: str, tmp_path: Path) -> None:
    rows = "".join(f"{k / 250},{k % 7},{k / 250},{k % 5}\n" for k in range(99))
    (tmp_path / "log.csv").write_text(f"Time,Torque,Time,Pos\n{units}{rows}")
    table = open_table(tmp_path / "log.csv", {"t": "Time", "position": "Pos"})
    (batch,) = table.batches()
    assert table.column_names == ["Time", "Torque", "Time 2", "Pos"]
    assert np.array_equal(batch.columns["t"], np.arange(99) / 250)


def test_of_two_columns_of_one_name_none_is_guessed(tmp_path: Path) -> None:
    """At rest at first, they are the same there."""
    (tmp_path / "log.csv").write_text("t,u,u\n" + "".join(f"{k},0.0,0.0\n" for k in range(9000)) + "9000,1.0,2.0\n")
    with pytest.raises(DataError, match='2 columns are called "u"'):
        open_table(tmp_path / "log.csv", {"t": "t", "u": "u"})


BESIDE = [f"{k / 250},{0.5 + k / 8},{k / 250},{-k / 16}" for k in range(12)]


def test_rows_that_describe_the_channels_stand_below_their_names() -> None:
    """As the data inspector of Simulink exports them; a header of names with a group each is none of them."""
    below = [",Type: double,,Type: double", ",Unit: N*m,,Unit: rad", ",Interp: zoh,,Interp: zoh"]
    found = seen("time,Torque,time,Angle", *below, *BESIDE)
    assert (found.header.names, found.units) == (["time", "Torque", "time", "Angle"], ["", "N*m", "", "rad"])
    assert seen("motor: t,motor: u,motor: q,motor: v", *BESIDE).header.names[1] == "motor: u"


def test_a_column_for_what_a_row_is_has_no_numbers_and_is_no_clock() -> None:
    """As dSPACE writes it: the labels stand before the rows, beside which nothing stands but in the first."""
    rows = [f"{'' if k else 'values'};{k / 250};{0.5 + k / 8};{-k / 16}" for k in range(12)]
    path = "path;;rig/iq;rig/theta"
    found = seen("tool;x", "", "trace_names;time;iq;theta", path, "unit;s;A;deg", "type;double;double;double", *rows)
    assert found.header.names[1:] == ["time", "iq", "theta"]
    assert (found.units or [])[1:] == ["s", "A", "deg"]


def test_a_preamble_with_a_line_for_each_channel() -> None:
    said = ["Model,X1", "Trace 1,Feedback Speed,min-1", "Trace 2,Torque Reference,%", "No.,Trace 1,Trace 2"]
    found = seen(*said, *(f"{k},{k / 8},{-k / 16}" for k in range(12)))
    assert found.header.names == ["No.", "Trace 1 Feedback Speed", "Trace 2 Torque Reference"]
    assert found.units == ["", "min-1", "%"]
    axes = ["C1,Axis 1,Torque,%", "C2,Axis 1,Speed,1/min", "C3,Axis 2,Place,mm", "No,C1,C2,C3"]  # as wide as the rows
    found = seen(*axes, *(f"{k},{k / 8},{-k / 16},{k / 4}" for k in range(12)))
    assert found.header.names == ["No", "C1 Axis 1 Torque", "C2 Axis 1 Speed", "C3 Axis 2 Place"]
    assert found.units == ["", "%", "1/min", "mm"]
    objects = ["Trace 1,0x606C: Velocity,rpm,", "Trace 2,0x6077: Torque,%,", ",,,", "Time,Trace 1,Trace 2"]
    found = seen("Rate,1 ms,,", *objects, *(f"{k},{k / 8},{-k / 16}" for k in range(12)))
    assert found.header.names[1:] == ["Trace 1 0x606C: Velocity", "Trace 2 0x6077: Torque"]
    assert found.units == ["", "rpm", "%"]


def test_lines_of_a_unit_or_a_number_each_leave_the_names_as_they_are() -> None:
    rows = [f"{k / 250},{0.5 + k / 8},{-k / 16}" for k in range(12)]
    found = seen("Torque,mNm", "Position,deg", "Time,Torque,Position", *rows)
    assert (found.header.names, found.units) == (["Time", "Torque", "Position"], ["", "mNm", "deg"])
    assert seen("Torque,0.001", "Position,1", "Time,Torque,Position", *rows).header.names[1] == "Torque"


def test_units_behind_whose_row_a_delimiter_stands() -> None:
    """LabVIEW's header has a column for comments, which its rows have not."""
    rows = [f"{k / 250}\t{0.5 + k / 8}\t{-k / 16}" for k in range(12)]
    found = seen("Y_Unit_Label\tN m\tdeg\t", "***End***\t\t\t", "X_Value\tTorque\tAngle\tComment", *rows)
    assert found.units == ["", "N m", "deg"]


@pytest.mark.parametrize(("last", "end", "rows"), [("99,", "", 99), ("99,0.5,1", "", 100), ("99,", "\n", None)])
def test_a_last_line_without_an_end_was_cut_off(last: str, end: str, rows: int | None, tmp_path: Path) -> None:
    """One that has an end is a row with a field missing, as any other."""
    (tmp_path / "log.csv").write_text("t,u,q\n" + "".join(f"{k},{k % 7},{k % 5}\n" for k in range(99)) + last + end)
    table = open_table(tmp_path / "log.csv", {"t": "t", "u": "u"})
    if rows is None:
        with pytest.raises(DataError, match="line 101: 2 fields where the header has 3"):
            list(table.batches())
        return
    assert sum(batch.rows for batch in table.batches()) == rows
    assert ("its last line is cut off in the middle, and left out" in table.warnings) == (rows == 99)


@pytest.mark.parametrize("tail", ["\n[End]\nTrace complete\n", "\n*** end of trace ***\n"])
def test_text_behind_the_numbers_is_left_out(tail: str, tmp_path: Path) -> None:
    (tmp_path / "log.csv").write_text("t,u\n" + "".join(f"{k},{k % 7}\n" for k in range(99)) + tail)
    assert sum(batch.rows for batch in open_table(tmp_path / "log.csv", {"t": "t", "u": "u"}).batches()) == 99


def test_a_header_that_comes_again_at_once_is_no_row_of_what_is_shown(tmp_path: Path) -> None:
    half = "t,u\n" + "".join(f"{k},{k % 7}\n" for k in range(30))
    (tmp_path / "log.csv").write_text(half + half)
    table = open_table(tmp_path / "log.csv", {})
    assert {name: len(column) for name, column in table.peek().items()} == {"t": 60, "u": 60}
    assert any("its header comes again" in note for note in table.warnings)


def test_a_byte_far_below_that_windows_has_not_is_one_of_latin(tmp_path: Path) -> None:
    rows = "".join(f"{k},{k % 7},ok\n" for k in range(20000)).encode()
    (tmp_path / "log.csv").write_bytes("t,u [‰],note\n".encode("cp1252") + rows + b"20000,1,\x81\n" + rows[-20:])
    peeked = open_table(tmp_path / "log.csv", {}).peek()
    assert len(peeked["u [‰]"]) > 20000


def test_a_word_that_has_no_name_is_the_last_column_where_the_first_has_its_own() -> None:
    """A drive numbers its rows under `step`, and ends them with a word: the names are those of the columns above."""
    found = seen("step,torque,velocity,position", *(f"{k},{row.partition(',')[2]},OK" for k, row in enumerate(ROWS)))
    assert found.header.names[:4] == ["step", "torque", "velocity", "position"]


def test_a_cell_of_the_first_row_over_two_lines_is_data() -> None:
    found = seen("t,u,q,note", '0.0,0.5,0.1,"slow', 'run"', *(f"{k},{k / 8},{k / 9},x" for k in range(1, 12)))
    assert (found.header.names, found.skip) == (["t", "u", "q", "note"], 1)


def test_a_cell_of_a_header_may_go_over_lines() -> None:
    """A spreadsheet writes a unit below a name so; a mark of inches within a text opens nothing."""
    found = seen(
        'Shaft 5" long;;', '"Time', '[s]";"Torque', '[Nm]";"Angle"', *(";".join(r.split(",")[:3]) for r in ROWS)
    )
    assert found.header.names == ["Time [s]", "Torque [Nm]", "Angle"]
