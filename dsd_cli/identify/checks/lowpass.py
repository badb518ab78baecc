"""A low-pass without phase whose edges are dropped, and the sampling of what has passed it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from dsd_cli.signals.log import Array

#: The band ends where the filter has fallen to a half; it is flat up to 0.7 and shut from 1.3 times that.
_TRANSITION = 0.6
#: A Blackman window of this many samples has a transition of one sample rate.
_BLACKMAN = 5.5
#: Rows of a stretch that are kept at most.
_MOST = 6000
#: Rows are kept at this many times the band's end.
_OVERSAMPLING = 3.0


@dataclass(frozen=True)
class LowPass:
    """`cutoff` in Hz for samples `T` s apart."""

    T: float
    cutoff: float

    @property
    def half(self) -> int:
        """Half width of the impulse response, samples."""
        return max(int(np.ceil(0.5 * _BLACKMAN / (_TRANSITION * self.cutoff * self.T))), 1)

    @property
    def stride(self) -> int:
        """Samples from one row that says something new to the next."""
        return max(int(1.0 / (_OVERSAMPLING * self.cutoff * self.T)), 1)

    def kernel(self) -> Array:
        """Windowed sinc, shape (2 half + 1,), sum 1."""
        k = np.arange(-self.half, self.half + 1)
        kernel = np.sinc(2.0 * self.cutoff * self.T * k) * np.blackman(2 * self.half + 3)[1:-1]
        return np.asarray(kernel / kernel.sum())

    def rows(self, n: int, margin: int = 0) -> NDArray[np.int64]:
        """The samples to keep of n, without the edges (and `margin` beside them) that reach beyond the stretch.

        Of a long stretch a few thousand say what can be said.
        """
        edge = self.half + margin
        return np.arange(edge, n - edge, max(self.stride, n // _MOST))

    def __call__(self, x: Array) -> Array:
        """Same length as x; the first and last `half` values are not to be used."""
        size = _fast_size(x.size + 2 * self.half)
        spectrum = np.fft.rfft(x, size) * _response(self, size)
        return np.fft.irfft(spectrum, size)[self.half : self.half + x.size]


def _fast_size(least: int) -> int:
    """The smallest of 8, 9, 10 and 12 times a power of two that holds so many: such transforms are fast."""
    return min(eighths << max(math.ceil(math.log2(least / eighths)), 0) for eighths in (8, 9, 10, 12))


@lru_cache(maxsize=2)  # each is as large as two channels
def _response(keep: LowPass, size: int) -> NDArray[np.complex128]:
    return np.fft.rfft(keep.kernel(), size)
