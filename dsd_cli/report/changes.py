"""The changes of state that `dsd detect` found, as JSON and as lines."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from dsd_cli.detect.profile.changes import Change, Side

#: Lines on the screen; the JSON has all.
MOST_CHANGES = 10


class Changes(NamedTuple):
    """What was found, and what to expect of the test.

    Attributes
    ----------
    threshold : nats; false_alarms_per_hour : in a log without changes.
    combinations : effect values by index.
    """

    found: tuple[Change, ...]
    threshold: float
    false_alarms_per_hour: float
    combinations: tuple[Mapping[str, float], ...]

    def to_json(self) -> dict[str, Any]:
        """`changes` and `change_test` of the contract's object."""
        return {
            "changes": [
                {
                    "time": change.time,
                    "low": change.low,
                    "high": change.high,
                    "detected": change.detected,
                    "nats": change.nats,
                    "before": self._side(change.before),
                    "after": self._side(change.after),
                }
                for change in self.found
            ],
            "change_test": {"threshold": self.threshold, "false_alarms_per_hour": self.false_alarms_per_hour},
        }

    def _side(self, side: Side) -> dict[str, float | None]:
        inertia = side.inertia if side.inertia < float("inf") else None
        return {"delay": side.delay, "inertia": inertia, **self.combinations[side.combination]}

    def lines(self) -> Iterator[str]:
        """One line for each change, for a person."""
        for change in self.found[:MOST_CHANGES]:
            before, after = self._side(change.before), self._side(change.after)
            what = ", ".join(
                f"{name} {_number(before[name])} -> {_number(after[name])}"
                for name in before
                if _number(before[name]) != _number(after[name])
            )
            between = f"{change.low:.6g} to {change.high:.6g}"
            yield f"change at {change.time:.6g} s ({between}), seen at {change.detected:.6g} s: {what}"
        if len(self.found) > MOST_CHANGES:
            yield f"  and {len(self.found) - MOST_CHANGES:,} more changes (--format json lists them)"


def _number(value: float | None) -> str:
    return "unknown" if value is None else f"{value:.4g}"
