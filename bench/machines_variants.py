"""`python -m bench machines --variants`: parts and forms of the real recordings, that nothing was tuned on.

Half of a log, a logger at half the rate, one motion channel in place of two, u in another unit, all signs turned round,
u and d_hat alone (a disturbance observer stepped by forward Euler), and files that no whole question uses. Which of
them are held back is decided by their name, so that it is the same for whoever asks.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bench.machines_cases import RECORDED, Recorded
from bench.machines_regression import read

Array = NDArray[np.float64]
Columns = dict[str, Array]
Change = Callable[[Columns], Columns]
#: Factor of u in its other unit.
OTHER_UNIT = 1000.0
_HALVES = {"first half": (0.0, 0.5), "middle half": (0.25, 0.75), "second half": (0.5, 1.0)}
_FORMS = ("every 2nd row", "velocity only", "position only", "u and d_hat", "u in thousandths", "all signs turned")
#: Questions whose search takes most of a minute: only halves and half the rate of them.
_LONG = ("slower_comp", "spinup", "silverbox", "bam_xl330")
#: Groups of the servo's runs and of the wheel drive's tests.
_GAINS, _KINDS = (100, 200, 400, 800), ("sin_sin", "sin_time_square", "up_and_down")
_WAYS = ("slow", "fast", "forward", "backward")
_TORQUE, _RECORDER = "torque of the motor in percent", "rack_pinion/servo_recorder.csv"
#: Those of which every form is asked, one of a machine: a unit and a sign change nothing, whatever the log.
_ALL_FORMS = ("kuka_kr300 A", "rack", "slow2_nocomp", "pos_0.06_1", "neg_0.045_2", "frc", "emps", "ddp")


def held_back(name: str) -> bool:
    """Whether a question is of the third that is asked once, at the end."""
    return int(hashlib.sha1(name.encode()).hexdigest(), 16) % 3 == 0


def variants(folder: Path, place: Path) -> Iterator[Recorded]:
    """Every question, its logs written to `place` when it is drawn.

    folder : of the recordings.
    """
    for case in RECORDED:
        if case.unknown or "arrow" in case.name:
            continue
        for form, change in _forms(case).items():
            yield _written(case, form, change, folder, place)
    yield from _others()


def _others() -> list[Recorded]:
    """Files, columns and groups of logs that no whole question uses, with what is asked of their machine."""
    of = {case.name: case for case in RECORDED}
    kuka, rack, frc = of["kuka_kr300 A"], of["rack_pinion, as logged"], of["frc_drivetrain, four tests"]
    link = kuka.signals | {"velocity": "velocity_link_rad_s", "position": "position_link_rad"}
    motor = rack.signals | {"u": "motor_torque_percent"}
    servo, swing = of["bam_xl330, twelve runs"], of["dfki_pendulum ddp"]
    spin, silver = of["odrive_cogging spinup_4_nocomp"], of["silverbox test_multisine"]
    found = [replace(of[f"kuka_kr300 {p}"], name=f"kuka_kr300 {p}, link side", signals=link) for p in "ABC"]
    found += [replace(servo, name=f"bam_xl330 kp{kp}, three runs", logs=_with(servo, f"kp{kp}")) for kp in _GAINS]
    found += [replace(servo, name=f"bam_xl330 {kind}, four runs", logs=_with(servo, kind)) for kind in _KINDS]
    found += [replace(frc, name=f"frc_drivetrain {way}, two tests", logs=_with(frc, way)) for way in _WAYS]
    found += [
        replace(rack, name=f"rack_pinion, {_TORQUE}", logs=(_RECORDER,), signals=motor, published={}),
        replace(swing, name="dfki_pendulum energy_shaping", logs=("dfki_pendulum/energy_shaping.csv",)),
        replace(spin, name="odrive_cogging spinup_3_comp", logs=("odrive_cogging/spinup_3_comp.parquet",)),
        replace(silver, name="silverbox train", logs=("silverbox/train.parquet",)),
    ]
    return found


def _with(case: Recorded, text: str) -> tuple[str, ...]:
    return tuple(log for log in case.logs if text in log)


def _forms(case: Recorded) -> dict[str, Change]:
    """{name: what is done to the columns (time, u, velocity, position: those that the log has)}."""
    forms: dict[str, Change] = {name: partial(_cut, share=share) for name, share in _HALVES.items()}
    forms["every 2nd row"] = _halved
    if any(name in case.name for name in _LONG):
        return forms
    moved = [name for name in ("velocity", "position") if case.signals.get(name)]
    if len(moved) == 2:
        forms |= {f"{kept} only": partial(_only, kept=kept) for kept in moved}
    if not any(m in ("gravity", "cogging") for m in case.must):
        forms["u and d_hat"] = partial(_observed, case=case)
    if any(name in case.name for name in _ALL_FORMS):
        forms |= {"u in thousandths": _in_thousandths, "all signs turned": _turned}
    return forms


def _written(case: Recorded, form: str, change: Change, folder: Path, place: Path) -> Recorded:
    name, logs, columns = f"{case.name}, {form}", [], {}
    target = place / hashlib.sha1(name.encode()).hexdigest()[:12]
    target.mkdir(parents=True, exist_ok=True)
    for log in case.logs:
        columns = change(read(case.signals, folder / log))
        rows = np.stack(list(columns.values()), axis=1)
        path = target / f"{Path(log).stem}.csv"
        np.savetxt(path, rows, delimiter=",", header=",".join(columns), comments="", fmt="%.12g")
        logs.append(str(path))
    unit = OTHER_UNIT if form == "u in thousandths" else 1.0
    units = {n: v if n in ("delay", "cogging.periods") else v * unit for n, v in case.published.items()}
    alone = ("velocity", "position") if "d_hat" in columns else ()
    signals = {n: n if n in columns else "" for n in ("time", "u", "d_hat", "velocity", "position")}
    return replace(
        case,
        name=name,
        logs=tuple(logs),
        signals=signals | dict.fromkeys(alone, ""),
        inertia=case.inertia * unit,
        published=units,
        regress_signals=signals | {"d_hat": ""},
    )


def _cut(columns: Columns, share: tuple[float, float]) -> Columns:
    first, last = (int(part * len(columns["time"])) for part in share)
    return {k: x[first:last] for k, x in columns.items()}


def _halved(columns: Columns) -> Columns:
    """As a logger of half the rate would have written it."""
    return {k: x[::2] for k, x in columns.items()}


def _only(columns: Columns, kept: str) -> Columns:
    return {k: columns[k] for k in ("time", "u", kept)}


def _in_thousandths(columns: Columns) -> Columns:
    return columns | {"u": OTHER_UNIT * columns["u"]}


def _turned(columns: Columns) -> Columns:
    return {k: x if k == "time" else -x for k, x in columns.items()}


def _observed(columns: Columns, case: Recorded) -> Columns:
    """u and d_hat = Q {Jn a - u}, Q = 1 / (tau s + 1) stepped by forward Euler, of the speed that is logged or the last
    difference of the position."""
    time, u = columns["time"], columns["u"]
    steps = np.diff(time, prepend=2.0 * time[0] - time[1])
    speed = columns.get("velocity")
    if speed is None:
        speed = np.diff(columns["position"], prepend=columns["position"][0]) / steps
    pulled = u + case.inertia / case.tau * speed
    low = np.empty_like(u)
    state = pulled[0]
    for k, (value, step) in enumerate(zip(pulled, steps, strict=True)):
        low[k] = state
        state += step / case.tau * (value - state)
    return columns | {"d_hat": case.inertia / case.tau * speed - low}


def table_of_forms(rows: Sequence[Mapping[str, Any]]) -> list[str]:
    """Markdown: how many of the effects that a plain regression finds in each form are named, engine by engine."""
    engines, forms = list(dict.fromkeys(r["engine"] for r in rows)), {_form(r) for r in rows}
    head = [f"{name}: named of those that are in it; must not, and is; no answer; CPU" for name in engines]
    lines = ["| form | questions | " + " | ".join(head) + " |", "|---|---|" + "---|" * len(engines)]
    for form in [*sorted(forms), "all"]:
        ours = [r for r in rows if form in ("all", _form(r))]
        counts = [_counted([r for r in ours if r["engine"] == name]) for name in engines]
        lines.append(f"| {form} | {len({r['name'] for r in ours})} | " + " | ".join(counts) + " |")
    return lines


def _form(row: Mapping[str, Any]) -> str:
    form = row["name"].rpartition(", ")[2]
    return form if form in (*_HALVES, *_FORMS) else "other files, columns, groups"


def _counted(rows: Sequence[Mapping[str, Any]]) -> str:
    met, there = (sum(of) for of in zip(*((r["met"], r["musts"] - len(r["hidden"])) for r in rows), strict=True))
    broken, errors = sum(len(r["violated"]) for r in rows), sum(r["verdict"] == "error" for r in rows)
    return f"{met} of {there}; {broken}; {errors}; {sum(r['seconds'] for r in rows):.0f} s"
