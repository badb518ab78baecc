"""The numbers that `dsd init` writes: what is identified from the log, as every command will take it."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import replace
from functools import partial

import numpy as np

from dsd_cli.cli.init_delay import explains, only_channel, put_delays, short
from dsd_cli.cli.init_proposal import Proposal, signals_of
from dsd_cli.cli.init_rho import put_rho
from dsd_cli.cli.odd_values import lone_spikes, said_of_spikes, without_impossible, zero_offsets
from dsd_cli.cli.recordings import by_updates, on_its_clock, to_turn_u
from dsd_cli.files.config.remedies import keys_that_multiply
from dsd_cli.files.first_look import time_unit_of
from dsd_cli.files.logs import LoadedLog
from dsd_cli.identify.checks import CheckResult, check_log, to_mend_first, without_late
from dsd_cli.identify.checks.clock import jitter
from dsd_cli.plant.model import ObserverSettings, PlantModel
from dsd_cli.signals.clock import FASTEST, SLOWEST, TIME_SCALE, plain
from dsd_cli.signals.log import Log, with_channels
from dsd_cli.signals.units import KeysOf

#: The window, in s and in samples at least and at most; rho as a share of u where there is no model.
WINDOW, FEWEST, MOST = 0.1, 50, 5000
RHO_OF_U = 0.1
#: What `dsd check` will say of an inertia that a scan finds all the same.
_NOT_IDENTIFIED = "not identifiable beside forces that [model] lacks (see dsd check)"


def propose_numbers(
    loaded: LoadedLog, factors: dict[str, float], out: Proposal, doubted: bool, given: Mapping[str, str]
) -> None:
    """What is identified from the log; `doubted`: its unit of time is, too, if it makes no servo log."""
    rows, warned = len(loaded.log), len(loaded.warnings)
    loaded, noisy = _evened(_without_spikes(by_updates(loaded), out), out, given)
    out.said += [*loaded.warnings[warned:], *noisy]

    def looked_at() -> CheckResult:
        return check_log(
            loaded.log, None, None, loaded.restarts, dropped=loaded.dropped, factors=factors, keys_of=_keys(out)
        )

    checked = looked_at()
    if (turned := to_turn_u(checked)) and ("signals", "u_sign") not in out.values:  # the numbers are of u as it acts
        out.put("signals", "u_sign", -1, turned.what)
        out.comments["signals", "u_sign"] = f"# <- {turned.what}"
        loaded = replace(loaded, log=with_channels(loaded.log, u=-loaded.log["u"]))
        factors = {**factors, "u": -factors.get("u", 1.0)}
        checked = looked_at()
    kind = next((one for one in checked.findings if one.hold), None)
    if kind is not None and kind.hold is not None and ("signals", "u_hold") not in out.values:
        out.put("signals", "u_hold", kind.hold, kind.what)
        loaded = replace(loaded, log=replace(loaded.log, u_hold=kind.hold))
        checked = looked_at()
    loaded = _without_late(loaded, checked, out, given)
    log = loaded.log
    step = log.sample_time if loaded.regular else float(f"{checked.seconds / checked.samples:.4g}")
    if doubted:
        _doubt_time_unit(step, out)
    clock = "regular" if loaded.regular else "irregular stamps"
    out.said.append(f"sample time {step:g} s ({clock}), from the first {rows:,} rows, {checked.seconds:.3g} s")
    out.put("observer", "time_constant", float(f"{5 * step:.3g}"), "5 samples; take your observer's if d_hat is logged")
    window = int(np.clip(round(WINDOW / step), FEWEST, MOST))
    out.put("detector", "window", window, f"{window * step:.3g} s")
    found = (*(checked.errors or to_mend_first(checked)), *zero_offsets(log, signals_of(out)))
    out.said += [f"{one.what}{'' if one.what.endswith('?') else ':'} {one.remedy}" for one in found]
    if _told(checked, "inertia") is None and not checked.errors:  # too little for the scan may do beside a model
        checked = check_log(log, PlantModel(1.0), None, loaded.restarts)
    inertia, delay = _told(checked, "inertia"), _told(checked, "delay")
    if inertia is None or inertia <= 0.0:
        _without_inertia(log, out)
        put_delays(max(delay or 0.0, 0.0), step, False, out, only_channel(log))
        return
    inertia = float(f"{inertia:.3g}")
    out.put("model", "inertia", inertia)
    out.put("states", "inertias", [short(0.67 * inertia), inertia, short(1.5 * inertia)])
    at = max(delay or 0.0, 0.0)
    judged = check_log(log, PlantModel(inertia, at), None, loaded.restarts)
    alone = at > 0.5 * step and explains(judged, "delay")
    if at > 0.0 and not alone:  # as dsd check will see it
        judged = check_log(log, PlantModel(inertia), None, loaded.restarts)
    known = _told(judged, "inertia") is not None
    why = "identified from this log" if known else f"a first guess from this log, {_NOT_IDENTIFIED}"
    units = signals_of(out).units
    unit = f"in {units.words('{u}/({v}/s)')}" if units.u and units.position else "per unit of u"
    out.put("observer", "nominal_inertia", inertia, f"{why}, {unit}")
    observer = _of_d_hat(log, PlantModel(inertia, at), ObserverSettings(inertia, 5 * step), loaded.restarts, out)
    put_delays(at, step, alone, out, only_channel(log))
    put_rho(loaded, PlantModel(inertia, at if alone else 0.0), observer, window, out)


def _of_d_hat(
    log: Log, model: PlantModel, observer: ObserverSettings, restarts: tuple[int, ...], out: Proposal
) -> ObserverSettings:
    """The observer that made a logged d_hat, as far as that shows it; as given where the log has none."""
    if "d_hat" not in log:
        return observer
    for one in check_log(log, model, observer, restarts, with_values=False).findings:
        key, _, value = one.remedy.partition(" = ")
        if key == "observer.sign":
            observer = replace(observer, sign=int(value))
        elif key == "observer.nominal_inertia":
            observer = replace(observer, nominal_inertia=float(value))
        elif key == "observer.time_constant":
            observer = replace(observer, time_constant=float(value))
        else:
            continue
        name = key.removeprefix("observer.")
        out.put("observer", name, getattr(observer, name), "of the d_hat in the log")
    return observer


def _keys(out: Proposal) -> KeysOf:
    return partial(keys_that_multiply, signals_of(out))


def _evened(loaded: LoadedLog, out: Proposal, given: Mapping[str, str]) -> tuple[LoadedLog, list[str]]:
    """The log on an even clock where its stamps are noise on one, as every command takes it; that is written where no
    sample is missing, and the user named no time."""
    even, noisy = on_its_clock(loaded)
    whole = bool(noisy) and np.ptp(np.diff(even.log["t"])) < 0.5 * even.log.sample_time
    if whole and not loaded.restarts and "time" not in given:
        usual, share = jitter(loaded.log, ())
        apart = plain(even.log.sample_time, 2.0 * share * usual / len(loaded.log))
        out.put("signals", "time", "", "its stamps are noise on an even clock")
        out.put("signals", "sample_time", apart)
        even = replace(even, log=replace(even.log, sample_time=apart))
    return even, noisy


def _without_spikes(loaded: LoadedLog, out: Proposal) -> LoadedLog:
    """The log without single values of u that no drive gives, which would bend all numbers."""
    at = lone_spikes(loaded.log)
    log = without_impossible(loaded.log, at)
    taken = "" if log is loaded.log else ", and the numbers here are found without those that no drive gives"
    out.said += [f"{one.what} {one.remedy}{taken}" for one in said_of_spikes(loaded.log, at)]
    return replace(loaded, log=log)


def _without_late(loaded: LoadedLog, checked: CheckResult, out: Proposal, given: Mapping[str, str]) -> LoadedLog:
    """The log without a velocity that is later than its position, as every command takes it, and the config, too."""
    late = next((one for one in checked.findings if one.late_channel == "velocity"), None)
    if late is None or checked.errors or "velocity" in given:
        return loaded
    out.values = {key: text for key, text in out.values.items() if not key[1].startswith("velocity")}
    out.said = [line for line in out.said if not line.startswith("velocity_")]
    out.put("signals", "velocity", "", f"{late.what}: the position alone is used")
    return replace(loaded, log=without_late(loaded.log, late))


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


def _told(checked: CheckResult, name: str) -> float | None:
    """A value that is identifiable to within half of it."""
    return next((one.value for one in checked.parameters if one.name == name and one.identified != "not"), None)
