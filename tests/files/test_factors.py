"""One place decides what the numbers of a text are multiplied by, whoever reads it: a file, a scope's text, a pipe."""

import os
from pathlib import Path

import numpy as np
import pytest

from dsd_cli.errors import DataError
from dsd_cli.files.csv_described import in_groups
from dsd_cli.files.csv_in import CsvTable
from dsd_cli.files.csv_layout import CsvLayout
from dsd_cli.files.line_stream import LineStream
from dsd_cli.files.tables_in import open_table

ROWS = 40
T = 0.002 * np.arange(ROWS)
U = np.round(1000.0 * np.sin(40.0 * T)) + 7.0
Q = np.round(50.0 * np.cos(30.0 * T)) + 3.0
NAMES = "time,torque,angle"
WANTED = {"t": "time", "u": "torque", "position": "angle"}


def text(above: list[str], *columns: np.ndarray) -> str:
    return "\n".join([*above, *(",".join(f"{x:.6g}" for x in row) for row in zip(*columns, strict=True))]) + "\n"


def read(table: object) -> dict[str, np.ndarray]:
    batches = list(table.batches())
    return {name: np.concatenate([batch.columns[name] for batch in batches]) for name in batches[0].columns}


def opened(kind: str, folder: Path, content: str, scaled: bool | None = None, wanted: dict = WANTED) -> object:
    path, layout = folder / "log.csv", CsvLayout(scaled=scaled)
    path.write_text(content)
    if kind == "file":
        return open_table(path, wanted, layout=layout)
    if kind == "followed":
        return LineStream(path, wanted, idle_timeout=0.05, layout=layout)
    reading, writing = os.pipe()
    os.write(writing, content.encode())
    os.close(writing)
    return LineStream(os.fdopen(reading, "rb"), wanted, layout=layout)


READERS = pytest.mark.parametrize("kind", ["file", "pipe", "followed"])


@READERS
@pytest.mark.parametrize(
    "above",
    [[NAMES, "Scale,0.01,0.5"], [NAMES, "Unit,Nm,rad", "Scale,0.01,0.5"], [NAMES, "TIME,INT,INT", "Gain,0.01,0.5"]],
)
def test_every_reader_multiplies_counts(kind: str, above: list[str], tmp_path: Path) -> None:
    table = opened(kind, tmp_path, text(above, T, U, Q))
    found = read(table)
    np.testing.assert_allclose(found["t"], T, atol=1e-9)
    np.testing.assert_allclose(found["u"], 0.01 * U)
    np.testing.assert_allclose(found["position"], 0.5 * Q)
    assert f"line {len(above)} says what whole numbers are multiplied by: torque 0.01, angle 0.5" in table.warnings
    assert table.unreadable == 0


@pytest.mark.parametrize(
    "head",
    [
        ["torque time,torque,angle time,angle", "Scale,0.01,,0.5"],
        ["Name,torque,Name,angle", "Unit,Nm,Unit,rad", "Scale,0.01,Scale,0.5"],
    ],
)
def test_channels_of_a_scope_with_clocks_of_their_own_are_multiplied(head: list[str], tmp_path: Path) -> None:
    path = tmp_path / "scope.csv"
    path.write_text(text(head, T, U, T + 0.0003, Q))
    table = open_table(path, {"t": "torque/time", "u": "torque/value"})
    found = read(table)
    np.testing.assert_allclose(found["u"], 0.01 * U)
    np.testing.assert_allclose(found["t"], T, atol=1e-9)
    assert any("multiplied by: torque 0.01" in note for note in table.warnings)
    found = read(open_table(path, {"t": "torque/time", "u": "torque/value"}, layout=CsvLayout(scaled=True)))
    np.testing.assert_allclose(found["u"], U)


@READERS
@pytest.mark.parametrize("rest", [0.0, 500.0])
def test_an_axis_that_rests_first_is_read_as_one_that_moves(kind: str, rest: float, tmp_path: Path) -> None:
    """It rests for longer than the head of a file."""
    still = np.full(9000, rest)
    t, u, q = 0.002 * np.arange(9000 + ROWS), np.append(0.0 * still, U), np.append(still, Q + rest)
    content = text([NAMES, "Scale,0.01,0.5"], t, u, q)
    if kind == "pipe":
        content = text([NAMES, "Scale,0.01,0.5"], *(x[-2000:] for x in (t, u, q)))  # what a pipe holds
    found = read(opened(kind, tmp_path, content))
    np.testing.assert_allclose(found["u"][-ROWS:], 0.01 * U)
    np.testing.assert_allclose(found["position"][-ROWS:], 0.5 * (Q + rest))
    np.testing.assert_allclose(found["position"][:9], 0.5 * rest)


@READERS
def test_what_contradicts_its_beginning_ends_with_the_key_that_answers(kind: str, tmp_path: Path) -> None:
    """2 Nm held for long, then others: they were multiplied already."""
    u = np.append(np.full(1200, 2.0), 0.01 * U)
    t = 0.001 * np.arange(u.size)
    content = text([NAMES, "Scale,0.01,0.5"], t, u, np.round(3.0 + 100.0 * t))
    if kind == "file":  # its first piece shows it
        np.testing.assert_allclose(read(opened(kind, tmp_path, content))["u"], u)
    else:
        table = opened(kind, tmp_path, content.partition("0.9,2,")[0])
        next(table.batches())
        with pytest.raises(DataError, match=r'line 2 has a factor, and "torque" .* csv.scaled = true if 0.01 is in it'):
            table._scaling.applied(1, 0.01 * U)
    np.testing.assert_allclose(read(opened(kind, tmp_path, content, scaled=True))["u"], u)
    np.testing.assert_allclose(read(opened(kind, tmp_path, content, scaled=False))["u"], 0.01 * u)


@READERS
def test_whole_factors_and_offsets_are_mended_by_the_key_that_is_named(kind: str, tmp_path: Path) -> None:
    content = text([NAMES, "Factor,0.1,10", "Offset,2.5,0"], T, U, Q)
    table = opened(kind, tmp_path, content)
    np.testing.assert_allclose(read(table)["u"], U)
    said = "line 2 has factors that are left to you: torque 0.1 and +2.5, angle 10; --set csv.scaled=false"
    assert any(note.startswith(said) for note in table.warnings)
    table = opened(kind, tmp_path, content, scaled=False)
    found = read(table)
    np.testing.assert_allclose(found["u"], 0.1 * U + 2.5)
    np.testing.assert_allclose(found["position"], 10.0 * Q)
    assert table.warnings == ["line 2 says what numbers are multiplied by: torque 0.1 and +2.5, angle 10"]
    assert not opened(kind, tmp_path, content, scaled=True).warnings


@READERS
def test_the_word_of_a_mode_that_comes_again_is_no_factor(kind: str, tmp_path: Path) -> None:
    rows = [f"{'offset' if k < 9 else 'run'},{T[k]:g},{U[k]:g},{Q[k]:g}" for k in range(ROWS)]
    table = opened(kind, tmp_path, "\n".join(["mode,time,torque,angle", *rows]) + "\n")
    found = read(table)
    np.testing.assert_allclose(found["t"], T, atol=1e-9)
    np.testing.assert_allclose(found["u"], U)


def test_powers_of_ten_above_the_numbers_are_factors_without_a_label(tmp_path: Path) -> None:
    for first in ("1", ""):
        table = opened("file", tmp_path, text([NAMES, "s,Nm,rad", f"{first},0.01,0.1"], T, U, Q))
        found = read(table)
        assert found["t"].size == ROWS
        np.testing.assert_allclose(found["u"], 0.01 * U)
        np.testing.assert_allclose(found["position"], 0.1 * Q)
        assert any("line 3 says what whole numbers" in note for note in table.warnings)


@pytest.mark.parametrize(("rest", "seen"), [(0, True), (500, True), (0, False)])
def test_of_what_counts_are_multiplied_by_the_counts_say(rest: int, seen: bool, tmp_path: Path) -> None:
    """A row of CiA 402's resolutions, without a word: no sample of counts has fractions. Of other numbers one may."""
    factors = [2.0**-12, 360.0 / 2**16]
    stamps, u, q = np.arange(ROWS + rest), np.append(np.zeros(rest), U), np.append(np.zeros(rest), Q + 0.5 * (not seen))
    head = [NAMES, "s,Nm,deg", ",".join(map(repr, [0.002, *factors]))]
    found = read(table := opened("file", tmp_path, text(head, stamps, u, q)))
    if not seen:
        assert (found["u"].size, found["position"][0]) == (ROWS + rest + 1, factors[1])
        return
    np.testing.assert_allclose(found["t"], 0.002 * stamps)
    np.testing.assert_allclose(found["u"], factors[0] * u)
    np.testing.assert_allclose(found["position"], factors[1] * q)
    assert any("line 3 says what whole numbers are multiplied by: time 0.002, torque" in one for one in table.warnings)


def test_a_first_sample_that_happens_to_be_of_tens_is_a_sample(tmp_path: Path) -> None:
    t = 0.01 * np.arange(1, ROWS + 1)
    u, q = U.copy(), Q.copy()
    u[0], q[0] = 1.0, 10.0
    np.testing.assert_allclose(read(opened("file", tmp_path, text([NAMES], t, u, q)))["u"], u)


def test_a_first_sample_with_a_fraction_that_a_clock_goes_on_from_is_a_sample(tmp_path: Path) -> None:
    """The first sample was dropped, and all others multiplied by 12.5."""
    u, q = U.copy(), 4000.0 + 3.0 * np.arange(ROWS)
    u[0] = 12.5
    content = text([NAMES], 10.0 * np.arange(1, ROWS + 1), u, q)
    np.testing.assert_allclose(read(opened("file", tmp_path, content))["u"], u)


@pytest.mark.parametrize(
    "above",
    [
        [NAMES, "Type,INT,LREAL"],
        ["Type,INT,LREAL", NAMES],
        [NAMES, "TIME,INT,LREAL", "s,Nm,rad"],
        [NAMES, ",DINT,DINT", "s,Nm,rad"],
        [NAMES, "s,Nm,rad", "LREAL,INT,INT"],
        ["Data type,INT,LREAL", "Name,torque,angle"],
    ],
)
def test_types_of_a_controller_are_neither_names_nor_units(above: list[str], tmp_path: Path) -> None:
    (tmp_path / "log.csv").write_text(text(above, T, U, Q))
    table = CsvTable(str(tmp_path / "log.csv"), WANTED)
    np.testing.assert_allclose(read(table)["u"], U)
    assert table.column_names == NAMES.split(",")
    units = [table.units.get(name, "") for name in table.column_names]
    assert units == (["s", "Nm", "rad"] if "s,Nm,rad" in above else ["", "", ""])


@pytest.mark.parametrize(
    ("above", "names"),
    [
        (["Axis1,,Axis2,", "pos,torque,pos,torque", "rad,Nm,rad,Nm"], "Axis1/pos,Axis1/torque,Axis2/pos,Axis2/torque"),
        (["time,A,,B", ",pos,torque,torque", "s,rad,Nm,Nm"], "time,pos,A/torque,B/torque"),
        ([",A,A,B", "time,pos,torque,torque", "s,rad,Nm,Nm"], "time,pos,A/torque,B/torque"),
        (["Channel,A,A,B", "Name,pos,torque,torque", "Unit,rad,Nm,Nm"], "time,pos,A/torque,B/torque"),
        (["Kanal,1,2,3", "Name,pos,torque,speed", "Unit,rad,Nm,rad/s"], "time,pos,torque,speed"),
    ],
)
def test_names_that_come_again_are_told_apart_by_the_group_above(above: list[str], names: str, tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text(text(above, T, U, Q, U))
    table = CsvTable(str(path), {})
    assert table.column_names == names.split(",")
    assert [table.units.get(name) for name in table.column_names][1:] == above[2].split(",")[1:]


def test_a_setting_above_names_that_differ_names_none() -> None:
    assert in_groups(["", "torque", "speed"], ["Sampling", "2", "us"]) == ["", "torque", "speed"]
