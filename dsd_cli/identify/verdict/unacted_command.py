"""What of the logged u did not act: single spikes, and lines such as hum of the mains, which the motion lacks."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from dsd_cli.effects import Role, get_effect
from dsd_cli.identify.fit.bank import Bank, has_friction
from dsd_cli.identify.fit.blocks import solve, total_gram
from dsd_cli.identify.fit.equations import equations_of
from dsd_cli.identify.fit.solve import Fit
from dsd_cli.identify.fit.testability import ROUNDING, Settings
from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.recordings.recording import Mended, Recording
from dsd_cli.identify.search.response import response_of
from dsd_cli.identify.search.seen import Seen
from dsd_cli.identify.search.sets import Search
from dsd_cli.identify.search.task import posed
from dsd_cli.signals.log import Array, with_channels
from dsd_cli.signals.windows import beside, median

#: Samples over which the median of u is taken: single wrong ones, and runs of ten that a slower logger holds.
_MEDIANS = (3, 21)
#: What is taken off u, rms, as a share of it: less is not worth asking.
_LEAST_PART = 0.05
#: The largest of what a median takes off, in units of its rms: noise has 5, and a u that switches has 2; its edges are
#: no spikes.
_CREST = 8.0
#: Power of a line over the median of that beside it: the largest of a hundred values of noise reaches 7.
_LINE = 30.0
#: Bins beside a line that are looked at, and that it fills itself (Hann window).
_BESIDE, _WIDTH = 50, 2
#: The acceleration at a line, or along with spikes, as a share of what u would cause there: below it, it did not act.
_UNANSWERED = 0.3
#: Hz by which a line may wander: mains do by some hundredths.
_WANDERS = 0.2
#: What is left without a part that did not act, as a share of what all that was found leaves with it; true ones have
#: 0.03-0.6, spikes that acted, with a law that misfits them, 0.83.
_AT_MOST = 0.7
#: Lines are looked for above so many times the highest frequency of the motion.
_ABOVE_MOTION = 5.0
#: Lines of one log that are taken off at most.
_MOST_LINES = 5


@dataclass(frozen=True)
class UnactedCommand:
    """A part of u that did not act.

    what : which; why : what is in its place, and what shows it; question : where it may be from. without : a recording,
    with u without that part. imitators : roles of effects that pass for it.
    """

    what: str
    why: str
    question: str
    without: Callable[[Recording], Recording]
    imitators: tuple[Role, ...]

    def shown(self, why: str) -> UnactedCommand:
        """This, by what shows it."""
        return replace(self, why=f"{self.why}, {why}")

    @property
    def said(self) -> str:
        """One sentence."""
        return f"{self.what} did not act on the axis, and count as not commanded: {self.why}. {self.question}"

    def taken_off(self, recordings: Sequence[Recording], holdout: Sequence[Recording]) -> Mended:
        """All without this part."""
        return Mended(tuple(map(self.without, recordings)), tuple(map(self.without, holdout)), (self.said,))


def idle_part(search: Search, whole: Fit, settings: Settings, seen: Seen | None) -> UnactedCommand | None:
    """The part of u without which forces alone explain the log better than all that was found, or as well as an effect
    on u that passes for it, or the load that the response shows (`seen`) is none."""
    problem, rmse = search.problem, search.problem.errors.rmse
    before, found = rmse(search.refit), rmse(whole)
    if before < POLICY.floor_factor * problem.floor and seen is None:
        return None
    as_found, best, least = problem.scale.model(whole), None, math.inf
    roles = {t.effect.role for t in search.added(whole.terms)}
    for part, taken_off in _parts(problem.recordings, search.solver.inertia):
        most = found * (1.0 + POLICY.nearly_the_same if roles & {*part.imitators} else _AT_MOST)
        load = seen.effect if seen is not None and Role.STRUCTURE in part.imitators else None
        if (acted := _answered(search, whole, taken_off) >= _UNANSWERED) and load is None:
            continue
        forces = {
            name: values for name, values in as_found.effects.items() if get_effect(name).role not in part.imitators
        }
        there = replace(problem.model, effects=forces)
        without = posed(taken_off, there, settings, as_found.delay)
        left = without.problem.errors.rmse(without.refit)
        response = load and response_of(without, without.refit, (load,), doubtful=True)
        if load is not None and not (response and response.seen):
            return part.shown("the response shows no load")
        better = left < most and left < least and problem.falls(before, left, search.refit)
        if better and not acted:
            why = f"forces alone leave {left:.3g}, any effects with u as it is logged {found:.3g}"
            best, least = part.shown(why), left
        del without  # as large as the next
    return best


def _answered(search: Search, whole: Fit, taken_off: Sequence[Recording]) -> float:
    """How much of what it would cause the acceleration has of the part of u that was taken off: 0 where it did not act.

    1 where it did; beside the forces that were found, and the rest of u.
    """
    bank, tap = search.problem.errors.bank, whole.tap
    terms = tuple(t for t in whole.terms if t.effect.role is not Role.INPUT)
    drive, acceleration, *others = bank.rows(terms, tap)
    equations = equations_of(taken_off, bank.equations.startup, bank.equations.bands)
    rest = Bank(equations).drive((), tap, held=has_friction(terms))
    kept = bank.equations.kept
    theta = solve(total_gram([x[kept] for x in (acceleration, rest, drive - rest, *others)])[None])[0]
    return float(theta[1] / theta[0]) if theta[0] > 0.0 else 1.0


def _parts(recordings: Sequence[Recording], inertia: float) -> Iterator[tuple[UnactedCommand, list[Recording]]]:
    """(a part of u that may not have acted, the recordings without it).

    A logger puts spikes into most of its logs; those of a few are kicks of the controller at steps.
    """
    for samples in _MEDIANS:
        without = partial(_despiked, samples=samples)
        smooth = [without(r) for r in recordings]
        if 2 * sum(a is not b for a, b in zip(smooth, recordings, strict=True)) >= len(recordings):
            question = "Is u logged more slowly than the drive runs, or are cells wrong?"
            instead = f"with the median of u over {samples} samples in their place"
            yield UnactedCommand("spikes of u", instead, question, without, (Role.INPUT,)), smooth
    found = [_without_lines(r, inertia) for r in recordings]
    lines = sorted({round(hz, 1) for _, lines in found for hz in lines})
    if lines:  # an axis that stands still at one frequency is what a load does that swings there
        what = f"u at {', '.join(f'{hz:g}' for hz in lines)} Hz"
        question = "Is it hum in a u that was measured, or a tone that the drive does not apply?"
        roles = (Role.INPUT, Role.STRUCTURE)
        part = UnactedCommand(what, "without it", question, lambda r: _without_lines(r, inertia)[0], roles)
        yield part, [r for r, _ in found]


def _despiked(recording: Recording, samples: int) -> Recording:
    """With the median of u over so many samples in its place; the same one where that takes no spikes off."""
    smooth = [median(beside(p["u"], samples // 2)) for p in recording.pieces]
    off = np.concatenate([p["u"] - m for p, m in zip(recording.pieces, smooth, strict=True)])
    if float(np.max(np.abs(off))) < _CREST * float(np.std(off)):
        return recording
    return _with_u(recording, smooth, "spikes")


def _without_lines(recording: Recording, inertia: float) -> tuple[Recording, list[float]]:
    """Without the lines of u that the acceleration does not answer, and those, Hz; the same one if there are none."""
    longest = max(recording.pieces, key=len)
    step, least = recording.sample_time, 0.0
    if "velocity" in longest:  # where the axis moves, forces answer u, and hardly any acceleration need
        least = _ABOVE_MOTION * _end_of(longest["velocity"], step)
    lines = [hz for hz in _unanswered(longest["u"], inertia * longest["acceleration"], step) if hz > least]
    if not lines:
        return recording, []
    without = _with_u(recording, [_notched(p["u"], lines, step) for p in recording.pieces], "lines")
    return without, lines if without is not recording else []


def _with_u(recording: Recording, u: Sequence[Array], kind: str) -> Recording:
    """With u less a part of this kind; the same one where hardly anything changes, or such a part is off already."""
    before, after = np.concatenate([p["u"] for p in recording.pieces]), np.concatenate(u)
    least = max(_LEAST_PART * float(np.std(before)), ROUNDING * float(np.max(np.abs(before))))
    if kind in recording.taken_off or float(np.std(before - after)) < least:
        return recording
    pieces = tuple(with_channels(p, u=x) for p, x in zip(recording.pieces, u, strict=True))
    return replace(recording, pieces=pieces, taken_off=(*recording.taken_off, kind))


def _unanswered(u: Array, force: Array, step: float) -> list[float]:
    """Hz of the lines of u, largest first, at which `force`, J times the acceleration, is far too small."""
    window = np.hanning(u.size)
    drive, answer = (np.abs(np.fft.rfft((x - x.mean()) * window)) for x in (u, force))
    highest, answered = (beside(x, _WIDTH).max(axis=1) for x in (drive, answer))
    at = np.flatnonzero((drive == highest) & (answered < _UNANSWERED * drive))
    at = at[drive[at] > math.sqrt(_LINE) * median(beside(drive, _BESIDE)[at])]
    at = at[np.argsort(-drive[at])][:_MOST_LINES]
    return [float(k) / (u.size * step) for k in at]


def _end_of(velocity: Array, step: float) -> float:
    """Hz below which nearly all of the motion is."""
    power = np.cumsum(np.abs(np.fft.rfft((velocity - velocity.mean()) * np.hanning(velocity.size))) ** 2)
    return float(np.searchsorted(power, 0.99 * power[-1])) / (velocity.size * step)


def _notched(u: Array, lines: Sequence[float], step: float) -> Array:
    """Without what is near these lines, Hz."""
    spectrum, frequency = np.fft.rfft(u), np.fft.rfftfreq(u.size, step)
    width = max(_WIDTH / (u.size * step), _WANDERS)
    for hz in lines:
        spectrum[np.abs(frequency - hz) <= width] = 0.0
    return np.fft.irfft(spectrum, u.size)
