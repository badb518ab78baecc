"""The result of `dsd export` for the eye and as JSON."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from dsd_cli.export.making import Cost, Made, Verified
from dsd_cli.report import terminal
from dsd_cli.report.head import head
from dsd_cli.report.names import number_or_none
from dsd_cli.signals.units import Units


@dataclass(frozen=True)
class ExportReport:
    """made : what was written, to `file` ("-" is stdout). verified, budget : None where the user did not ask.

    budget : part -> what leaving it out costs. samples : files with drawn values.
    """

    made: Made
    verified: Verified | None
    target: str
    file: str
    logs: tuple[str, ...]
    units: Units
    budget: Mapping[str, Cost] | None = None
    samples: tuple[str, ...] = ()


def export_json(report: ExportReport) -> dict[str, Any]:
    """The object of the contract."""
    made, verified = report.made, report.verified
    return {
        **head("export", report.logs),
        "target": report.target,
        "file": report.file,
        "name": made.joint.name,
        "sample_time": made.joint.sample_time,
        "unit": report.units.force,
        "carried": [{"effect": one.part, "how": one.how} for one in made.carried],
        "dropped": [{"effect": one.part, "why": one.why, "cost": cost_json(one.cost)} for one in made.dropped],
        "verify": {
            "ran": verified is not None and verified.ran,
            "how": "not asked for" if verified is None else verified.how,
            "rms_percent": None
            if verified is None or verified.rms_percent is None
            else number_or_none(verified.rms_percent),
        },
        "budget": None
        if report.budget is None
        else [{"effect": part, "cost": cost_json(cost)} for part, cost in report.budget.items()],
        "samples": list(report.samples),
    }


def cost_json(cost: Cost) -> dict[str, Any]:
    """What leaving an effect out costs."""
    return {
        "force_rms": number_or_none(cost.force),
        "force_percent": number_or_none(cost.force_percent),
        "velocity_percent": number_or_none(cost.velocity_percent),
    }


def verified_line(report: ExportReport) -> str:
    """How far what was written is from `dsd simulate`, in one line."""
    one = report.verified
    if one is None:
        return "not run: --no-verify"
    if one.rms_percent is None:
        return one.how
    return f"run under {one.how}: the speed is {percent_off(one.rms_percent)} (rms) off that of `dsd simulate`"


def cost_line(cost: Cost, units: Units) -> str:
    """`without it ...`."""
    force = f"{cost.force:.3g} {units.force} ({percent_off(cost.force_percent)} of u)"
    free = f"a free simulation over 0.5 s is {percent_off(cost.velocity_percent)} off in speed"
    return f"without it {force} of force is missing (rms), and {free}"


def percent_off(value: float) -> str:
    """An error in percent; of a model that runs away it is no number, or none that says anything."""
    return f"{value:.2g} %" if value < 1000.0 else "more than 1000 %"


def print_export(report: ExportReport, file: Any) -> None:
    """What is in the file, what is not, and whether it was run."""
    console, made = terminal.console(file), report.made
    width = max(len(one.part) for one in made.carried)
    lines = [f"{report.file}: {report.target}, {made.joint.name}; {verified_line(report)}"]
    lines += [f"  carried  {one.part:<{width}}  {one.how}" for one in made.carried]
    lines += [f"  left out {one.part}: {one.why}; {cost_line(one.cost, report.units)}" for one in made.dropped]
    lines += [f"  budget   {part}: {cost_line(cost, report.units)}" for part, cost in (report.budget or {}).items()]
    lines += [f"  samples  {report.samples[0]} to {report.samples[-1]}"] if report.samples else []
    for line in lines:
        console.print(terminal.escaped(line))
