"""What [signals] must say for the columns of a log to be multiplied by more than they are."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from dsd_cli.files.config.signals import UNKNOWN

if TYPE_CHECKING:
    from dsd_cli.files.config.signals import Signals


def keys_that_multiply(signals: Signals, more: Mapping[str, float]) -> list[str]:
    """Lines as `signals.velocity_scale = -1`, which together multiply each channel by its factor, and no other one.

    A scale stands beside a unit only where it turns the sign: any other takes its place, and of counts there are then
    more or fewer to a turn.
    """
    factors, applied = dict(more), signals.factors()
    sized = abs(factors.get("position", 1.0)) != 1.0
    if sized and signals.velocity is not None and signals.velocity_unit == UNKNOWN:  # it would follow the position
        factors["velocity"] = factors.get("velocity", 1.0) / abs(factors["position"])
    if signals.velocity_unit == UNKNOWN:
        applied["velocity"] = signals.velocity_scale
    counted = sized and signals.position_unit.startswith("counts") and signals.velocity_unit.startswith("counts")
    if counted:  # it would, too, by the counts of both
        factors.setdefault("velocity", 1.0)
    found = []
    for channel, factor in factors.items():
        found += _keys(signals, channel, factor, applied, whole=counted and channel == "velocity")
    return found


def _keys(
    signals: Signals, channel: str, factor: float, applied: Mapping[str, float], *, whole: bool = False
) -> list[str]:
    """`whole`: by a scale alone, without a unit."""
    if channel == "u":
        return [f"signals.u_sign = {-signals.u_sign if factor < 0.0 else signals.u_sign}"]
    unit, scale = getattr(signals, f"{channel}_unit", ""), getattr(signals, f"{channel}_scale", 1.0)
    in_whole = [f"signals.{channel}_scale = {applied.get(channel, 1.0) * factor:.6g}"]
    if unit in ("", UNKNOWN):
        return in_whole
    turned = [f"signals.{channel}_scale = {-scale:.6g}"] if factor < 0.0 else []
    if abs(factor) == 1.0 and not whole:
        return turned
    if unit.startswith("counts") and (channel == "position" or not signals.position_unit.startswith("counts")):
        name = "counts_per_turn" if signals.counts_per_turn else "counts_per_metre"
        return [f"signals.{name} = {(getattr(signals, name) or 1.0) / abs(factor):.6g}", *turned]
    return [f'signals.{channel}_unit = ""', *in_whole]
