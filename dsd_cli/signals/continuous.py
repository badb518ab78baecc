"""A position as the axis moved it: without wraps, single wrong samples and the jumps of a new zero."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from dsd_cli.signals.log import Array, Log, with_channels

#: A jump of the position by more than this share of its whole range, and by this many usual changes of its steps, is a
#: wrap: the steps of a fast axis that is logged slowly are long, but each is about as the one before.
WRAP_SHARE, WRAP_CHANGES, USUAL = 0.4, 20.0, 95.0
#: More of its samples than this share are wraps only of a turn that is known, where the axis went half of it for each;
#: and wraps are of one size but for the usual steps beside them.
WRAPS_MOST, TURN_EACH, STEPS_BESIDE = 0.02, 0.5, 2.0
#: A step beyond those beside it by more than so many times the large changes of a step, in the log and there, is none
#: that the axis made: no u accelerates so. A hit on a stop ends a speed within the range of the steps beside it.
JUMP_STEPS, FAST, BESIDE = 20.0, 99.0, 3
#: Rows that a sensor may hang before its position goes on where the axis is by then.
HELD = 10
#: Share by which a turn is off that was printed with seven digits.
_PRINTED = 1e-6


class Continuous(NamedTuple):
    """A position as the axis moved it, shape (n,).

    wraps, turn : how often it jumped by a turn, and by how much. wrong : samples off by themselves, now between their
    neighbours. jumps : samples that do not continue the one before.
    """

    position: Array
    wraps: int
    turn: float
    wrong: tuple[int, ...]
    jumps: tuple[int, ...]


def continuous(q: Array) -> Continuous:
    """The position without wraps and single wrong samples, and where it jumps all the same."""
    found = _jumps(q)
    wrong = tuple(k for k in found if k + 1 in found)
    if wrong:
        inside = np.array(wrong)
        q = q.copy()
        q[inside] = 0.5 * (q[inside - 1] + q[inside + 1])
    q, wraps, turn = unwrapped(q)
    return Continuous(q, wraps, turn, wrong, tuple(_jumps(q)))


def in_pieces(log: Log, restarts: Sequence[int]) -> tuple[Log, list[int]]:
    """(the log with a continuous position, where its pieces begin, 0 and the end of the log along)."""
    jumps: tuple[int, ...] = ()
    if "position" in log:
        found = continuous(log["position"])
        log, jumps = with_channels(log, position=found.position), found.jumps
    return log, [0, *sorted({at for at in (*restarts, *jumps) if 0 < at < len(log)}), len(log)]


def _jumps(q: Array) -> list[int]:
    """Samples to which the position steps by what neither the steps beside it nor any change of the speed reach."""
    steps = np.diff(q)
    changes = np.abs(np.diff(steps))
    if len(steps) <= 2 * BESIDE or not np.any(steps):
        return []
    least = np.abs(steps[steps != 0.0]).min()  # of an encoder, a count
    usual = max(float(np.percentile(changes, FAST)), float(least))
    ends = np.concatenate([[np.inf], changes, [np.inf]])
    found = []
    for k in np.flatnonzero(np.minimum(ends[:-1], ends[1:]) > JUMP_STEPS * usual).tolist():
        before, after = steps[max(k - BESIDE - 1, 0) : k], steps[k + 1 : k + BESIDE + 2]
        beside = np.concatenate([before[-BESIDE:], after[:BESIDE]])
        local = float(np.median(np.abs(np.concatenate([np.diff(before), np.diff(after)]))))
        if _beyond(float(steps[k]), beside, _rows(steps, k)) > JUMP_STEPS * max(usual, local):
            found.append(k + 1)
    return found


def _beyond(step: float, beside: Array, rows: int) -> float:
    """By how much a step leaves the range of those beside it, or of a sensor that hung, that of as many `rows`."""
    low, high = float(beside.min()), float(beside.max())
    return max(step - max(rows * high, high), min(rows * low, low) - step)


def _rows(steps: Array, k: int) -> int:
    """Rows that step k may be of: itself, and where the position stood still before it those, and one that it may have
    changed its speed by."""
    moving = np.flatnonzero(steps[max(k - HELD, 0) : k])
    held = min(k, HELD) - (int(moving[-1]) + 1 if moving.size else 0)
    return held + 2 if held else 1


def unwrapped(q: Array) -> tuple[Array, int, float]:
    """(position without its jumps of a turn or several, how many there were, their size)."""
    steps = np.diff(q)
    if steps.size == 0:
        return q, 0, 0.0
    jumps = np.flatnonzero(np.abs(steps) > WRAP_SHARE * float(np.ptp(q)))
    others, at = np.delete(steps, jumps), jumps - np.arange(jumps.size)  # a jump is a turn less what the axis moved
    often = jumps.size > WRAPS_MOST * steps.size  # then a stroke and a fast way back are as likely
    if jumps.size == 0 or others.size < 2 or not _may_be_wraps(steps[jumps], others, often):
        return q, 0, 0.0
    moved = 0.5 * (others[np.maximum(at - 1, 0)] + others[np.minimum(at, others.size - 1)])
    sizes, usual = np.abs(steps[jumps] - moved), float(np.percentile(np.abs(others), USUAL))
    size = float(np.median(sizes))
    known = _whole_turn(size, usual)
    turn = size if known is None else known
    if known is None and (often or jumps.size == 1 or np.ptp(q) > size + STEPS_BESIDE * usual):
        return q, 0, 0.0  # a new zero; and what wraps stays within a turn
    if often and np.diff(jumps).min() == 1:
        return q, 0, 0.0
    if np.max(np.abs(sizes - turn)) > STEPS_BESIDE * usual + _PRINTED * turn:
        return q, 0, 0.0
    offsets = np.zeros(q.size)
    offsets[jumps + 1] = -np.sign(steps[jumps]) * turn
    return q + np.cumsum(offsets), int(jumps.size), turn


def _may_be_wraps(jumps: Array, others: Array, often: bool) -> bool:
    """Whether none of the jumps is as the other steps change, and the axis moves enough for so many."""
    changes = float(np.percentile(np.abs(np.diff(others)), USUAL))
    far = np.abs(others).sum() > TURN_EACH * np.abs(jumps).sum()
    return bool(np.abs(jumps).min() > WRAP_CHANGES * changes and (far or not often))


def _whole_turn(size: float, usual: float) -> float | None:
    """The turn that a jump stands for: a known one if there is one within the usual step."""
    counts = 2.0 ** np.arange(8, 33)
    known = np.array([2.0 * np.pi, np.pi, 360.0, 180.0, 1.0, *counts, 1000.0, 4000.0, 10000.0, 100000.0, 1e6])
    near = known[np.argmin(np.abs(known - size))]
    return float(near) if abs(near - size) <= STEPS_BESIDE * usual + _PRINTED * size else None
