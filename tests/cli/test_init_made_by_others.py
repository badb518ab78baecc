"""`dsd init` on what programs of others write: layouts are theirs, columns and numbers are made up."""

import json
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest
from openpyxl import Workbook
from scipy.io import netcdf_file, savemat

from dsd_cli.errors import DataError
from dsd_cli.files.sample import sample
from tests.cli.rig import done
from tests.cli.test_init_walked import AXIS, chosen, proposed, roles
from tests.files import strangers

SHORT = {name: x[:600] for name, x in AXIS.items()}
U_AND_PLACE = list(zip(SHORT["t"], SHORT["u"], SHORT["q"], strict=True))


def test_a_sheet_with_notes_beside_and_a_mean_below_its_table(tmp_path: Path) -> None:
    """A blank row was taken for the blank row above the names, and the mean for a cell that is no number."""
    book = Workbook()
    sheet = book.active
    sheet.append(["Run 7"])
    sheet.append([])
    sheet.append([None, "t", "Current", "Angle"])
    sheet.append([None, "[ms]", "[A]", "[rad]"])
    for at, (t, u, q) in enumerate(U_AND_PLACE):
        sheet.append([None, 1e3 * t, u, q, None, "outlier?" if at == 9 else None, 1.5 * at if at < 30 else None])
    sheet.append([])
    sheet.append([None, "Mean", 0.5, 0.0])
    book.save(tmp_path / "run.xlsx")
    made = proposed(tmp_path / "run.xlsx")
    assert made.question == ""
    assert not any("comes again" in one for one in made.said)


def test_a_list_of_events_above_the_rows_is_no_row(tmp_path: Path) -> None:
    """As wide as the rows by chance: `1 fields where the header has 4`."""
    head = ["Data info", "Sample rate:,500", "", "Ch. no.,Name,Unit,Min,Max", "0,Torque,Nm,-1.2,1.2", "", "Events"]
    head += ["Event,Text,Time,Comment", "1,storing started at,0,", "2,storing stopped at,8,", "", "Data1"]
    head += ["Time (s),Torque (Nm),Speed (rad/s),Angle (rad)"]
    body = strangers.rows(SHORT, *(SHORT[one] for one in "tuvq"))
    path = strangers.text(tmp_path, "run.csv", [*head, *body], "\r\n")
    assert [one.values.size for one in sample(str(path)).tables[0].channels] == [600] * 4
    assert roles(chosen(path))["position"] == "Angle (rad)"


def pandas_table(path: Path) -> None:
    """`to_hdf(format="table")`: a block of columns in one field, named in a pickle, and an index beside the table."""
    kind = [("index", "f8"), ("values_block_0", "f8", (2,))]
    rows = np.array([(t, (u, q)) for t, u, q in U_AND_PLACE], kind)
    with h5py.File(path, "w") as file:
        table = file.create_dataset("log/table", data=rows)
        table.attrs["values_block_0_kind"] = np.bytes_(b"(lp0\nVtau\np1\naVtheta\np2\na.")
        file["log/_i_table/index/sortedLR"] = np.sort(np.random.default_rng(5).random(5000))
        file["log/_i_table/index/indicesLR"] = np.arange(5000, dtype="u4")[::-1]


def pandas_frame(path: Path) -> None:
    """`to_hdf`: a matrix, and the list of its columns beside it."""
    with h5py.File(path, "w") as file:
        file["log/axis1"] = SHORT["t"]
        file["log/block0_items"] = np.array([b"tau", b"theta"])
        file["log/block0_values"] = np.column_stack([SHORT["u"], SHORT["q"]])


@pytest.mark.parametrize("write", [pandas_table, pandas_frame])
def test_what_pandas_wrote_has_the_names_of_its_columns(write: Callable[[Path], None], tmp_path: Path) -> None:
    write(tmp_path / "log.h5")
    found = roles(chosen(tmp_path / "log.h5"))
    assert {role: found[role].rpartition("/")[2] for role in ("u", "position")} == {"u": "tau", "position": "theta"}
    assert found["time"] in ("log/table/index", "log/axis1")


def test_registers_that_a_drive_names_with_their_numbers(tmp_path: Path) -> None:
    said = "{:.6f} 1/{{MODE(0x000): 10, POSITION(0x001): {:.6g}, TORQUE(0x003): {:.6g}, FAULT(0x00f): 0}}"
    lines = [said.format(1_741_200_000 + t, q, u) for t, u, q in U_AND_PLACE]
    found = roles(chosen(strangers.text(tmp_path, "log.txt", lines)))
    assert {role: found[role] for role in ("time", "u", "position")} == {
        "time": "time",
        "u": "TORQUE",
        "position": "POSITION",
    }


def test_frames_that_were_decoded_over_several_lines(tmp_path: Path) -> None:
    said = "({:.6f}) can0 064#00 R ::\nDrive(\n    Torque: {:.6g} Nm,\n    Angle: {:.6g} rad\n)"
    path = strangers.text(tmp_path, "log.txt", [said.format(1_741_200_000 + t, u, q) for t, u, q in U_AND_PLACE])
    (table,) = sample(str(path)).tables
    assert {one.name: one.unit for one in table.channels} == {"time": "", "Torque": "Nm", "Angle": "rad"}
    assert [one.values.size for one in table.channels] == [600] * 3


@pytest.mark.parametrize(
    "head",
    [
        b"date Wed Mar 05 18:40:00.0 2025\nbase hex  timestamps absolute\n 0.0 Start of measurement\n",
        b"LOGG\x90\0\0\0\x02\x10\0\0" + bytes(90),
        b"timestamp,arbitration_id,extended,remote,error,dlc,data\n0.1,0x64,0,0,0,8,AAAAAAAAAAA=\n",
        b";$FILEVERSION=1.1\n;$STARTTIME=45000.5\n 1) 2.1 Rx 0064 8 00 01 02 03 04 05 06 07\n",
    ],
)
def test_traces_of_a_bus_are_raw_frames(head: bytes, tmp_path: Path) -> None:
    (tmp_path / "trace.asc").write_bytes(head + 20 * b" 0.1 1 64 Rx d 8 00 01 02 03 04 05 06 07\n")
    with pytest.raises(DataError, match=r"trace\.asc: holds raw frames of a CAN bus"):
        sample(str(tmp_path / "trace.asc"))


def test_a_stamp_with_two_zones_is_one(tmp_path: Path) -> None:
    """mosquitto_sub writes `Z+0000`; its stamps were left aside without a word."""
    row = '{{"tst":"2025-05-01T12:00:{:09.6f}Z+0000","topic":"axis","payload":{{"torque":{:.6g},"pos":{:.6g}}}}}'
    path = strangers.text(tmp_path, "log.jsonl", [row.format(*one) for one in U_AND_PLACE])
    assert roles(chosen(path))["time"] == "tst"
    assert json.loads(path.read_text("utf-8").splitlines()[0])["tst"].endswith("Z+0000")


def test_stamps_since_a_day_say_their_unit(tmp_path: Path) -> None:
    with netcdf_file(tmp_path / "log.nc", "w") as file:
        file.createDimension("time", 600)
        for name, unit, x in (
            ("time", b"milliseconds since 2025-01-01 00:00:00", 1e3 * SHORT["t"]),
            ("torque", b"N m", SHORT["u"]),
            ("angle", b"rad", SHORT["q"]),
        ):
            variable = file.createVariable(name, "f8", ("time",))
            variable[:] = x
            variable.units = unit
    assert chosen(tmp_path / "log.nc").found["time"].time_unit == "ms"


def test_an_instrument_says_its_interval(tmp_path: Path) -> None:
    said = {"Tstart": -0.6, "Tinterval": 0.002, "Length": 600.0}
    channels = {"A": SHORT["u"].reshape(-1, 1), "B": SHORT["v"].reshape(-1, 1)}
    savemat(tmp_path / "scope.mat", {**said, **channels}, format="4")
    assert sample(str(tmp_path / "scope.mat")).sample_time == 0.002


def test_quotes_inside_of_a_name_are_of_the_name(tmp_path: Path) -> None:
    head = 'Index;Time stamp (ms);"""Axis_1"".ActualPosition";"""Axis_1"".Torque"'
    body = strangers.rows(SHORT, np.arange(600), 1e3 * SHORT["t"], SHORT["q"], SHORT["u"], by=";")
    found = roles(chosen(strangers.text(tmp_path, "trace.csv", [head, *body])))
    assert (found["position"], found["u"]) == ('"Axis_1".ActualPosition', '"Axis_1".Torque')


@pytest.mark.parametrize("delimiter", ["\t", ","])
def test_means_below_an_empty_stamp_are_no_rows(delimiter: str, tmp_path: Path) -> None:
    rows = [delimiter.join(f"{x:.6g}" for x in row) for row in U_AND_PLACE]
    ends = [delimiter.join(("", "Mean", "0.1")), delimiter.join(("", "Std", "0.3"))]
    (tmp_path / "log.csv").write_text("\n".join([delimiter.join(("t", "u", "q")), *rows, *ends]) + "\n")
    done("init", "log.csv", cwd=tmp_path)


def test_a_csv_whose_stamps_have_two_zones(tmp_path: Path) -> None:
    rows = [f"2025-05-01T12:00:{t:09.6f}Z+0000,{u:.6g},{q:.6g}" for t, u, q in U_AND_PLACE]
    (tmp_path / "log.csv").write_text("\n".join(["time,u,q", *rows]) + "\n")
    assert roles(chosen(tmp_path / "log.csv"))["time"] == "time"
    done("init", "log.csv", cwd=tmp_path)


def _users_own(file: h5py.File) -> None:
    """A group that begins like an index of PyTables'."""
    for name in ("t", "u", "q"):
        file[f"_i_axis/{name}"] = SHORT[name]


def _a_group_beside(file: h5py.File) -> None:
    file["axis_values"] = np.array(U_AND_PLACE)
    file.create_group("axis_items")


def _an_empty_attribute(file: h5py.File) -> None:
    rows = [(t, (u, q)) for t, u, q in U_AND_PLACE]
    file["d"] = np.array(rows, [("t", "f8"), ("u", "f8", (2,))])
    file["d"].attrs["u_kind"] = np.array([], dtype="f8")


@pytest.mark.parametrize("write", [_users_own, _a_group_beside, _an_empty_attribute])
def test_what_only_looks_like_pandas_is_read_as_it_is(write: Callable[[h5py.File], None], tmp_path: Path) -> None:
    with h5py.File(tmp_path / "log.h5", "w") as file:
        write(file)
    assert len(sample(str(tmp_path / "log.h5")).tables[0].channels) == 3
