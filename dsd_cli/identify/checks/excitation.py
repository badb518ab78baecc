"""How much a log asks of the axis: moves, directions, rests, and whether u does anything."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from dsd_cli.identify.checks.balance import Band
from dsd_cli.identify.checks.results import MOVES_PER_EFFECT, Excitation, Finding
from dsd_cli.identify.checks.stretches import LowPass, Stretch
from dsd_cli.signals.log import Array
from dsd_cli.signals.runs import runs

#: Rest is a speed below this share of its rms while moving, or this many standard deviations of its noise.
REST, DEVIATIONS = 0.03, 3.0
#: Share of a log that may lie at either end of a low-pass.
_SAID_OF = 0.05
#: A move of less than this share of the whole travel is none.
SMALL = 0.005
#: Moving less than this share of the time is worth a word, u at its largest value for more than that too.
SELDOM, AT_LIMIT = 0.1, 0.01
#: u is at a limit where it keeps its largest value for so many samples in a row.
_RUN = 5


def excitation(stretches: Sequence[Stretch], band: Band | None, cutoff: float) -> Excitation:
    """Of all stretches together; `cutoff` (Hz) of the speeds."""
    us = [s.u for s in stretches if s.u is not None]
    limit = _at_limit(us)
    if not stretches:
        return Excitation(None, 0, 0, None, None, limit)
    speeds = [v for s in stretches if (v := _speed(s, cutoff)) is not None]
    if not speeds:
        return Excitation(None, *_turns(us), None, None, limit)
    T, noise = stretches[0].T, 0.0 if band is None else band.speed_noise
    every = np.concatenate(speeds)
    size = np.abs(every)
    fast = float(np.sqrt(2.0 * np.mean(size**2 * (size >= np.median(size)))))  # long rests do not count
    rest = max(REST * fast, DEVIATIONS * noise)
    travel = max((float(np.ptp(np.cumsum(v) * T)) for v in speeds), default=0.0)
    runs = [run for v in speeds for run in _runs(v, rest, SMALL * travel / T)]
    return Excitation(
        float(np.mean(size > rest)) if rest > 0.0 else 0.0,
        sum(run > 0 for run in runs),
        sum(run < 0 for run in runs),
        float(size.max()),
        travel,
        limit,
    )


def _speed(s: Stretch, cutoff: float) -> Array | None:
    """Low-passed; as it is where the low-pass has no say of a good part of a short log."""
    keep = LowPass(s.T, cutoff)
    raw, short = s.speed, keep.half > _SAID_OF * s.t.size
    return raw if raw is None or short else keep(raw)[keep.half : -keep.half]


def _runs(v: Array, rest: float, least: float) -> list[int]:
    """Direction of each run of samples faster than `rest` that sums up to `least` at least."""
    sign = np.where(np.abs(v) > rest, np.sign(v), 0.0)
    starts = np.concatenate([[0], np.flatnonzero(np.diff(sign)) + 1])
    sums = np.add.reduceat(v, starts)
    return [int(s) for s, total in zip(sign[starts], sums, strict=True) if s and abs(total) >= max(least, 1e-300)]


def _turns(us: Sequence[Array]) -> tuple[int, int]:
    """Runs of u above and below its mean, with some hysteresis."""
    counts = [0, 0]
    for u in us:
        centred = u - u.mean()
        runs = _runs(centred, 0.3 * float(np.std(centred)), 0.0)
        turned = [run for i, run in enumerate(runs) if i == 0 or run != runs[i - 1]]
        counts[0] += sum(run > 0 for run in turned)
        counts[1] += sum(run < 0 for run in turned)
    return counts[0], counts[1]


def _at_limit(us: Sequence[Array]) -> float:
    """Share of samples in runs at the largest or the smallest value."""
    if not us or all(np.ptp(u) == 0.0 for u in us):
        return 0.0
    high, low = max(float(u.max()) for u in us), min(float(u.min()) for u in us)
    held = 0
    for u in us:
        lengths = (end - start for start, end in runs((u == high) | (u == low)))
        held += sum(length for length in lengths if length >= _RUN)
    return held / sum(u.size for u in us)


def check_excitation(found: Excitation, stretches: Sequence[Stretch], effects: int) -> list[Finding]:
    """Findings; `effects` is the number of effects that the model has."""
    us = [s.u for s in stretches if s.u is not None]
    if us and all(np.ptp(u) == 0.0 for u in us):
        return [Finding("u is constant: nothing excites the axis", "u", "error", 1.0, "is that its column? signals.u")]
    if found.moving is not None and (found.stretches == 0 or not found.travel):
        where = "position" if any(s.position is not None for s in stretches) else "velocity"
        what = "the axis does not move"
        return [Finding(what, where, "error", 0.99, f"record while it moves; is that its column? signals.{where}")]
    return [*_moves(found, effects), *_limit(found)]


def _moves(found: Excitation, effects: int) -> list[Finding]:
    out = []
    if found.moving is not None and min(found.forward, found.backward) == 0:
        what = "the axis moves in one direction only: dry friction is indistinguishable from a constant load"
        out.append(Finding(what, "log", "warning", 0.95, "record moves to and fro"))
    if found.effects < max(1, effects):
        asked = "an effect" if effects < 2 else f"the {effects} effects of [model]"
        moves = "1 move" if found.stretches == 1 else f"{found.stretches} moves"
        what = f"{moves}: too few for {asked}, each asks for {MOVES_PER_EFFECT}"
        out.append(Finding(what, "log", "warning", 0.9, "a longer log, with moves of different length and speed"))
    if found.moving is not None and found.moving < SELDOM:
        what = f"the axis moves {100.0 * found.moving:.0f} % of the time only"
        out.append(Finding(what, "log", "note", 0.95, "cut the rests, or record more moves"))
    return out


def _limit(found: Excitation) -> list[Finding]:
    if found.at_limit < AT_LIMIT:
        return []
    what = f"u keeps its largest value for {100.0 * found.at_limit:.0f} % of the time: a limit?"
    return [Finding(what, "u", "note", 0.7, "if the drive clips further, the logged u is not what acts")]
