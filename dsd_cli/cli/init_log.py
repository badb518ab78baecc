"""`dsd init LOG`: a config that the log itself proposes, and what in it is a guess."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from dsd_cli.cli.init_questions import column_question, step_question, without_coarse_stamps
from dsd_cli.cli.init_roles import Chosen, choose
from dsd_cli.cli.init_units import Units, step_of, units_of
from dsd_cli.errors import DsdError, source_name
from dsd_cli.files.config import Signals
from dsd_cli.files.csv_layout import CsvLayout
from dsd_cli.files.first_look import time_unit_of
from dsd_cli.files.formats.base import CLOCK
from dsd_cli.files.logs import LoadedLog, load_log
from dsd_cli.files.recognise import Recognised
from dsd_cli.files.sample import sample
from dsd_cli.files.template import headed, template_text, with_value
from dsd_cli.files.words import COUNTS, plain_unit
from dsd_cli.identify.checks import CheckResult, check_log
from dsd_cli.plant.model import ObserverSettings, PlantModel
from dsd_cli.plant.observer import observe_log
from dsd_cli.plant.prediction import predict_d_hat
from dsd_cli.signals.clock import FASTEST, SLOWEST, TIME_SCALE
from dsd_cli.signals.log import Array, Log
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


@dataclass
class Proposal:
    """(section, key) -> TOML value, and one line for each thing that was found or guessed."""

    values: dict[tuple[str, str], str] = field(default_factory=dict)
    said: list[str] = field(default_factory=list)

    def put(self, section: str, key: str, value: object, why: str = "") -> None:
        """Set a key; `why`, where it is worth a line."""
        self.values[section, key] = json.dumps(value, ensure_ascii=False) if isinstance(value, str) else _toml(value)
        if why:
            self.said.append(f"{key} = {self.values[section, key]}: {why}")


class Asked(NamedTuple):
    """What the user said: role -> column, (section, key) -> value; `ask` him for a column, None: nobody is there."""

    given: Mapping[str, str]
    values: Mapping[tuple[str, str], object]
    layout: CsvLayout | None = None
    ask: Callable[[str, Sequence[str]], str] | None = None


class Proposed(NamedTuple):
    """The text of a config, what was guessed, and the question that is left ("" for none), with its command."""

    text: str
    said: list[str]
    question: str = ""
    command: str = ""


def propose(path: str, asked: Asked, name: str = "") -> Proposed:
    """A config for that log; `name` is what it is called where that is not its path.

    Raises
    ------
    DataError : it cannot be read. UsageError : a column that was named is not there.
    """
    name, looked = name or path, sample(path, asked.layout)
    out = Proposal(said=list(looked.notes))
    chosen = choose(source_name(name), looked, asked.given)
    while chosen.missing and asked.ask is not None:
        answer = asked.ask(chosen.missing, chosen.candidates)
        asked = asked._replace(given={**asked.given, chosen.missing: answer})
        chosen = choose(source_name(name), looked, asked.given)
    chosen = without_coarse_stamps(chosen)
    out.said += chosen.said
    _name_columns(chosen, out)
    unstamped = not chosen.missing and not chosen.clock and "time" not in chosen.found
    step = _rows_apart(chosen, asked, looked.sample_time, out) if unstamped else None
    if not chosen.missing and (step or not unstamped):
        try:
            loaded, factors = _read(path, chosen, step, asked.layout, out)
        except DsdError as error:
            said = str(error).replace(path, source_name(name))
            out.said.append(f"its rows could not be read ({said}); the numbers are those of the template")
        else:
            _propose_numbers(loaded, factors, out)
    for (section, key), value in asked.values.items():
        out.put(section, key, value)
    text = headed(template_text("lab"), source_name(name))
    for (section, key), written in out.values.items():
        text = with_value(text, section, key, written)
    if not chosen.missing and (step or not unstamped):
        return Proposed(text, out.said)
    left = (column_question if chosen.missing else step_question)(name, chosen, asked.given, text)
    return Proposed(left.text, out.said, left.question, left.command)


def _rows_apart(chosen: Chosen, asked: Asked, said: float | None, out: Proposal) -> float | None:
    """s between the rows of a log without a clock: as the user, the file or the motion says; None: nothing does."""
    told = asked.values.get(("signals", "sample_time"))
    if isinstance(told, int | float):
        return float(told)
    found = step_of(chosen.table, chosen.found)
    why = "the file says so"
    if not said and found is not None and found[1]:
        said, why = found[0], f'"{chosen.found["velocity"].column}" is the slope of the position then'
    if said:
        out.put("signals", "sample_time", said, why)
    return said


def _name_columns(chosen: Chosen, out: Proposal) -> None:
    if chosen.clock:
        out.put("signals", "time", CLOCK, "the file stamps its rows itself")
    for channel, one in chosen.found.items():
        if chosen.clock and channel == "time":
            continue
        guess = chosen.reasons.get(channel)
        others = f"; it could be {', '.join(one.others[:3])} as well" if one.others else ""
        unit = f", in {one.spoken}" if one.unit else ""
        why = "by its name" if guess is None else guess.reason
        doubt = f"; {guess.doubt}" if guess is not None and guess.doubt else ""
        out.put("signals", channel, one.column, f"{why}{unit}{doubt}{others}")
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
        known = "is not said" if not one.unit else f'is "{one.unit}", which is not known'
        if plain_unit(one.unit) in COUNTS:
            unit = "counts/s" if channel == "velocity" else "counts"
            known = f'is counts: {channel}_unit = "{unit}" and counts_per_turn (or counts_per_metre) say how much'
        out.said.append(f'{channel}: the unit of "{one.column}" {known}; it is taken as {si}')


def _one_kind(channel: str, unit: str, out: Proposal) -> bool:
    """Not turns beside metres: a config has one kind. The velocity comes first."""
    velocity = out.values.get(("signals", "velocity_unit"))
    return channel != "position" or velocity is None or POSITION[unit][0] == VELOCITY[json.loads(velocity)][0]


def _read(
    path: str, chosen: Chosen, told: float | None, layout: CsvLayout | None, out: Proposal
) -> tuple[LoadedLog, dict[str, float]]:
    found = chosen.found
    names = {c: one.column for c, one in found.items() if c in ("u", "d_hat", "velocity", "position")}
    unit, sample_time = "s", None
    if chosen.clock:
        names = {"t": CLOCK, **names}
    elif (time := found.get("time")) is not None:
        names = {"t": time.column, **names}
        unit = time.time_unit or ""
    else:
        sample_time = told
    if not unit:
        first = load_log(path, names, most_rows=1, layout=layout).log
        step = first.sample_time
        unit = time_unit_of(step, float(first["t"][0]))
        out.said.append(f"time_unit: not said; steps of {step:g} are taken as {unit}")
    out.put("signals", "time_unit", unit)
    _settle_units(units_of(chosen.table, found, TIME_SCALE[unit], sample_time), out)
    factors = _factors(out)
    scale = TIME_SCALE[unit]
    loaded = load_log(
        path, names, sample_time=sample_time, time_scale=scale, factors=factors, most_rows=ROWS, layout=layout
    )
    return loaded, factors


def _settle_units(units: Units, out: Proposal) -> None:
    for at, (key, value) in enumerate(units.keys.items()):
        out.put("signals", key, value, units.why if at == 0 else "")
        channel = key.partition("_")[0]
        out.said = [line for line in out.said if not _is_answered(line, channel)]


def _is_answered(line: str, channel: str) -> bool:
    """Whether it asks for the unit of a channel, which another has said by now."""
    return line.startswith(f"{channel}: ") and ("is not said" in line or "is counts" in line)


def _factors(out: Proposal) -> dict[str, float]:
    """Channel -> factor, as the config will have it."""
    written: dict[str, Any] = {
        key: json.loads(text) for (section, key), text in out.values.items() if section == "signals"
    }
    told = {key: value for key, value in written.items() if key in Signals.keys and key != "sample_time"}
    factors = Signals(**told).factors()
    return {channel: value for channel, value in factors.items() if channel in _SCALE_KEYS}


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
        _without_inertia(log, out)
        _put_delays(0.0 if delay is None else max(delay, 0.0), step, delay is not None, out)
        return
    inertia = float(f"{inertia:.3g}")
    out.put("observer", "nominal_inertia", inertia, "identified from this log, per unit of u")
    out.put("model", "inertia", inertia)
    out.put("states", "inertias", [_short(0.67 * inertia), inertia, _short(1.5 * inertia)])
    at = max(delay or 0.0, 0.0)
    _put_delays(at, step, delay is not None, out)
    left = _left(loaded, PlantModel(inertia, at), ObserverSettings(inertia, 5 * step, 1))
    if 0.0 < left < float(np.std(log["u"])):  # more is no fit at all, as of trials joined in one file
        rho = float(f"{max(RHO_OF_LEFT * left, RHO_LEAST * float(np.std(log['u']))):.3g}")
        out.put("detector", "rho", rho, f"{RHO_OF_LEFT:g} times what inertia and delay leave")


def _without_inertia(log: Log, out: Proposal) -> None:
    """rho is how far d_hat strays: without a d_hat in the log it asks for the nominal inertia that makes one."""
    if "d_hat" not in log:
        out.said.append(
            "nominal_inertia, inertias and rho are the template's, not of this log: inertia is not identifiable here; "
            "put yours before dsd detect"
        )
        return
    rho = RHO_OF_U * float(np.std(log["u"]))
    if 0.0 < rho < math.inf:  # of a corrupt cell (1e300) a square is no number
        out.put("detector", "rho", float(f"{rho:.3g}"), "a tenth of what u does: inertia is not identifiable here")


def _doubt_time_unit(step: float, out: Proposal) -> None:
    """Say so where the unit in a name makes a sample time that no servo log has, and another unit would not."""
    unit = json.loads(out.values.get(("signals", "time_unit"), '"s"'))
    as_written = step / TIME_SCALE[unit]
    likely = time_unit_of(as_written)
    seconds = as_written * TIME_SCALE[likely]
    if not FASTEST <= step <= SLOWEST and FASTEST <= seconds <= SLOWEST:
        out.said.append(
            f"time_unit: in {unit}, rows are {step:g} s apart; in {likely} they would be {seconds:g} s: which?"
        )


def _put_delays(at: float, step: float, told: bool, out: Proposal) -> None:
    if told and at > 0.5 * step:
        wide = max(step, 0.5 * at)
        delays = [_short(at - wide), _short(at), _short(at + wide)]
        out.put("states", "delays", delays, f"around {at:.3g} s, identified from this log")
        out.put("model", "delay", _short(at))
    else:
        out.put("states", "delays", [0.0, *(_short(k * step) for k in (1, 2, 4))], "0, 1, 2 and 4 samples")


def _told(checked: CheckResult, name: str) -> float | None:
    """A value that is identifiable to within half of it."""
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
    return str(value).lower() if isinstance(value, bool) else repr(value)
