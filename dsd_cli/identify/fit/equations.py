"""The balance of forces as rows: one equation a row, in the unit of u (docs/how/identify.md).

    u_eff(t - L) = J a(t) - sum_k f_k(t) + r(t)

The acceleration is left as measured, at rest as well: cut off at an edge, the noise of its sensor would no longer
cancel under the low-pass.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from dsd_cli.identify.fit.band import HALF, Band, band_of, own_bands
from dsd_cli.identify.fit.stretches import DelayTap, Stretch, stretch_of
from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.recordings.recording import Recording
from dsd_cli.identify.recordings.sensor import errors_of
from dsd_cli.signals.log import Array
from dsd_cli.signals.passes import passed

_Kind = TypeVar("_Kind", bound=np.generic)


@dataclass(frozen=True)
class Equations:
    """All stretches of some recordings as rows.

    bands : of each recording: what one of them does not show another may.
    startup : samples at the beginning of each stretch that depend on a u before the log; excluded.
    whitening : of each recording, taps over rows (`band.whitening`); (1,) leaves rows in the unit of u.
    row_weight : of each whitened row, a factor; None weighs all alike.
    """

    recordings: tuple[Recording, ...]
    stretches: tuple[Stretch, ...]
    bands: tuple[Band, ...]
    startup: int
    whitening: tuple[Array, ...]
    row_weight: Array | None = None

    @cached_property
    def band(self) -> Band:
        """The widest one."""
        return max(self.bands, key=lambda band: band.hz)

    @cached_property
    def bands_of_stretches(self) -> list[Band]:
        """Of each stretch."""
        return [self.bands[i] for i in self.owners]

    @property
    def sample_time(self) -> float:
        """s, of a sample (not of a row)."""
        return self.band.sample_time

    @cached_property
    def lengths(self) -> list[int]:
        """Rows of each stretch."""
        return [len(at) for at in self.centres]

    @cached_property
    def centres(self) -> list[NDArray[np.int_]]:
        """Samples at which the rows of each stretch stand."""
        by_stretch = zip(self.stretches, self.bands_of_stretches, self.begins, strict=True)
        return [band.centres(begin, len(s.log)) for s, band, begin in by_stretch]

    @cached_property
    def begins(self) -> list[int]:
        """Sample of each stretch at which its rows begin: not before `startup`, nor while its load is anywhere."""
        pairs = zip(self.stretches, self.bands_of_stretches, strict=True)
        return [max(self.startup, min(s.begin, len(s.log) - len(b.taps) - 2 * b.step)) for s, b in pairs]

    @property
    def row_times(self) -> list[float]:
        """s from row to row of each stretch."""
        return [band.step * band.sample_time for band in self.bands_of_stretches]

    @property
    def owners(self) -> list[int]:
        """Recording of each stretch, by its place among `recordings`."""
        return [s.owner for s in self.stretches]

    @cached_property
    def logs_of_rows(self) -> NDArray[np.int_]:
        """Recording of each row, shape (N,)."""
        return np.repeat(self.owners, self.lengths)

    def of_rows(self, by_sample: Sequence[Array]) -> Array:
        """Values of samples at the centres of rows, joined."""
        return np.concatenate([x[at] for x, at in zip(by_sample, self.centres, strict=True)])

    def plain(self, by_stretch: Sequence[Array]) -> Array:
        """Averaged forces of every stretch -> rows in the unit of u, joined."""
        pairs = zip(by_stretch, self.bands_of_stretches, self.begins, strict=True)
        return np.concatenate([band.rows(x, begin) for x, band, begin in pairs])

    def acting(self, raw: Sequence[Array], smooth: bool, held: bool) -> Array:
        """Forces per interval of every stretch -> rows in the unit of u; see `Stretch.acting`."""
        return self.plain([s.acting(x, smooth, held) for s, x in zip(self.stretches, raw, strict=True)])

    def commanded(self, commands: Sequence[Array], delay: float, held: bool) -> Array:
        """A command of every stretch, `delay` s late -> rows in the unit of u; see `Stretch.commanded`."""
        return self.plain([s.commanded(u, delay, held) for s, u in zip(self.stretches, commands, strict=True)])

    def parts(self, delay: float) -> dict[DelayTap, float]:
        """Parts of a command that is `delay` s late, and their weights; none where logs are sampled differently."""
        first, *others = (s.parts(delay) for s in self.stretches)
        return first if all(one == first for one in others) else {}

    def part(self, commands: Sequence[Array], part: DelayTap, held: bool) -> Array:
        """One of `parts` -> rows in the unit of u."""
        return self.plain([s.part(u, part, held) for s, u in zip(self.stretches, commands, strict=True)])

    def acceleration(self) -> Array:
        """Rows of the measured acceleration."""
        return self.plain([s.acceleration for s in self.stretches])

    def whitened(self, rows: Array) -> Array:
        """Rows (in the unit of u) made white by symmetric taps; beyond its ends a stretch stays as it is there."""
        pairs = [(x, self.whitening[i]) for x, i in zip(self.by_stretch(rows), self.owners, strict=True)]
        white = np.concatenate([x * taps[0] if len(taps) == 1 else passed(x, taps, HALF) for x, taps in pairs])
        return white if self.row_weight is None else white * self.row_weight

    def by_stretch(self, rows: NDArray[_Kind]) -> list[NDArray[_Kind]]:
        """Rows as one array per stretch."""
        return [rows] if len(self.lengths) == 1 else list(np.split(rows, np.cumsum(self.lengths)[:-1]))

    @cached_property
    def counted(self) -> float:
        """Whole rows that they count as, by the squares of their weights: the likelihood is of so many."""
        return float(sum(self.lengths)) if self.row_weight is None else float(self.row_weight @ self.row_weight)

    @cached_property
    def kept(self) -> NDArray[np.bool_]:
        """Rows in which the direction of friction, and what the load does, is known for a large enough share."""
        free = self.plain([s.averaged(s.free, False) for s in self.stretches])
        return np.asarray(free > POLICY.least_free)

    @cached_property
    def counting(self) -> float:
        """Share of the samples that count: less than 1 where contacts of a load are known."""
        return float(np.mean(np.concatenate([s.clear for s in self.stretches])))

    @property
    def noisy(self) -> Equations:
        """With the synthetic noise of the sensors."""
        return replace(self, stretches=tuple(replace(s, noisy=True) for s in self.stretches))

    def of_counts(self) -> list[tuple[Array, ...]]:
        """Accelerations by stretch, (n,) each, that counts alone are in this motion, of each beginning; [] of none."""
        made = (errors_of(s.log, self.recordings[s.owner].sensor) for s in self.stretches)
        return list(zip(*made, strict=True)) if any(r.sensor.counts for r in self.recordings) else []

    def in_full(self) -> Equations:
        """With all samples, also those where a load may touch."""
        if self.counting == 1.0:
            return self
        stretches = (replace(s, clear=np.ones(len(s.log))) for s in self.stretches)
        return replace(self, stretches=tuple(stretches))

    def with_whitening(self, *taps: Array) -> Equations:
        """The same rows, to be whitened by these taps: of each recording."""
        return replace(self, whitening=taps)

    def by_recording(self, rows: NDArray[_Kind]) -> list[list[NDArray[_Kind]]]:
        """Rows as arrays per stretch, of each recording."""
        pairs = list(zip(self.owners, self.by_stretch(rows), strict=True))
        return [[x for k, x in pairs if k == i] for i in range(len(self.recordings))]


def equations_of(
    recordings: Sequence[Recording], startup: int, bands: Band | Sequence[Band] | None = None, widened: float = 1.0
) -> Equations:
    """Rows of these recordings, not whitened.

    startup : see `Equations`. bands : of all, or of each; None chooses those that the sensors allow, their ends times
        `widened`.
    """
    if bands is None:
        bands = own_bands(recordings)
        if widened != 1.0:
            bands = [band_of(min(widened * b.hz, POLICY.highest_share / b.sample_time), b.sample_time) for b in bands]
    elif isinstance(bands, Band):
        bands = len(recordings) * [bands]
    made = []
    for i, (recording, band) in enumerate(zip(recordings, bands, strict=True)):
        shortest = startup + len(band.taps) + 2 * band.step
        made += [stretch_of(p, recording, i) for p in recording.pieces if len(p) > shortest]
    return Equations(tuple(recordings), tuple(made), tuple(bands), startup, len(bands) * (np.ones(1),))
