"""Recordings in part, or changed: excerpts of long ones for the search, a u on time, levels of single logs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.recordings.recording import SHORTEST, Recording
from dsd_cli.signals.log import Array, Log, with_channels
from dsd_cli.signals.low_pass import in_front
from dsd_cli.signals.runs import runs

#: Cells into which the range of a channel is cut, to see how much of what the axis does a window contains.
_CELLS = 16
#: Kinds of `Recording.taken_off`: u was later than what it did; it had passed a low-pass.
LATE, SMOOTHED = "late u", "smoothed u"
#: From one window that is tried to the next, as a share of their length.
_STEP = 0.1


def excerpts(recordings: Sequence[Recording]) -> tuple[Recording, ...]:
    """The most exciting windows of each recording; short recordings whole."""
    step = recordings[0].sample_time
    samples = max(POLICY.searched_samples, int(POLICY.searched_seconds / step))
    if sum(r.samples for r in recordings) <= POLICY.searched_slack * samples:
        return tuple(recordings)
    return tuple(_excerpt(r, max(samples // len(recordings), samples // 4)) for r in recordings)


def with_part(
    parts: Sequence[Recording], recordings: Sequence[Recording], index: int, at: float
) -> tuple[Recording, ...]:
    """The parts and a window more, as long as a part, of recording `index` around `at` s; what overlaps is joined."""
    whole, part = recordings[index], parts[index]
    piece = next(p for p in whole.pieces if p["t"][0] <= at <= p["t"][-1])
    length = min(part.samples, len(piece))
    start = int(np.clip(np.searchsorted(piece["t"], at) - length // 2, 0, len(piece) - length))
    taken = np.zeros(len(piece), dtype=bool)
    taken[start : start + length] = True
    others = []
    for known in part.pieces:
        if piece["t"][0] <= known["t"][0] <= piece["t"][-1]:
            first = int(np.searchsorted(piece["t"], known["t"][0]))
            taken[first : first + len(known)] = True
        else:
            others.append(known)
    windows = [_cut(piece, a, b - a) for a, b in runs(taken)]
    more = replace(part, pieces=tuple(sorted([*others, *windows], key=lambda p: float(p["t"][0]))))
    return tuple(more if i == index else p for i, p in enumerate(parts))


def inside(recording: Recording, low: float, high: float, kind: str) -> Recording | None:
    """The samples at positions between the two, in more pieces; None where less than half of the log would be left."""
    found = ((p, runs((p["position"] > low) & (p["position"] < high))) for p in recording.pieces)
    pieces = tuple(_cut(p, a, b - a) for p, spells in found for a, b in spells if b - a >= SHORTEST)
    if 2 * sum(map(len, pieces)) < recording.samples:
        return None
    return replace(recording, pieces=pieces, taken_off=(*recording.taken_off, kind))


def earlier(recording: Recording, seconds: float) -> Recording:
    """With a u that acted so much earlier than it was logged: of the held one the mean over what was each interval."""
    steps = seconds / recording.sample_time
    whole = int(steps)

    def moved(piece: Log) -> Log:
        u, rest = piece["u"], _cut(piece, 0, len(piece) - whole - 1)
        mean = u[whole:-1] + (steps - whole) * np.diff(u[whole:])
        return replace(rest, channels={**rest.channels, "u": mean})

    pieces = tuple(moved(p) for p in recording.pieces if len(p) - whole > SHORTEST)
    return replace(recording, pieces=pieces, taken_off=(*recording.taken_off, LATE))


def unfiltered(recording: Recording, time_constant: float) -> Recording:
    """With u in front of a low-pass of first order, s, that it was logged behind."""
    pieces = tuple(with_channels(p, u=in_front(p["t"], p["u"], time_constant)) for p in recording.pieces)
    return replace(recording, pieces=pieces, taken_off=(*recording.taken_off, SMOOTHED))


def _excerpt(recording: Recording, samples: int) -> Recording:
    """The richest window of each stretch, the richest of them first, until there are enough samples."""
    windows = sorted((_richest(p, samples) for p in recording.pieces), key=lambda w: -w[0])
    taken: list[Log] = []
    for _, piece in windows:
        if sum(len(p) for p in taken) >= samples:
            break
        taken.append(piece)
    taken.sort(key=lambda p: float(p["t"][0]))
    return replace(recording, pieces=tuple(taken))


def _richest(piece: Log, samples: int) -> tuple[int, Log]:
    """(cells of position and speed that it visits, window of that many samples), the stretch itself if it is short."""
    cells = _cells(piece)
    if len(piece) <= samples:
        return len(np.unique(cells)), piece
    starts = np.arange(0, len(piece) - samples + 1, max(int(_STEP * samples), 1))
    visited = [len(np.unique(cells[a : a + samples : 7])) for a in starts]
    best = int(np.argmax(visited))
    return visited[best], _cut(piece, int(starts[best]), samples)


def _cells(piece: Log) -> Array:
    names = [name for name in ("position", "velocity", "u") if name in piece][:2]
    found = np.zeros(len(piece))
    for name in names:
        x = piece[name]
        found = found * _CELLS + np.floor((_CELLS - 1e-9) * (x - x.min()) / max(float(np.ptp(x)), 1e-300))
    return found


def _cut(piece: Log, start: int, samples: int) -> Log:
    return replace(piece, channels={name: x[start : start + samples] for name, x in piece.channels.items()})


@dataclass(frozen=True)
class Deviations:
    """A value of an effect that differs between logs; the deviations add up to zero, each log counting once.

    column : of the effect, that the parameter multiplies. by_log, errors : deviation of each log and its standard
        error, unit of the parameter. alike : effects whose levels would explain the logs as well in its place.
    """

    effect: str
    parameter: str
    column: int
    by_log: tuple[float, ...]
    errors: tuple[float, ...]
    alike: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        """`coulomb_friction.level`."""
        return f"{self.effect}.{self.parameter}"


def may_differ(recordings: Sequence[Recording]) -> bool:
    """Whether levels of single logs can be asked for: of one there are none, and a reconstructed motion floats."""
    return len(recordings) > 1 and not any(r.walk > 0.0 for r in recordings)


def with_levels(recordings: Sequence[Recording], known: Sequence[Deviations]) -> tuple[Recording, ...]:
    """The recordings with these deviations, and no others, as forces that are known to act in them."""
    if not known and not any(r.levels for r in recordings):
        return tuple(recordings)
    return tuple(
        replace(r, levels=tuple((one.effect, one.column, one.by_log[i]) for one in known))
        for i, r in enumerate(recordings)
    )
