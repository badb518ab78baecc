"""One motion as the recorders, drives and instruments of others write it; names, preambles and units are theirs."""

import datetime
import gzip
import json
import struct
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from scipy.io import savemat

ROWS, STEP = 3000, 0.002


def axis() -> dict[str, np.ndarray]:
    """A mass of 2 with viscous friction 3 and dry friction 1, led along a path by a controller: by plain sums."""
    t = np.arange(ROWS) * STEP
    path = 0.4 * np.sin(2.1 * t) + 0.15 * np.sin(5.3 * t + 0.4) - 0.15 * np.sin(0.4)
    u, q, v = np.zeros(ROWS), np.zeros(ROWS), np.zeros(ROWS)
    for k in range(ROWS - 1):
        u[k] = np.clip(900.0 * (path[k] - q[k]) - 45.0 * v[k], -60.0, 60.0)
        v[k + 1] = v[k] + STEP / 2.0 * (u[k] - 3.0 * v[k] - np.tanh(v[k] / 0.01))
        q[k + 1] = q[k] + STEP * 0.5 * (v[k] + v[k + 1])
    u[-1] = u[-2]
    return {"t": t, "u": u, "q": q, "v": v, "r": path}


def german(x: float, places: int = 6) -> str:
    return f"{x:.{places}f}".replace(".", ",")


def text(folder: Path, name: str, lines: list[str], end: str = "\n", encoding: str = "utf-8") -> Path:
    path = folder / name
    path.write_bytes((end.join(lines) + end).encode(encoding))
    return path


def rows(a: dict, *columns: np.ndarray, by: str = ",", form: str = "{:.7g}") -> list[str]:
    return [by.join(form.format(x) for x in row) for row in zip(*columns, strict=True)]


def twincat(folder: Path, a: dict) -> Path:
    """Pairs of time and value, whose names and units stand in rows that begin with what they are."""
    head = ["Name\tScope Project\t\t", "File\tC:\\axis.svdx\t\t", "", "Name\tActPos\tName\tActVelo\tName\tActTorque"]
    head += [f"SampleTime[ms]\t{1e3 * STEP:g}" + f"\tSampleTime[ms]\t{1e3 * STEP:g}" * 2]
    head += ["Data-Type\tREAL64\tData-Type\tREAL64\tData-Type\tREAL64", "Unit\tmm\tUnit\tmm/s\tUnit\tNm", ""]
    t = 1e3 * a["t"]
    body = ["\t".join(german(x) for x in row) for row in zip(t, 1e3 * a["q"], t, 1e3 * a["v"], t, a["u"], strict=True)]
    return text(folder, "scope.csv", head + body, "\r\n")


def trace(folder: Path, a: dict) -> Path:
    head = ['"Trace";"Achse_1";"";"";""', '"Datum";"13.02.2024 10:11:12";"";"";""', '"Abtastzeit";"2 ms";"";"";""', ""]
    head += ['"Zeit";"Istposition";"Sollposition";"Drehmoment-Istwert";"Regler aktiv"', '"ms";"mm";"mm";"Nm";""']
    columns = (1e3 * a["t"], 1e3 * a["q"], 1e3 * a["r"], a["u"])
    return text(folder, "trace.csv", head + [";".join(map(german, row)) + ";1" for row in zip(*columns, strict=True)])


def ruled(folder: Path, a: dict, ruler: str = "---", by: str = "  ") -> Path:
    """A table for the eye, as databases print it; `cmd` is no motion that was asked for, but u."""
    columns = zip(1e3 * a["t"], a["u"], a["q"], a["v"], strict=True)
    body = [by.join(f"{x:<22.7g}" for x in row) for row in columns]
    return text(folder, "table.txt", [by.join(("ms", "cmd", "enc", "vel")), by.join([ruler] * 4), *body])


def markdown(folder: Path, a: dict) -> Path:
    return ruled(folder, a, ":---:", " | ")


def recorder(folder: Path, a: dict) -> Path:
    head = ["Recording", "Drive: Gold 7", "Date: 2023-05-11", "Sampling Time: 2 ms", ""]
    head += ["Time (sec),Position (deg),Velocity (deg/s),Active Current (A)"]
    return text(folder, "drive.csv", head + rows(a, a["t"], np.degrees(a["q"]), np.degrees(a["v"]), a["u"]))


def liveplotter(folder: Path, a: dict) -> Path:
    """No header, and blanks between the columns."""
    return text(folder, "live.txt", rows(a, a["t"], a["v"], a["q"], a["u"], by="  "))


def labview(folder: Path, a: dict) -> Path:
    head = ["LabVIEW Measurement\t", "Separator\tTab", "***End_of_Header***\t", "", "Channels\t3\t\t\t"]
    head += ["Samples\t3000\t3000\t3000\t", "Y_Unit_Label\tVolts\tVolts\tVolts\t", "X0\t0.0\t0.0\t0.0\t"]
    head += ["Delta_X\t0.002\t0.002\t0.002\t", "***End_of_Header***\t\t\t\t"]
    head += ["X_Value\tVoltage_0\tVoltage_1\tVoltage_2\tComment"]
    return text(folder, "lab.lvm", head + [f"{row}\t" for row in rows(a, a["t"], a["u"], a["q"], a["r"], by="\t")])


def scope(folder: Path, a: dict) -> Path:
    head = ["Model,MSO44", "Firmware Version,1.28", "", "Sample Interval,0.002,,", "Record Length,3000,,", "Labels,,,"]
    head += ["TIME,CH1,CH2,"]
    return text(folder, "tek.csv", head + [f"{row}," for row in rows(a, a["t"] - 3.0, a["u"], a["v"])])


def sequence(folder: Path, a: dict) -> Path:
    head = ["X,CH1,CH2,Start,Increment,", "Sequence,Volt,Volt,0.0,0.002000,"]
    return text(folder, "rigol.csv", head + [f"{row},,," for row in rows(a, np.arange(ROWS), a["u"], a["q"])])


def timetable(folder: Path, a: dict) -> Path:
    body = [f"{row[0]:.3f} sec,{row[1]:.7g},{row[2]:.7g}" for row in zip(a["t"], a["u"], a["v"], strict=True)]
    return text(folder, "timetable.csv", ["Time,Current,Speed", *body])


def spreadsheet(folder: Path, a: dict) -> Path:
    """A title above and a mean below the numbers."""
    head = ["Messung Achse 1;;;", "Bediener: Huber;;;", ";;;", "Zeit [s];Strom [A];Position [mm];Bemerkung"]
    body = [";".join(map(german, row)) + ";" for row in zip(a["t"], a["u"], 1e3 * a["q"], strict=True)]
    foot = ["", "Mittelwert;0,12;3,4;", "Ende der Messung;;;"]
    return text(folder, "messung.csv", head + body + foot, "\r\n", "utf-8-sig")


def clock_time(folder: Path, a: dict) -> Path:
    """Stamps as the time of day."""
    day = datetime.datetime(2024, 2, 13, 10, 59, 59)
    stamps = [(day + datetime.timedelta(seconds=float(t))).strftime("%d.%m.%Y %H:%M:%S.%f") for t in a["t"]]
    body = [f"{s};{row}" for s, row in zip(stamps, rows(a, a["u"], a["v"], by=";"), strict=True)]
    return text(folder, "day.csv", ["Zeitstempel;Strom;Drehzahl", *body])


def short_names(folder: Path, a: dict) -> Path:
    return text(folder, "short.csv", ["qg,qm,t,vir", *rows(a, a["r"], a["q"], a["t"], a["u"])])


def degrees(folder: Path, a: dict) -> Path:
    body = [f"{row},True" for row in rows(a, a["t"], np.degrees(a["q"]), np.degrees(a["v"]), a["u"])]
    return text(folder, "deg.csv", ["time_s,pos_deg,vel_deg_per_s,torque_nm,enabled", *body])


def dspace(folder: Path, a: dict) -> Path:
    """X and Y of a recorder, structs with names, data and units."""
    fields = [("Name", object), ("Data", object), ("Unit", object)]
    y = np.zeros(3, dtype=fields)
    y[:] = [("Model Root/i_q[A]", a["u"], "A"), ("x_mess[m]", a["q"], "m"), ("x_soll[m]", a["r"], "m")]
    x = np.zeros(1, dtype=fields[:2])
    x[0] = ("", a["t"])
    savemat(folder / "exp.mat", {"exp_001": {"X": x, "Y": y, "Description": "lab"}})
    return folder / "exp.mat"


def simulink(folder: Path, a: dict) -> Path:
    signals = np.zeros(3, dtype=[("values", object), ("dimensions", object), ("label", object)])
    signals[:] = [(a[k].reshape(-1, 1), 1.0, n) for k, n in (("u", "Motor torque"), ("q", "theta"), ("v", "omega"))]
    savemat(folder / "out.mat", {"out": {"time": a["t"].reshape(-1, 1), "signals": signals}, "Kp": 3.0})
    return folder / "out.mat"


def big_endian(folder: Path, a: dict) -> Path:
    """MAT version 4 of a machine whose high bytes come first."""
    table = np.column_stack([a["t"], a["u"], a["q"]])
    with open(folder / "old.mat", "wb") as file:
        file.write(struct.pack(">5i", 1000, *table.shape, 0, 5) + b"data\0" + table.astype(">f8").tobytes(order="F"))
    return folder / "old.mat"


def wide(folder: Path, a: dict) -> Path:
    """Signals in rows, six axes of which one moves, and constants beside them."""
    rest = np.zeros((5, ROWS))
    axes = {name: np.vstack([a[k], rest]) for name, k in (("act_torque_nm", "u"), ("act_pos", "q"), ("act_vel", "v"))}
    savemat(folder / "wide.mat", {"rec": {"time": a["t"], **axes}, "para": {"u": np.arange(6.0), "K_pos": np.ones(6)}})
    return folder / "wide.mat"


def nameless(folder: Path, a: dict) -> Path:
    np.save(folder / "log.npy", np.vstack([a["t"], a["q"], a["u"]]))
    return folder / "log.npy"


def sysid(folder: Path, a: dict) -> Path:
    """WPILib SysId: tests as rows of numbers, which belong together."""
    table = np.column_stack([a["t"], a["u"], a["q"], a["v"]]).round(9)
    half = ROWS // 2
    tests = {"slow-backward": table[half + 50 :].tolist(), "slow-forward": table[:half].tolist()}
    (folder / "sysid.json").write_text(json.dumps({"sysid": True, "test": "Elevator", "units": "Meters", **tests}))
    return folder / "sysid.json"


def records(folder: Path, a: dict) -> Path:
    one = [
        {"timestamp": t, "state": {"pos": q, "vel": v}, "pwm": u, "on": True, "note": "x"}
        for t, q, v, u in zip(*(a[k].tolist() for k in "tqvu"), strict=True)
    ]
    return text(folder, "robot.jsonl", [json.dumps(record) for record in one])


def codesys(folder: Path, a: dict) -> Path:
    """One variable after the other, each with its stamps in ms."""
    lines = ["[key]; [value]", "Version; 0x03050000", "Name; Application.Trace", "Comment; ", "Flags; 16"]
    for at, (name, k) in enumerate((("fActPosition", "q"), ("fActVelocity", "v"), ("fActTorque", "u"))):
        lines += [f"{at}.Variable; PLC_PRG.axis.{name}", f"{at}.Class; 14", f"{at}.Data; "]
        lines += [f"; {1e3 * t:g}; {x:.7g}" for t, x in zip(a["t"], a[k], strict=True)]
    return text(folder, "axis.trace.csv", lines)


def rostopic(folder: Path, a: dict) -> Path:
    """The header begins with a percent sign, and rows have words in them."""
    head = "%time,field.header.seq,field.header.frame_id,field.name0,field.position0,field.velocity0,field.effort0"
    body = [
        f"{1_700_000_000_000_000_000 + round(1e9 * t)},{k},,j1,{q:.7g},{v:.7g},{u:.7g}"
        for k, (t, q, v, u) in enumerate(zip(*(a[k].tolist() for k in "tqvu"), strict=True))
    ]
    return text(folder, "states.csv", [head, *body])


def savetxt(folder: Path, a: dict) -> Path:
    """NumPy: the header is a comment, of names that blanks separate."""
    np.savetxt(folder / "log.txt", np.column_stack([a[k] for k in "tuqv"]), header="t[s] tau[Nm] q[rad] dq[rad/s]")
    return folder / "log.txt"


def titled(folder: Path, a: dict) -> Path:
    """A title of two cells stands above the names, in as many columns as the numbers."""
    head = ["Trace;Messung 2;", "Zeit [ms];r61[0] Drehzahlistwert [1/min];r79[0] Drehmomentsollwert [Nm]"]
    turns = 60.0 / (2.0 * np.pi)
    body = [";".join(map(german, row)) for row in zip(1e3 * a["t"], turns * a["v"], a["u"], strict=True)]
    return text(folder, "starter.csv", head + body, encoding="latin-1")


def filetime(folder: Path, a: dict) -> Path:
    """Stamps in steps of 100 ns since 1601, torque in thousandths of the rated one."""
    stamps = [133_800_000_000_000_000 + round(1e7 * t) for t in a["t"]]
    body = [f"{s},{row}" for s, row in zip(stamps, rows(a, np.round(1e2 * a["u"]), a["q"], a["v"]), strict=True)]
    return text(folder, "ticks.csv", ["Timestamp,nTorqueActual,fActPos,fActVelo", *body])


def matlab_dates(folder: Path, a: dict) -> Path:
    day = datetime.datetime(2026, 11, 23, 9, 30)
    stamps = [(day + datetime.timedelta(seconds=float(t))).strftime("%d-%b-%Y %H:%M:%S.%f") for t in a["t"]]
    body = [f"{s},{row}" for s, row in zip(stamps, rows(a, a["u"], a["q"]), strict=True)]
    return text(folder, "table.csv", ["Time,MotorTorque,JointAngle", *body])


def joint_states(folder: Path, a: dict) -> Path:
    """JSON lines of ROS: whole seconds and the rest, joints by their names."""
    one = [
        {"topic": "/js", "msg": {"header": {"stamp": {"sec": 1_760_000_000 + int(t), "nanosec": round(1e9 * (t % 1))}},
                                 "name": ["arm", "hand"], "position": [q, 0.1], "effort": [u, 0.0]}}
        for t, q, u in zip(*(a[k].tolist() for k in "tqu"), strict=True)
    ]  # fmt: skip
    return text(folder, "states.jsonl", [json.dumps(record) for record in one])


def lists(folder: Path, a: dict) -> Path:
    """LeRobot: lists in Parquet, of which one row has none."""
    pairs = {name: [[x, 0.5] for x in a[k].tolist()] for name, k in (("state", "q"), ("effort", "u"))}
    pairs["effort"][7] = None
    table = {"timestamp": a["t"], "frame_index": np.arange(ROWS), **pairs}
    pq.write_table(pa.table(table), folder / "episode.parquet")
    return folder / "episode.parquet"


def structs(folder: Path, a: dict) -> Path:
    """Messages as columns of records, one of them in another, in Parquet; a record that is missing has no numbers."""
    inner = pa.StructArray.from_arrays([pa.array(a["q"]), pa.array(a["v"])], ["position", "velocity"])
    state = pa.StructArray.from_arrays([inner], ["joint"], mask=pa.array(np.arange(ROWS) == 7))
    drive = pa.StructArray.from_arrays([pa.array(a["u"]), pa.array(["run"] * ROWS)], ["torque", "mode"])
    pq.write_table(pa.table({"stamp": a["t"], "state": state, "drive": drive}), folder / "messages.parquet")
    return folder / "messages.parquet"


def printed(folder: Path, a: dict) -> Path:
    """Firmware: names with values and units behind a stamp, and what else it has to say."""
    columns = zip(1e3 * a["t"], a["u"], np.degrees(a["q"]), strict=True)
    body = [f"I ({1200 + t:.0f}) axis1: torque={u:.6g}Nm, angle={q:.7g}deg" for t, u, q in columns]
    return text(folder, "monitor.log", ["boot: esp-idf v5.1", *body[:900], "W (3001) wifi: retry=3", *body[900:]])


def two_levels(folder: Path, a: dict) -> Path:
    """pandas: columns of three levels, and the name of the index below them."""
    head = [",motor,stage,stage", ",force,pos,vel", ",N,um,mm/s", "time,,,"]
    return text(folder, "levels.csv", head + rows(a, a["t"], a["u"], 1e6 * a["q"], 1e3 * a["v"]))


def merged(folder: Path, a: dict) -> Path:
    """PlotJuggler: two topics, each with stamps of its own, and blank cells in between."""
    moved = [f"{t:.6f},,{q:.9g},{v:.9g}" for t, q, v in zip(a["t"], a["q"], a["v"], strict=True)]
    drove = [f"{t + 0.0007:.6f},{u:.9g},," for t, u in zip(a["t"], a["u"], strict=True)]
    both = [row for pair in zip(moved, drove, strict=True) for row in pair]
    return text(folder, "merged.csv", ["__time,/drive/torque,/joint/position,/joint/velocity", *both])


def series(folder: Path, a: dict) -> Path:
    """InfluxDB: three rows about the columns, and a row for each value, one signal after the other."""
    head = ["#group,false,false,true,true,false,true,true", "#datatype,string,long,dateTime:RFC3339,dateTime:RFC3339,"]
    head = [head[0], head[1] + "double,string,string", "#default,_result,,,,,,"]
    day = datetime.datetime(2025, 3, 1, 9, tzinfo=datetime.UTC)
    stamps = [(day + datetime.timedelta(seconds=float(t))).isoformat(timespec="microseconds") for t in a["t"]]
    names = (("angle", "q"), ("current", "u"))
    body = [
        f",,{k},2025-03-01T00:00:00Z,{stamp},{x:.9g},{name},axis1"
        for k, (name, key) in enumerate(names)
        for stamp, x in zip(stamps, a[key], strict=True)
    ]
    return text(folder, "query.csv", [*head, ",result,table,_start,_time,_value,_field,_measurement", *body])


def joints(folder: Path, a: dict) -> Path:
    """A row for each joint and stamp; the other one rests."""
    pairs = [((t, "arm", q, u), (t, "hand", 0.1, 0.0)) for t, q, u in zip(*(a[k] for k in "tqu"), strict=True)]
    names, rows = ("time", "joint", "position", "effort"), [row for pair in pairs for row in pair]
    pq.write_table(pa.table(dict(zip(names, zip(*rows, strict=True), strict=True))), folder / "joints.parquet")
    return folder / "joints.parquet"


def data_recorder(folder: Path, a: dict) -> Path:
    """UTF-16, as Windows programs write it; counts of an encoder beside a speed with a unit."""
    head = "Time [ms]\tPosition actual value [inc]\tVelocity averaged [rpm]\tCurrent actual value [mA]"
    columns = (1e3 * a["t"], np.round(a["q"] * 4096 / 2 / np.pi), a["v"] * 30 / np.pi, 1e3 * a["u"])
    return text(folder, "recorder.txt", [head, *rows(a, *columns, by="\t")], "\r\n", "utf-16")


def unmarked(folder: Path, a: dict) -> Path:
    """The same without a mark."""
    path = data_recorder(folder, a)
    path.write_bytes(path.read_bytes()[2:])
    return path


def packed(folder: Path, a: dict) -> Path:
    """A zip with one table, and what the system of its maker adds."""
    body = [";".join(map(german, row)) for row in zip(1e3 * a["t"], a["u"], np.degrees(a["q"]), strict=True)]
    with zipfile.ZipFile(folder / "lauf.zip", "w", zipfile.ZIP_DEFLATED) as archive:
        table = "\n".join(["Zeit [ms];Motorstrom [A];Istwinkel [°]", *body])
        archive.writestr("lauf/achse.csv", table.encode("latin-1"))
        archive.writestr("__MACOSX/lauf/._achse.csv", b"\0\5")
    return folder / "lauf.zip"


def squeezed(folder: Path, a: dict) -> Path:
    """JSON lines, compressed."""
    columns = zip(*(a[k].tolist() for k in "tqu"), strict=True)
    lines = "".join(json.dumps({"time": t, "values": {"POSITION": q, "TORQUE": u}}) + "\n" for t, q, u in columns)
    (folder / "run.jsonl.gz").write_bytes(gzip.compress(lines.encode()))
    return folder / "run.jsonl.gz"


def panels(folder: Path, a: dict) -> Path:
    """Grafana for a spreadsheet: a unit in every cell."""
    day = datetime.datetime(2024, 5, 3, 12)
    stamps = [(day + datetime.timedelta(seconds=float(t))).strftime("%Y-%m-%d %H:%M:%S.%f")[:-3] for t in a["t"]]
    body = [f'"{s}","{u:.5f} N·m","{q:.6f} rad"' for s, u, q in zip(stamps, a["u"], a["q"], strict=True)]
    return text(folder, "panels.csv", ["sep=,", '"Time","Torque","Position"', *body])


def thousands(folder: Path, a: dict) -> Path:
    """Points between thousands, and a decimal comma."""
    micrometres = [f"{1e6 * q:,.1f}".translate(str.maketrans(",.", ".,")) for q in a["q"]]
    body = [f"{german(t)};{german(u)};{q}" for t, u, q in zip(a["t"], a["u"], micrometres, strict=True)]
    return text(folder, "tausend.csv", ["Zeit;Kraft;Weg", "s;N;µm", *body], "\r\n", "cp1252")


def hexadecimal(folder: Path, a: dict) -> Path:
    """A counter in base 16, below zero as two's complement."""
    counts = np.round(a["q"] * 1e6).astype(np.int64) & 0xFFFFFFFF
    body = [f"{1e6 * t:.0f},0x{q:08X},{1e3 * u:.0f}" for t, q, u in zip(a["t"], counts, a["u"], strict=True)]
    return text(folder, "hex.csv", ["t_us,enc,pwm", *body])


def monitor(folder: Path, a: dict) -> Path:
    """No header, and the stamp of a serial monitor before each line."""
    day = datetime.datetime(2024, 5, 3, 12, 34, 56)
    stamps = [(day + datetime.timedelta(seconds=float(t))).strftime("%H:%M:%S.%f")[:-3] for t in a["t"]]
    body = [f"{s} -> {row}" for s, row in zip(stamps, rows(a, a["u"], a["v"], a["q"], by="\t"), strict=True)]
    return text(folder, "serial.txt", body)


def japanese(folder: Path, a: dict) -> Path:
    """Names in the encoding of Japanese Windows; what is left of a path is no position."""
    head = ['"Ver.7.30"', '"時間[ms]","トルク指令[%]","フィードバック速度[min-1]","位置偏差[指令単位]"']
    columns = (1e3 * a["t"], a["u"], a["v"] * 30 / np.pi, np.round(1e4 * (a["r"] - a["q"])))
    return text(folder, "trace.csv", [*head, *rows(a, *columns)], "\r\n", "cp932")


def timed(folder: Path, a: dict) -> Path:
    """pandas: an index of times has no name."""
    stamps = [f"0 days 00:00:{t:09.6f}" for t in a["t"]]
    body = [f"{s},{row}" for s, row in zip(stamps, rows(a, a["u"], a["v"]), strict=True)]
    return text(folder, "frame.csv", [",voltage_V,speed_rad_s", *body])


def shown(folder: Path, a: dict) -> Path:
    """What Python prints of a dictionary, line by line."""
    body = [repr({"t": t, "u": u, "q": q}) for t, u, q in zip(*(a[k].tolist() for k in "tuq"), strict=True)]
    return text(folder, "print.txt", body)


def points(folder: Path, a: dict) -> Path:
    """The lines of InfluxDB: names with values, and the stamp in ns behind them."""
    columns = zip(*(a[k].tolist() for k in "tuq"), strict=True)
    body = [
        f"drive,axis=x torque={u:.7g},position={q:.7g} {1_709_283_600_000_000_000 + round(1e9 * t)}"
        for t, u, q in columns
    ]
    return text(folder, "points.lp", body)


def slashed(folder: Path, a: dict) -> Path:
    """Quantity / unit, and words of which German makes one."""
    head = "Zeit / ms\tIstdrehzahl / 1/min\tDrehmoment / % Mnenn\tIstlage / °"
    columns = zip(1e3 * a["t"], a["v"] * 30 / np.pi, a["u"], np.degrees(a["q"]), strict=True)
    return text(folder, "scope.txt", [head, *("\t".join(map(german, row)) for row in columns)], "\r\n", "cp1252")


def counts(folder: Path, a: dict) -> Path:
    """Whole numbers, with a row that says their factors, and one of their types; cut off, and closed by a program."""
    head = ["Logger 7", "time,torque,angle", "s,Nm,deg", "f8,i4,i4", "Scale,0.001,0.01"]
    body = rows(a, a["t"], np.round(1e3 * a["u"]), np.round(1e2 * np.degrees(a["q"])))
    return text(folder, "counts.csv", [*head, *body, "6.000,12", "", "closed by user"])


def qualities(folder: Path, a: dict) -> Path:
    """A time, a value and how good that is for each signal, which have stamps of their own."""
    body = zip(a["t"], a["u"], a["t"] + 0.0004, a["q"], strict=True)
    lines = [f"{t:.4f};{u:.6f};Good;{s:.4f};{q:.7f};Good" for t, u, s, q in body]
    return text(folder, "tags.csv", ["Torque;;;Angle;;", "Time;Value;Quality;Time;Value;Quality", *lines])


#: Every one of them, and the columns of u and of position or velocity in it.
MADE: dict[str, tuple[Callable[[Path, dict], Path], str, str]] = {
    "twincat": (twincat, "ActTorque", "ActPos"),
    "trace": (trace, "Drehmoment-Istwert", "Istposition"),
    "recorder": (recorder, "Active Current (A)", "Position (deg)"),
    "liveplotter": (liveplotter, "4", "3"),
    "labview": (labview, "Voltage_0", "Voltage_1"),
    "scope": (scope, "CH1", "CH2"),
    "sequence": (sequence, "CH1", "CH2"),
    "timetable": (timetable, "Current", "Speed"),
    "ruled": (ruled, "cmd", "enc"),
    "markdown": (markdown, "cmd", "enc"),
    "spreadsheet": (spreadsheet, "Strom [A]", "Position [mm]"),
    "clock_time": (clock_time, "Strom", "Drehzahl"),
    "short_names": (short_names, "vir", "qm"),
    "degrees": (degrees, "torque_nm", "pos_deg"),
    "dspace": (dspace, "exp_001/Model Root/i_q[A]", "exp_001/x_mess[m]"),
    "simulink": (simulink, "out/Motor torque", "out/theta"),
    "big_endian": (big_endian, "data/2", "data/3"),
    "wide": (wide, "rec/act_torque_nm/1", "rec/act_pos/1"),
    "nameless": (nameless, "data/3", "data/2"),
    "sysid": (sysid, "voltage", "position"),
    "records": (records, "pwm", "state/pos"),
    "codesys": (codesys, "PLC_PRG.axis.fActTorque", "PLC_PRG.axis.fActPosition"),
    "rostopic": (rostopic, "field.effort0", "field.position0"),
    "savetxt": (savetxt, "tau[Nm]", "q[rad]"),
    "filetime": (filetime, "nTorqueActual", "fActPos"),
    "matlab_dates": (matlab_dates, "MotorTorque", "JointAngle"),
    "joint_states": (joint_states, "msg/effort/arm", "msg/position/arm"),
    "lists": (lists, "effort/1", "state/1"),
    "structs": (structs, "drive/torque", "state/joint/position"),
    "printed": (printed, "torque", "angle"),
    "two_levels": (two_levels, "force", "pos"),
    "merged": (merged, "/drive/torque", "/joint/position"),
    "series": (series, "current", "angle"),
    "data_recorder": (data_recorder, "Current actual value [mA]", "Velocity averaged [rpm]"),
    "unmarked": (unmarked, "Current actual value [mA]", "Velocity averaged [rpm]"),
    "packed": (packed, "Motorstrom [A]", "Istwinkel [°]"),
    "squeezed": (squeezed, "values/TORQUE", "values/POSITION"),
    "panels": (panels, "Torque", "Position"),
    "thousands": (thousands, "Kraft", "Weg"),
    "hexadecimal": (hexadecimal, "pwm", "enc"),
    "monitor": (monitor, "2", "4"),
    "japanese": (japanese, "トルク指令[%]", "フィードバック速度[min-1]"),
    "timed": (timed, "voltage_V", "speed_rad_s"),
    "shown": (shown, "u", "q"),
    "points": (points, "torque", "position"),
    "slashed": (slashed, "Drehmoment / % Mnenn", "Istlage / °"),
    "joints": (joints, "arm/effort", "arm/position"),
    "counts": (counts, "torque", "angle"),
    "qualities": (qualities, "Torque/value", "Angle/value"),
    "titled": (titled, "r79[0] Drehmomentsollwert [Nm]", "r61[0] Drehzahlistwert [1/min]"),
}
