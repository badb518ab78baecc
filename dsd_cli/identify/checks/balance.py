"""The force balance u(t - L) = J a + what depends on the motion, in the band in which the acceleration is seen: as far
up in frequency as a sensor shows it, signal against noise, from the log itself."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from dsd_cli.identify.checks.stretches import LowPass, Stretch
from dsd_cli.identify.recordings.smoothing import noise_of
from dsd_cli.signals.encoder import encoder_step
from dsd_cli.signals.log import Array

Source = Literal["position", "velocity"]

#: Within the band the noise of the acceleration is at most this share of its power: it biases an inertia by as much.
NOISE_SHARE = 0.02
#: And the last third of an octave of the band still holds this many times the power of the noise.
LOCAL_RATIO = 4.0
#: The band never goes beyond this share of the sample rate: differences of samples are no derivatives there.
HIGHEST = 0.15
#: The velocity is taken where its band is so many times wider.
_CLEARLY = 1.3
#: Seconds of a segment of the spectrum, and its bounds in samples.
_SEGMENT, _SHORTEST, _LONGEST = 4.0, 64, 8192
#: A channel that changes in less than this share of the samples is coarse.
_RARE = 0.02
#: The noise is looked for above this share of the sample rate.
_NOISE_ABOVE = 0.04


@dataclass(frozen=True)
class Band:
    """What one sensor shows of the acceleration.

    source : the channel that is differentiated. cutoff : Hz, end of the band. step : of the encoder; 0 if the channel
    is not quantised. speed_noise : standard deviation of the speed within the band, rad/s or m/s.
    """

    source: Source
    cutoff: float
    step: float
    speed_noise: float


def find_band(stretches: Sequence[Stretch]) -> Band | None:
    """That of the position, unless the velocity shows clearly more; None if neither shows any acceleration.

    A velocity is often the position's own difference, half a sample late, or filtered.
    """
    position, velocity = _band(stretches, "position"), _band(stretches, "velocity")
    if position is None or velocity is None:
        return position or velocity
    return velocity if velocity.cutoff > _CLEARLY * position.cutoff else position


def difference(x: Array, T: float, source: Source) -> Array:
    """Acceleration at each sample by differences of the samples beside it; 0 at both ends."""
    a = np.zeros(x.size)
    if source == "position":
        a[1:-1] = (x[2:] - 2.0 * x[1:-1] + x[:-2]) / T**2
    else:
        a[1:-1] = (x[2:] - x[:-2]) / (2.0 * T)
    return a


def _band(stretches: Sequence[Stretch], source: Source) -> Band | None:
    channels = [x for s in stretches if (x := getattr(s, source)) is not None]
    if not channels or not any(np.ptp(x) > 0.0 for x in channels):
        return None
    T = stretches[0].T
    f, power = _spectrum([difference(x, T, source) for x in channels], T)
    gain = _gain(f, T, source)
    step = max(encoder_step(x) or _rare_step(x) for x in channels)
    level = 2.0 * T * (step * step) / 12.0  # of a huge step infinite: nothing is seen
    if step == 0.0:  # each sees some signal as noise: the spectrum jumps, the high differences smooth motion
        rms = max(noise_of(x) for x in channels)
        level = min(_white_level(f, power, gain, T), 2.0 * T * (rms * rms))
    cutoff = _cutoff(f, power, level * gain, T)
    if cutoff is None:
        return None
    inside = f[f <= cutoff]
    to_speed = (2.0 * np.pi * inside) ** 2 if source == "position" else np.ones(inside.size)
    return Band(source, cutoff, step, float(np.sqrt(level * np.sum(to_speed) * f[1])))


def _rare_step(x: Array) -> float:
    """The step of a channel that hardly ever changes: so coarse that it is quantised whatever its steps are."""
    changes = np.abs(np.diff(x))
    changes = changes[changes > 0.0]
    return float(changes.min()) if 0 < changes.size < _RARE * x.size else 0.0


def _spectrum(channels: Sequence[Array], T: float) -> tuple[Array, Array]:
    """(Hz, power density) by Hann windows that overlap by half, averaged over all channels."""
    longest = max(x.size for x in channels)
    size = int(np.clip(_SEGMENT / T, _SHORTEST, min(_LONGEST, max(longest // 4, _SHORTEST))))
    size = min(size, longest)
    window = np.hanning(size + 2)[1:-1]
    total, count = np.zeros(size // 2 + 1), 0
    for x in channels:
        if x.size >= size:
            segments = np.lib.stride_tricks.sliding_window_view(x, size)[:: max(size // 2, 1)]
            total += np.sum(np.abs(np.fft.rfft(window * segments)) ** 2, axis=0)
            count += len(segments)
    density = total * 2.0 * T / (max(count, 1) * np.sum(window**2))
    return np.asarray(np.fft.rfftfreq(size, T), dtype=np.float64), density


def _gain(f: Array, T: float, source: Source) -> Array:
    """Power gain of `difference` for white noise of the channel."""
    w = 2.0 * np.pi * f * T
    return (2.0 - 2.0 * np.cos(w)) ** 2 / T**4 if source == "position" else np.sin(w) ** 2 / T**2


def _white_level(f: Array, power: Array, gain: Array, T: float) -> float:
    """Density of white noise on the channel: what the quietest stretch of the upper spectrum allows."""
    levels = [float(np.mean(power[low:high]) / np.mean(gain[low:high])) for low, high in _octaves(f, _NOISE_ABOVE / T)]
    return min(levels, default=0.0)


def _octaves(f: Array, above: float) -> list[tuple[int, int]]:
    """Thirds of octaves from there up to 0.45 of the sample rate, as slices."""
    top, edges = 0.9 * f[-1], [max(above, f[1])]
    while edges[-1] < top:
        edges.append(max(edges[-1] * 2.0 ** (1.0 / 3.0), edges[-1] + 2.0 * f[1]))
    at = np.searchsorted(f, np.minimum(edges, top))
    return [(a, b) for a, b in pairwise(at.tolist()) if b > a]


def _cutoff(f: Array, power: Array, noise: Array, T: float) -> float | None:
    """Hz; None where the noise is above the limits from the lowest frequencies on."""
    if not power[1:].sum() > 0.0:
        return None
    highest = HIGHEST / T
    share = np.cumsum(noise[1:]) / np.maximum(np.cumsum(power[1:]), 1e-30 * power[1:].sum())
    allowed = np.flatnonzero((share <= NOISE_SHARE) & (f[1:] <= highest))
    octaves = _octaves(f, f[1])
    clear = [f[b - 1] for a, b in octaves if power[a:b].sum() > LOCAL_RATIO * noise[a:b].sum()]
    return float(min(f[1 + allowed[-1]], max(clear), highest)) if allowed.size > 0 and clear else None


#: Below this share of its rms the speed is rest, where friction may be any force: such rows are left out.
REST = 0.03
#: From so many deviations of its noise on the direction of a speed is sure, if not from the speed of rest on.
SURE = 3.0


@dataclass(frozen=True)
class Balance:
    """Band-limited rows of all stretches; u is kept at every sample, so that it can be read at any delay.

    acceleration : shape (rows,).
    speed : shape (rows,).
    motion : basis of what else a force may depend on (speed, direction, position, 1), shape (rows, k), orthonormal.
    stored : basis of what takes no work out of the motion (acceleration, position, 1), likewise.
    starts : row -> the stretch's offset into `u` plus the row's sample, shape (rows,).
    u : low-passed u of all stretches, one after the other.
    T : s.
    reach : samples by which u may be read before and after a row.
    """

    acceleration: Array
    speed: Array
    motion: Array
    stored: Array
    starts: Array
    u: Array
    T: float
    reach: tuple[int, int]

    def u_at(self, shift: float) -> Array:
        """u, `shift` s before each row, shape (rows,)."""
        at = self.starts - shift / self.T
        whole = np.floor(at).astype(np.int64)
        part = at - whole
        return (1.0 - part) * self.u[whole] + part * self.u[np.minimum(whole + 1, self.u.size - 1)]


def balance(
    stretches: Sequence[Stretch], band: Band, cutoff: float, reach: tuple[float, float], cycle: float
) -> Balance | None:
    """Rows of all stretches that are long enough; None if there are too few.

    cutoff : Hz, at most that of the band.
    reach : s before and after a row within which u must be there.
    cycle : s after which the motion repeats itself, see `in_phase`.
    """
    T = stretches[0].T
    keep = LowPass(T, cutoff)
    before, after = (int(np.ceil(x / T)) + 1 for x in reach)
    parts: list[tuple[Array, Array, Array]] = []
    us: list[Array] = []
    offset = 0
    for s in stretches:
        measured = getattr(s, band.source)
        rows = keep.rows(s.t.size, max(before, after))
        if s.u is None or measured is None or rows.size < 2:
            continue
        measured_speed = speed_of(s, band)
        speed = keep(measured_speed)
        position = s.position if s.position is not None else np.cumsum(speed) * T
        a = keep(difference(measured, T, band.source))
        columns = motion_columns(
            speed, keep(position), LowPass(T, band.cutoff)(measured_speed), band.speed_noise, keep, rows
        )
        parts.append((a[rows], columns, rows.astype(np.float64) + offset))
        us.append(keep(s.u))
        offset += s.t.size
    if not parts:
        return None
    a, columns, starts = (np.concatenate(x) for x in zip(*parts, strict=True))
    moving = np.abs(columns[:, 0]) > REST * np.sqrt(np.mean(columns[:, 0] ** 2))
    if moving.sum() < 4 * columns.shape[1]:
        return None
    kept = np.flatnonzero(moving)[in_phase(starts[moving] * T, cycle)]
    a, columns, starts = a[kept], columns[kept], starts[kept]
    stored = orthonormal(np.column_stack([a, columns[:, 2:]]))
    return Balance(a, columns[:, 0], orthonormal(columns), stored, starts, np.concatenate(us), T, (before, after))


def in_phase(t: Array, cycle: float) -> NDArray[np.int64]:
    """The order of rows at t (s) whose blocks are left out in turn: of the phase where the motion repeats itself.

    All cycles lack the same forces at the same places, so that blocks of time would agree in whatever is wrong.
    """
    return np.argsort(t % cycle, kind="stable")


def without(basis: Array, x: Array) -> Array:
    """What the columns of an orthonormal basis do not explain of x, shape (rows,) or (rows, k)."""
    return np.asarray(x - basis @ (basis.T @ x))


def speed_of(s: Stretch, band: Band) -> Array:
    """Speed of a stretch, shape (n,), from the same channel as the acceleration, so that both have one sign."""
    if band.source == "velocity":
        assert s.velocity is not None
        return s.velocity
    assert s.position is not None
    return np.gradient(s.position, s.T)


def motion_columns(
    speed: Array, position: Array, sharp: Array, noise: float, keep: LowPass, rows: NDArray[np.int64]
) -> Array:
    """What friction, weight and springs may be made of, shape (rows, 6), of low-passed motion; first is the speed.

    sharp : the speed in all of its band. A low-pass moves a reversal that is quick before zero and slow after it, as
    those of a relay with friction are, and the force that friction then shows too early passes for inertia and lead.
    noise : standard deviation of `sharp`; a turn that is softer than the sensor asks for passes for them, too.
    """
    soft = max(min(REST * float(np.sqrt(np.mean(speed**2))), SURE * noise), 1e-300)
    direction, middle = keep.at(np.tanh(sharp / soft), rows), position.mean()
    speed, position = speed[rows], position[rows]
    return np.column_stack(
        [speed, direction, np.sin(position), np.cos(position), position - middle, np.ones(rows.size)]
    )


def orthonormal(columns: Array) -> Array:
    """A basis of the columns, without those that add nothing, shape (rows, k)."""
    scaled = columns / np.maximum(np.sqrt(np.mean(columns**2, axis=0)), 1e-300)
    basis, sizes, _ = np.linalg.svd(scaled, full_matrices=False)
    return np.asarray(basis[:, sizes > 1e-6 * sizes[0]])
