"""Rows above, between and behind the numbers that say something of the channels: none of them is a row of data."""

from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

from dsd_cli.errors import DataError
from dsd_cli.files.csv_in import CsvTable
from dsd_cli.files.formats.known import format_of, open_container
from dsd_cli.files.formats.long_form import LongFile, long_form
from dsd_cli.files.sample import sample
from tests.files.test_factors import opened

ROWS = 30
T = 0.002 * np.arange(ROWS)
U = np.round(1000.0 * np.sin(40.0 * T))
Q = np.round(50.0 * np.cos(30.0 * T)) + 3.0
NAMES = "time [s],torque [Nm],angle [deg]"


def table(path: Path, *names: str) -> tuple[list[np.ndarray], CsvTable]:
    read = CsvTable(str(path), {str(k): name for k, name in enumerate(names)})
    batches = list(read.batches())
    return [np.concatenate([batch.columns[str(k)] for batch in batches]) for k in range(len(names))], read


def written(folder: Path, above: list[str], *columns: np.ndarray, by: str = ",", below: str = "") -> Path:
    rows = [by.join(f"{x:g}" if x == round(x) else f"{x:.3f}" for x in row) for row in zip(*columns, strict=True)]
    text = "\n".join([*above, *rows]) + "\n" + below
    path = folder / "log.csv"
    path.write_text(text.replace(".", ",") if by == ";" else text)
    return path


@pytest.mark.parametrize(
    ("above", "by"),
    [
        ([NAMES, "Scale,0.001,0.01"], ","),
        (["Logger 3", "Scale,0.001,0.01", NAMES], ","),
        (["time,torque,angle", "Unit,Nm,deg", "Faktor,0.001,0.01", "Offset,0,0"], ","),
        (["Name,torque,angle", "Unit,Nm,deg", "Gain,0.001,0.01"], ","),
        (["time [s];torque [Nm];angle [deg]", "Skalierung;0.001;0.01"], ";"),
    ],
)
def test_a_row_of_factors_is_taken_for_counts_and_said(above: list[str], by: str, tmp_path: Path) -> None:
    path = written(tmp_path, above, T, U, Q, by=by)
    columns = CsvTable(str(path), {}).column_names
    (t, u, q), read = table(path, *columns)
    assert [name.split(" ")[0] for name in columns[1:]] == ["torque", "angle"]
    np.testing.assert_allclose(t, T, atol=1e-9)
    np.testing.assert_allclose(u, 0.001 * U)
    np.testing.assert_allclose(q, 0.01 * Q)
    assert any("multiplied by" in note and "0.001" in note and "0.01" in note for note in read.warnings)
    peeked = read.peek()
    np.testing.assert_allclose(np.array(peeked[columns[1]]), 0.001 * U)


@pytest.mark.parametrize("row", ["Multiplier,0.5,2", "Scale,1,1000", "Scale factor,1,0.1", "Offset,0,5"])
def test_factors_of_numbers_that_may_be_multiplied_already_are_left_to_the_user(row: str, tmp_path: Path) -> None:
    path = written(tmp_path, [NAMES, row], T, 0.137 * U, 0.137 * Q)
    (u, q), read = table(path, "torque [Nm]", "angle [deg]")
    assert (u.size, q.size) == (ROWS, ROWS)
    np.testing.assert_allclose(u, np.round(0.137 * U, 3), atol=1e-9)
    assert any("line 2 has factors that are left to you" in n and "csv.scaled=false" in n for n in read.warnings)


def test_a_mode_that_is_called_like_a_factor_is_data(tmp_path: Path) -> None:
    mode = ["offset"] * 10 + ["run"] * (ROWS - 10)
    rows = [f"{m},{t:.3f},{u:g},{q:g}" for m, t, u, q in zip(mode, T, U, Q, strict=True)]
    path = tmp_path / "log.csv"
    path.write_text("\n".join(["mode,time,torque,angle", *rows]) + "\n")
    (t, u), read = table(path, "time", "torque")
    np.testing.assert_allclose(t, T, atol=1e-9)
    np.testing.assert_allclose(u, U)
    assert not any("factor" in note or "multiplied" in note for note in read.warnings)


def test_a_setting_of_the_preamble_and_a_stale_first_row_are_no_factors(tmp_path: Path) -> None:
    above = ["Drive XY", "Gain,0.5", NAMES]
    (u, q), read = table(written(tmp_path, above, T, U, Q), "torque [Nm]", "angle [deg]")
    np.testing.assert_allclose(u, U)
    assert not any("multiplied" in note for note in read.warnings)
    stale = ["time,torque,angle", "s,Nm,deg", "4.0,-12.5,0.3"]
    (u, q), read = table(written(tmp_path, stale, T, U, Q), "torque", "angle")
    np.testing.assert_allclose((u[0], q[0]), (-12.5, 0.3))
    np.testing.assert_allclose(u[1:], U)


@pytest.mark.parametrize("names", ["Gain,Phase,Angle", "Offset,u,q", "unit,u,q", "scale,torque,Nm"])
def test_names_like_keys_are_names(names: str, tmp_path: Path) -> None:
    (u, q), read = table(written(tmp_path, [names], T, U, Q), *names.split(",")[1:])
    assert (read.column_names, u.size, q.size) == (names.split(","), ROWS, ROWS)


def test_factors_of_one_need_no_word(tmp_path: Path) -> None:
    (u,), read = table(written(tmp_path, [NAMES, "Scale,1,1"], T, U, Q), "torque [Nm]")
    assert u.size == ROWS
    assert not any("factor" in note or "multiplied" in note for note in read.warnings)


@pytest.mark.parametrize(
    ("above", "units"),
    [
        (["ETASAsciiItemFile,record,CrLf", "time,n,M", "f8,f8,i2", "s,rpm,Nm"], ["s", "rpm", "Nm"]),
        (["time,n,M", "s,1/min,N·m", "T0 = 1,T0 = 1,T0 = 1", "dt = 0.1,dt = 0.1,dt = 0.1"], ["s", "1/min", "N·m"]),
        (["time,n,M", "LREAL,LREAL,INT", "s,°/s (Angular velocity),(None)"], ["s", "°/s", ""]),
    ],
)
def test_types_and_settings_of_each_channel_are_no_names(above: list[str], units: list[str], tmp_path: Path) -> None:
    read = CsvTable(str(written(tmp_path, above, T, U, Q)), {"t": "time", "u": "M"})
    assert [read.units[name] for name in ("time", "n", "M")] == units


def test_lines_say_what_numbered_channels_are(tmp_path: Path) -> None:
    head = ["Sample Rate = 2000 Hz", "CH1 = Motor Speed [rpm]", "CH2 = Torque Command [%]", "Time(s),CH1,CH2"]
    read = CsvTable(str(written(tmp_path, head, T, U, Q)), {})
    assert read.column_names == ["Time(s)", "CH1 Motor Speed [rpm]", "CH2 Torque Command [%]"]


def test_a_recorder_that_names_its_rows_and_leaves_the_first_column_empty(tmp_path: Path) -> None:
    head = ['"Model","DL"', '"TraceName","Torque  ","Angle  "', '"VUnit","Nm","deg"', '"HResolution",5.0E-04,5.0E-04']
    rows = [f",{u:.3E},{q:.3E}," for u, q in zip(U, Q, strict=True)]
    (tmp_path / "log.csv").write_text("\n".join([*head, "", *rows]) + "\n")
    (u,), read = table(tmp_path / "log.csv", "Torque")
    np.testing.assert_allclose(u, U, rtol=1e-3)
    assert (read.units["Angle"], read.sample_time) == ("deg", 5e-4)


@pytest.mark.parametrize(
    "below", ["0.06,0.1\n\nEnd of data\nSamples: 30\n", "0.06\nstopped by user\n", "0.0\n# closed\n"]
)
def test_a_footer_behind_a_line_that_was_cut(below: str, tmp_path: Path) -> None:
    (u, q), read = table(written(tmp_path, [NAMES], T, U, Q, below=below), "torque [Nm]", "angle [deg]")
    assert (u.size, q.size) == (ROWS, ROWS)
    assert read.warnings[-1] == "the line before them is cut off in the middle, and left out"


def test_tabs_at_the_end_of_the_last_row_are_cells_without_a_value(tmp_path: Path) -> None:
    rows = [f"{t:g}\t{u:g}\t{q:g}\t\n" for t, u, q in zip(T, U, Q, strict=True)]
    last = rows.pop().split("\t")
    (tmp_path / "log.txt").write_text(f"time\tu\tslow\t\n{''.join(rows)}{last[0]}\t{last[1]}\t\t\nEOF\n")
    (u,), read = table(tmp_path / "log.txt", "u")
    assert (u.size, read.warnings) == (ROWS, ["1 line(s) of text at its end are left out"])


def test_a_recorder_with_signs_apart_and_milliseconds_beside_the_date(tmp_path: Path) -> None:
    """2023-05-01 10:00:00 UTC is 1682935200 s."""
    head = ['"Model","GL840"', '"Number","Date&Time","ms","CH1"', '"NO.","Time","ms","A"']
    rows = [
        f'{k + 1},"2023/05/01 10:00:{k // 100:02d}",{10 * (k % 100)},"{"-" if u < 0 else "+"} {abs(u):.1f}"'
        for k, u in enumerate(np.tile(U, 7))
    ]
    (tmp_path / "log.csv").write_text("\n".join([*head, *rows]) + "\n")
    read = CsvTable(str(tmp_path / "log.csv"), {"t": "Date&Time+ms", "u": "CH1"})
    (batch,) = read.batches()
    t = batch.columns["t"]
    np.testing.assert_allclose(t, 1682935200.0 + 0.01 * np.arange(7 * ROWS), atol=1e-6)
    np.testing.assert_allclose(batch.columns["u"], np.tile(U, 7))
    np.testing.assert_allclose(np.array(read.peek()["Date&Time+ms"]), t)
    assert read.units["CH1"] == "A"


@pytest.mark.parametrize(("kind", "before"), [("file", 9), ("file", 1 << 18), ("pipe", 9), ("followed", 9)])
@pytest.mark.parametrize("units", [[], ["s,Nm,deg"]])
def test_a_header_that_comes_again_is_left_out(kind: str, units: list[str], before: int, tmp_path: Path) -> None:
    """Another recording of the same logger; without a clock nothing else would say so. One of them fills blocks."""
    head = ["# a rig", "time,torque,angle" if units else NAMES, *units]
    rows = [[f"{t},{10 * k},2" for t in range(size)] for k, size in enumerate((before, 9, 4))]
    again = ["# started once more", *head[1:]]
    content = "\n".join([*head, *rows[0], *again, *rows[1], "", *head, *rows[2]]) + "\n"
    torque = "torque" if units else "torque [Nm]"
    for clock, begins in (({}, [before, before + 9]), ({"t": head[1].split(",")[0]}, [])):
        read = opened(kind, tmp_path, content, wanted={**clock, "u": torque})
        batches = list(read.batches())
        np.testing.assert_allclose(
            np.concatenate([one.columns["u"] for one in batches]), np.repeat([0, 10, 20], (before, 9, 4))
        )
        ends = np.cumsum([one.rows for one in batches])
        assert [int(end) - one.rows for end, one in zip(ends, batches, strict=True) if one.restart] == begins
        line = before + 4 + len(units)
        assert any(note.startswith(f"its header comes again 2 time(s), first in line {line}") for note in read.warnings)
        assert read.unreadable == 0
    if kind == "file":  # as `init` looks at it
        assert [c.values.size for c in sample(str(tmp_path / "log.csv")).tables[0].channels] == [before + 13] * 3


def test_a_bad_cell_below_a_header_that_comes_again_is_in_its_line(tmp_path: Path) -> None:
    rows = [f"{t},1,2" for t in range(9)]
    (tmp_path / "log.csv").write_text("\n".join([NAMES, *rows, NAMES, *rows, "9,x1,2", *rows]) + "\n")
    with pytest.raises(DataError, match='line 21, column "torque \\[Nm\\]": "x1" is not a number'):
        table(tmp_path / "log.csv", "torque [Nm]")


def test_a_short_line_in_the_middle_is_an_error_as_ever(tmp_path: Path) -> None:
    rows = [f"{t},1,2" for t in range(9)]
    (tmp_path / "log.csv").write_text("\n".join([NAMES, *rows, "9,1", *rows]) + "\nEnd of data\n")
    with pytest.raises(DataError, match="2 fields where the header has 3"):
        table(tmp_path / "log.csv", "torque [Nm]")


@pytest.mark.parametrize(
    ("head", "row"),
    [
        ("torque time,torque,torque status,angle time,angle,angle status", "{t},{u},0,{s},{q},0"),
        ("Time,torque,Quality,Time,angle,Quality", "{t},{u},Good,{s},{q},Good"),
        ("Torque,,,Angle,,\nTime,Value,Quality,Time,Value,Quality", "{t},{u},192,{s},{q},192"),
        ("t,torque,unit,t,angle,unit", "{t},{u},Nm,{s},{q},deg"),
    ],
)
def test_three_columns_for_each_signal(head: str, row: str, tmp_path: Path) -> None:
    """Time, value and how good it is, or its unit: each value stays with its stamp."""
    path = tmp_path / "log.csv"
    rows = [row.format(t=f"{t:.4f}", s=f"{t + 0.0003:.4f}", u=u, q=q) for t, u, q in zip(T, U, Q, strict=True)]
    path.write_text("\n".join([head, *rows]) + "\n")
    kind = format_of(path, path.read_bytes())
    assert kind is not None
    file = open_container(path, kind)
    channels = {group.full(name): (group, name) for group in file.groups for name in group.units}
    for one, late, values in (("torque", 0.0, U), ("angle", 0.0003, Q)):
        group, name = next(at for full, at in channels.items() if full.lower() == f"{one}/value")
        clock = next(name for name in group.units if name.endswith("time"))
        found = file.read(group, [clock, name], 0, ROWS)
        np.testing.assert_allclose(found[clock], T + late, atol=1e-9)
        np.testing.assert_allclose(found[name], values)
        if "unit" in head:
            assert group.units[name] == {"torque": "Nm", "angle": "deg"}[one]


def test_a_single_number_of_a_mat_file_is_its_sample_time(tmp_path: Path) -> None:
    """As an iddata keeps it; two that differ say nothing."""
    path = str(tmp_path / "log.mat")
    for said, found in (({"Ts": 0.002}, 0.002), ({"Ts": 0.002, "dt": 0.004}, None), ({"Ts": 20.0}, None)):
        savemat(path, {"z": {"u": U, "y": Q, **said}})
        assert sample(path).sample_time == found


def test_the_sample_time_of_a_controller_is_none_of_the_log(tmp_path: Path) -> None:
    """A struct goes with the log where it holds channels; gains and matrices are none."""
    path, controller = str(tmp_path / "log.mat"), {"Ts": 0.001, "K": np.eye(3), "num": np.ones(5)}
    for said, found in (({}, None), ({"Ts": 0.002}, 0.002), ({"rec": {"Ts": 0.002, "v": U}}, 0.002)):
        savemat(path, {"u": U, "y": Q, "controller": controller, **said})
        assert sample(path).sample_time == found


def test_values_of_a_long_table_may_be_words(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    rows = [f"{t},u,{u}\n{t},q,{q}\n{t},on,true\n{t},mode,idle" for t, u, q in zip(T, U, Q, strict=True)]
    path.write_text("\n".join(["Timestamp,Key,Value", *rows]) + "\n")
    assert long_form(CsvTable(str(path), {})) == ("Timestamp", ("Key",), ("Value",))
    file = LongFile(str(path))
    (group,) = file.groups
    found = file.read(group, ["u", "q", "on"], 0, ROWS)
    np.testing.assert_allclose([found["u"], found["q"], found["on"]], [U, Q, np.ones(ROWS)])


@pytest.mark.parametrize(
    ("head", "row"),
    [("name,time,value", "torque,{t},{u}"), ("time,torque,angle", "{t},{u},{q}"), ("k,torque,angle", "{k},{u},{q}")],
)
def test_commas_that_tear_decimal_commas_are_named(head: str, row: str, tmp_path: Path) -> None:
    def comma(x: float) -> str:
        return f"{x:.4f}".replace(".", ",")

    path = tmp_path / "log.csv"
    rows = [row.format(k=k, t=comma(T[k]), u=comma(U[k]), q=comma(Q[k])) for k in range(ROWS)]
    path.write_text("\n".join([head, *rows]) + "\n")
    with pytest.raises(DataError, match=r"log.csv: line 1 names 3 columns, .*: decimal commas between commas"):
        CsvTable(str(path), {})


@pytest.mark.parametrize("form", ["stamped", "several", "bare"])
def test_samples_for_teleplot(form: str, tmp_path: Path) -> None:
    """`>name:ms:value§unit|flags`, a sample of one channel in a line, or several; texts and planes are none."""
    lines = ["boot v3", ">log:1:started|t", ">xy:1:2:3|xy", ">p:1:2|np,xy", ">u:1.2.3", ">u:-", ">u:1e"]
    lines += [] if form == "bare" else [">q:3", ">w:5"]
    if form == "several":
        for begin in range(0, ROWS, 3):
            part = slice(begin, begin + 3)
            u, q = (";".join(f"{1000 * t:g}:{x:g}" for t, x in zip(T[part], y[part], strict=True)) for y in (U, Q))
            lines += [f">u:{u}§Nm", f">q:{q};§deg|g"]
    else:
        stamps = [f"{1000 * t:g}:" if form == "stamped" else "" for t in T]
        lines += [f">u:{t}{u:g}§Nm|g\n>q:{t}{q:g}§deg" for t, u, q in zip(stamps, U, Q, strict=True)]
    (tmp_path / "log.txt").write_text("\n".join(lines) + "\n", encoding="utf-8")
    kind = format_of(tmp_path / "log.txt", (tmp_path / "log.txt").read_bytes()[:4096])
    assert kind is not None
    file = open_container(tmp_path / "log.txt", kind)
    found = {group.full(name): file.read(group, [name], 0, ROWS)[name] for group in file.groups for name in group.units}
    units = {group.full(name): unit for group in file.groups for name, unit in group.units.items()}
    of = "" if form == "bare" else "/value"
    np.testing.assert_allclose(found[f"u{of}"], U)
    np.testing.assert_allclose(found[f"q{of}"], Q)
    assert (units[f"u{of}"], units[f"q{of}"]) == ("Nm", "deg")
    if of:
        np.testing.assert_allclose(found["q/time"], 1000 * T)
        assert units["q/time"] == "ms"
    assert file.notes[:1] == ["7 line(s) that are no samples are left out"]
    said = [] if form == "bare" else ["samples without stamps beside others are left out: 1 of q, 1 of w"]
    assert file.notes[1:] == said
