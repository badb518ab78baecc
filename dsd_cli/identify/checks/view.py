"""What all checks of one log look at, computed once."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from dsd_cli.identify.checks.balance import Balance, balance, speed_of
from dsd_cli.identify.checks.band import Band, find_band
from dsd_cli.identify.checks.scan import SHARES, Scanned, Work, reach, scan, work
from dsd_cli.identify.checks.stretches import LowPass, Stretch, cut
from dsd_cli.identify.recordings.spectrum import repeats_after
from dsd_cli.signals.log import Log

#: Where no acceleration is seen, speeds are looked at below this share of the sample rate.
FALLBACK = 0.02
#: Signs and delays are looked for below this frequency, Hz: beyond, loads swing on their couplings.
HIGHEST = 40.0


@dataclass(frozen=True)
class View:
    """A log in stretches, the band of its acceleration, and the force balance in it.

    band : None if no channel shows an acceleration.
    cutoff : Hz, of `rows`, and of every comparison of channels.
    cycle : s after which speed or u of the longest stretch repeats itself, be it with the other sign; infinite where
        neither does.
    rows : None without a band, without u, or where the axis hardly moves.
    forward, backward : best fits with J above and below 0.
    work : how clearly u drives the motion.
    """

    log: Log
    restarts: tuple[int, ...]
    stretches: tuple[Stretch, ...]
    band: Band | None
    cutoff: float
    cycle: float
    rows: Balance | None
    forward: Scanned | None
    backward: Scanned | None
    work: Work | None


def look(log: Log, restarts: Sequence[int]) -> View:
    """The view of a log."""
    stretches = cut(log, restarts)
    band = find_band(stretches) if stretches else None
    if band is None:
        cutoff = min(HIGHEST, FALLBACK / (stretches[0].T if stretches else log.sample_time))
        return View(log, tuple(restarts), tuple(stretches), None, cutoff, math.inf, None, None, None, None)
    cutoff = min(band.cutoff, HIGHEST)
    longest = max((s for s in stretches if getattr(s, band.source) is not None), key=lambda s: s.t.size)
    keep = LowPass(longest.T, cutoff)
    cycle = min(repeats_after(keep(x), longest.T) for x in (speed_of(longest, band), longest.u) if x is not None)
    reaches = (reach(longest.t.size * longest.T, cycle, share) for share in SHARES)
    tried = (balance(stretches, band, cutoff, one, cycle) for one in reaches)
    rows = next((one for one in tried if one is not None), None)
    forward, backward = scan(rows, cutoff) if rows is not None else (None, None)
    drives = work(rows) if rows is not None else None
    return View(log, tuple(restarts), tuple(stretches), band, cutoff, cycle, rows, forward, backward, drives)
