"""What a page says: results of the other commands, each of them there or missing for a reason."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Generic, TypeVar

from dsd_cli.design.results import Plan
from dsd_cli.identify.checks import CheckResult
from dsd_cli.learn.results import Learnt
from dsd_cli.report.comparison import Report
from dsd_cli.report.detection import Detection
from dsd_cli.report.diagnosis import DiagnosisReport
from dsd_cli.report.ladder import LadderReport
from dsd_cli.report.page.series import Views
from dsd_cli.signals.log import Array
from dsd_cli.signals.units import Units

T = TypeVar("T")


@dataclass(frozen=True)
class Outcome(Generic[T]):
    """A result, or the one line that says why there is none."""

    value: T | None = None
    missing: str = ""


@dataclass(frozen=True)
class Labels:
    """What the detector said of one log, and its labels: values of each axis of the grid by row; arrays of shape (n,).

    `t` : stamps, s. `confident` : whether a label is well founded. `between` : estimates of an axis between its
    candidates, NaN before the first one; of method "profile" alone.
    """

    result: Detection
    t: Array
    axes: Mapping[str, Array]
    confident: Array
    between: Mapping[str, Array] = field(default_factory=dict)


@dataclass(frozen=True)
class SourceFile:
    """A file that was read, so that a reader can see whether he has the same."""

    name: str
    size: int
    sha256: str


@dataclass(frozen=True)
class Story:
    """All of it, in the order of the page.

    Attributes
    ----------
    command : as it was typed, quoted for a shell. files : what was read. versions : what it was made with.
    config_name, config_text : the config that results; "" without a ladder.
    detected_with : what the labels are of that the config as given does not have; "" if nothing.
    law : what was learnt where the ladder ended in `unknown`; None where nothing was asked.
    plan : the motion that settles what is left open; missing where nothing is.
    warnings : of reading the logs, and values of [model] beyond what is known of them.
    """

    logs: tuple[str, ...]
    holdout: tuple[str, ...]
    checks: tuple[CheckResult, ...]
    detections: tuple[tuple[str, Outcome[Labels]], ...]
    comparison: Outcome[Report]
    diagnosis: Outcome[DiagnosisReport]
    ladder: Outcome[LadderReport]
    views: Outcome[Views]
    config_name: str
    config_text: str
    command: str
    made: str
    units: Units
    detected_with: str = ""
    files: tuple[SourceFile, ...] = ()
    versions: Mapping[str, str] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()
    plan: Outcome[Plan] = Outcome()
    law: Learnt | None = None

    def why_not(self, part: Outcome[Any]) -> str:
        """Why a later part is missing; not twice the same line."""
        return "for the same reason" if part.missing == self.comparison.missing else part.missing
