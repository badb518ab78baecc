"""Rows of a planned motion like those that its log will have beside the logs: band, whitening, and which rows count."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from dsd_cli.identify.design.inverse import Path, as_recording
from dsd_cli.identify.design.rows import equations_like, own_form, sure_of
from dsd_cli.identify.design.seen import as_heard, as_seen, times_white
from dsd_cli.identify.fit.band import Band
from dsd_cli.identify.fit.equations import Equations
from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.recordings.recording import Recording
from dsd_cli.identify.search.sets import Search
from dsd_cli.signals.log import Array


@dataclass(frozen=True)
class LikeLogs:
    """How motions become rows.

    template : a log of the axis. delay : s, the longest of all plants. held : whether there may be friction.
    form : band and whitening, at first of that log which shows most. surely : whether the rows in which friction's
    direction is sure decide alone; None asks each motion by itself.
    """

    template: Recording
    rest_speed: float
    delay: float
    held: bool
    form: tuple[Band, Array]
    surely: bool | None = None

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
        found = equations_like(self.form, recording, self.delay, self.held, self.surely)
        if seen is None or not found.stretches:
            return found
        weights = np.ones(sum(found.lengths)) if found.row_weight is None else found.row_weight
        return replace(found, row_weight=weights / np.sqrt(max(times_white(seen, path, *self.form), 1.0)))

    def beside(self, search: Search, path: Path, u: Array, times: int) -> tuple[LikeLogs, Equations]:
        """(the same in the form that the log of this motion, made so often, will have; rows of the logs beside it):
        where the direction of friction is sure in many rows of both, those alone count in both."""
        seen, known = as_seen(self.template, path, u, self.rest_speed), search.equations
        found = replace(self, form=own_form(search, seen or as_heard(self.template, path, u)))
        if not self.held:
            return found, known
        both = [(known, 1), (found.equations(path, u), times)]
        sure, rows = (sum(n * float(of(e).sum()) for e, n in both) for of in (sure_of, lambda e: e.kept))
        found = replace(found, surely=sure > POLICY.sure_part * rows)
        if found.surely and known.row_weight is None:
            known = replace(known, row_weight=sure_of(known).astype(np.float64))
        return found, known
