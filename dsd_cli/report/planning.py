"""The result of `dsd plan` as JSON and as a table."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any, NamedTuple

import numpy as np

from dsd_cli.design.results import Plan, PlannedPair, PlannedValue, Stage
from dsd_cli.report import terminal
from dsd_cli.report.diagnosis import plain_table
from dsd_cli.report.head import head
from dsd_cli.report.names import error, listed, number_or_none
from dsd_cli.report.terminal import escaped
from dsd_cli.signals.log import Array

#: Nats from which on explanations count as told apart in words: odds of 1 to 400.
TOLD = 6.0
#: A limit is in a picture that is no more than so many times as far away as the motion goes.
_NEAR = 3.0
#: Beyond so many nats only that they are many is said.
_MANY = 1e4


@dataclass(frozen=True)
class Experiment:
    """One round of a loop: files, and what the logs so far say after it."""

    reference: str
    log: str
    verdict: str
    probability: float
    left_open: tuple[str, ...]


class Channel(NamedTuple):
    """A channel of the motion, shape (n,), with those of its limits that it comes near to."""

    title: str
    unit: str
    values: Array
    limits: tuple[float, ...]


def channels(plan: Plan) -> tuple[Channel, ...]:
    """What a picture of the motion shows over time; () without a motion."""
    motion, limits, units = plan.motion, plan.limits, plan.units
    if motion is None:
        return ()
    rows = (
        ("position", units.of_position, motion.position, (limits.low, limits.high)),
        ("velocity", units.of_velocity, motion.velocity, (-limits.velocity, limits.velocity)),
        ("u, foreseen", units.force, motion.u, (-limits.u, limits.u)),
    )
    return tuple(
        Channel(title, unit, x, tuple(end for end in ends if abs(end) < _NEAR * float(np.abs(x).max()) + 1e-300))
        for title, unit, x, ends in rows
    )


def to_json(plan: Plan, experiments: Sequence[Experiment] = (), output: str = "") -> dict[str, Any]:
    """The object of the contract."""
    motion, limits = plan.motion, plan.limits
    return {
        **head("plan", plan.logs),
        "verdict": plan.verdict,
        "output": output if motion is not None else None,
        "seconds": None if motion is None else motion.seconds,
        "sample_time": None if motion is None else motion.step,
        "pairs": [
            {
                "a": p.a,
                "b": p.b,
                "nats_before": p.nats_before,
                "nats_expected": p.nats_expected,
                "nats_range": None if math.isnan(p.nats_low) else [p.nats_low, p.nats_high],
                "nats_if_a": number_or_none(p.nats_if_a),
                "nats_if_b": number_or_none(p.nats_if_b),
            }
            for p in plan.pairs
        ],
        "values": [_value_json(v, plan) for v in plan.values],
        "limits": {"position": [limits.low, limits.high], **limits.sizes, "start": limits.start},
        "limits_given": list(limits.given),
        "reached": dict(plan.reached),
        "not_counted": list(plan.not_counted),
        "impossible": [asdict(one) for one in plan.impossible],
        "stages": [
            {"kind": s.kind, "start": s.start, "end": s.end, "values": {k: list(v) for k, v in s.values.items()}}
            for s in plan.stages
        ],
        "cost": [{"seconds": s, "nats": number_or_none(n)} for s, n in plan.cost],
        "band_hz": number_or_none(plan.band_hz),
        "experiments": [{**asdict(one), "left_open": list(one.left_open)} for one in experiments],
        "warnings": list(plan.warnings),
    }


def _value_json(value: PlannedValue, plan: Plan) -> dict[str, Any]:
    return {
        "name": value.name,
        "value": number_or_none(value.value),
        "unit": plan.units.words(value.unit),
        "std_error_before": number_or_none(value.std_error_before),
        "std_error_expected": number_or_none(value.std_error_expected),
    }


def print_table(plan: Plan, experiments: Sequence[Experiment], file: Any) -> None:
    """For a person."""
    console = terminal.console(file)
    for i, one in enumerate(experiments, 1):
        left = f", left open: {listed(one.left_open)}" if one.left_open else ", nothing left open"
        console.print(escaped(f"experiment {i}: {one.log}: {one.verdict}, {100.0 * one.probability:.0f} %{left}"))
    console.print(f"[bold]{escaped(headline(plan))}[/bold]")
    if plan.pairs:
        table = plain_table("explanations, and by how much the true one will lead", "", "now", "after (nats)")
        for pair in plan.pairs:
            table.add_row(f"{pair.a} or {pair.b}", _now(pair), _after(pair))
        console.print(table)
    if plan.values:
        table = plain_table("values", "", "now", "after (standard error)", "unit")
        for v in plan.values:
            now, after = error(v.std_error_before), error(v.std_error_expected)
            table.add_row(v.name, f"{v.value:.4g} +- {now}", f"+- {after}", plan.units.words(v.unit))
        console.print(table)
    for line in _closing(plan):
        console.print(escaped(line))


def headline(plan: Plan) -> str:
    """What the motion is and does, one sentence."""
    logs = ", ".join(plan.logs)
    if plan.motion is None:
        return f"{logs}: no motion is written: " + (
            "none within the limits settles what is open"
            if plan.pairs or plan.values
            else f"{'no motion can be planned for what' if plan.impossible else 'nothing'} is left open"
        )
    kinds = list(dict.fromkeys(s.kind for s in plan.stages))
    told = [p for p in plan.pairs if p.nats_expected > TOLD]
    words = [f"distinguishes {len(told)} of {len(plan.pairs)} pairs of explanations"] if plan.pairs else []
    lost = {one.what for one in plan.impossible}
    better = [v.name for v in plan.values if v.name not in lost]
    words += [f"identifies {listed(better)} better"] if better else []
    words = words or ["shows whatever effect of the catalogue is there"]
    return (
        f"{logs}: {plan.motion.seconds:.3g} s of {listed(kinds)}, from rest at {plan.limits.start:.3g}, {listed(words)}"
    )


def _now(pair: PlannedPair) -> str:
    return f"{nats_text(abs(pair.nats_before))} for {pair.a if pair.nats_before >= 0.0 else pair.b}"


def _after(pair: PlannedPair) -> str:
    """The smaller of both ways, least to most of what was simulated; both ways where that is less than now, as when the
    logs would have misled."""
    ways = [(n, name) for n, name in ((pair.nats_if_a, pair.a), (pair.nats_if_b, pair.b)) if math.isfinite(n)]
    if len(ways) < 2 or pair.nats_expected >= abs(pair.nats_before):
        ends = dict.fromkeys(map(nats_text, (pair.nats_low, pair.nats_high)))
        return " to ".join(ends) if math.isfinite(pair.nats_low) else nats_text(pair.nats_expected)
    return "; ".join(f"{nats_text(nats)} if {name}" for nats, name in ways)


def nats_text(nats: float) -> str:
    """Three digits; large ones as such."""
    return f"> {_MANY:,.0f}" if nats > _MANY else f"{nats:,.3g}" if abs(nats) < 100.0 else f"{nats:,.0f}"


def _closing(plan: Plan) -> list[str]:
    limits, units = plan.limits, plan.units
    lines = [f"no motion settles: {one.what}: {one.remedy}" for one in plan.impossible]
    if plan.motion is None:
        return lines
    if len(plan.cost) > 1:
        curve = ", ".join(f"{s:g} s {nats_text(n)}" for s, n in plan.cost)
        what = "all that is open" if plan.pairs or plan.values else "all effects of the catalogue"
        lines.append(f"what it costs: smallest nats of {what}: {curve}")
    lines += [f"  {s.start:.4g} to {s.end:.4g} s  {_stage_text(s)}" for s in plan.stages]
    where = "given" if len(limits.given) == 5 else "what the logs reached where no --limit says more"
    lines.append(
        f"limits ({where}): position {limits.low:.4g} to {limits.high:.4g} {units.of_position}, velocity "
        f"{limits.velocity:.4g}, acceleration {limits.acceleration:.4g}, jerk {limits.jerk:.4g}, u {limits.u:.4g}"
    )
    reached = plan.reached
    if reached:
        which = "other" if plan.not_counted else "likely"
        lines.append(
            f"every {which} plant kept them under the simulated loop: position {reached['position_low']:.4g} to "
            f"{reached['position_high']:.4g}, velocity up to {reached['velocity']:.4g}, u up to {reached['u']:.4g}"
        )
    if plan.not_counted:
        lines.append(not_counted(plan))
    lines.append("-> run it, then diagnose both logs together: dsd diagnose OLD NEW")
    return lines


def not_counted(plan: Plan) -> str:
    """Explanations that were left out."""
    return f"not counted, for it breaks a limit on every motion: {', '.join(plan.not_counted)}"


def _stage_text(stage: Stage) -> str:
    """`chirp: frequency_hz 0.4, 7.8; amplitude 0.2`; the first few of long lists."""
    words = []
    for name, values in stage.values.items():
        more = ", ..." if len(values) > 4 else ""
        words.append(f"{name} " + ", ".join(f"{x:.3g}" for x in values[:4] if math.isfinite(x)) + more)
    return f"{stage.kind}: " + "; ".join(words)
