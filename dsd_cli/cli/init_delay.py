"""The delay that `dsd init` writes: only one that nothing else makes."""

from __future__ import annotations

from dsd_cli.cli.init_proposal import Proposal
from dsd_cli.identify.checks import CheckResult
from dsd_cli.signals.log import Log

#: Why a delay that the log makes is not written.
_NOT_ALONE = "but as much may be made by a force that [model] lacks, as friction (see dsd diagnose)"


def explains(checked: CheckResult, name: str) -> bool:
    """Whether a value of a model is identified with nothing else in it: no force that it lacks bends it."""
    found = next(one for one in checked.parameters if one.name == name)
    return found.identified == "identified" and not found.lacks_force


def put_delays(at: float, step: float, alone: bool, out: Proposal, only: str = "") -> None:
    """at : s, what the log makes of it, or 0. alone : no force makes it. only : the one motion channel, or ""."""
    if at > 0.5 * step and alone:
        wide = max(step, 0.5 * at)
        delays = [short(at - wide), short(at), short(at + wide)]
        late = (
            f", if it is u that is late and not the measured {only}: one motion channel cannot show which"
            if only
            else ""
        )
        out.put("states", "delays", delays, f"around {at:.3g} s, identified from this log{late}")
        out.put("model", "delay", short(at))
        return
    out.put("states", "delays", [0.0, *(short(k * step) for k in (1, 2, 4))], "0, 1, 2 and 4 samples")
    if at > 0.5 * step:
        out.put("model", "delay", 0.0, f"{short(at):g} s would fit, {_NOT_ALONE}")
        out.comments["model", "delay"] = f"# L, s: {short(at):g} would fit, {_NOT_ALONE}"


def only_channel(log: Log) -> str:
    """The motion channel of a log that has no other."""
    motion = [name for name in ("position", "velocity", "d_hat") if name in log]
    return motion[0] if len(motion) == 1 and motion != ["d_hat"] else ""


def short(value: float) -> float:
    return float(f"{max(value, 0.0):.3g}")
