"""Rows of a planned motion like those that its log will have beside the logs: band, whitening, and which rows count."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from dsd_cli.identify.design.inverse import Path, as_recording, command_for, friction_of
from dsd_cli.identify.design.rows import equations_like, forces_left, logs_beside, own_form, sure_of
from dsd_cli.identify.design.seen import as_heard, as_seen, heard_in, times_white
from dsd_cli.identify.fit.band import Band
from dsd_cli.identify.fit.equations import Equations
from dsd_cli.identify.fit.noise import ForceNoise
from dsd_cli.identify.fit.row_weights import uncertain
from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.recordings.recording import Recording
from dsd_cli.identify.search.sets import Search
from dsd_cli.plant.model import PlantModel
from dsd_cli.signals.log import Array


@dataclass(frozen=True)
class LikeLogs:
    """How motions become rows.

    template : a log of the axis. delay : s, the longest of all plants. held : whether there may be friction.
    form : band and whitening, at first of that log which shows most; own : of the motion itself, by the noise that its
    sensor has there. surely : whether the rows in which friction's direction is sure decide alone; None asks each
    motion by itself.
    """

    template: Recording
    rest_speed: float
    delay: float
    held: bool
    form: tuple[Band, Array]
    own: bool = False
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
        band, taps = self.form
        louder = 1.0 if seen is None or self.own else max(times_white(seen, path, band, taps), 1.0)
        return equations_like((band, taps / np.sqrt(louder)), recording, self.delay, self.held, self.surely)

    def beside(self, search: Search, plant: PlantModel, path: Path, doubt: float) -> tuple[LikeLogs, Equations]:
        """(the same in the form that the log of this motion of a plant will have; rows of the logs beside it): where
        the direction of friction is sure in many rows of both, those alone count in both.

        doubt : probability that what the logs leave beyond the noise of the sensor is a force.
        """
        u, inertia = command_for(plant, path), plant.inertia
        seen, forces = as_seen(self.template, path, u, self.rest_speed), doubt * forces_left(search, inertia)
        shown = seen or as_heard(self.template, path, u)
        known = logs_beside(search, shown)

        def heard(band: Band) -> ForceNoise:
            return ForceNoise(0.0, 1.0) if seen is None else heard_in(seen, path, band)

        found = replace(self, form=own_form(search, shown, heard, (inertia, forces)), own=True)
        if not self.held:
            return found, known
        planned = found.equations(path, u)
        sure, rows = (sum(float(of(e).sum()) for e in (known, planned)) for of in (sure_of, lambda e: e.kept))
        found = replace(found, surely=sure > POLICY.sure_part * rows)
        if not found.surely:
            share = float(np.mean(uncertain(planned, resting=False)[planned.kept] ** 2)) if planned.kept.any() else 0.0
            off = share * float(np.mean(friction_of(plant, path) ** 2)) / float(found.form[0].taps @ found.form[0].taps)
            found = replace(found, form=own_form(search, shown, heard, (inertia, forces + off)))
        elif known.row_weight is None:
            known = replace(known, row_weight=sure_of(known).astype(np.float64))
        return found, known
