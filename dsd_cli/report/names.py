"""Values, units and effects in words, as all tables and pictures show them."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

from dsd_cli.identify.fit.values import LEAST_INERTIA
from dsd_cli.identify.results import DELAY, INERTIA, Estimate, Estimates
from dsd_cli.signals.units import LEGEND, Units, in_words

__all__ = [
    "LEGEND",
    "balance_json",
    "error",
    "estimate_text",
    "estimates_json",
    "fall_text",
    "force_error",
    "in_words",
    "listed",
    "moves",
    "number_or_none",
    "percent",
    "values_text",
]

#: Digits of a value whose error is not known, and of an error.
DIGITS = 4


def estimate_text(estimate: Estimate, unit: bool = True) -> str:
    """`0.52 +- 0.01 u`: as many digits as the error deserves."""
    value = 0.0 if abs(estimate.value) <= LEAST_INERTIA else estimate.value  # a config cannot hold an inertia of 0
    text, error = f"{value:.{DIGITS}g}", estimate.std_error
    if math.isfinite(error) and error > 0.0 and math.isfinite(estimate.value):
        leading = math.floor(math.log10(error))
        second = int(error < 2.0 * 10.0**leading)  # 0.013, but 0.03
        places, large = second - leading, max(abs(estimate.value), error)
        if large >= 1e6 or large < 1e-4:
            digits = max(places + math.floor(math.log10(large)), 0)
            text = f"{estimate.value:.{digits}e} +- {error:.{second}e}"
        else:
            text = f"{estimate.value:.{max(places, 0)}f} +- {error:.{max(places, 0)}f}"
    if unit and estimate.unit not in ("", "1"):
        text += f" {in_words(estimate.unit)}"
    if estimate.held or estimate.at_bound:
        return f"{text} ({'held' if estimate.held else 'at its bound'})"
    return f"{text} (not identifiable)" if estimate.grade == "not" and math.isnan(error) else text


def values_text(estimates: Estimates) -> str:
    """`level 0.52 +- 0.01 u, ...`; a value that is named like its effect stands alone."""
    alone = len(estimates) == 1 and next(iter(estimates), "") in (INERTIA, DELAY)
    return ", ".join(estimate_text(e) if alone else f"{name} {estimate_text(e)}" for name, e in estimates.items())


def estimates_json(estimates: Estimates) -> dict[str, Any]:
    """name -> value, std_error, unit, at_bound."""
    return {
        name: {
            "value": number_or_none(e.value),
            "std_error": number_or_none(e.std_error),
            "unit": in_words(e.unit),
            "at_bound": e.at_bound,
            **({"held": True} if e.held else {}),
            **({"identified": e.grade} if e.grade else {}),
            **({"prior_sigma": number_or_none(e.pull)} if math.isfinite(e.pull) else {}),
        }
        for name, e in estimates.items()
    }


def force_error(band_hz: float) -> str:
    """`force error below 31 Hz`: what an error is of; without the band where it is not known."""
    return f"force error below {band_hz:.3g} Hz" if math.isfinite(band_hz) else "force error"


def balance_json(band_hz: float, floor: float, units: Units) -> dict[str, Any]:
    """What errors of the balance of forces are measured in, up to where, and what the sensor alone would leave."""
    return {"unit": units.force, "band_hz": number_or_none(band_hz), "floor": number_or_none(floor)}


def number_or_none(value: float) -> float | None:
    """What JSON has no word for is null."""
    return float(value) if math.isfinite(value) else None


def fall_text(before: float, after: float) -> str:
    """`72 %` of a fall, `rises 3 %`, `-` where it cannot be said."""
    text = change_text(before, after)
    return f"rises {text[1:]}" if text.startswith("+") else text[1:] or "-"


def moves(before: float, after: float) -> str:
    """`falls from 0.4 to 0.1`; a rise is called one, and what three digits do not show is none of both."""
    first, second = error(before), error(after)
    if first == second or not (math.isfinite(before) and math.isfinite(after)):
        return f"stays at {second}" if first == second else f"goes from {first} to {second}"
    return f"{'falls' if after < before else 'rises'} from {first} to {second}"


def change_text(before: float, after: float) -> str:
    """`-72 %`, `+3.1 %`, `-` where it cannot be said."""
    if not (math.isfinite(before) and math.isfinite(after)) or before <= 0.0:
        return "-"
    change = 100.0 * (after / before - 1.0)
    size = abs(change)
    text = f"{size:.1f}" if size < 9.95 or 99.0 < size < 100.0 else f"{size:.0f}"
    return f"{'+' if change > 0.0 and float(text) > 0.0 else '-'}{text} %"


def listed(words: Iterable[str], last: str = "and") -> str:
    """`a, b and c`."""
    *first, end = words
    return f"{', '.join(first)} {last} {end}" if first else end


def error(rmse: float) -> str:
    """An error, three digits."""
    return f"{rmse:.3g}" if math.isfinite(rmse) else "-"


def percent(probability: float) -> str:
    """Whole percent; a probability is never 0 or 100."""
    if not math.isfinite(probability):
        return "-"
    share = 100.0 * probability
    if share < 0.5:
        return "< 1 %"
    return "> 99 %" if share >= 99.5 else f"{share:.0f} %"
