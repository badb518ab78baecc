"""Whether the sensors of a log repeat their values, seen at its begin, however its samples come."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from dsd_cli.detect.plan import Plan
from dsd_cli.signals.cleaning import Piece
from dsd_cli.signals.log import Array, Log
from dsd_cli.signals.updates import updated

#: Samples that are looked at.
FIRST = 20_000
#: Where d_hat is made of them, the difference over a row without news is 0, and the next one that of several rows.
_REMEDY = "every row is labelled: `dsd observe LOG -o NEW.parquet` writes those with new values, give dsd that log"


class Repeats:
    """Sees the first samples of a log of which d_hat is made."""

    def __init__(self, plan: Plan) -> None:
        self._made = plan.d_hat_source != "logged"
        self._parts: list[dict[str, Array]] = []
        self._restarts: list[int] = []
        self._samples = 0

    def look(self, pieces: Sequence[Piece]) -> None:
        """At the next samples."""
        for piece in pieces if self._made else ():
            if self._samples >= FIRST:
                return
            if piece.restart:
                self._restarts.append(self._samples)
            channels = {"t": piece.t, **piece.values}
            self._parts.append({name: x[: FIRST - self._samples].copy() for name, x in channels.items()})
            self._samples += self._parts[-1]["t"].size

    def what(self, sample_time: float | None) -> str:
        """What they do; "" where each is read in every row, as far as was seen. sample_time : s."""
        if not self._samples or sample_time is None:
            return ""
        channels = {name: np.concatenate([part[name] for part in self._parts]) for name in self._parts[0]}
        return updated(Log(channels, sample_time), self._restarts).what

    def warnings(self, sample_time: float | None) -> list[str]:
        """One sentence at most."""
        what = self.what(sample_time)
        return [f"{what}; {_REMEDY}"] if what else []
