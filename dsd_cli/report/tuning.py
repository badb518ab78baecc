"""The result of `dsd tune` as JSON and as lines for a person."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

from dsd_cli.detect.settings import DetectorSettings
from dsd_cli.detect.tune.tuning import Tuning
from dsd_cli.report import terminal
from dsd_cli.report.head import head
from dsd_cli.report.terminal import escaped


@dataclass(frozen=True)
class TuningReport:
    """A tuning, the logs' name and where the config was written (None: nowhere)."""

    tuning: Tuning
    log: str
    config: str | None


def to_json(report: TuningReport) -> dict[str, Any]:
    """The object of the contract."""
    tuning = report.tuning
    return {
        **head("tune", [report.log]),
        "samples": tuning.samples,
        "part": tuning.evidence.part or None,
        "noise": tuning.noise,
        "correlation": tuning.correlation,
        "dwell": tuning.dwell,
        "changes": tuning.changes,
        "rho": tuning.after.settings.rho,
        "window": tuning.after.settings.window,
        "transition": transition_value(tuning.after.settings),
        "delays": list(tuning.grid.delays),
        "inertias": list(tuning.grid.inertias),
        "added": [asdict(addition) for addition in tuning.added],
        "visited": list(tuning.visited),
        "agreement": {"before": tuning.before.agreement, "after": tuning.after.agreement},
        "expected": asdict(tuning.expected),
        "config": report.config,
    }


def transition_value(settings: DetectorSettings) -> Any:
    """A as the config has it."""
    return "uniform" if settings.transition.stay is None else {"stay": settings.transition.stay}


def print_lines(report: TuningReport, file: Any) -> None:
    """What was chosen and why, and what to expect."""
    console = terminal.console(file)
    tuning, now, old = report.tuning, report.tuning.after.settings, report.tuning.before.settings
    part = f" of {tuning.evidence.part}: there u moves the axis most" if tuning.evidence.part else ""
    console.print(f"[bold]{escaped(report.log)}[/bold]: tuned on {tuning.samples:,} judged samples{part}")
    for line in (
        f"rho         {old.rho:g} -> {now.rho:g}: residual of the right states {tuning.noise:.3g}{_lasting(tuning)}",
        f"window      {old.window} -> {now.window} samples",
        f"transition  {transition_text(old)} -> {transition_text(now)}: {tuning.changes} changes seen, "
        f"one in {tuning.dwell:.3g} s",
        *_grid_lines(tuning),
        agreement_line(tuning),
        *(["no other tuning labels as well: the present one stays"] if tuning.after == tuning.before else []),
        *_expected_lines(tuning),
    ):
        console.print(escaped(line))


def agreement_line(tuning: Tuning) -> str:
    """How well the labels follow, before and after."""
    before, after = 100 * tuning.before.agreement, 100 * tuning.after.agreement
    return f"labels like the path smoothed over the whole log: {before:.1f} % -> {after:.1f} %"


def _lasting(tuning: Tuning) -> str:
    if tuning.correlation < 2.0:
        return ""
    return f", and it lasts: {tuning.correlation:.0f} samples count as one"


def transition_text(settings: DetectorSettings) -> str:
    """A in words."""
    if settings.transition.matrix is not None:
        return "a matrix"
    stay = settings.transition.stay
    return "uniform" if stay is None else f"stay 1 - {1.0 - stay:.0e}"


def _grid_lines(tuning: Tuning) -> list[str]:
    lines = [
        f"{a.axis:<11} {a.value:g} +- {a.std_error:.1g} added: from {a.start:g} s on the residual is "
        f"{a.rms_before:.3g} with the nearest candidate, {a.rms_after:.3g} with this one"
        for a in tuning.added
    ]
    return lines or [f"grid        stays: {len(tuning.visited)} of {len(tuning.grid)} states seen, none is missing"]


def _expected_lines(tuning: Tuning) -> list[str]:
    found = tuning.expected
    if found.delay_median is None:
        followed = f"of simulated changes {100 * found.followed:.0f} % are followed before the log ends"
    else:
        late = "more" if found.delay_p90 is None else f"{found.delay_p90:.3g} s"
        followed = f"a change is followed after {found.delay_median:.3g} s (median; 9 of 10 within {late})"
    alarms = f"{found.false_per_hour:.3g} false changes an hour"
    if found.false_per_hour == 0.0:
        alarms = f"no false change in {3600.0 * found.hours:.0f} s without one"
    return [f"expected, by simulation with this u and noise: {followed}; {alarms}"]
