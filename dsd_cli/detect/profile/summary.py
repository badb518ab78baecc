"""What a run found of delay and inertia between the candidates."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from dsd_cli.detect.rows import Rows


class Estimate(NamedTuple):
    """The last well-founded estimate of an axis (None before the first), and the share of rows that founded it."""

    value: float | None
    std: float | None
    confident_share: float


class EstimateCount:
    """Adds up the estimates of rows, batch by batch."""

    def __init__(self) -> None:
        self._last: list[float] = []
        self._founded, self._rows = np.zeros(2), 0

    def add(self, rows: Rows) -> None:
        """The next rows; nothing where the method has no estimates."""
        if not rows.estimates:
            return
        self._last = [float(column[-1]) for column in rows.estimates[:4]]
        self._founded += [float(flag.sum()) for flag in rows.estimates[4:]]
        self._rows += rows.state.size

    def result(self) -> dict[str, Estimate]:
        """Delay and inertia; {} where the method has no estimates."""
        last = [value if np.isfinite(value) else None for value in self._last]
        shares = (self._founded / max(self._rows, 1)).tolist()
        pairs = zip(("delay", "inertia"), last[::2], last[1::2], shares, strict=True) if last else ()
        return {name: Estimate(value, std, share) for name, value, std, share in pairs}
