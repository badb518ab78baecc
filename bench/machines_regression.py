"""A plain regression of a recording, beside what is published: what the log can say at all of a value.

Both sides of u(t - L) = J a + B v + Fc sgn v + ... pass a Butterworth low-pass both ways, the delay is scanned, and
least squares do the rest; errors are a jackknife over 20 blocks. Nothing of the package is used.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bench.machines_cases import Recorded

Array = NDArray[np.float64]
_BLOCKS, _DELAYS, _SLOW = 20, np.arange(0.0, 0.0165, 0.001), 0.02


def regressed(case: Recorded, logs: Sequence[Path]) -> dict[str, tuple[float, float]]:
    """{name of a value: (value, standard error)} of the terms of a case, unit of u; "delay" is the best of the scan."""
    columns = [_columns(case, log) for log in logs]
    fits = [(_fit([_rows(case, c, delay) for c in columns]), delay) for delay in _DELAYS]
    (values, errors, squares), delay = min(fits, key=lambda one: one[0][2])
    if squares <= 1e-12 * sum(float(c["u"] @ c["u"]) for c in columns):  # one level a direction: nothing is told
        errors = np.full(len(values), np.inf)
    found = {n: (float(v), float(e)) for n, v, e in zip(case.regress, values, errors, strict=True)}
    return found | {"delay": (float(delay), float(_DELAYS[1]))}


def read(signals: dict[str, str], log: Path) -> dict[str, Array]:
    """The columns of a recording, {signal: shape (n,)}."""
    from pyarrow import csv, parquet

    table = parquet.read_table(log) if log.suffix == ".parquet" else csv.read_csv(log)
    return {k: table[name].to_numpy().astype(float) for k, name in signals.items() if name}


def _columns(case: Recorded, log: Path) -> dict[str, Array]:
    """t, u, position, velocity on a regular clock."""
    raw = read(case.regress_signals or case.signals, log)
    whole = np.all([np.isfinite(x) for x in raw.values()], axis=0)
    raw = {k: x[whole] for k, x in raw.items()}
    step = float(np.median(np.diff(raw["time"])))
    clock = np.arange(raw["time"][0], raw["time"][-1], step)
    found = {k: np.interp(clock, raw["time"], x) for k, x in raw.items()}
    if "velocity" not in found:
        found["velocity"] = np.gradient(found["position"], step)
    if "position" not in found:
        found["position"] = np.cumsum(found["velocity"]) * step
    return found | {"time": clock}


def _rows(case: Recorded, of: dict[str, Array], delay: float) -> Array:
    """Low-passed columns of the terms and, last, u of that delay before, shape (n, k + 1)."""
    from scipy.signal import butter, sosfiltfilt

    step = float(of["time"][1] - of["time"][0])
    low = butter(4, case.regress_hz, fs=1.0 / step, output="sos")
    speed = sosfiltfilt(low, of["velocity"])
    sign = np.tanh(speed / max(_SLOW * float(np.std(speed)), 1e-300))
    made = {
        "inertia": np.gradient(of["velocity"], step),
        "viscous_friction.coefficient": of["velocity"],
        "coulomb_friction.level": sign,
        "constant_load.force": np.ones_like(speed),
        "gravity.amplitude": np.sin(of["position"]),
        "stiffness.coefficient": of["position"],
        "cubic_stiffness.coefficient": of["position"] ** 3,
        "cogging.sine": np.sin(7.0 * of["position"]),
        "cogging.cosine": np.cos(7.0 * of["position"]),
    }
    u = np.interp(of["time"] - delay, of["time"], of["u"])
    rows = np.stack([sosfiltfilt(low, x) for x in (*(made[name] for name in case.regress), u)], axis=1)
    edge = min(int(1.0 / case.regress_hz / step), len(rows) // 8)
    return rows[edge:-edge]


def _fit(parts: Sequence[Array]) -> tuple[Array, Array, float]:
    """(coefficients, their errors, sum of squares that is left)."""
    rows = np.concatenate(parts)
    theta = np.linalg.lstsq(rows[:, :-1], rows[:, -1], rcond=None)[0]
    block = np.arange(len(rows)) * _BLOCKS // len(rows)
    grams = np.stack([rows[block == b].T @ rows[block == b] for b in range(_BLOCKS)])
    left_out = grams.sum(axis=0) - grams
    each = (np.linalg.pinv(left_out[:, :-1, :-1]) @ left_out[:, :-1, -1:])[..., 0]  # one direction: two are one column
    spread = np.sqrt((_BLOCKS - 1) * np.var(each, axis=0))
    return theta, spread, float(np.sum((rows[:, -1] - rows[:, :-1] @ theta) ** 2))
