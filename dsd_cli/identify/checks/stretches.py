"""A log cut at its gaps into evenly spaced stretches, and the low-pass without phase that all checks use."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from dsd_cli.identify.recordings.smoothing import mean_held
from dsd_cli.plant.filtering import irregular_stamps
from dsd_cli.plant.model import ObserverSettings
from dsd_cli.signals.continuous import continuous, in_pieces
from dsd_cli.signals.log import Array, Log
from dsd_cli.signals.windows import smooth_size

#: The band ends where the filter has fallen to a half; it is flat up to 0.7 and shut from 1.3 times that.
_TRANSITION = 0.6
#: A Blackman window of this many samples has a transition of one sample rate.
_BLACKMAN = 5.5
#: Rows of a stretch that are kept at most.
_MOST = 6000
#: Products of a sum over the kernel, per sample of the stretch, that take no longer than a transform.
_AS_LONG = 4
#: Rows are kept at this many times the band's end.
OVERSAMPLING = 3.0


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
        return max(int(1.0 / (OVERSAMPLING * self.cutoff * self.T)), 1)

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
        size = smooth_size(x.size + 2 * self.half)
        spectrum = np.fft.rfft(x, size) * _response(self, size)
        return np.fft.irfft(spectrum, size)[self.half : self.half + x.size]

    def at(self, x: Array, rows: NDArray[np.int64]) -> Array:
        """The same at some of `rows` alone: of a long stretch their sums take less than a transform of all of it."""
        kernel = self.kernel()
        if x.size < kernel.size or rows.size * kernel.size > _AS_LONG * x.size:
            return self(x)[rows]
        return np.lib.stride_tricks.sliding_window_view(x, kernel.size)[rows - self.half] @ kernel


@lru_cache(maxsize=2)  # each is as large as two channels
def _response(keep: LowPass, size: int) -> NDArray[np.complex128]:
    return np.fft.rfft(keep.kernel(), size)


#: Samples of the shortest stretch that is looked at.
SHORTEST = 50
#: In the order of `Stretch`.
_CHANNELS = ("u", "position", "velocity", "d_hat")


@dataclass(frozen=True)
class Stretch:
    """Samples T apart; each channel of shape (n,), None where it is not logged.

    `position` has its wraps undone. `wraps` : how often it jumped, `turn` : by how much (its unit).
    """

    T: float
    t: Array
    u: Array | None
    position: Array | None
    velocity: Array | None
    d_hat: Array | None
    wraps: int = 0
    turn: float = 0.0

    @property
    def speed(self) -> Array | None:
        """As logged, else the slope of the position over the samples beside each, which is not late."""
        slope = None if self.position is None else np.gradient(self.position, self.T)
        return slope if self.velocity is None else self.velocity

    def net_force(self, observer: ObserverSettings) -> Array | None:
        """Jn a by u + Q^-1 d_hat, shape (n,); None where one of them is not logged."""
        if self.u is None or self.d_hat is None:
            return None
        pole = observer.pole(self.T)
        undone = (self.d_hat - pole * before(self.d_hat)) / (1.0 - pole)
        return observer.sign * undone + before(self.u)  # d_hat_k has seen u up to u_{k-1}


def before(x: Array) -> Array:
    """The sample before each, of the first itself."""
    return np.concatenate([x[:1], x[:-1]])


def cut(log: Log, restarts: Sequence[int]) -> list[Stretch]:
    """The stretches of a log that are long enough; restarts : samples that do not continue the one before."""
    _, edges = in_pieces(log, restarts)
    return [_stretch(log, a, b) for a, b in pairwise(edges) if b - a >= SHORTEST]


def stamps_of(log: Log) -> Array:
    """t, shape (n,); from the sample time where the log has none."""
    return log["t"] if "t" in log else np.arange(len(log), dtype=np.float64) * log.sample_time


def _stretch(log: Log, a: int, b: int) -> Stretch:
    channels = {name: np.array(log[name][a:b]) for name in _CHANNELS if name in log}
    t, T = stamps_of(log)[a:b], log.sample_time
    wraps, turn = 0, 0.0
    if "position" in channels:
        channels["position"], wraps, turn, *_ = continuous(channels["position"])
    if irregular_stamps(log) is not None:
        T = float(np.mean(np.diff(t)))
        grid = t[0] + T * np.arange(int((t[-1] - t[0]) / T) + 1)
        edges, held = np.append(grid, grid[-1] + T), {"u"} if log.u_hold == "held" else set()
        channels = {n: mean_held(x, t, edges) if n in held else np.interp(grid, t, x) for n, x in channels.items()}
        t = grid
    u, position, velocity, d_hat = (channels.get(name) for name in _CHANNELS)
    return Stretch(T, t, u, position, velocity, d_hat, wraps, turn)
