"""The passport of an axis as JSON and as a table."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from dsd_cli.passport import RMSE, Judged, Passport, Reading, Verdict, change, value_of
from dsd_cli.report import terminal
from dsd_cli.report.diagnosis import plain_table
from dsd_cli.report.head import head
from dsd_cli.report.names import estimate_text, estimates_json, listed, number_or_none
from dsd_cli.report.terminal import escaped
from dsd_cli.signals.units import Units

_STYLES = {Verdict.OUTSIDE: "bold red", Verdict.NOT_IDENTIFIED: "yellow", Verdict.UNDECIDED: "yellow"}


@dataclass(frozen=True)
class Signed:
    """What a passport is signed with.

    date : of the signing, ISO 8601. version : of dsd. files : "config", "limits" -> {file, sha256}.
    logs : log -> sha256, None where it is no file. reference : file, kind and date of the delivery.
    """

    date: str
    version: str
    files: Mapping[str, Mapping[str, str]]
    logs: Mapping[str, str | None]
    reference: Mapping[str, str | None]


def passport_json(passport: Passport, signed: Signed, units: Units) -> dict[str, Any]:
    """The document, but for its hash."""
    return {
        **head("passport", (one.log for one in passport.readings)),
        "verdict": passport.verdict.value,
        "verdict_text": verdict_line(passport, units),
        "date": signed.date,
        "version": signed.version,
        **signed.files,
        "reference": dict(signed.reference),
        "unit": units.force,
        "limits": [_limit_json(one, units) for one in passport.limits],
        "readings": [_reading_json(one, signed.logs) for one in passport.readings],
        "warnings": list(passport.warnings),
    }


def _limit_json(one: Judged, units: Units) -> dict[str, Any]:
    reference = one.reference
    return {
        "name": one.name,
        "unit": _unit(one, units),
        "reference": number_or_none(reference.value),
        "reference_error": number_or_none(reference.std_error),
        "low": number_or_none(one.low),
        "high": number_or_none(one.high),
        "value": number_or_none(one.estimate.value),
        "std_error": None if one.name == RMSE else number_or_none(one.estimate.std_error),
        "sigma": None if one.name == RMSE else number_or_none(one.sigma),
        "verdict": one.verdict.value,
        "since": None if one.since is None else {"log": one.since.log, "date": one.since.date or None},
        "outside": list(one.outside),
    }


def _reading_json(one: Reading, hashes: Mapping[str, str | None]) -> dict[str, Any]:
    return {
        "log": one.log,
        "sha256": hashes.get(one.log),
        "date": one.date or None,
        "rmse": number_or_none(one.score.rmse),
        "heldout_rmse": number_or_none(one.score.heldout_rmse),
        "band_hz": number_or_none(one.band_hz),
        "floor": number_or_none(one.floor),
        "values": estimates_json(one.estimates),
    }


def verdict_line(passport: Passport, units: Units) -> str:
    """The whole in one line: what changed, by how many sigma, and since which log."""
    one, newest = passport.worst, passport.readings[-1]
    if passport.verdict is Verdict.OUTSIDE:
        return _outside_line(one, newest, sum(j.verdict is Verdict.OUTSIDE for j in passport.limits) - 1, units)
    if passport.verdict is Verdict.NOT_IDENTIFIED:
        names = listed(j.name for j in passport.limits if j.verdict is Verdict.NOT_IDENTIFIED)
        return (
            f"{newest.log} does not identify {names} well enough for its limits: {_value(one, units)}, {_limits(one)}"
        )
    count = f"{len(passport.limits)} limits" if len(passport.limits) > 1 else "the limit"
    near = [j.name for j in passport.limits if j.verdict is Verdict.UNDECIDED]
    if near:
        return f"{newest.log}: outside of no limit, but too near to one to decide: {listed(near)}"
    return f"{newest.log}: within {count}"


def _outside_line(one: Judged, newest: Reading, more: int, units: Units) -> str:
    """`coulomb_friction.level 0.21 +- 0.01 N m is above 0.18: +40 % (12 sigma) from 0.15, since b.csv (2026-01-31)`."""
    above = one.estimate.value > one.high
    edge = f"{'above' if above else 'below'} {one.high if above else one.low:.4g}"
    moved = change(one.name, one.estimate.value, one.reference.value)
    size = (
        ""
        if math.isnan(moved)
        else f"{100.0 * moved / abs(one.reference.value):+.0f} %"
        if one.reference.value
        else f"{moved:+.3g}"
    )
    if one.name != RMSE and math.isfinite(one.sigma):
        size += f" ({'over 100' if abs(one.sigma) > 100.0 else f'{abs(one.sigma):.0f}'} sigma)"
    assert one.since is not None
    when = f" ({one.since.date})" if one.since.date else ""
    since = f"since {one.since.log}{when}" if one.since is not newest else f"in {newest.log}{when}"
    others = f"; {more} more outside" if more else ""
    far = f": {size} from {one.reference.value:.4g}" if size else ""
    return f"{_value(one, units)} is {edge}{far}, {since}{others}"


def _value(one: Judged, units: Units) -> str:
    if one.name == RMSE:
        return f"held-out force error {one.estimate.value:.3g} {units.force}"
    return f"{one.name} {estimate_text(one.estimate)}"


def _unit(one: Judged, units: Units) -> str:
    return units.force if one.name == RMSE else one.estimate.unit


def _limits(one: Judged) -> str:
    if math.isinf(one.low):
        return f"at most {one.high:.4g}"
    return f"at least {one.low:.4g}" if math.isinf(one.high) else f"{one.low:.4g} to {one.high:.4g}"


def print_passport(passport: Passport, units: Units, file: Any) -> None:
    """For a person: the limits, and each value over the logs where there are several."""
    console = terminal.console(file)
    newest = passport.readings[-1]
    when = f" ({newest.date})" if newest.date else ""
    table = plain_table(f"{newest.log}{when}", "value", "delivered", "allowed", "now", "sigma", "")
    for one in passport.limits:
        bare = f"{one.estimate.value:.3g}" if one.name == RMSE else estimate_text(one.estimate, unit=False)
        unit = _unit(one, units)
        table.add_row(
            escaped(f"{one.name}, {unit}" if unit not in ("", "1") else one.name),
            f"{one.reference.value:.4g}" if math.isfinite(one.reference.value) else "-",
            _limits(one),
            bare,
            f"{one.sigma:+.1f}" if math.isfinite(one.sigma) and one.name != RMSE else "-",
            f"[{style}]{one.verdict.value}[/]" if (style := _STYLES.get(one.verdict)) else one.verdict.value,
        )
    console.print(table)
    if len(passport.readings) > 1:
        console.print(_over_logs(passport))
    if not passport.failed:  # else it is the line of the failure
        console.print(escaped(verdict_line(passport, units)))


def _over_logs(passport: Passport) -> Any:
    names = [one.name for one in passport.limits]
    table = plain_table("each log by itself", "log", "date", *names)
    for reading in passport.readings:
        table.add_row(escaped(reading.log), reading.date or "-", *_marked(passport.limits, reading))
    return table


def _marked(limits: Sequence[Judged], reading: Reading) -> list[str]:
    cells = []
    for one in limits:
        found = value_of(reading, one.name)
        text = f"{found.value:.3g}" if one.name == RMSE else estimate_text(found, unit=False)
        cells.append(f"[bold red]{text} ![/]" if reading.log in one.outside else text)
    return cells
