"""Logs of one machine on three days, of which a level differs: is it found what all of them hide?"""

from __future__ import annotations

from typing import Any

from bench.outside_cases import DAYS
from dsd_cli.identify.recordings.recording import prepare
from dsd_cli.identify.results import UNKNOWN
from dsd_cli.identify.verdict.diagnose import Settings, diagnose
from dsd_cli.plant.model import ObserverSettings, PlantModel
from dsd_cli.signals.log import Log
from tests.oracle.rig import RigLog
from tests.oracle.rig_days import LEVEL, days_of


def of_days(log: RigLog, sure: float) -> dict[str, Any]:
    """Right: what is hidden, and no other, and the level of each day within a tenth of what differs.

    sure : a verdict as sure as this is a confident one.
    """
    hidden, varies = log.case.what
    factors = dict(DAYS)[varies]
    days = days_of(log.case, varies, factors)
    observer = ObserverSettings(days.inertia, log.observer["time_constant"])
    model = PlantModel(days.inertia, days.delay, {n: v for n, v in days.effects.items() if n != hidden})
    logs = [prepare(Log(one, days.sample_time, f"day {i}"), observer) for i, one in enumerate(days.logs)]
    answer = diagnose(logs, model, observer, Settings())
    level = days.effects[varies][LEVEL[varies]]
    found = next((x.values for x in answer.levels if x.deviations.effect == varies), ())
    told = [abs(e.value - f * level) < 0.03 * abs(level) for e, f in zip(found, factors, strict=False)]
    named = next((c for c in answer.ranking if c.effect == answer.verdict), None)
    right = answer.found == (hidden,) and answer.verdict == hidden
    ties = named.indistinguishable_from if named else ()
    return {
        "right": right,
        "levels": len(told) == len(factors) and all(told),
        "verdict": answer.verdict,
        "steps": list(answer.found),
        "probability": answer.probability,
        "wrong_and_sure": answer.verdict not in (hidden, UNKNOWN) and not ties and answer.probability >= sure,
    }
