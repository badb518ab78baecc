"""Is u held from sample to sample, or sampled from a continuous signal? Decided in the upper half of the spectrum.

    a = (u late by the delay, as each kind has it - B v - k q) / J

Between the samples the two differ by (w T)^2 and less, so that only a fast drive and a fine sensor show it; J, B, k and
the delay are free in both. Where the drive is slower, the delay decides: a sampled u is half a sample ahead of a held
one, and no u acts before it is there.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dsd_cli.identify.checks.balance import Band, Source
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
    """By segment, over the noise of a: u, shape (segments, frequencies), and a, v, q, shape (3, segments, frequencies);
    w in rad per sample."""

    w: Array
    motion: Spectrum
    u: Spectrum

    def without(self, part: int) -> _Spectra:
        return _Spectra(self.w, np.delete(self.motion, part, axis=1), np.delete(self.u, part, axis=0))

    def rest(self, response: Spectrum) -> Array:
        """Share of a that v, q and u under each response leave, shape (responses,); `response` (responses,
        frequencies)."""
        xx = np.real(np.einsum("isf,jsf->ij", np.conj(self.motion), self.motion))
        ux = np.real(np.conj(response) @ np.einsum("sf,jsf->fj", np.conj(self.u), self.motion))
        uu = np.abs(response) ** 2 @ np.sum(np.abs(self.u) ** 2, axis=0)
        beside = np.linalg.pinv(xx[1:, 1:], rcond=1e-12, hermitian=True)
        whole = max(float(xx[0, 0]), 1e-300)
        left = xx[0, 0] - xx[0, 1:] @ beside @ xx[1:, 0]
        cross = ux[:, 0] - ux[:, 1:] @ beside @ xx[1:, 0]
        power = np.maximum(uu - np.einsum("ri,ij,rj->r", ux[:, 1:], beside, ux[:, 1:]), 1e-300)
        return np.asarray((left - np.where(cross > 0.0, cross**2 / power, 0.0)) / whole)


def check_hold(stretches: Sequence[Stretch], band: Band, delay: float, hold: Hold) -> list[Finding]:
    """A finding where u is clearly not what `hold` says; `delay` (s) is the one found with it."""
    samples = delay / stretches[0].T
    whole = max(round(samples), 0)
    spectra = _spectra(stretches, band, whole)
    if spectra is None:
        return []
    delays = samples - whole + np.linspace(-_AROUND, _AROUND, _TRIED)
    delays = delays[delays >= -whole]
    if not delays.size:
        return []
    held, sampled = (kind(spectra.w, delays, band.source) for kind in (_held, _sampled))
    rests = [float(spectra.rest(kind).min()) for kind in (held, sampled)]
    better = int(rests[1] < rests[0])
    found: Hold = "sampled" if better else "held"
    if found == hold or min(rests) > 1.0 - EXPLAINED or max(rests) < WORSE * min(rests):
        return []
    early = samples - whole + np.linspace(-_AROUND, _AROUND, _TRIED)
    if float(spectra.rest(_held(spectra.w, early, band.source)).min()) * WORSE < min(rests):
        return []  # rather a held u that was logged late
    parts = [spectra.without(k) for k in range(0, len(spectra.u), max(len(spectra.u) // _LEAST, 1))]
    ratios = np.array([np.log(part.rest(held).min() / part.rest(sampled).min()) for part in parts])
    if abs(np.log(rests[0] / rests[1])) < CLEAR * float(jackknife(ratios)):
        return []
    like = "a continuous signal that was sampled" if better else "held from one sample to the next"
    return [Finding(f"u looks like {like}", "u", "warning", 0.9, f'signals.u_hold = "{found}"', first=True, hold=found)]


def _spectra(stretches: Sequence[Stretch], band: Band, ahead: int) -> _Spectra | None:
    """With u `ahead` samples before a, so that both are of the same events within a segment."""
    window = np.hanning(_SEGMENT + 2)[1:-1]
    T = stretches[0].T
    w = 2.0 * np.pi * np.fft.rfftfreq(_SEGMENT)
    inside = (w > 2.0 * np.pi * _FROM) & (w < 2.0 * np.pi * _TO)
    noise = (2.0 - 2.0 * np.cos(w[inside])) ** (2 if band.source == "position" else 1)
    motion: list[Spectrum] = []
    u: list[Spectrum] = []
    for s in stretches:
        measured = getattr(s, band.source)
        if measured is None or s.u is None or s.t.size < 2 * _SEGMENT + ahead:
            continue
        moved = _backward(measured, T, band.source)[:, ahead:]
        for parts, x in ((motion, moved), (u, s.u[2 : s.t.size - ahead])):
            segments = np.lib.stride_tricks.sliding_window_view(x, _SEGMENT, axis=-1)[..., :: _SEGMENT // 2, :]
            parts.append(np.fft.rfft(window * segments)[..., inside] / np.sqrt(noise))
    if sum(map(len, u)) < _LEAST:
        return None
    return _Spectra(np.asarray(w[inside], dtype=np.float64), np.concatenate(motion, axis=1), np.concatenate(u))


def _backward(x: Array, T: float, source: Source) -> Array:
    """Mean a, v and q over the interval (from position: the two intervals) that ends at each sample from the third on,
    shape (3, n - 2)."""
    if source == "velocity":
        return np.stack([np.diff(x[1:]) / T, 0.5 * (x[1:-1] + x[2:]), np.cumsum(x)[1:-1] * T])
    return np.stack([np.diff(x, 2) / T**2, 0.5 * (x[2:] - x[:-2]) / T, x[1:-1]])


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
