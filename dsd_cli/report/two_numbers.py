"""What is missing, and is that all: the two answers of `dsd diagnose` and `dsd improve`, as JSON and as a line."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.results import Diagnosis, Missing, Unexplained
from dsd_cli.report.names import error, listed, number_or_none, percent, values_text

#: Why errors of values do not hold beside what is unexplained: they count it as noise that goes with no effect.
_BENT = "their +- count what is unexplained as noise; where an effect or J stands in for it they are off by more"
#: Share of what is left, below which what an effect would leave is worth saying.
_MOST_OF_IT = 0.5


def missing_json(missing: Sequence[Missing]) -> list[dict[str, Any]]:
    """The first question: what is missing."""
    return [{"effect": one.effect, "probability": number_or_none(one.probability)} for one in missing]


def unexplained_json(one: Unexplained) -> dict[str, Any]:
    """The second: is that all?"""
    return {
        "share_of_u": number_or_none(one.share_of_u),
        "probability": number_or_none(one.probability),
        "on": list(one.on),
    }


def believed(probability: float) -> bool:
    """Whether it is rather so than not; what has no probability is not in doubt."""
    return not probability < 0.5


def two_answers(missing: Sequence[Missing], last: Diagnosis, added: Sequence[str] = ()) -> list[str]:
    """`missing: coulomb_friction (98 %)` and `unexplained: 3 % of u (probability that more is missing: 90 %)`.

    last : the diagnosis that says what is left. added : effects of the model at the end, which are missing no more.
    """
    said, left = dict[str, list[str]](), last.unexplained
    for one in missing:
        what = "added" if one.effect in added else "missing" if believed(one.probability) else "perhaps missing"
        said.setdefault(what, []).append(f"{one.effect} ({percent(one.probability)})")
    lines = [f"{what}: {listed(said[what])}" for what in ("added", "missing", "perhaps missing") if what in said]
    if not math.isfinite(left.share_of_u):
        return lines
    over = f", over {listed(left.on)}" if left.on else ""
    share = percent(min(left.share_of_u, 1.0))
    lines.append(f"unexplained: {share} of u (probability that more is missing: {percent(left.probability)}){over}")
    if math.isfinite(left.probability) and believed(left.probability):
        return [*lines, f"values: {_BENT}"]
    return [*lines, *_too_small(last)]


def _too_small(last: Diagnosis) -> list[str]:
    """That what is left is no noise of the sensor, and yet so little of u that it does not count as missing; or that it
    is much of u, but may be that noise."""
    u, share = 100.0 * last.score.rmse / max(last.score.relative_error_percent, 1e-300), last.unexplained.share_of_u
    left = math.hypot(share * u, last.floor)  # the share is without the noise
    if not left > POLICY.floor_factor * last.floor:
        noise = f"may be noise: the sensor's is measured as {error(last.floor)} {last.units.force}, and up to"
        return [f"{noise} {POLICY.floor_factor:g} times that counts as such"] if share > POLICY.least_unknown else []
    line = f"too small to count: {error(left)} {last.units.force} is left, of which the sensor's noise would leave"
    line += f" {error(last.floor)}; less than {percent(POLICY.floor_excess)} of u counts as what any model leaves"
    before = last.refitted.heldout_rmse
    tested = (one for one in last.ranking if one.parameters and one.effect not in (last.verdict, *last.found))
    best = min(tested, key=lambda one: one.heldout_rmse_after, default=None)
    if best is None or not best.heldout_rmse_after < _MOST_OF_IT * before:
        return [line]
    fall = percent(1.0 - best.heldout_rmse_after / before)
    return [f"{line}; {best.effect} ({values_text(best.parameters)}) would take {fall} of it off"]
