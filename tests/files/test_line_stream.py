"""Reading while it is written: half lines, rotation, unreadable lines."""

import os
import threading
import time

import numpy as np
import pytest

from dsd_cli.errors import DataError
from dsd_cli.files.csv_layout import CsvLayout
from dsd_cli.files.line_stream import LineStream

WANTED = {"t": "t", "u": "u"}


def pipe_with(content: bytes):
    reading, writing = os.pipe()
    os.write(writing, content)
    os.close(writing)
    return os.fdopen(reading, "rb")


def rows_of(batches):
    return [row for batch in batches for row in zip(*(batch.columns[name].tolist() for name in WANTED), strict=True)]


def test_each_line_is_given_when_it_is_complete():
    reading, writing = os.pipe()
    os.write(writing, b"t,u\n0,1\n")
    with os.fdopen(reading, "rb") as stream:
        batches = LineStream(stream, WANTED).batches()
        assert rows_of([next(batches)]) == [(0.0, 1.0)]
        os.write(writing, b"1,")
        threading.Timer(0.1, os.write, (writing, b"5\n2")).start()
        assert rows_of([next(batches)]) == [(1.0, 5.0)]
        os.write(writing, b",3")
        os.close(writing)
        assert rows_of(batches) == [(2.0, 3.0)]


def test_dialects_of_a_stream():
    content = '\ufeff# rig\n t ;note;"u"\r\ns;x;V\r\n0;a;1,5\r\n\r\n1;b;NA\r\n'.encode()
    stream = LineStream(pipe_with(content), WANTED)
    np.testing.assert_array_equal(rows_of(stream.batches()), [(0.0, 1.5), (1.0, np.nan)])
    assert "line 3 is taken as units" in stream.warnings[0]
    assert stream.unreadable == 0


def test_unreadable_lines_are_nan_rows_and_counted():
    stream = LineStream(pipe_with(b"t,u\n0,1\n1,abc\n2\n3,4\n"), WANTED)
    rows = rows_of(stream.batches())
    assert len(rows) == 4
    assert np.isnan(rows[1:3]).all()
    assert rows[3] == (3.0, 4.0)
    assert stream.unreadable == 2
    assert 'line 3 cannot be read: "1,abc"' in stream.warnings[0]


@pytest.mark.parametrize(
    ("content", "said"),
    [(b"", "is empty"), (b"t,u\n", "no rows"), (b"t,v\n0,1\n", 'no column "u"'), (b"1,2\n", "no header")],
)
def test_refusals(content, said):
    with pytest.raises(DataError, match=said):
        list(LineStream(pipe_with(content), WANTED).batches())


def follow(path, steps):
    """Follow a file while `steps` change it, each after what came before it was read."""
    stream = LineStream(path, WANTED, idle_timeout=0.3)
    batches = []
    changes = threading.Thread(target=lambda: [(time.sleep(0.12), step()) for step in steps])
    changes.start()
    batches.extend(stream.batches())
    changes.join()
    return batches


def append(path, text):
    def step():
        with path.open("a") as file:
            file.write(text)

    return step


def test_a_growing_file_with_a_half_written_line(tmp_path):
    path = tmp_path / "live.csv"
    path.write_text("t,u\n0,1\n1,2")
    batches = follow(path, [append(path, "5\n"), append(path, "2,3\n3,")])
    assert rows_of(batches) == [(0.0, 1.0), (1.0, 25.0), (2.0, 3.0)]
    assert not any(batch.restart for batch in batches)


def test_rotation(tmp_path):
    path = tmp_path / "live.csv"
    path.write_text("t,u\n0,1\n1,2\n2,9")

    def rotate():
        path.rename(tmp_path / "live.csv.1")
        path.write_text("u,t\n7,0\n")

    batches = follow(path, [rotate, append(path, "8,1\n")])
    assert rows_of(batches) == [(0.0, 1.0), (1.0, 2.0), (0.0, 7.0), (1.0, 8.0)]
    assert [batch.restart for batch in batches] == [False, True, False]


def test_a_file_that_is_cut_begins_anew(tmp_path):
    path = tmp_path / "live.csv"
    path.write_text("t,u\n0,1\n1,2\n2,3\n")
    batches = follow(path, [lambda: path.write_text("t,u\n0,5\n")])
    assert rows_of(batches)[3:] == [(0.0, 5.0)]
    assert batches[-1].restart


def test_following_stops_when_asked(tmp_path):
    path = tmp_path / "live.csv"
    path.write_text("t,u\n0,1\n")
    assert len(list(LineStream(path, WANTED, stop=lambda: True).batches())) == 1


def test_a_stream_with_units_in_its_cells_says_which_and_not_that_it_has_no_stamps(tmp_path):
    path = tmp_path / "live.csv"
    path.write_text("t,u\n" + "".join(f"{k},{k % 5}.5 A\n" for k in range(20)))
    stream = LineStream(path.open("rb"), {"t": "t", "u": "u"}, name="<stdin>")
    with pytest.raises(DataError, match=r'line 2: column "u" is written as "0\.5 A", which is no number in a stream'):
        list(stream.batches())


def test_a_row_that_a_file_takes_for_factors_is_said():
    """Numbers with fractions above counts: the file multiplies by them, and in a pipe they went by already."""
    rows = "".join(f"{k},{k * k % 11}\n" for k in range(30))
    stream = LineStream(pipe_with(f"t,u\n0.002,0.5\n{rows}".encode()), WANTED)
    assert len(rows_of(stream.batches())) == 31
    assert "line 2 is taken as a sample: if it is of factors, write it to a file first" in stream.warnings
    stream = LineStream(pipe_with(f"t,u\n0.5,0.5\n{rows.replace(chr(10), '.5' + chr(10))}".encode()), WANTED)
    list(stream.batches())
    assert not any("factors" in note for note in stream.warnings)


def test_units_that_come_again_with_the_header_are_no_row():
    text = b"t,u\n1,2\n0,1\n1,2.5\nt,u\n1,2\n0,3\n"
    stream = LineStream(pipe_with(text), WANTED, layout=CsvLayout(units_row=2))
    assert rows_of(stream.batches()) == [(0.0, 1.0), (1.0, 2.5), (0.0, 3.0)]


def test_names_of_some_columns_of_a_stream_are_refused():
    with pytest.raises(DataError, match="line 2 has 3 fields where the header names 2"):
        list(LineStream(pipe_with(b"t,u\n0,1,2\n1,2,3\n"), WANTED).batches())


def test_a_header_of_other_columns_is_what_the_rows_below_it_are_read_by():
    stream = LineStream(pipe_with(b"t,u,note\n0,1,9\n1,2,9\nu,t\n3,2\nu,t,note,more\n4,3,7,7\n"), WANTED)
    assert rows_of(stream.batches()) == [(0.0, 1.0), (1.0, 2.0), (2.0, 3.0), (3.0, 4.0)]
    assert stream.unreadable == 0
    assert "line 4 is a header of other columns: what is below it is read by it" in stream.warnings


def test_below_a_header_that_lacks_a_column_no_line_is_read_until_one_has_it():
    """The logger was started once more with another list; the run goes on, as with any line that cannot be read."""
    stream = LineStream(pipe_with(b"t,u,q\n0,1,5\nt,q\n1,5\n2,5\nt,u,q\n3,4,5\n"), WANTED)
    rows = rows_of(stream.batches())
    assert np.isnan(rows[1:3]).all()
    assert [rows[0], *rows[3:]] == [(0.0, 1.0), (3.0, 4.0)]
    assert stream.unreadable == 2
    assert any('no line below can be read: <stdin>: no column "u"; it has t, q' in note for note in stream.warnings)


def test_a_file_that_was_replaced_by_one_with_fewer_names_does_not_end_following(tmp_path):
    path = tmp_path / "live.csv"
    path.write_text("t,u,q\n0,1,5\n1,2,5\n")

    def rotate(text):
        def step():
            path.rename(tmp_path / "old.csv")
            path.write_text(text)

        return step

    batches = follow(path, [rotate("t,q\n0,5\n"), rotate("t,u\n0,7,1\n"), rotate("t,u\n0,8\n")])
    rows = rows_of(batches)
    assert np.isnan(rows[2:4]).all()
    assert [*rows[:2], *rows[4:]] == [(0.0, 1.0), (1.0, 2.0), (0.0, 8.0)]


@pytest.mark.parametrize(
    ("cells", "values"),
    [
        (["999,5", "1.234,5", "-1.234.567,8", "2.345", "0,125"], [999.5, 1234.5, -1234567.8, 2345.0, 0.125]),
        (["999.5", "1,234.5", "-1,234,567.8", "2,345", "0.125"], [999.5, 1234.5, -1234567.8, 2345.0, 0.125]),
        (["1'234.5", "2.345", "17"], [1234.5, 2.345, 17.0]),
        (["2.345", "1.234", "0.5", "3.456"], [2.345, 1.234, 0.5, 3.456]),
    ],
)
def test_thousands_are_apart_in_a_stream_as_in_a_file(cells, values):
    """A lone sign stands for thousands from where the column has shown its decimal sign on."""
    lines = "".join(f'{k};"{cell}"\n' for k, cell in enumerate(cells))
    stream = LineStream(pipe_with(f"t;u\n{lines}".encode()), WANTED)
    assert rows_of(stream.batches()) == [(float(k), x) for k, x in enumerate(values)]
    assert stream.unreadable == 0


@pytest.mark.parametrize(("alone", "said"), [(True, True), (False, False)])
def test_cells_that_are_blank_in_most_rows_of_a_stream_are_said(alone, said):
    lines = "".join(f"{k},{k if not alone or k % 3 == 0 else ''}\n" for k in range(300))
    stream = LineStream(pipe_with(b"t,u\n" + lines.encode()), WANTED)
    rows_of(stream.batches())
    assert any("200 of 300 rows lack a value" in one for one in stream.warnings) == said


SHOWN = 'column "u": "999,5" shows that its decimal sign is ","; what came before it as "1.234" was read a thousand'


@pytest.mark.parametrize(("cells", "told"), [(["1.234", "2.345", "999,5"], SHOWN), (["1.234", "0.5", "2.345"], "")])
def test_a_decimal_sign_that_a_column_shows_late_is_said(cells, told):
    lines = "".join(f"{k};{cell}\n" for k, cell in enumerate(cells))
    stream = LineStream(pipe_with(f"t;u\n{lines}".encode()), WANTED)
    rows_of(stream.batches())
    found = [one for one in stream.warnings if "decimal sign" in one]
    assert [one.startswith(told) for one in found] == ([True] if told else [])


def test_a_preamble_of_a_stream_ends_where_the_columns_are_named():
    """A file had its preamble left out; on stdin its first line was the header: no column "t"."""
    stream = LineStream(pipe_with(b'"Scope","XEL"\nMade by hand\n"t","u"\n0,1\n1,2\n'), WANTED)
    assert rows_of(stream.batches()) == [(0.0, 1.0), (1.0, 2.0)]
    assert "line 3 is taken as the header" in stream.warnings[0]


@pytest.mark.parametrize("content", [b"t,x\n0,1\n", b"Scope\nt,x\n0,1\n", b"t,x\n", b"t;x\n" * 200])
def test_a_stream_that_never_names_a_needed_column_says_so(content):
    with pytest.raises(DataError, match='no column "u"; it has t, x'):
        LineStream(pipe_with(content), WANTED)
