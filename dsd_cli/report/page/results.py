"""The results of the commands as the page holds them for scripts: the same JSON that they print."""

from __future__ import annotations

from typing import Any

from dsd_cli.report import checks, comparison, detection, diagnosis, ladder, learning, planning
from dsd_cli.report.page.story import Outcome, Story

#: Segments of one label that are kept; `segments_total` has their number.
MOST_SEGMENTS = 1_000


def results(story: Story) -> dict[str, Any]:
    """Command -> its JSON; null where it had no result, and "missing" says why."""
    parts: dict[str, Outcome[Any]] = {
        "compare": story.comparison,
        "diagnose": story.diagnosis,
        "improve": story.ladder,
    }
    detected = [part for _, part in story.detections]
    return {
        "schema_version": 1,
        "command": "report",
        "log": list(story.logs),
        "check": checks.to_json(story.checks),
        "detect": [_detected(part.value.result) for part in detected if part.value is not None],
        "compare": story.comparison.value and comparison.to_json(story.comparison.value),
        "diagnose": story.diagnosis.value and diagnosis.to_json(story.diagnosis.value),
        "improve": story.ladder.value and ladder.improve_json(story.ladder.value),
        "plan": story.plan.value and planning.to_json(story.plan.value),
        "learn": story.law and learning.learn_json(learning.LearnReport(story.law, story.logs)),
        "missing": {name: part.missing for name, part in parts.items() if part.value is None}
        | {f"detect {log}": part.missing for log, part in story.detections if part.value is None},
    }


def _detected(result: detection.Detection) -> dict[str, Any]:
    found = detection.to_json(result)
    return found | {"segments": found["segments"][:MOST_SEGMENTS]}
