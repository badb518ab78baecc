"""Runs the tool on hidden-effect logs, in two processes; one row of plain numbers per log."""

from __future__ import annotations

import math
import multiprocessing
import os
import time
from collections.abc import Iterator, Sequence
from typing import Any

from bench.hidden_cases import Job, prepared
from dsd_cli.identify.improve import improve
from dsd_cli.identify.results import DELAY, INERTIA, Diagnosis, Estimate
from dsd_cli.identify.verdict.diagnose import Settings, diagnose
from dsd_cli.plant.model import PlantModel
from tests.oracle import machines

Row = dict[str, Any]
#: Logs that one process makes together (the generator's cost grows slower than their number).
BATCH = 14
WORKERS = 2
#: Angles are compared modulo a turn, and an amplitude below 0 is half a turn of phase.
ANGLE = "phase"


def rows(work: Sequence[Job], workers: int = WORKERS) -> Iterator[Row]:
    """One row per job, as they come."""
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    # jobs of one kind cost alike: deal them out so that no batch is slow as a whole
    count = max(1, math.ceil(len(work) / BATCH))
    batches = [work[i::count] for i in range(count)]
    if workers == 1:
        for batch in batches:
            yield from batch_rows(batch)
        return
    with multiprocessing.get_context("spawn").Pool(workers) as pool:
        for found in pool.imap_unordered(batch_rows, batches):
            yield from found


def batch_rows(batch: Sequence[Job]) -> list[Row]:
    """The rows of some jobs, in one process."""
    recordings = machines.run([job.case() for job in batch])
    return [_row(job, recording) for job, recording in zip(batch, recordings, strict=True)]


def _row(job: Job, found: machines.Recording) -> Row:
    ask = _climbed if job.part in ("pairs", "strangers") else _diagnosed
    head = job.as_json() | {"ratio": found.ratio, "floor": found.noise_floor, "hidden_rms": found.hidden_rms}
    try:
        return head | ask(job, found)
    except Exception as error:  # a crash is a wrong answer, not the end of the study
        return head | {"verdict": "error", "probability": 0.0, "error": f"{type(error).__name__}: {error}"}


def _diagnosed(job: Job, found: machines.Recording) -> Row:
    begin = time.perf_counter()
    recording, model, observer = prepared(found)
    answer = diagnose([recording], model, observer, Settings())
    seconds = time.perf_counter() - begin
    own = {INERTIA: answer.estimates[INERTIA].value / found.truth.inertia - 1.0}
    return _answer(answer, job.truth) | {
        "seconds": seconds,
        "values": _values(answer, found, job.truth),
        "own_error": own,
    }


def _answer(answer: Diagnosis, truth: str) -> Row:
    named = next((c for c in answer.ranking if c.effect == answer.verdict), None)
    own = next((c for c in answer.ranking if c.effect == truth), None)
    after = answer.refitted.heldout_rmse
    if named is not None and answer.verdict not in (INERTIA, DELAY):
        after = named.heldout_rmse_after
    return {
        "verdict": answer.verdict,
        "probability": answer.probability,
        "ties": list(named.indistinguishable_from) if named else [],
        "untestable": bool(own and own.untestable),
        "before": answer.score.heldout_rmse,
        "refitted": answer.refitted.heldout_rmse,
        "after": after,
        "ceiling": answer.ceiling.heldout_rmse,
        "sensor": answer.floor,
        "band_hz": answer.band_hz,
        "on": list(answer.depends_on),
    }


def _values(answer: Diagnosis, found: machines.Recording, truth: str) -> list[Row]:
    """True and fitted values of the effect that was named rightly."""
    if answer.verdict != truth or truth == "none":
        return []
    if truth in (INERTIA, DELAY):
        return [_value(truth, getattr(found.truth, truth), answer.estimates[truth])]
    candidate = next(c for c in answer.ranking if c.effect == truth)
    true = _upright(dict(found.truth.hidden)[truth])
    fitted = _upright({name: e.value for name, e in candidate.parameters.items()})
    names = [n for n in true if n in fitted and isinstance(true[n], float)]
    return [
        _value(name, true[name], candidate.parameters[name], fitted[name])
        for name in names
        if name != ANGLE or found.truth.channels != "d_hat"  # where the origin of the position is not known
    ]


def _upright(values: Any) -> dict[str, Any]:
    """With an amplitude above 0."""
    if ANGLE in values and values["amplitude"] < 0.0:
        return dict(values) | {"amplitude": -values["amplitude"], ANGLE: values[ANGLE] + math.pi}
    return dict(values)


def _value(name: str, true: float, estimate: Estimate, fitted: float | None = None) -> Row:
    value = estimate.value if fitted is None else fitted
    error = math.remainder(value - true, 2 * math.pi) if name == ANGLE else value - true
    return {"name": name, "true": true, "error": error, "std_error": estimate.std_error, "at_bound": estimate.at_bound}


def _own(case: machines.Case, model: PlantModel) -> dict[str, float]:
    """Of a wrong inertia or delay: share of the gap between the believed and the true value that is closed."""
    values = {
        INERTIA: (case.believed_inertia, case.inertia, model.inertia),
        DELAY: (case.believed_delay, case.delay, model.delay),
    }
    return {k: 1.0 - abs(now - true) / abs(was - true) for k, (was, true, now) in values.items() if was != true}


def _climbed(job: Job, found: machines.Recording) -> Row:
    begin = time.perf_counter()
    recording, model, observer = prepared(found)
    asked: list[Diagnosis] = []

    def take(answer: Diagnosis) -> str:
        asked.append(answer)
        return answer.verdict

    ladder = improve([recording], model, observer, Settings(), choose=take)
    first = asked[0] if asked else ladder.last
    return {
        "seconds": (time.perf_counter() - begin) / max(len(ladder.steps), 1),
        "first": first.verdict,
        "first_probability": first.probability,
        "steps": [s.effect for s in ladder.steps[1:]],
        "verdict": ladder.verdict,
        "probability": ladder.last.probability,
        "stopped": ladder.stopped,
        "before": ladder.steps[0].score.heldout_rmse,
        "after": ladder.steps[-1].score.heldout_rmse,
        "ties": sorted(
            {r for a in asked for c in a.ranking if c.effect == a.verdict for r in c.indistinguishable_from}
        ),
        "own": _own(found.truth, ladder.steps[-1].model),
        "on": list(ladder.last.depends_on),
    }
