"""Files of every format, written by the format's own library: a rig's channels as its loggers would store them."""

import json
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

START_NS = 1_767_225_600_000_000_000  # 2026-01-01


class Made(NamedTuple):
    """`names`: canonical channel -> what a config calls it in this file."""

    path: Path
    names: dict[str, str]


def channels(rows: int = 600, step: float = 0.001) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(7)
    t = np.arange(rows) * step
    return {
        "t": t,
        "u": np.sin(9.0 * t) + 0.1 * rng.standard_normal(rows),
        "velocity": np.cumsum(rng.normal(size=rows)),
    }


def arrow_file(folder: Path, data: dict) -> Made:
    import pyarrow as pa

    table = pa.table({**data, "note": ["x"] * data["t"].size})
    with pa.OSFile(str(folder / "log.arrow"), "wb") as sink, pa.ipc.new_file(sink, table.schema) as writer:
        for batch in table.to_batches(max_chunksize=101):
            writer.write_batch(batch)
    return Made(folder / "log.arrow", {"t": "t", "u": "u", "velocity": "velocity"})


def arrow_stream(folder: Path, data: dict) -> Made:
    import pyarrow as pa

    table = pa.table(data)
    with pa.OSFile(str(folder / "log.arrows"), "wb") as sink, pa.ipc.new_stream(sink, table.schema) as writer:
        writer.write_table(table, max_chunksize=77)
    return Made(folder / "log.arrows", {"t": "t", "u": "u", "velocity": "velocity"})


def feather(folder: Path, data: dict) -> Made:
    import pyarrow as pa
    from pyarrow.feather import write_feather

    write_feather(pa.table(data), str(folder / "log.feather"), compression="zstd")
    return Made(folder / "log.feather", {"t": "t", "u": "u", "velocity": "velocity"})


def npz(folder: Path, data: dict) -> Made:
    matrix = np.column_stack([data["u"], data["velocity"]])
    np.savez_compressed(folder / "log.npz", time=data["t"], drive=matrix, objects=np.array([None]))
    return Made(folder / "log.npz", {"t": "time", "u": "drive/1", "velocity": "drive/2"})


def npy(folder: Path, data: dict) -> Made:
    np.save(folder / "log.npy", np.rec.fromarrays(list(data.values()), names=list(data)))
    return Made(folder / "log.npy", {"t": "t", "u": "u", "velocity": "velocity"})


def mat5(folder: Path, data: dict) -> Made:
    from scipy.io import savemat

    drive = {"time": data["t"], "current": data["u"], "name": "axis 1", "axis": {"speed": data["velocity"]}}
    savemat(folder / "log.mat", {"drive": drive, "gain": 3.0}, do_compression=True)
    return Made(folder / "log.mat", {"t": "time", "u": "drive/current", "velocity": "axis/speed"})


def mat4(folder: Path, data: dict) -> Made:
    from scipy.io import savemat

    savemat(folder / "old.mat", data, format="4")
    return Made(folder / "old.mat", {"t": "t", "u": "u", "velocity": "velocity"})


def mat73(folder: Path, data: dict) -> Made:
    hdf5storage = pytest.importorskip(
        "hdf5storage", reason="hdf5storage, which writes MATLAB's files, is not installed"
    )
    drive = {"time": data["t"], "current": data["u"], "both": np.column_stack([data["u"], data["velocity"]])}
    hdf5storage.savemat(str(folder / "new.mat"), {"drive": drive, "name": "axis"}, format="7.3")
    return Made(folder / "new.mat", {"t": "drive/time", "u": "drive/current", "velocity": "drive/both/2"})


def _objects(folder: Path, data: dict, version: str) -> Path:
    """A table and a class of ours, as MATLAB stores what `save` is given."""
    matio = pytest.importorskip("matio", reason="mat-io is not installed")
    pandas = pytest.importorskip("pandas", reason="pandas is not installed")
    from matio.utils.matclass import MatlabOpaque

    held = {"Data": data["velocity"][:, None], "Time": data["t"][:, None], "Name": "speed"}
    axis = MatlabOpaque(properties=held, classname="recording", type_system="MCOS")
    drive = pandas.DataFrame({"Time": data["t"], "iq": data["u"], "mode": ["run"] * data["t"].size})
    path = folder / f"objects{version}.mat"
    matio.save_to_mat(str(path), {"drive": drive, "axis": axis, "gain": np.arange(5.0)}, version=version)
    return path


def mat7_objects(folder: Path, data: dict) -> Made:
    return Made(_objects(folder, data, "v7"), {"t": "Time", "u": "drive/iq", "velocity": "axis/Data"})


def mat73_objects(folder: Path, data: dict) -> Made:
    return Made(_objects(folder, data, "v7.3"), {"t": "Time", "u": "drive/iq", "velocity": "axis/Data"})


def _series(folder: Path, data: dict, version: str) -> Path:
    """Two timeseries as MATLAB stores them: start, step and length of even stamps (ms); all others, samples last."""
    matio = pytest.importorskip("matio", reason="mat-io is not installed")
    from matio.utils.matclass import MatlabOpaque

    def series(values: np.ndarray, **info: Any) -> Any:
        times = MatlabOpaque(properties=info, classname="tsdata.timemetadata", type_system="MCOS")
        held = {"Data_": values, "Time_": np.empty((0, 0)), "TimeInfo": times, "Name": "unnamed", "Version": 10.1}
        return MatlabOpaque(properties=held, classname="timeseries", type_system="MCOS")

    t, none = data["t"], np.empty((0, 0))
    even = {"Start_": t[0] * 1e3, "Increment_": (t[-1] - t[0]) * 1e3 / (t.size - 1), "Length": float(t.size)}
    u = series(data["u"][:, None], Units="milliseconds", Time_=none, **even)
    uneven = {"Start_": none, "Increment_": np.nan, "Length": float(t.size)}
    v = series(data["velocity"][None, None, :], Units="seconds", Time_=t[:, None], **uneven)
    path = folder / f"series{version}.mat"
    matio.save_to_mat(str(path), {"iq": u, "speed": v}, version=version)
    return path


def mat7_timeseries(folder: Path, data: dict) -> Made:
    return Made(_series(folder, data, "v7"), {"t": "Time", "u": "iq/Data", "velocity": "speed/Data"})


def mat73_timeseries(folder: Path, data: dict) -> Made:
    return Made(_series(folder, data, "v7.3"), {"t": "Time", "u": "iq/Data", "velocity": "speed/Data"})


def mat7_timetable(folder: Path, data: dict, begin: str = "") -> Made:
    matio = pytest.importorskip("matio", reason="mat-io is not installed")
    pandas = pytest.importorskip("pandas", reason="pandas is not installed")
    stamps = pandas.to_timedelta(np.round(data["t"] * 1e6).astype("i8"), unit="us")
    rows = pandas.Timestamp(begin) + stamps if begin else stamps
    table = pandas.DataFrame({"iq": data["u"], "speed": data["velocity"]}, index=rows)
    table.index.name = "Time"
    with warnings.catch_warnings():  # of the unit in which MATLAB shows the times
        warnings.simplefilter("ignore")
        matio.save_to_mat(str(folder / "tt.mat"), {"log": table}, version="v7")
    return Made(folder / "tt.mat", {"t": "log/Time", "u": "log/iq", "velocity": "log/speed"})


def hdf5(folder: Path, data: dict) -> Made:
    h5py = pytest.importorskip("h5py", reason="h5py is not installed")
    with h5py.File(folder / "log.h5", "w") as file:
        file["time"] = data["t"]
        drive = file.create_group("drive")
        drive.create_dataset("u", data=data["u"].astype("f8"), chunks=(32,), compression="gzip")
        drive["u"].attrs["unit"] = "A"
        file["axis"] = np.rec.fromarrays([data["velocity"], data["velocity"] * 2], names=["speed", "twice"])
        file["picture"] = np.zeros((3, 4, 5))
    return Made(folder / "log.h5", {"t": "time", "u": "drive/u", "velocity": "axis/speed"})


def hdf5_octave(folder: Path, data: dict) -> Made:
    """As `save -hdf5` of Octave 7 lays its variables out."""
    h5py = pytest.importorskip("h5py", reason="h5py is not installed")
    with h5py.File(folder / "octave.h5", "w") as file:
        for name, values in data.items():
            variable = file.create_group(name)
            variable["type"] = np.bytes_("matrix")
            variable["value"] = values[None, :]
    return Made(folder / "octave.h5", {"t": "t", "u": "u", "velocity": "velocity"})


def netcdf(folder: Path, data: dict) -> Made:
    from scipy.io import netcdf_file

    with netcdf_file(folder / "log.nc", "w") as file:
        file.createDimension("time", data["t"].size)
        for name, values in {"time": data["t"], "iq": data["u"], "speed": data["velocity"]}.items():
            file.createVariable(name, "d", ("time",))[:] = values
            file.variables[name].units = {"time": "s", "iq": "A", "speed": "rad/s"}[name]
    return Made(folder / "log.nc", {"t": "time", "u": "iq", "velocity": "speed"})


def json_by_rows(folder: Path, data: dict) -> Made:
    """As pandas' `to_json` writes a table unless it is told otherwise."""
    columns = {name: {str(k): value for k, value in enumerate(values.tolist())} for name, values in data.items()}
    (folder / "columns.json").write_text(json.dumps(columns))
    return Made(folder / "columns.json", {"t": "t", "u": "u", "velocity": "velocity"})


def json_of_rows(folder: Path, data: dict) -> Made:
    """The same, `orient="index"`."""
    rows = zip(*(values.tolist() for values in data.values()), strict=True)
    (folder / "rows.json").write_text(
        json.dumps({str(k): dict(zip(data, row, strict=True)) for k, row in enumerate(rows)})
    )
    return Made(folder / "rows.json", {"t": "t", "u": "u", "velocity": "velocity"})


def mdf(folder: Path, data: dict) -> Made:
    asammdf = pytest.importorskip("asammdf", reason="asammdf is not installed")
    file = asammdf.MDF(version="4.10")
    scaled = asammdf.Signal(
        np.round(data["u"] * 1e6).astype("i8"), data["t"], name="iq", unit="A", conversion={"a": 1e-6, "b": 0.0}
    )
    file.append([scaled], acq_name="drive", common_timebase=True)
    file.append([asammdf.Signal(data["velocity"], data["t"], name="speed", unit="rad/s")], acq_name="axis")
    file.save(folder / "log.mf4")
    file.close()
    return Made(folder / "log.mf4", {"t": "t", "u": "drive/iq", "velocity": "axis/speed"})


def tdms(folder: Path, data: dict) -> Made:
    nptdms = pytest.importorskip("nptdms", reason="npTDMS is not installed")
    timing = {"wf_increment": data["t"][1], "wf_start_offset": 0.0, "unit_string": "A"}
    with nptdms.TdmsWriter(str(folder / "log.tdms")) as writer:
        for cut in (slice(0, 250), slice(250, None)):  # segments, as a recorder writes them
            writer.write_segment(
                [
                    nptdms.ChannelObject("drive", "iq", data["u"][cut], properties=timing),
                    nptdms.ChannelObject("drive", "speed", data["velocity"][cut], properties=timing),
                ]
            )
    return Made(folder / "log.tdms", {"t": "t", "u": "iq", "velocity": "speed"})


def mcap_json(folder: Path, data: dict) -> Made:
    pytest.importorskip("mcap", reason="mcap is not installed")
    from mcap.writer import Writer

    with open(folder / "log.mcap", "wb") as stream:
        writer = Writer(stream)
        writer.start()
        schema = writer.register_schema("drive", "jsonschema", b'{"type": "object"}')
        topic = writer.register_channel("/drive", "json", schema)
        for t, u, v in zip(*(data[name].tolist() for name in ("t", "u", "velocity")), strict=True):
            now = START_NS + round(t * 1e9)
            message = {"current": u, "axis": {"speed": v}, "mode": "run"}
            writer.add_message(topic, now, json.dumps(message).encode(), now)
        writer.finish()
    return Made(folder / "log.mcap", {"t": "t", "u": "drive/current", "velocity": "drive/axis/speed"})


JOINT_STATE = """\
std_msgs/Header header
string[] name
float64[] position
float64[] velocity
float64[] effort
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""


def mcap_ros2(folder: Path, data: dict) -> Made:
    pytest.importorskip("mcap_ros2", reason="mcap-ros2-support is not installed")
    from mcap_ros2.writer import Writer

    rng = np.random.default_rng(0)
    with open(folder / "ros2.mcap", "wb") as stream:
        writer = Writer(stream)
        schema = writer.register_msgdef("sensor_msgs/msg/JointState", JOINT_STATE)
        for t, u, v in zip(*(data[name].tolist() for name in ("t", "u", "velocity")), strict=True):
            now = START_NS + round(t * 1e9)
            late = now + int(rng.integers(100_000, 400_000))  # logged some 0.1 to 0.4 ms after it was measured
            stamp = {"sec": now // 10**9, "nanosec": now % 10**9}
            message = {
                "header": {"stamp": stamp, "frame_id": ""},
                "name": ["shoulder", "elbow"],
                "position": [0.0, 1.0],
                "velocity": [0.5, v],
                "effort": [0.0, u],
            }
            writer.write_message("/joint_states", schema, message, late, late)
        writer.finish()
    return Made(
        folder / "ros2.mcap",
        {"t": "t", "u": "joint_states/effort/elbow", "velocity": "joint_states/velocity/elbow"},
    )


def mcap_protobuf(folder: Path, data: dict) -> Made:
    pytest.importorskip("mcap_protobuf", reason="mcap-protobuf-support is not installed")
    from google.protobuf.struct_pb2 import ListValue
    from mcap_protobuf.writer import Writer

    with open(folder / "proto.mcap", "wb") as stream, Writer(stream) as writer:
        for t, u, v in zip(*(data[name].tolist() for name in ("t", "u", "velocity")), strict=True):
            now = START_NS + round(t * 1e9)
            message = ListValue()
            message.extend([u, v])
            writer.write_message("/drive", message, log_time=now, publish_time=now)
    names = {"u": "drive/values/1/number_value", "velocity": "drive/values/2/number_value"}
    return Made(folder / "proto.mcap", {"t": "t", **names})


def ros2_bag(folder: Path, data: dict) -> Made:
    pytest.importorskip("rosbags", reason="rosbags is not installed")
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    kinds = store.types
    state, header, time = (
        kinds[f"{one}"] for one in ("sensor_msgs/msg/JointState", "std_msgs/msg/Header", "builtin_interfaces/msg/Time")
    )
    with Writer(folder / "bag", version=8, storage_plugin=StoragePlugin.SQLITE3) as writer:
        topic = writer.add_connection("/joint_states", state.__msgtype__, typestore=store)
        for t, u, v in zip(*(data[name].tolist() for name in ("t", "u", "velocity")), strict=True):
            now = START_NS + round(t * 1e9)
            head = header(stamp=time(sec=now // 10**9, nanosec=now % 10**9), frame_id="")
            values = [np.array([x]) for x in (0.0, v, u)]
            message = state(header=head, name=["elbow"], position=values[0], velocity=values[1], effort=values[2])
            writer.write(topic, now + 250_000, store.serialize_cdr(message, state.__msgtype__))
    return Made(folder / "bag", {"t": "t", "u": "effort/elbow", "velocity": "velocity/elbow"})


def ros1_bag(folder: Path, data: dict) -> Made:
    pytest.importorskip("rosbags", reason="rosbags is not installed")
    from rosbags.rosbag1 import Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC)
    number = store.types["std_msgs/msg/Float64"]
    with Writer(folder / "old.bag") as writer:
        topics = {name: writer.add_connection(f"/{name}", number.__msgtype__, typestore=store) for name in ("u", "v")}
        for t, u, v in zip(*(data[name].tolist() for name in ("t", "u", "velocity")), strict=True):
            now = START_NS + round(t * 1e9)
            for name, value in (("u", u), ("v", v)):
                writer.write(topics[name], now, store.serialize_ros1(number(value), number.__msgtype__))
    return Made(folder / "old.bag", {"t": "t", "u": "u/data", "velocity": "v/data"})


MAKERS: list[Callable[[Path, dict], Made]] = [
    arrow_file,
    arrow_stream,
    feather,
    npz,
    npy,
    mat5,
    mat4,
    mat73,
    mat7_objects,
    mat73_objects,
    mat7_timeseries,
    mat73_timeseries,
    mat7_timetable,
    hdf5,
    hdf5_octave,
    netcdf,
    json_by_rows,
    json_of_rows,
    mdf,
    tdms,
    mcap_json,
    mcap_ros2,
    mcap_protobuf,
    ros2_bag,
    ros1_bag,
]
