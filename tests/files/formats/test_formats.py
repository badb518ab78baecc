"""Files of every format, as its own library writes them, are read as the numbers that went in."""

import json
import logging
import struct
from pathlib import Path

import numpy as np
import pytest
from scipy.io import netcdf_file, savemat

from dsd_cli.errors import DataError
from dsd_cli.files.sample import sample
from dsd_cli.files.tables_in import open_table
from tests.files.formats import makers
from tests.files.formats.makers import (
    MAKERS,
    START_NS,
    channels,
    mat5,
    mat7_objects,
    mat7_timetable,
    mat73_objects,
    mcap_ros2,
    mdf,
    npz,
    tdms,
)


def read(path: Path, names: dict[str, str]) -> tuple[dict[str, np.ndarray], list[str]]:
    table = open_table(path, names)
    batches = list(table.batches())
    return {name: np.concatenate([batch.columns[name] for batch in batches]) for name in names}, table.warnings


@pytest.mark.parametrize("maker", MAKERS, ids=lambda maker: maker.__name__)
def test_what_went_in_comes_out(maker, tmp_path: Path) -> None:
    data = channels()
    made = maker(tmp_path, data)
    found, _ = read(*made)
    np.testing.assert_allclose(found["t"] - found["t"][0], data["t"], rtol=0, atol=2e-9)
    for name in ("u", "velocity"):
        np.testing.assert_allclose(found[name], data[name], rtol=0, atol=1e-6 if maker.__name__ == "mdf" else 0)


@pytest.mark.parametrize("maker", MAKERS, ids=lambda maker: maker.__name__)
@pytest.mark.filterwarnings(
    "error::pytest.PytestUnraisableExceptionWarning"
)  # what a library says when it is collected
def test_a_file_that_was_cut_off_is_one_line_or_what_is_whole_of_it(maker, tmp_path: Path) -> None:
    data = channels(300)
    made = maker(tmp_path, data)
    path = next(made.path.glob("*.db3")) if made.path.is_dir() else made.path
    content = path.read_bytes()
    for share in (0.02, 0.3, 0.5, 0.9, 0.99):
        path.write_bytes(content[: int(share * len(content))])
        try:
            found, _ = read(*made)
        except DataError as error:
            said = str(error)
        else:
            said = str(made.path)
            np.testing.assert_allclose(found["u"], data["u"][: found["u"].size], rtol=0, atol=1e-6)
        assert said.startswith(str(made.path))
        assert "\n" not in said


@pytest.mark.parametrize("maker", [mat7_objects, mat73_objects], ids=lambda maker: maker.__name__)
def test_objects_without_their_library_are_said(maker, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made = maker(tmp_path, channels())
    monkeypatch.setattr("dsd_cli.files.formats.matlab_objects.find_spec", lambda name: None)
    with pytest.raises(DataError, match=r"no column .drive/iq.; it has gain.*pip install 'mat-io"):
        read(*made)
    assert "pip install 'mat-io" in open_table(made.path, {"u": "gain"}).warnings[0]


def test_a_tdms_file_that_was_cut_off_is_read_and_said_and_nothing_else_is(tmp_path: Path, capfd) -> None:
    path, names = tdms(tmp_path, channels(300))
    path.write_bytes(path.read_bytes()[:-100])
    assert read(path, names)[1][0] == "its end is missing: what is whole of it is read"
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize(
    ("maker", "whole", "spoiled"),
    [(mdf, b"##CG", b"##9G"), (mcap_ros2, b"builtin_interfaces/Time", b"builtin_interfa es/Time")],
)
def test_a_library_that_logs_or_prints_what_it_raises_is_not_heard_twice(
    maker, whole, spoiled, tmp_path, capfd
) -> None:
    path, names = maker(tmp_path, channels(300))
    path.write_bytes(path.read_bytes().replace(whole, spoiled))
    with pytest.raises(DataError, match="cannot be read as"):
        read(path, names)
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize(
    ("whole", "spoiled"),
    [((9, 4800), (46, 4800)), ((6, 8, 6), (6, 8, 77))],
    ids=["no such type of numbers", "no such class of matrix"],
)
def test_an_element_that_there_cannot_be_ends_no_process(whole, spoiled, tmp_path: Path) -> None:
    """SciPy reads through a pointer to nothing there."""
    path, names = tmp_path / "log.mat", {"t": "drive/t", "u": "drive/u"}
    savemat(path, {"drive": channels(600)})
    before, after = (b"".join(part.to_bytes(4, "little") for part in parts) for parts in (whole, spoiled))
    assert before in path.read_bytes()
    path.write_bytes(path.read_bytes().replace(before, after))
    with pytest.raises(DataError, match=r"cannot be read as a MAT file .*there (cannot be|is not)"):
        read(path, names)


def test_a_channel_that_lies_outside_of_its_record_ends_no_process(tmp_path: Path) -> None:
    """asammdf reads, and writes, what is not its own."""
    path, names = mdf(tmp_path, channels(300))
    content, placed = path.read_bytes(), bytes([8, 0, 0, 0, 64, 0, 0, 0])
    assert placed in content
    path.write_bytes(content.replace(placed, bytes([236, *placed[1:]])))
    with pytest.raises(DataError, match=r"is damaged .*outside of its record"):
        read(path, names)


def test_an_archive_of_numpy_of_a_version_that_there_is_not_is_one_line(tmp_path: Path) -> None:
    path, names = npz(tmp_path, channels(50))
    content = bytearray(path.read_bytes())
    content[content.index(b"PK\x01\x02") + 6] = 99  # what is needed to extract it
    path.write_bytes(content)
    with pytest.raises(DataError, match=r"cannot be read as a NumPy"):
        read(path, names)


@pytest.mark.parametrize(
    ("said", "step"),
    [
        ({"dt": 2e-3}, 2e-3),
        ({"dt": 2e-3, "Ts": 1e-3}, None),
        ({"K": 2e-3}, None),
        ({"fs": 500}, 2e-3),
        ({"sampling_rate": 500.0, "dt": 2e-3}, 2e-3),
        ({"fs": 0}, None),
        ({"fs": 300, "dt": 1 / 300 + 1e-10}, 1 / 300),
        ({"Fs": 60.0, "Fc": 45.0}, None),  # friction at rest and in motion
        ({"fs": 8}, None),  # kHz
    ],
)
def test_a_number_in_an_archive_of_numpy_says_how_far_rows_are_apart(said, step, tmp_path: Path) -> None:
    np.savez(tmp_path / "log.npz", q=np.arange(60.0), tau=np.ones(60), **said)
    assert sample(str(tmp_path / "log.npz")).sample_time == step


@pytest.mark.parametrize("shuffled", [False, True])
def test_rows_by_their_numbers_are_in_the_order_of_these(shuffled, tmp_path: Path) -> None:
    made = makers.json_by_rows(tmp_path, data := channels(300))
    if shuffled:
        columns = json.loads(made.path.read_text())
        made.path.write_text(json.dumps({name: dict(sorted(rows.items())) for name, rows in columns.items()}))
    np.testing.assert_array_equal(read(*made)[0]["t"], data["t"])


def test_trials_that_are_numbered_are_tables(tmp_path: Path) -> None:
    data = {name: values.tolist() for name, values in channels(300).items()}
    (tmp_path / "a.json").write_text(json.dumps({"0": data, "1": data}))
    found, _ = read(tmp_path / "a.json", {"u": "1/u"})
    np.testing.assert_array_equal(found["u"], data["u"])
    (tmp_path / "b.json").write_text(json.dumps({"1": {"u": data["u"]}}))
    assert read(tmp_path / "b.json", {"u": "1/u"})[0]["u"].size == 300


def test_packed_numbers_of_netcdf_are_scaled_and_missing_ones_are_none(tmp_path: Path) -> None:
    """Conventions of CF: 2 bytes with scale_factor, add_offset and _FillValue; a unit may be the number 1."""
    packed = np.arange(300, dtype=np.int16)
    with netcdf_file(tmp_path / "log.nc", "w") as file:
        file.createDimension("time", 300)
        variable = file.createVariable("u", "h", ("time",))
        variable[:] = packed
        variable.scale_factor, variable.add_offset, variable._FillValue, variable.units = 0.5, 2.0, np.int16(7), 1.0
    found, _ = read(tmp_path / "log.nc", {"u": "u"})
    np.testing.assert_array_equal(found["u"], np.where(packed == 7, np.nan, 0.5 * packed + 2.0))


def test_a_value_in_a_group_of_its_own_is_no_variable_of_octave(tmp_path: Path) -> None:
    h5py = pytest.importorskip("h5py", reason="h5py is not installed")
    with h5py.File(tmp_path / "log.h5", "w") as file:
        file["speed/value"] = np.arange(50.0)
    assert read(tmp_path / "log.h5", {"u": "speed/value"})[0]["u"].size == 50


def test_what_asammdf_says_elsewhere_is_heard_again(tmp_path: Path) -> None:
    path, names = makers.mdf(tmp_path, channels(300))
    logger = logging.getLogger("asammdf")
    level = logger.level
    read(path, names)
    assert logger.level == level


def test_an_archive_of_numpy_that_was_cut_off_is_no_spreadsheet(tmp_path: Path) -> None:
    path, names = npz(tmp_path, channels())
    path.write_bytes(path.read_bytes()[:-100])
    with pytest.raises(DataError, match=r"cannot be read as a NumPy.*is it whole"):
        read(path, names)


@pytest.mark.parametrize("version", ["v7", "v7.3"])
def test_objects_without_numbers_say_what_to_do_in_matlab(version: str, tmp_path: Path) -> None:
    matio = pytest.importorskip("matio", reason="mat-io is not installed")
    from matio.utils.matclass import MatlabOpaque

    named = MatlabOpaque(properties={"Name": "axis"}, classname="Simulink.Signal", type_system="MCOS")
    matio.save_to_mat(str(tmp_path / "named.mat"), {"named": named}, version=version)
    with pytest.raises(
        DataError, match=r"no channel with numbers in it: the MATLAB objects .*save\('log.mat'"
    ) as caught:
        open_table(tmp_path / "named.mat", {"u": "u"})
    assert "\n" not in str(caught.value)


def test_a_timetable_of_dates_is_stamped_since_1970(tmp_path: Path) -> None:
    data = channels(step=0.0001)
    path, names = mat7_timetable(tmp_path, data, "2026-01-01")
    found, _ = read(path, names)
    np.testing.assert_allclose(found["t"] - START_NS / 1e9, data["t"], rtol=0, atol=3e-7)


def test_a_timetable_keeps_its_stamps_below_a_millisecond(tmp_path: Path) -> None:
    data = channels(step=0.0001)
    found, _ = read(*mat7_timetable(tmp_path, data))
    np.testing.assert_allclose(found["t"], data["t"], rtol=0, atol=1e-9)


def test_the_hint_for_a_channel_that_is_not_there_goes_by_its_own_name_and_not_by_its_group(tmp_path: Path) -> None:
    path = mat5(tmp_path, channels()).path
    for name, hint in (("drive/iq", 'u = "..."'), ("drive/curent", 'u = "drive/current"')):
        with pytest.raises(DataError) as caught:
            open_table(path, {"t": "time", "u": name})
        assert str(caught.value).endswith(hint)


def test_a_wide_matrix_has_its_signals_in_its_rows(tmp_path: Path) -> None:
    wide = np.arange(3)[:, None] + np.arange(2000.0)
    savemat(tmp_path / "log.mat", {"X": wide, "k": np.ones((1, 5))})
    channels = {one.name: one.values for table in sample(str(tmp_path / "log.mat")).tables for one in table.channels}
    for k in range(3):
        assert np.array_equal(channels[f"X/{k + 1}"], wide[k])


@pytest.mark.parametrize("fill", [" ", "\0"])
@pytest.mark.parametrize("turned", [True, False])
def test_a_result_of_modelica_has_its_variables_by_their_names(turned: bool, fill: str, tmp_path: Path) -> None:
    """By the manual of Dymola: texts as matrices of letters, `dataInfo` with matrix and column, below 0 a negative; it
    fills texts up with blanks, OpenModelica with NUL."""
    names, said = ["Time", "J", "arm.w", "load.w"], ["in [s]", "[kg.m2]", "speed [rad/s|rpm]", "the other way"]
    texts = {
        key: np.array([[*f"{one:{fill}<20}"] for one in of]) for key, of in (("name", names), ("description", said))
    }
    info = np.array([[0, 1, 0, -1], [1, 2, 0, -1], [2, 2, 0, -1], [2, -2, 0, -1]])
    whole = texts | {"dataInfo": info, "data_1": np.ones((2, 2)), "data_2": np.arange(60.0).reshape(30, 2)}
    whole = {key: value.T if turned else value for key, value in whole.items()}
    kind = np.array([[*f"{one:11}"] for one in ("Atrajectory", "1.1", "", "binTrans" if turned else "binNormal")])
    with (tmp_path / "a.mat").open("wb") as file:  # version 4, by its manual: SciPy writes no NUL in texts
        for name, values in {"Aclass": kind, **whole}.items():
            text = values.dtype.kind == "U"
            file.write(np.array([51 if text else 0, *values.shape, 0, len(name) + 1], "<i4").tobytes())
            file.write(name.encode() + b"\0")
            file.write((values.view("<u4").astype("u1") if text else values.astype("<f8")).tobytes("F"))
    expected = {"Time": ("s", [0.0, 2.0]), "arm.w": ("rad/s", [1.0, 3.0]), "load.w": ("", [-1.0, -3.0])}
    assert channels_in(tmp_path / "a.mat") == expected


def channels_in(path: Path) -> dict[str, tuple[str, list[float]]]:
    """Name -> unit, first values."""
    tables = sample(str(path)).tables
    return {one.name: (one.unit, [*one.values[:2]]) for table in tables for one in table.channels}


def test_a_matrix_of_hdf5_whose_columns_have_names_and_units(tmp_path: Path) -> None:
    """As a text for each column in its attributes; one of them for all columns is no name."""
    h5py = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "a.h5", "w") as file:
        data = file.create_dataset("log", data=np.arange(90.0).reshape(30, 3))
        data.attrs["columns"], data.attrs["units"] = ["t", "tau", "q"], ["s", "Nm", "rad"]
        other = file.create_dataset("raw", data=np.arange(90.0).reshape(30, 3))
        other.attrs["columns"], other.attrs["unit"] = "all", "V"
        for name, labels in (
            ("of_rows", [f"r{k}" for k in range(30)]),
            ("numbered", ["0", "1", "2"]),
            ("alike", ["x"] * 3),
        ):
            file.create_dataset(name, data=np.arange(90.0).reshape(30, 3)).attrs["labels"] = labels
    names = {"log/t": ("s", [0.0, 3.0]), "log/tau": ("Nm", [1.0, 4.0]), "log/q": ("rad", [2.0, 5.0])}
    by_number = {"raw": "V", "of_rows": "", "numbered": "", "alike": ""}
    names |= {f"{name}/{k + 1}": (unit, [k, k + 3.0]) for name, unit in by_number.items() for k in range(3)}
    assert channels_in(tmp_path / "a.h5") == names


def test_tests_of_json_with_names_are_no_channels(tmp_path: Path) -> None:
    tests = [{"name": name, "position": [0.5] * 99} for name in ("slow", "fast")]
    (tmp_path / "a.json").write_text(json.dumps({"tests": tests}))
    assert all(name.endswith("position") for name in channels_in(tmp_path / "a.json"))


def test_a_mat_that_has_the_names_of_a_result_of_modelica_alone_is_read_as_it_is(tmp_path: Path) -> None:
    parts = {
        "Aclass": "x",
        "name": "one",
        "description": "two",
        "dataInfo": np.ones((2, 3)),
        "data_2": np.ones((30, 3)),
    }
    savemat(tmp_path / "a.mat", parts)
    assert [*channels_in(tmp_path / "a.mat")][-3:] == ["data_2/1", "data_2/2", "data_2/3"]


def test_channels_of_json_that_say_their_names_and_a_rate(tmp_path: Path) -> None:
    channels = [{"name": "Torque", "unit": "Nm", "data": [0.5] * 99}, {"name": "q", "data": [0.25] * 99}]
    (tmp_path / "a.json").write_text(json.dumps({"fs": 500, "channels": channels}))
    assert [*channels_in(tmp_path / "a.json")] == ["channels/Torque [Nm]", "channels/q"]
    assert sample(str(tmp_path / "a.json")).sample_time == 0.002


@pytest.mark.parametrize("place", [0, 1, 2])
def test_of_arrays_of_more_dimensions_the_longest_is_time(place: int, tmp_path: Path) -> None:
    """Samples, robots and joints, in whatever order; Simulink has samples of one signal as 1 x 1 x N."""
    told = np.arange(2000.0)[:, None, None] + np.array([[10.0, 20.0, 30.0], [40.0, 50.0, 60.0]])
    np.savez(
        tmp_path / "a.npz", q=np.moveaxis(told, 0, place), u=told[None, None, :, 0, 0], picture=np.ones((70, 64, 64))
    )
    channels = {one.name: one.values for table in sample(str(tmp_path / "a.npz")).tables for one in table.channels}
    assert [*channels] == [*(f"q/{i}/{j}" for i in (1, 2) for j in (1, 2, 3)), "u"]
    assert np.array_equal(channels["q/2/3"], told[:, 1, 2])
    assert np.array_equal(channels["u"], told[:, 0, 0])


def test_a_mat_file_of_version_4_from_a_machine_of_the_other_byte_order(tmp_path: Path) -> None:
    """By the format's description: five whole numbers, the name, the columns one after the other."""
    told = {"t": np.arange(50.0) / 8, "tau": -np.arange(50.0)}
    heads = (struct.pack(">5i", 1000, x.size, 1, 0, len(n) + 1) + n.encode() + b"\0" for n, x in told.items())
    parts = (head + x.astype(">f8").tobytes() for head, x in zip(heads, told.values(), strict=True))
    (tmp_path / "old.mat").write_bytes(b"".join(parts))
    (table,) = sample(str(tmp_path / "old.mat")).tables
    for one in table.channels:
        assert np.array_equal(one.values, told[one.name])


def test_structs_with_stamps_of_their_own_keep_them_whatever_they_call_themselves(tmp_path: Path) -> None:
    """As `struct` makes them of timeseries, all of which may be called alike."""
    t, values = np.arange(50.0)[:, None] / 8, {"torque": np.arange(50.0), "angle": -np.arange(50.0)}
    log = {name: {"Time": t, "Data": x[:, None], "Name": "x"} for name, x in values.items()}
    savemat(tmp_path / "log.mat", {"log": log})
    names = {"t": "log/torque/Time", "u": "log/torque/Data", "position": "log/angle/Data"}
    columns, _ = read(tmp_path / "log.mat", names)
    assert np.array_equal(columns["u"], values["torque"])
    assert np.array_equal(columns["position"], values["angle"])


@pytest.mark.parametrize("clock", [False, True])
def test_tests_in_a_list_are_read_one_after_the_other(clock, tmp_path):
    """Their arrays were left out, and what the file says of its joint's limits was all of it."""
    tests = [channels(300), channels(200)]
    for one in tests:
        one["u"] = one["u"][::-1]  # which does not rise, and is no clock
    names = ("t", "u", "velocity") if clock else ("u", "velocity")
    data = [{"type": "sine", "targets": ["a"]} | {name: one[name].tolist() for name in names} for one in tests]
    document = {"config": {"hz": 50, "joint_limits": [-0.6, 0.6]}, "data": data}
    (tmp_path / "rig.json").write_text(json.dumps(document))
    found, said = read(tmp_path / "rig.json", {"u": "u", "velocity": "velocity"})
    for name, values in found.items():
        np.testing.assert_array_equal(values, np.concatenate([one[name] for one in tests]))
    assert any("2 tests with the same columns" in one for one in said)
