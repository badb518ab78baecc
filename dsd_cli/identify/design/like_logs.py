"""Rows of a planned motion like those that its log will have beside the logs: band, whitening, and which rows count."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dsd_cli.identify.design.inverse import Path, as_recording
from dsd_cli.identify.design.rows import equations_like
from dsd_cli.identify.design.seen import as_seen, times_white
from dsd_cli.identify.fit.band import Band
from dsd_cli.identify.fit.equations import Equations
from dsd_cli.identify.recordings.recording import Recording
from dsd_cli.identify.search.sets import Search
from dsd_cli.signals.log import Array


@dataclass(frozen=True)
class LikeLogs:
    """How motions become rows.

    template : a log of the axis. delay : s, the longest of all plants. held : whether there may be friction.
    form : band and whitening, of that log which shows most.
    """

    template: Recording
    rest_speed: float
    delay: float
    held: bool
    form: tuple[Band, Array]

    @classmethod
    def of(cls, search: Search, delay: float, held: bool) -> LikeLogs:
        """By the logs of a search."""
        known, problem = search.equations, search.problem
        form = known.band, known.whitening[known.bands.index(known.band)]
        return cls(problem.recordings[0], problem.model.rest_speed, delay, held, form)

    def equations(self, path: Path, u: Array) -> Equations:
        """Rows of a motion; the axis rests before and after it."""
        seen = as_seen(self.template, path, u, self.rest_speed)
        recording = as_recording(self.template, path, u, self.rest_speed, seen)
        band, taps = self.form
        louder = 1.0 if seen is None else max(times_white(seen, path, band, taps), 1.0)
        return equations_like((band, taps / np.sqrt(louder)), recording, self.delay, self.held)
