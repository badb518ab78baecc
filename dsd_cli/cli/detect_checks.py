"""What the user of `dsd detect` expects of the labels, as given on the command line."""

from __future__ import annotations

import math
from dataclasses import dataclass

from dsd_cli.detect.plan import Plan
from dsd_cli.detect.summary import Expectation, Summarizer
from dsd_cli.errors import UsageError

#: Share of the samples that --expect asks for.
DEFAULT_SHARE = 0.95


@dataclass(frozen=True)
class Judgement:
    """--expect, --after, --min-share and --confident-only.

    Raises
    ------
    UsageError : a share outside 0 to 1, a time that is no number.
    """

    expect: tuple[str, ...] = ()
    after: float | None = None
    min_share: float = DEFAULT_SHARE
    confident_only: bool = False

    def __post_init__(self) -> None:
        if not 0.0 <= self.min_share <= 1.0:
            raise UsageError(f"--min-share {self.min_share:g}", "a share is between 0 and 1")
        given = self.after is not None or self.confident_only or self.min_share != DEFAULT_SHARE
        if given and not self.expect:
            raise UsageError(
                "--after, --min-share and --confident-only say how --expect is judged", "give --expect too"
            )
        if self.after is not None and math.isnan(self.after):
            raise UsageError("--after nan", "give a time in s")

    def summarizer(self, plan: Plan) -> Summarizer:
        """Adds up the labels of this plan, and holds them against what is expected."""
        return Summarizer(
            plan.grid,
            [_expectation(text, plan) for text in self.expect],
            after=-math.inf if self.after is None else self.after,
            min_share=self.min_share,
            confident_only=self.confident_only,
            rho=plan.settings.rho,
        )


def _expectation(text: str, plan: Plan) -> Expectation:
    axis, _, value = text.partition("=")
    axes = plan.grid.axes
    if axis not in axes or not value:
        raise UsageError(f"--expect {text}", "write AXIS=VALUE, with an axis of the grid: " + ", ".join(axes))
    try:
        number = float(value)
    except ValueError:
        raise UsageError(f"--expect {text}: '{value}' is not a number") from None
    candidates = sorted(set(axes[axis].tolist()))
    if not any(abs(number - c) <= 1e-9 * abs(c) + 1e-12 for c in candidates):
        listed = ", ".join(f"{c:g}" for c in candidates)
        raise UsageError(f"--expect {text}: no state has that {axis}", f"candidates are {listed}")
    return Expectation(axis, number)
