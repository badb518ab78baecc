"""The motion of `strangers.axis` as programs of drives and laboratories export it; all values are made here."""

from collections.abc import Callable
from pathlib import Path

import numpy as np

from tests.files.strangers import ROWS, STEP, german, text

MS = 1e3 * STEP * np.arange(ROWS)


def rows(*columns: np.ndarray, by: str = ",", form: Callable[[float], str] = "{:.7g}".format) -> list[str]:
    return [by.join(map(form, row)) for row in zip(*columns, strict=True)]


def scope_unscaled(folder: Path, a: dict) -> Path:
    """A scope of a controller that exports what was sampled, with factors, offsets and a tag at the end."""
    said = {
        "Name": ("Axes.X.ActPos", "Axes.X.ActVelo", "MAIN.fTorque"),
        "Data-Type": ("REAL64", "REAL64", "INT16"),
        "SampleTime[ms]": (f"{1e3 * STEP:g}",) * 3,
        "Offset": ("0",) * 3,
        "ScaleFactor": ("1", "1", "0.01"),
        "Unit": ("mm", "mm/s", "Nm"),
    }
    head = ["Name\tProject", "File\tx.scope", "", *("\t".join(f"{k}\t{x}" for x in row) for k, row in said.items()), ""]
    body = rows(MS, 1e3 * a["q"], MS, 1e3 * a["v"], MS, np.round(100.0 * a["u"]), by="\t")
    return text(folder, "scope.csv", [*head, *body, "EOF"], "\r\n")


def scope_clocks(folder: Path, a: dict) -> Path:
    """The same with a clock for each channel, one of them a quarter of a step late."""
    said = {"Name": ("ActPos", "ActTorque"), "Data-Type": ("INT32", "INT16"), "ScaleFactor": ("0.00001", "0.01")}
    head = ["\t".join(f"{k}\t{x}" for x in row) for k, row in {**said, "Unit": ("rad", "Nm")}.items()]
    body = rows(MS, np.round(1e5 * a["q"]), MS + 250.0 * STEP, np.round(100.0 * a["u"]), by="\t")
    return text(folder, "clocks.csv", [*head, *body, "EOF"], "\r\n")


def parameters(folder: Path, a: dict) -> Path:
    """Channels are numbers of parameters, what these are stands in brackets: a setpoint beside what was measured."""
    names = ("r62 (Drehzahlsollwert nach Filter)", "r63[0] (Drehzahlistwert)", "r80[0] (Drehmomentistwert)")
    head = ['"Name";"Trace"', ";".join(["Sample", "Zeit", *names, "r482[0] (Geberlageistwert)"])]
    head += [";[ms];[1/min];[1/min];[Nm];"]
    rpm = 60.0 / (2.0 * np.pi) * a["v"]
    columns = (np.arange(ROWS), MS, np.roll(rpm, -5), rpm, a["u"], np.round(a["q"] * 2**20 / (2.0 * np.pi)))
    return text(folder, "trace.csv", head + rows(*columns, by=";", form=german), "\r\n", "cp1252")


def measured(folder: Path, a: dict) -> Path:
    """Rows about the channels begin with what they say, in a column of their own; one of them is of numbers."""
    head = ["Group Name;R;R;R", "Channel Name;Time;Motor torque;Load angle", "Unit;s;Nm;deg"]
    head += ["Data Type;DT_DOUBLE;DT_DOUBLE;DT_DOUBLE", "wf_increment;0,002;0,002;0,002"]
    columns = (a["t"], a["u"], np.degrees(a["q"]))
    return text(folder, "export.csv", head + [f";{row}" for row in rows(*columns, by=";", form=german)], "\r\n")


def named_traces(folder: Path, a: dict) -> Path:
    model = "Platform()://Model/Plant"
    head = ["version,1.0", "date,2024-01-15", "", f"trace_names,Time,{model}/torque/Out1,{model}/angle/Out1"]
    head += ["trace_units,s,Nm,deg", "trace_values"]
    return text(folder, "rec.csv", head + [f",{row}" for row in rows(a["t"], a["u"], np.degrees(a["q"]))])


def two_drives(folder: Path, a: dict) -> Path:
    """The same names under each of two drives, of which one rests, with types and units below."""
    head = ["Device;drive_1;;;drive_2;;", "Variable;fPos;fVel;fTrq;fPos;fVel;fTrq", "Type" + 2 * ";LREAL;LREAL;REAL"]
    columns = (a["t"], a["q"], a["v"], a["u"], 0.0 * a["t"] + 0.5, 0.0 * a["t"], 0.0 * a["t"] + 0.1)
    return text(folder, "two.csv", [*head, "Unit" + 2 * ";rad;rad/s;Nm", *rows(*columns, by=";", form=german)])


def printed_again(folder: Path, a: dict) -> Path:
    """A sketch that prints its header every 500 lines."""
    head = "t_us\tpwm\tangle_deg"
    body = rows(1e3 * MS, np.round(10.0 * a["u"]), np.degrees(a["q"]), by="\t", form="{:.8g}".format)
    lines = [line for k, row in enumerate(body) for line in ([head, row] if k and k % 500 == 0 else [row])]
    return text(folder, "monitor.txt", ["Starting up...", head, *lines], "\r\n")


def arrays(folder: Path, a: dict) -> Path:
    """Messages with arrays as pandas writes them: a list in a cell, one item for each joint."""
    pairs = zip(a["t"], a["q"], a["v"], a["u"], strict=True)
    body = [f'{t:.4f},"[\'a\', \'b\']","[{q:.7g}, 0.1]","[{v:.7g}, 0.0]","[{u:.7g}, 0.3]"' for t, q, v, u in pairs]
    return text(folder, "states.csv", ["time,name,position,velocity,effort", *body])


def tenths(folder: Path, a: dict) -> Path:
    """A line for each channel, which counts in tenths of a unit, and pulses of which the speed says how many."""
    head = ["CH1,Motor Speed,0.1 r/min", "CH2,Torque,0.1 %", "CH3,Motor position,pulse", "Time(ms),CH1,CH2,CH3"]
    columns = (300.0 / np.pi * a["v"], 1000.0 * a["u"], 1_280_000 / (2.0 * np.pi) * a["q"])
    return text(folder, "scope.csv", [*head, *rows(1e3 * a["t"], *map(np.round, columns), form="{:.9g}".format)])


def resolutions(folder: Path, a: dict) -> Path:
    """Counts below the resolutions of CiA 402, without a word that says what these are."""
    steps = (2.0**-9, 360.0 / 2**22)
    columns = (1e3 * a["t"], a["u"] / steps[0], np.degrees(a["q"]) / steps[1])
    head = ["time,torque,position", "s,Nm,deg", f"0.001,{steps[0]!r},{steps[1]!r}"]
    return text(folder, "counts.csv", [*head, *rows(*map(np.round, columns), form="{:.9g}".format)])


def objects(folder: Path, a: dict) -> Path:
    """Lines of the objects that were recorded, as wide as the rows; one is what the position is to be."""
    head = ["Oscilloscope;;;", "Channel 1;0x6077: Torque actual value;% of rated;", "Channel 2;0x6064: Position;°;"]
    head += ["Channel 3;0x6062: Position demand;°;", ";;;", "Time [s];Channel 1;Channel 2;Channel 3"]
    columns = (a["t"], 100.0 * a["u"], np.degrees(a["q"]), np.degrees(a["r"]))
    return text(folder, "scope.csv", [*head, *rows(*columns, by=";", form=german)])


def teleplot(folder: Path, a: dict) -> Path:
    """A sample of one channel in each line."""
    columns = zip(1e3 * a["t"], a["u"], a["q"], strict=True)
    lines = [f">torque:{t:.0f}:{u:.7g}§Nm|g\n>pos:{t:.0f}:{q:.7g}§rad" for t, u, q in columns]
    return text(folder, "plot.txt", ["boot", *lines])


def loops(folder: Path, a: dict) -> Path:
    """Loops by their letters, commanded beside fed back; what the columns hold is in brackets alone."""
    head = ["drive, 192.168.0.104", "Time (ms),PL.CMD (deg),PL.FB (deg),VL.CMD (rpm),VL.FB (rpm),IL.CMD (N),IL.FB (N)"]
    places = (np.degrees(a["r"]), np.degrees(a["q"]))
    speeds = (30.0 / np.pi * np.gradient(a["r"], a["t"]), 30.0 / np.pi * a["v"])
    noise = 0.02 * np.random.default_rng(7).standard_normal(a["u"].size)
    return text(folder, "scope.csv", [*head, *rows(1e3 * a["t"], *places, *speeds, a["u"], a["u"] + noise)])


#: Name -> (maker, u, position, what the position is multiplied by, unit of u in N or N m).
def nodes(folder: Path, a: dict) -> Path:
    """Nodes of a control's tree, the last of which is the unit."""
    head = '"Timestamp";"axs/X/state/values/actual/pos/mm";"axs/X/state/values/actual/vel/mm-per-min";"drive/X/trq/N"'
    columns = (a["t"], 1e3 * a["q"], 6e4 * a["v"], a["u"])
    return text(folder, "nodes.csv", [head, *rows(*columns, by=";", form=german)], "\r\n")


def trend(folder: Path, a: dict) -> Path:
    """A word before each row, and stamps of a date and a time of day."""
    head = ['"Controller Name:","Line1"', '"Trend Tags:",2', '"Sample Period:",2,"ms"', '"Start Time:","9/12/2023"']
    head += ['"Header:","Date","Time","Axis_X.ActualPosition","Axis_X.TorqueReference"']
    at = [f'"Data:","09/12/2023","10:11:{12.0 + t:06.3f}"' for t in a["t"]]
    body = [f"{t},{q:.7g},{u:.7g}" for t, q, u in zip(at, a["q"], a["u"], strict=True)]
    return text(folder, "trend.csv", head + body, "\r\n")


MADE = {
    "scope_unscaled": (scope_unscaled, "MAIN.fTorque", "Axes.X.ActPos", 1e-3, 1.0),
    "scope_clocks": (scope_clocks, "ActTorque/value", "ActPos/value", 1.0, 1.0),
    "parameters": (parameters, "r80[0] (Drehmomentistwert)", "r482[0] (Geberlageistwert)", 2.0 * np.pi / 2**20, 1.0),
    "measured": (measured, "Motor torque", "Load angle", np.pi / 180.0, 1.0),
    "named_traces": (
        named_traces,
        "Platform()://Model/Plant/torque/Out1",
        "Platform()://Model/Plant/angle/Out1",
        np.pi / 180.0,
        1.0,
    ),
    "two_drives": (two_drives, "drive_1/fTrq", "drive_1/fPos", 1.0, 1.0),
    "printed_again": (printed_again, "pwm", "angle_deg", np.pi / 180.0, 0.1),
    "tenths": (tenths, "CH2 Torque", "CH3 Motor position", 2.0 * np.pi / 1_280_000, 0.01),
    "nodes": (nodes, "drive/X/trq/N", "axs/X/state/values/actual/pos/mm", 1e-3, 1.0),
    "trend": (trend, "Axis_X.TorqueReference", "Axis_X.ActualPosition", 1.0, 1.0),
    "resolutions": (resolutions, "torque", "position", np.pi / 180.0, 1.0),
    "objects": (
        objects,
        "Channel 1 0x6077: Torque actual value",
        "Channel 2 0x6064: Position",
        np.pi / 180.0,
        0.01,
    ),
    "teleplot": (teleplot, "torque/value", "pos/value", 1.0, 1.0),
    "loops": (loops, "IL.CMD (N)", "PL.FB (deg)", np.pi / 180.0, 1.0),
    "arrays": (arrays, "effort/1", "position/1", 1.0, 1.0),
}
