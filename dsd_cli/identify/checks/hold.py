"""Is u held from sample to sample, or sampled from a continuous signal? Decided in the upper half of the spectrum.

Between the samples the two differ by (w T)^2 and less, so that only a fast drive and a fine sensor show it. Cross
spectra of u and the acceleration are compared with what each kind makes of them; J and the delay are free in both.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dsd_cli.identify.checks.band import Band, Source
from dsd_cli.identify.checks.results import Finding
from dsd_cli.identify.checks.scan import jackknife
from dsd_cli.identify.checks.stretches import Stretch
from dsd_cli.signals.log import Array, Hold

#: The better kind explains this share of the acceleration there, the worse leaves so many times as much, ...
EXPLAINED, WORSE = 0.9, 1.5
#: ... by so many standard errors.
CLEAR = 5.0
#: The spectrum that is looked at, shares of the sample rate; samples of a segment; segments at least.
_FROM, _TO, _SEGMENT, _LEAST = 0.08, 0.45, 512, 16
#: Delays that are tried about the one found, samples, and their number.
_AROUND, _TRIED = 1.5, 61

Spectrum = NDArray[np.complex128]


@dataclass(frozen=True)
class _Spectra:
    """a and u by segment, shape (segments, frequencies), over the noise of a; w in rad per sample."""

    w: Array
    a: Spectrum
    u: Spectrum

    def without(self, part: int) -> _Spectra:
        return _Spectra(self.w, np.delete(self.a, part, axis=0), np.delete(self.u, part, axis=0))

    def rest(self, response: Spectrum) -> Array:
        """Share of a that is left by each response, shape (responses,); `response` (responses, frequencies)."""
        uu, ua = np.sum(np.abs(self.u) ** 2, axis=0), np.sum(np.conj(self.u) * self.a, axis=0)
        cross = np.real(np.conj(response) * ua).sum(axis=1)
        power = np.maximum((np.abs(response) ** 2 * uu).sum(axis=1), 1e-300)
        gained = np.where(cross > 0.0, cross**2 / power, 0.0)
        return 1.0 - gained / max(float(np.sum(np.abs(self.a) ** 2)), 1e-300)


def check_hold(stretches: Sequence[Stretch], band: Band, delay: float, hold: Hold) -> list[Finding]:
    """A finding where u is clearly not what `hold` says; `delay` (s) is the one found with it."""
    samples = delay / stretches[0].T
    whole = max(round(samples), 0)
    spectra = _spectra(stretches, band, whole)
    if spectra is None:
        return []
    delays = samples - whole + np.linspace(-_AROUND, _AROUND, _TRIED)
    held, sampled = (kind(spectra.w, delays, band.source) for kind in (_held, _sampled))
    rests = [float(spectra.rest(kind).min()) for kind in (held, sampled)]
    better = int(rests[1] < rests[0])
    found: Hold = "sampled" if better else "held"
    if found == hold or min(rests) > 1.0 - EXPLAINED or max(rests) < WORSE * min(rests):
        return []
    parts = [spectra.without(k) for k in range(0, len(spectra.a), max(len(spectra.a) // _LEAST, 1))]
    ratios = np.array([np.log(part.rest(held).min() / part.rest(sampled).min()) for part in parts])
    if abs(np.log(rests[0] / rests[1])) < CLEAR * float(jackknife(ratios)):
        return []
    like = "a continuous signal that was sampled" if better else "held from one sample to the next"
    return [Finding(f"u looks like {like}", "u", "warning", 0.9, f'signals.u_hold = "{found}"')]


def _spectra(stretches: Sequence[Stretch], band: Band, ahead: int) -> _Spectra | None:
    """With u `ahead` samples before a, so that both are of the same events within a segment."""
    window = np.hanning(_SEGMENT + 2)[1:-1]
    T = stretches[0].T
    w = 2.0 * np.pi * np.fft.rfftfreq(_SEGMENT)
    inside = (w > 2.0 * np.pi * _FROM) & (w < 2.0 * np.pi * _TO)
    noise = (2.0 - 2.0 * np.cos(w[inside])) ** (2 if band.source == "position" else 1)
    a: list[Spectrum] = []
    u: list[Spectrum] = []
    for s in stretches:
        measured = getattr(s, band.source)
        if measured is None or s.u is None or s.t.size < 2 * _SEGMENT + ahead:
            continue
        moved = _backward(measured, T, band.source)
        for parts, x in ((a, moved[2 + ahead :]), (u, s.u[2 : s.t.size - ahead])):
            segments = np.lib.stride_tricks.sliding_window_view(x, _SEGMENT)[:: _SEGMENT // 2]
            parts.append(np.fft.rfft(window * segments)[:, inside] / np.sqrt(noise))
    if sum(map(len, a)) < _LEAST:
        return None
    return _Spectra(np.asarray(w[inside], dtype=np.float64), np.concatenate(a), np.concatenate(u))


def _backward(x: Array, T: float, source: Source) -> Array:
    """Mean acceleration over the interval (from position: the two intervals) that ends at each sample."""
    order = 2 if source == "position" else 1
    return np.concatenate([np.zeros(order), np.diff(x, order)]) / T**order


def _held(w: Array, delays: Array, source: Source) -> Spectrum:
    """Response of that mean to a u that is held, for each delay (samples), exact; shape (delays, frequencies)."""
    whole = np.floor(delays)[:, None]
    f = delays[:, None] - whole
    if source == "velocity":
        taps = [1.0 - f, f]
    else:
        taps = [0.5 * (1.0 - f) ** 2, f - 0.5 * f**2 + 0.5 * (1.0 - f**2), 0.5 * f**2]
    return np.asarray(sum(tap * np.exp(-1j * w * (whole + 1 + k)) for k, tap in enumerate(taps)))


def _sampled(w: Array, delays: Array, source: Source) -> Spectrum:
    """The same of a u that is continuous and has nothing above half the sample rate."""
    order = 2 if source == "position" else 1
    return np.asarray(np.sinc(w / (2.0 * np.pi)) ** order * np.exp(-1j * w * (delays[:, None] + 0.5 * order)))
