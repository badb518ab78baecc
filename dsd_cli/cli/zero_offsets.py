"""What `init` and `check` say of a channel that rests at another value than 0."""

from __future__ import annotations

from dsd_cli.identify.checks import Finding
from dsd_cli.signals.log import Log
from dsd_cli.signals.zero_offset import zero_offset


def zero_offsets(log: Log) -> list[Finding]:
    """Channels that rest at what is rather the zero of their sensor than a force or a speed."""
    found = [(name, zero_offset(log[name])) for name in ("u", "velocity") if name in log]
    return [
        Finding(
            f"{name} never comes to 0, begins at {zero:.4g} and goes to both sides of it: its sensor's zero?",
            name,
            "warning",
            0.8,
            f"take {zero:.4g} off its column first ([signals] has factors only): friction and loads are wrong by it",
        )
        for name, zero in found
        if zero is not None
    ]
