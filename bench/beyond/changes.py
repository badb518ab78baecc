"""Change points: found, placed, how late, and how often where there is none."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np

from bench.beyond._runs import State, T, engine, excitation, measured, percent, table
from dsd_cli.detect.profile.alarms import false_alarms_per_hour
from dsd_cli.signals.log import Array

CUT, LENGTH = 2000, 4000
#: s, of Q.
TAU = 0.01
BEFORE = State(0.004, 1.0)
CASES = {
    "inertia 1 -> 1.5": State(0.004, 1.5),
    "inertia 1 -> 1.2": State(0.004, 1.2),
    "inertia 1 -> 0.7": State(0.004, 0.7),
    "delay 4 -> 7 ms": State(0.007, 1.0),
    "delay 4 -> 2 ms": State(0.002, 1.0),
    "delay 4 -> 2 ms, inertia 1 -> 0.8": State(0.002, 0.8),
}
NOISE, THRESHOLD = 0.1, 20.0


class Score(NamedTuple):
    """Shares of the runs in which the change was found once, and in which its interval holds it; per run other changes.

    lag : samples until it was seen; error : rms of its place, samples.
    """

    found: float
    inside: float
    extra: float
    lag: float
    error: float


def score(after: State, runs: int, threshold: float = THRESHOLD, back: bool = False) -> Score:
    """A change at sample 2000 of 4000; `back`: the other way round."""
    states = [after, BEFORE] if back else [BEFORE, after]
    hits, lags, errors, extra, inside = 0, [], [], 0, 0
    for seed in range(runs):
        u = excitation(LENGTH, seed)
        d_hat = measured(u, states, [CUT]) + NOISE * np.random.default_rng(seed + 10_000).normal(size=LENGTH)
        found = engine(change=threshold)
        found.run(u, d_hat, t=T * np.arange(LENGTH))
        near = [change for change in found.changes if abs(change.time / T - CUT) < 100]
        hits += len(near) == 1
        extra += len(found.changes) - len(near[:1])
        for change in near[:1]:
            lags.append(change.detected / T - CUT)
            errors.append(change.time / T - CUT)
            inside += change.low / T - 0.5 <= CUT <= change.high / T + 0.5
    count = max(len(lags), 1)
    rms = float(np.sqrt(np.mean(np.square(errors)))) if errors else np.nan
    return Score(hits / runs, inside / count, extra / runs, float(np.median(lags)) if lags else np.nan, rms)


def alarms_per_hour(threshold: float, window: int, samples: int, bandwidth: float = 20.0, seed: int = 0) -> float:
    """False alarms in a log without changes."""
    u = excitation(samples, seed, bandwidth)
    d_hat = measured(u, [BEFORE]) + NOISE * np.random.default_rng(seed + 1).normal(size=samples)
    found = engine(window, change=threshold)
    found.run(u, d_hat, t=T * np.arange(samples))
    return len(found.changes) * 3600.0 / (samples * T)


def lag_rows(runs: int) -> list[tuple[str, ...]]:
    rows = []
    for what, after in CASES.items():
        for back in (False, True):
            found = score(after, runs, back=back)
            name = what + (", the other way" if back else "")
            cells = (percent(found.found), f"{found.lag:.0f} ms", f"{found.error:.1f} ms", percent(found.inside))
            rows.append((name, *cells, f"{found.extra:.2f}"))
    return rows


def alarm_rows(samples: int) -> list[tuple[str, ...]]:
    rows = []
    for window, bandwidth in ((50, 20.0), (100, 20.0), (100, 100.0), (300, 20.0)):
        for threshold in (5.0, 6.0, 7.0, 8.0):
            seen = alarms_per_hour(threshold, window, samples, bandwidth)
            stated = false_alarms_per_hour(threshold, window, T, TAU)
            spread = np.sqrt(seen * 3600.0 / (samples * T))  # of as many independent alarms
            cells = (f"{threshold:g}", f"{seen:.0f} +- {spread:.0f}", f"{stated:.0f}", f"{seen / stated:.2f}")
            rows.append((str(window), f"{bandwidth:g} Hz", *cells))
    return rows


def section(pictures: Path) -> str:
    _picture(pictures / "beyond-changes.png")
    lags = table(
        ("change (noise 10 % of u, M = 100, 20 nats)", "found once", "seen after", "error of the place (rms)",
         "95 % interval holds it", "other changes per run"),
        lag_rows(40),
    )  # fmt: skip
    alarms = table(
        ("window", "u", "threshold", "false alarms per hour", "stated", "seen / stated"), alarm_rows(600_000)
    )
    return f"{lags}\n\n{alarms}\n\n![A change of the inertia](../beyond-changes.png)"


def _picture(path: Path) -> None:
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    u, t = excitation(LENGTH, 3), T * np.arange(LENGTH)
    d_hat = measured(u, [BEFORE, State(0.006, 1.3)], [CUT]) + NOISE * np.random.default_rng(3).normal(size=LENGTH)
    found = engine(change=THRESHOLD)
    labels = found.run(u, d_hat, t=t)
    figure, axes = plt.subplots(2, 1, figsize=(8, 4.5), sharex=True, layout="constrained")
    truths: tuple[tuple[Array, float, str], ...] = (
        (np.where(t < CUT * T, 4.0, 6.0), 1e3, "delay, ms"),
        (np.where(t < CUT * T, 1.0, 1.3), 1.0, "inertia"),
    )
    for i, (axis, (truth, unit, name)) in enumerate(zip(axes, truths, strict=True)):
        value, std = unit * labels.estimates[2 * i], unit * labels.estimates[2 * i + 1]
        axis.fill_between(t, value - 1.96 * std, value + 1.96 * std, alpha=0.3, lw=0)
        axis.plot(t, value, lw=1.0, label="estimate and 95 %")
        axis.plot(t, truth, color="grey", lw=0.8, label="truth")
        for change in found.changes:
            axis.axvspan(change.low, change.high, color="tab:red", alpha=0.5, label="change, 95 %")
            axis.axvline(change.detected, color="tab:red", ls=":", label="seen")
        axis.set(ylabel=name)
    axes[0].legend(fontsize=8)
    axes[1].set(xlabel="t, s", xlim=(1.5, 2.5))
    figure.savefig(path, dpi=110)
    plt.close(figure)
