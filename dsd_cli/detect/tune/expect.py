"""What a tuning will do: changes put into the log's own u by simulation, with the noise that the log has."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsd_cli.detect.settings import DetectorSettings
from dsd_cli.detect.tune.choose import Path
from dsd_cli.detect.tune.evidence import Evidence
from dsd_cli.signals.log import Array

#: Simulated changes, and simulated logs without one.
CHANGES, QUIET = 60, 20
SEED = 1
#: A label is right once it has been for so many samples on end.
STANDS = 20


@dataclass(frozen=True)
class Expected:
    """By simulation: `CHANGES` changes at random times from one candidate to another, and `QUIET` logs without one.

    Attributes
    ----------
    delay_median, delay_p90 : s from the change until the label is right, and stays so for STANDS samples at least; None
        where fewer were followed.
    followed : share of the changes that the label followed before the log ended.
    false_per_hour : changes of the label per hour of log while nothing changes, once it is right.
    hours : of simulated log without a change, behind that rate.
    """

    delay_median: float | None
    delay_p90: float | None
    followed: float
    false_per_hour: float
    hours: float


def expect(evidence: Evidence, settings: DetectorSettings, path: Path) -> Expected:
    """Simulate with u, clock and effect forces of the log, and the errors that the smoothed path leaves."""
    rng = np.random.default_rng(SEED)
    d = state_disturbances(evidence)
    first, n = int(path.at[0]), len(evidence.inputs.u)
    states = d.shape[1]
    lags: list[float] = []
    for _ in range(CHANGES):
        before, after = rng.choice(states, size=2, replace=False)
        change = int(rng.integers(first + (n - first) // 10, first + 7 * (n - first) // 10))
        mixed = np.where(np.arange(n) < change, d[:, before], d[:, after])
        labels = _labels(evidence, settings, mixed + _noise(rng, path, n), int(before))
        at = change + _first_run(labels[change:] == after, STANDS)
        lags.append(float(evidence.inputs.t[at] - evidence.inputs.t[change]) if at < n else np.inf)
    false = sum(false_changes(evidence, settings, quiet) for quiet in quiet_logs(evidence, path, QUIET))
    hours = QUIET * float(evidence.inputs.t[-1] - evidence.inputs.t[first]) / 3600.0
    found = np.array(lags)
    median, p90 = (float(np.quantile(found, q, method="higher")) for q in (0.5, 0.9))
    return Expected(
        median if np.isfinite(median) else None,
        p90 if np.isfinite(p90) else None,
        float(np.isfinite(found).mean()),
        false / hours if hours > 0.0 else 0.0,
        hours,
    )


def quiet_logs(evidence: Evidence, path: Path, count: int) -> list[tuple[int, Array]]:
    """(state, d_hat) of logs in which nothing changes: one of the state seen most, the others of any."""
    rng, d = np.random.default_rng(SEED + 1), state_disturbances(evidence)
    states = [int(np.bincount(path.states).argmax()), *rng.integers(d.shape[1], size=count - 1).tolist()]
    return [(state, d[:, state] + _noise(rng, path, len(d))) for state in states]


def false_changes(evidence: Evidence, settings: DetectorSettings, quiet: tuple[int, Array]) -> int:
    """Changes of the label in a log without any; it begins with the right one."""
    state, d_hat = quiet
    return int((np.diff(_labels(evidence, settings, d_hat, state)) != 0).sum())


def _first_run(right: NDArray[Any], length: int) -> int:
    """Where the first run of `length` true samples begins; the number of samples if there is none."""
    total = np.concatenate([[0], np.cumsum(right)])
    full = np.flatnonzero(total[length:] - total[:-length] == length) if right.size >= length else np.empty(0)
    return int(full[0]) if full.size else right.size


def state_disturbances(evidence: Evidence) -> Array:
    """d_hat that every state predicts, shape (n, states), with the log's sign; 0 in the warm-up."""
    w, z = evidence.predictions()
    alphas, sign = evidence.engine.spec.alphas, evidence.engine.measurement.sign
    return np.nan_to_num(sign * ((z[:, :, None] * alphas).reshape(len(w), -1) - w[:, None]))


def _noise(rng: np.random.Generator, path: Path, n: int) -> Array:
    """The errors of the path, turned round by a random number of samples: their own size and colour."""
    return np.resize(np.roll(path.errors, int(rng.integers(path.errors.size))), n)


def _labels(evidence: Evidence, settings: DetectorSettings, d_hat: Array, initial: int) -> Array:
    return evidence.run(replace(settings, initial=initial), evidence.inputs._replace(d_hat=d_hat)).state
