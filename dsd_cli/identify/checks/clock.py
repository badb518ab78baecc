"""The stamps: their jitter, and whether irregular ones say when the samples were taken."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from dsd_cli.identify.checks.results import Finding
from dsd_cli.identify.checks.scan import block_starts
from dsd_cli.identify.checks.stretches import stamps_of
from dsd_cli.signals.cleaning import BEYOND
from dsd_cli.signals.clock import suspicious
from dsd_cli.signals.continuous import continuous
from dsd_cli.signals.log import Array, Log, with_channels

#: Jitter of the steps (standard deviation over T) from which it is worth a word: less is no noise beside a sensor's.
JITTERY = 0.02
#: Two clocks are distinguished from so many standard errors on, over blocks of the log.
CLEAR = 5.0
#: And one is taken for the other from so many on.
RATHER = 3.0
#: Stamps that are off an even clock by more than so many times what their steps are off add up: white noise is 0.7 of
#: that, a line that hands over 16 samples at once 1.2.
ADDED_UP = 3.0
#: A mean step this near to the sample time of the first rows, as a share of it, is that one.
ROUNDED = 1e-3
#: Rows dropped or put in are a warning from this share of the log on, else a note.
MANY = 0.01
#: Of jitter below this share of a step, steps of one sample and of two are apart.
APART = 0.15
_OfStamps = Callable[[Array], Array]
_ORDER = 2  # samples to either side that foretell one


def jitter(log: Log, restarts: Sequence[int]) -> tuple[float, float]:
    """The usual step between stamps, s: the median; and the standard deviation of the steps as a share of it."""
    steps = np.concatenate([np.diff(t) for t in _pieces(stamps_of(log), restarts)])
    usual = float(np.median(steps)) if steps.size else log.sample_time
    return usual, float(np.std(steps) / usual) if steps.size and usual > 0.0 else 0.0


def seconds_of(log: Log, restarts: Sequence[int]) -> float:
    """How long the log is by its stamps: of each piece from the first to the last, and a mean step for the last.

    The sample time of the first rows says less: where stamps jitter, its multiples drift away from them.
    """
    spans = [(float(t[-1] - t[0]), t.size) for t in _pieces(stamps_of(log), restarts) if t.size]
    return sum(span * n / (n - 1) if n > 1 else log.sample_time for span, n in spans)


def evened(log: Log, restarts: Sequence[int]) -> Log:
    """The log on an even clock, with holes where samples are missing, if the motion is smoother on it than at the
    irregular stamps, and these are off it by noise: what a stamp is late adds nothing to the next, as a true step does.
    """
    usual, share = jitter(log, restarts)
    if share <= JITTERY:
        return log
    logged, even, holed = _roughnesses(log, restarts)
    holes, pieces = _smoother(holed, even) > CLEAR, _pieces(stamps_of(log), restarts)
    if not _smoother(holed if holes else even, logged) > RATHER:
        return log
    t = np.concatenate([t if t.size < 2 else _with_holes(t)[0] if holes else _even(t) for t in pieces])
    if np.std(stamps_of(log) - t) > ADDED_UP * share * usual:
        return log
    apart = np.diff(t)
    return replace(with_channels(log, t=t), sample_time=float(np.median(apart[apart > 0.0])))


def _even(t: Array) -> Array:
    return t[0] + (t[-1] - t[0]) * np.arange(t.size) / (t.size - 1)


def _roughnesses(log: Log, restarts: Sequence[int]) -> list[Array]:
    """`_roughness` over the stamps as logged, an even clock, and one with holes."""
    clocks: tuple[_OfStamps, ...] = (lambda t: t, _even, lambda t: _with_holes(t)[0])
    return [_roughness(log, restarts, clock) for clock in clocks]


def _roughness(log: Log, restarts: Sequence[int], clock: _OfStamps) -> Array:
    """Log of how rough the position (or velocity) is in each block, shape (b,), over a clock made of the stamps of each
    piece, shape (n,)."""
    name = next((name for name in ("position", "velocity") if name in log), None)
    if name is None:
        return np.zeros(0)
    found = [np.zeros(0)]
    for t, x in zip(_pieces(stamps_of(log), restarts), _pieces(log[name], restarts), strict=True):
        x = continuous(x).position if name == "position" else x
        if x.size > 20 * _ORDER:
            found.append(np.log(_blocks(_foretold(x, clock(t)))))
    return np.concatenate(found)


def _smoother(one: Array, other: Array) -> float:
    """Standard errors by which the motion is smoother over one clock than over another; 0 where it does not say."""
    gain = other - one
    return float(np.mean(gain) / max(np.std(gain) / np.sqrt(gain.size), 1e-12)) if np.any(gain) else 0.0


def _with_holes(t: Array) -> tuple[Array, float]:
    """Even stamps with samples missing where steps are long, shape (n,), and the time from sample to sample, s.

    A line through the stamps over their numbers, found on ever longer parts: what is wrong with the time from sample to
    sample is never more than a part of a sample over the next.
    """
    apart, first, part = float(np.median(np.diff(t))), float(t[0]), 16
    while True:
        rows = np.arange(min(part, t.size))
        number = np.maximum.accumulate(np.rint((t[:part] - first) / apart) - rows) + rows  # each has one of its own
        apart, first = map(float, np.polyfit(number, t[:part], 1))
        if part >= t.size:
            return np.asarray(first + apart * number, dtype=np.float64), apart
        part *= 2


def _pieces(x: Array, restarts: Sequence[int]) -> list[Array]:
    return [x[a:b] for a, b in pairwise([0, *(at for at in restarts if 0 < at < x.size), x.size])]


def _foretold(x: Array, t: Array) -> Array:
    """Squared error of a cubic through two samples to either side, at each sample between, shape (n - 4,).

    In units of what white noise of the channel alone would make there: uneven weights amplify it.
    """
    n = x.size
    at = [t[k : n - 2 * _ORDER + k] for k in range(2 * _ORDER + 1)]
    here, others = at[_ORDER], [k for k in range(2 * _ORDER + 1) if k != _ORDER]
    error, amplified = x[_ORDER : n - _ORDER].copy(), np.ones(n - 2 * _ORDER)
    for i in others:
        weight = np.ones(n - 2 * _ORDER)
        for j in others:
            if j != i:
                weight *= (here - at[j]) / (at[i] - at[j])
        error -= weight * x[i : n - 2 * _ORDER + i]
        amplified += weight**2
    return np.asarray(error**2 / amplified)


def _blocks(squares: Array) -> Array:
    """Mean of each block; equal ones where nothing moves."""
    starts = block_starts(squares.size)
    return np.maximum(np.add.reduceat(squares, starts), 1e-300)


def check_clock(log: Log, restarts: Sequence[int], noisy: bool) -> list[Finding]:
    """Findings about the stamps; `noisy`: `evened` takes them for noise."""
    found = []
    if doubt := suspicious(log.sample_time):
        what, _, remedy = doubt.partition(": ")
        found.append(Finding(what, "t", "warning", 0.8, remedy))
    usual, share = jitter(log, restarts)
    if share > JITTERY:
        clean, missing, apart, remedy = _missing(log, restarts)
        if missing and clean <= JITTERY:  # whole multiples of one step: the long ones lack samples, and are no noise
            what = f"{missing} sample(s) of an even clock are missing"
            return [*found, Finding(what, "t", "warning" if missing > MANY * len(log) else "note", 1.0, remedy)]
        mean = seconds_of(log, restarts) / max(len(log), 1)
        plain = abs(mean / log.sample_time - 1.0) < ROUNDED
        logged, even, holed = _roughnesses(log, restarts)
        against = [_smoother(holed, logged), _smoother(holed, even)]
        if missing and (clean < APART or min(against) > CLEAR):  # an even clock for all rows would be none
            one = _jittery(apart, apart, clean, -against[0])
            what = f"{one.what}, and {missing} samples are missing"
            found.append(replace(one, what=what, remedy=one.remedy and remedy))
        else:
            true = _smoother(logged, even)
            found.append(_jittery(log.sample_time if plain else mean, usual, share, true if noisy else max(true, 0.0)))
    return found


def _missing(log: Log, restarts: Sequence[int]) -> tuple[float, int, float, str]:
    """Of even stamps with holes: jitter beside them, as a share; samples in holes; the step, s; the remedy."""
    held = [(t, *_with_holes(t)) for t in _pieces(stamps_of(log), restarts) if t.size > 1]
    off = np.concatenate([np.zeros(1), *(np.diff(t - even) / apart for t, even, apart in held)])
    missing = sum(round((e[-1] - e[0]) / a) + 1 - e.size for t, e, a in held if round(np.diff(t).max() / a) > 1)
    _, even, apart = max(held, key=lambda one: one[0].size, default=(None, np.zeros(1), log.sample_time))
    mend = f"round the stamps less {even[0]:.9g} s to multiples of {apart:.9g} s: missing ones are put in"
    return float(np.std(off)), missing, apart, mend


def _jittery(mean: float, usual: float, share: float, true: float) -> Finding:
    apart = f"steps of {usual * 1e3:.4g} ms, give or take {100.0 * share:.0f} %"
    apart += f", {mean * 1e3:.4g} ms in the mean" if abs(mean - usual) > 0.005 * usual else ""
    text = f"stamps are irregular ({apart})"
    if true > CLEAR:
        return Finding(f"{text}, and the samples were taken at them", "t", "note", 0.95)
    if true < -CLEAR:
        even = f'signals.time = "" and signals.sample_time = {mean:.6g}'
        what = f"{text}, but the samples were taken evenly: the stamps are noise"
        return Finding(what, "t", "warning", 0.95, even)
    return Finding(f"{text}; this log cannot say whether the samples are", "t", "note", 0.5)


_ROWS: dict[str, tuple[str, str]] = {
    "gap": ("{n} gap(s) longer than can be bridged: the log is taken as {pieces} pieces", "t"),
    "restart": ("the stamps go back {n} time(s): several recordings in one file", "t"),
    "duplicate stamp": ("{n} row(s) with the stamp of the row before are left out", "t"),
    "bridged": ("{n} sample(s) are missing and put in on a straight line", "t"),
    "unreadable line": ("{n} line(s) cannot be read", "log"),
}


def check_rows(dropped: Mapping[str, int], samples: int) -> list[Finding]:
    """Findings about rows that were not taken as they are; `dropped` as `Cleaner.dropped` has it."""
    pieces = 1 + dropped.get("gap", 0) + dropped.get("restart", 0)
    found = []
    for reason, count in dropped.items():
        what, channel = _ROWS.get(reason, ("", ""))
        if reason.startswith("not finite: "):
            channel = reason.removeprefix("not finite: ")
            what = "{n} row(s) without a finite " + channel
        if reason.startswith(f"{BEYOND}: "):
            channel = reason.removeprefix(f"{BEYOND}: ")
            what = "{n} row(s) beyond the range of " + channel
        if count and what:
            severity = "warning" if count > MANY * samples else "note"
            found.append(Finding(what.format(n=count, pieces=pieces), channel, severity, 1.0))  # type: ignore[arg-type]
    return found
