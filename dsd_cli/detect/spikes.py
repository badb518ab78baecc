"""Labels that rest on a spike of u: a corrupt cell looks like a command that the plant never got.

A delay of 0 with the nominal inertia predicts d_hat = 0 for any u. One wrong value of u therefore speaks, with all the
weight of its square, for that state and against every other, and d_hat cannot contradict. A state whose prediction
would show the spike is another matter: if it explains its window with the spike in it, the spike was there. A window
holds a spike twice: as it is in d_hat, u(t), and as that state delays it, u(t - L). Between the two, and after both,
the window says of the state only that others are wrong.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from dsd_cli.detect.spec import KernelSpec, nats_of_fit
from dsd_cli.signals.log import Array
from dsd_cli.signals.outliers import Level

#: A spike is at least so many times what u usually reaches.
FACTOR = 4.0


class Spikes:
    """Finds the labels that rest on a spike; every value of u passes through it, in order.

    Parameters
    ----------
    spec : what the kernel works with.
    window : samples that a decision looks back on.
    logged : d_hat comes from the log; else it is computed from u, and a spike of u is in both.
    """

    def __init__(self, spec: KernelSpec, window: int, logged: bool) -> None:
        self.largest = 0.0
        self._shown = smallest_shown(spec, logged)
        self._rho = spec.settings.rho
        self._decay = spec.time_constant / spec.sample_time if spec.pole > 0.0 else 0.0
        longest = max(whole for whole, _ in spec.taps())
        self._span, self._longest = window + spec.aperture + 2, longest
        self._delays = np.repeat([whole for whole, _ in spec.taps()], self._shown.size // len(spec.taps()))
        self._level = Level()
        self._active: list[tuple[int, float, int]] = []  # sample, size, samples for which a window holds it

    @property
    def level(self) -> float:
        """What u usually reaches, as a power of two."""
        return self._level.value

    def warning(self, doubted: int) -> str:
        """What to say of that many confident labels that were none."""
        return (
            f"u stands out (up to {self.largest:.3g}, it usually reaches about {self.level:.3g}), and nothing shows "
            f"that it was so: {doubted} label(s) that rest on it are not confident"
        )

    def restart(self) -> None:
        """What comes next rests on nothing that was before; the level of u stays."""
        self._active = []

    def unfounded(self, u: Array, state: NDArray[np.int32]) -> NDArray[np.bool_] | None:
        """Which labels of the next samples, shape (n,), rest on a spike; None: none does."""
        sizes = self._spike_behind(u, self._delays[state])
        return None if sizes is None else sizes < self._shown[state]

    def _spike_behind(self, u: Array, delays: NDArray[np.int64]) -> Array | None:
        """Per sample the smallest spike that a window holds, infinite for none; None: there is none in all of them.

        Where the window of the sample's own delay holds none of it, its size is 0. A value is no spike any more from
        the sample on that shows it to be the level of u.
        """
        start = self._level.rows
        found = self._level.follow(u, FACTOR)
        if not found and not self._active:
            return None
        sizes = np.full(u.size, np.inf)
        for row, size, level in found:
            self._cover(sizes, delays, start, row, level)
            if size < FACTOR * level:
                continue
            self.largest = max(self.largest, size)
            span = self._span + self._decay * max(math.log(size) - math.log(self._rho), 0.0)
            self._active.append((row, size, math.ceil(span)))
        self._cover(sizes, delays, start, start + u.size, self._level.value)
        self._active = [one for one in self._active if one[0] + one[2] + self._longest > start + u.size]
        return sizes

    def _cover(self, sizes: Array, delays: NDArray[np.int64], start: int, now: int, level: float) -> None:
        """Write down what the spikes act on before `now`, and let those go that are no spikes at this level."""
        for row, size, span in self._active:
            first, end = max(row, start), min(row + span + self._longest, now)
            part = slice(first - start, max(end - start, first - start))
            since = np.arange(first, first + len(sizes[part])) - row
            late = since - delays[part]
            own = (since < span) | ((late >= 0) & (late < span))
            others = since < self._span + self._longest  # what Q has left of it later tells no states apart
            sizes[part] = np.minimum(sizes[part], np.where(others & ~own, 0.0, size))
        self._active = [one for one in self._active if one[1] >= FACTOR * level]


def smallest_shown(spec: KernelSpec, logged: bool) -> Array:
    """Per state the smallest spike of u, in its unit, that the measurement must show if the state holds.

    Shape (states,). The response to one value of u is that of Q (none where d_hat is computed: u cancels), less (Jn/J)
    times the same one delay later; its energy must be what makes a window unexplained. Infinite without a response.
    """
    p = spec.pole
    energy = (1.0 - p) / (1.0 + p) * (0.5 * (1.0 + p) if spec.aperture == 2 else 1.0)
    whole, f = (np.array(column)[:, None] for column in zip(*spec.taps(), strict=True))
    alpha = np.asarray(spec.alphas)[None, :]
    delayed = (1.0 - f) ** 2 + f**2 + 2.0 * f * (1.0 - f) * p
    together = (1.0 - f) * p**whole + f * p ** (whole + 1)
    response = alpha**2 * delayed + (1.0 - 2.0 * alpha * together if logged else 0.0)
    floor = 2.0 * nats_of_fit(spec.settings.window) * spec.settings.rho**2
    with np.errstate(divide="ignore"):
        shown = np.sqrt(floor / (energy * np.where(response > 1e-12, response, 0.0)))
    combos = len(spec.grid.combinations)
    return np.repeat(shown[:, None, :], combos, axis=1).ravel()
