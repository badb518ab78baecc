"""`dsd init LOG`: a config that the log itself proposes, and what in it is a guess."""

from __future__ import annotations

import json
import re
from dataclasses import dataclass, field

import numpy as np

from dsd_cli.errors import DataError, DsdError
from dsd_cli.files.first_look import FirstLook, first_look, time_unit_of
from dsd_cli.files.formats.base import CLOCK
from dsd_cli.files.joints import joint_that_moves
from dsd_cli.files.logs import LoadedLog, load_log
from dsd_cli.files.recognise import Recognised
from dsd_cli.files.template import template_text
from dsd_cli.identify.checks import CheckResult, check_log
from dsd_cli.plant.model import ObserverSettings, PlantModel
from dsd_cli.plant.observer import observe_log
from dsd_cli.plant.prediction import predict_d_hat
from dsd_cli.signals.clock import FASTEST, SLOWEST
from dsd_cli.signals.log import Array
from dsd_cli.signals.units import POSITION, VELOCITY

#: Rows from which everything is proposed.
ROWS = 200_000
#: The window, in s and in samples at least and at most; rho, as a multiple of what the first model leaves, and as a
#: share of u where there is no model.
WINDOW, FEWEST, MOST = 0.1, 50, 5000
RHO_OF_LEFT, RHO_OF_U = 1.5, 0.1
#: rho at least, as a share of u: no sensor is better than that.
RHO_LEAST = 0.002
_SCALE_KEYS = {"u": "u_scale", "velocity": "velocity_scale", "position": "position_scale"}
_TIME_SCALE = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}


@dataclass
class Proposal:
    """(section, key) -> TOML value, and one line for each thing that was found or guessed."""

    values: dict[tuple[str, str], str] = field(default_factory=dict)
    said: list[str] = field(default_factory=list)

    def put(self, section: str, key: str, value: object, why: str = "") -> None:
        """Set a key; `why`, where it is worth a line."""
        self.values[section, key] = json.dumps(value) if isinstance(value, str) else _toml(value)
        if why:
            self.said.append(f"{key} = {self.values[section, key]}: {why}")


def propose(path: str) -> tuple[str, list[str]]:
    """The text of a config for that log, and what was guessed.

    Raises
    ------
    DataError : it cannot be read, or no control input or nothing to have d_hat from is recognised.
    """
    out = Proposal()
    look, chosen = joint_that_moves(path, first_look(path))
    out.said += chosen
    _name_columns(path, look, out)
    try:
        loaded, factors = _read(path, look, out)
    except DsdError as error:
        out.said.append(f"its rows could not be looked at ({error}); the numbers are those of the template")
    else:
        _propose_numbers(loaded, factors, out)
    text = _headed(template_text("lab"), path)
    for (section, key), value in out.values.items():
        text = _with_value(text, section, key, value)
    return text, out.said


def _name_columns(path: str, look: FirstLook, out: Proposal) -> None:
    found = look.found
    needed = any(channel in found for channel in ("d_hat", "velocity", "position"))
    if "u" not in found or not needed:
        what = "no control input" if "u" not in found else "neither disturbance nor velocity nor position"
        listed = ", ".join(look.columns[:12]) + (" ..." if len(look.columns) > 12 else "")
        raise DataError(
            f"{path}: {what} among its columns ({listed})",
            "`dsd init` without a log writes a config in which to name them",
        )
    if look.clock:
        out.put("signals", "time", CLOCK, "the file stamps its rows itself")
    for channel, one in found.items():
        others = f"; it could be {', '.join(one.others[:3])} as well" if one.others else ""
        unit = f", in {one.spoken}" if one.unit else ""
        out.put("signals", channel, one.column, f"by its name{unit}{others}")
        _name_unit(channel, one, out)


def _name_unit(channel: str, one: Recognised, out: Proposal) -> None:
    """Units by name, so that every table and picture has them; a factor where the name has none."""
    if channel not in _SCALE_KEYS:
        return
    if one.named and _one_kind(channel, one.named, out):
        out.put("signals", f"{channel}_unit", one.named)
    factor = one.factor or 1.0
    if factor != 1.0 and (channel == "u" or ("signals", f"{channel}_unit") not in out.values):
        out.put("signals", _SCALE_KEYS[channel], float(f"{factor:.6g}"), f'"{one.column}" is in {one.unit}')
    if channel != "u" and not one.named:
        si = "rad/s or m/s" if channel == "velocity" else "rad or m"
        known = "not said" if not one.unit else f'"{one.unit}", which is not known'
        out.said.append(f'{channel}: the unit of "{one.column}" is {known}; it is taken as {si}')


def _one_kind(channel: str, unit: str, out: Proposal) -> bool:
    """Not turns beside metres: a config has one kind. The velocity comes first."""
    velocity = out.values.get(("signals", "velocity_unit"))
    return channel != "position" or velocity is None or POSITION[unit][0] == VELOCITY[json.loads(velocity)][0]


def _read(path: str, look: FirstLook, out: Proposal) -> tuple[LoadedLog, dict[str, float]]:
    names = {c: one.column for c, one in look.found.items() if c in ("u", "d_hat", "velocity", "position")}
    factors = {c: one.factor for c, one in look.found.items() if c in _SCALE_KEYS and one.factor not in (None, 1.0)}
    unit, sample_time = "s", None
    if look.clock:
        names = {"t": CLOCK, **names}
    elif (time := look.found.get("time")) is not None:
        names = {"t": time.column, **names}
        unit = time.time_unit or ""
    else:
        sample_time = 0.001
        out.put("signals", "sample_time", sample_time, "no time is recognised; put yours")
    if not unit:
        step = load_log(path, names, most_rows=1).log.sample_time
        unit = time_unit_of(step)
        out.said.append(f"time_unit: not said; steps of {step:g} are taken as {unit}")
    out.put("signals", "time_unit", unit)
    loaded = load_log(
        path, names, sample_time=sample_time, time_scale=_TIME_SCALE[unit], factors=factors, most_rows=ROWS
    )
    return loaded, factors


def _propose_numbers(loaded: LoadedLog, factors: dict[str, float], out: Proposal) -> None:
    log = loaded.log
    step = log.sample_time
    _doubt_time_unit(step, out)
    clock = "regular" if loaded.regular else "irregular stamps"
    out.said.append(f"sample time {step:g} s ({clock}), from the first {len(log):,} rows, {len(log) * step:.3g} s")
    out.put("observer", "time_constant", float(f"{5 * step:.3g}"), "5 samples; take your observer's if d_hat is logged")
    window = int(np.clip(round(WINDOW / step), FEWEST, MOST))
    out.put("detector", "window", window, f"{window * step:.3g} s")
    checked = check_log(log, None, None, loaded.restarts, dropped=loaded.dropped, factors=factors)
    out.said += [f"{one.what}: {one.remedy}" for one in checked.errors]
    inertia, delay = _told(checked, "inertia"), _told(checked, "delay")
    if inertia is None or inertia <= 0.0:
        rho = RHO_OF_U * float(np.std(log["u"]))
        if rho > 0.0:
            out.put("detector", "rho", float(f"{rho:.3g}"), "a tenth of what u does, for the log tells no inertia")
        _put_delays(0.0 if delay is None else max(delay, 0.0), step, delay is not None, out)
        return
    inertia = float(f"{inertia:.3g}")
    out.put("observer", "nominal_inertia", inertia, "what this log tells, per unit of u")
    out.put("model", "inertia", inertia)
    out.put("states", "inertias", [_short(0.67 * inertia), inertia, _short(1.5 * inertia)])
    at = max(delay or 0.0, 0.0)
    _put_delays(at, step, delay is not None, out)
    left = _left(loaded, PlantModel(inertia, at), ObserverSettings(inertia, 5 * step, 1))
    if left > 0.0:
        rho = float(f"{max(RHO_OF_LEFT * left, RHO_LEAST * float(np.std(log['u']))):.3g}")
        out.put("detector", "rho", rho, f"{RHO_OF_LEFT:g} times what inertia and delay leave")


def _doubt_time_unit(step: float, out: Proposal) -> None:
    """Say so where the unit in a name makes a sample time that no servo log has, and another unit would not."""
    unit = json.loads(out.values.get(("signals", "time_unit"), '"s"'))
    as_written = step / _TIME_SCALE[unit]
    likely = time_unit_of(as_written)
    seconds = as_written * _TIME_SCALE[likely]
    if not FASTEST <= step <= SLOWEST and FASTEST <= seconds <= SLOWEST:
        out.said.append(
            f"time_unit: in {unit}, rows are {step:g} s apart; in {likely} they would be {seconds:g} s: which?"
        )


def _put_delays(at: float, step: float, told: bool, out: Proposal) -> None:
    if told and at > 0.5 * step:
        wide = max(step, 0.5 * at)
        delays = [_short(at - wide), _short(at), _short(at + wide)]
        out.put("states", "delays", delays, f"around {at:.3g} s, what this log tells")
        out.put("model", "delay", _short(at))
    else:
        out.put("states", "delays", [0.0, *(_short(k * step) for k in (1, 2, 4))], "0, 1, 2 and 4 samples")


def _told(checked: CheckResult, name: str) -> float | None:
    """A value that the log tells to within half of it."""
    return next((one.value for one in checked.parameters if one.name == name and one.identified != "not"), None)


def _left(loaded: LoadedLog, model: PlantModel, observer: ObserverSettings) -> float:
    """rms of d_hat around the prediction of that model, unit of u; the loudest twentieth does not count."""
    log = loaded.log
    observed = log if "d_hat" in log and not ("velocity" in log or "position" in log) else observe_log(log, observer)
    error: Array = np.abs(observed["d_hat"] - predict_d_hat(model, observed, observer))
    error = error[np.isfinite(error)]
    return float(np.sqrt(np.mean(error[error <= np.quantile(error, 0.95)] ** 2))) if error.size else 0.0


def _short(value: float) -> float:
    return float(f"{max(value, 0.0):.3g}")


def _toml(value: object) -> str:
    return repr(value)


def _headed(text: str, path: str) -> str:
    name = json.dumps(path)
    return text.replace(
        "# Your own recording. Change what is marked <-, then:",
        f"# Proposed from {name}. Look over what is marked <-, then:",
    )


def _aligned(setting: str, line: re.Match[str]) -> str:
    comment = line[2].lstrip()
    return f"{setting:<{len(line[0]) - len(comment) - 1}} {comment}" if comment else setting


def _with_value(text: str, section: str, key: str, value: str) -> str:
    """The text with that key set, where the section has it (commented out, too), its comment kept."""
    head = re.search(rf"^\[{section}\].*$", text, flags=re.MULTILINE)
    assert head is not None, section
    end = re.search(r"^\[", text[head.end() :], flags=re.MULTILINE)
    stop = head.end() + end.start() if end else len(text)
    body = text[head.end() : stop]
    line = re.compile(rf"^(?:# )?{key} = (\[[^\]]*\]|\"[^\"]*\"|[^#\s]+)(.*)$", flags=re.MULTILINE)
    if line.search(body):
        body = line.sub(lambda found: _aligned(f"{key} = {value}", found), body, count=1)
    else:
        body = f"{body.rstrip()}\n{key} = {value}\n\n"
    if key == "sample_time":
        body = re.sub(r"^time = .*\n", "", body, flags=re.MULTILINE)
    return text[: head.end()] + body + text[stop:]
