"""The motion of a stretch in its band, from the sensor or from u and d_hat; along the reference it is an instrument.

A controller puts the noise of its sensor into u, and least squares of u on the motion takes that for an answer of the
axis: inertia and delay lean. The motion that was asked for drives both and has none of that noise: the same columns
along the reference are instruments (two-stage least squares, as IDIM-IV of Janot, Vandanjon and Gautier, 2014). Where
the reference explains little of the motion, errors are large and values not wrong.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from dsd_cli.identify.checks.balance import difference, orthonormal, without
from dsd_cli.identify.checks.scan import View
from dsd_cli.identify.checks.stretches import LowPass, Stretch
from dsd_cli.plant.model import ObserverSettings, PlantModel
from dsd_cli.plant.prediction import Frame
from dsd_cli.signals.log import Array, Log
from dsd_cli.signals.windows import smooth_size

#: An axis follows its reference within this, s.
_FOLLOWS = 0.25


@dataclass(frozen=True)
class Motion:
    """Low-passed channels of shape (n,), SI; `cutoff` in Hz; `sharp`: velocity in all of its band, and its noise."""

    acceleration: Array
    velocity: Array
    position: Array
    sharp: Array
    noise: float
    cutoff: float

    def channels(self, s: Stretch) -> dict[str, Array]:
        """With u, as a log has them."""
        assert s.u is not None
        return {"t": s.t, "u": s.u, "velocity": self.velocity, "position": self.position}


def motion_of(s: Stretch, view: View, observer: ObserverSettings | None) -> Motion | None:
    """None where neither sensor nor d_hat gives one, or the stretch is too short for its band."""
    keep = LowPass(s.T, view.cutoff)
    if s.t.size < 4 * keep.half:
        return None
    if view.band is None:
        return None if observer is None else _from_disturbance(s, keep, observer)
    measured = getattr(s, view.band.source)
    if measured is None:
        return None
    speed = np.gradient(measured, s.T) if view.band.source == "position" else measured
    velocity, sharp = keep(speed), LowPass(s.T, view.band.cutoff)(speed)
    position = s.position if s.position is not None else np.cumsum(velocity) * s.T
    return Motion(
        keep(difference(measured, s.T, view.band.source)),
        velocity,
        keep(position),
        sharp,
        view.band.speed_noise,
        view.cutoff,
    )


def along_reference(s: Stretch, keep: LowPass) -> Motion:
    """The motion that was asked for, as late as the axis follows: it has nothing of the sensor's noise."""
    assert s.reference is not None
    lag = 0 if s.position is None else _lag(s.reference, s.position, min(s.t.size // 4, round(_FOLLOWS / s.T)))
    position = np.concatenate([np.full(lag, s.reference[0]), s.reference[: s.t.size - lag]])
    speed = np.gradient(position, s.T)
    return Motion(keep(difference(position, s.T, "position")), keep(speed), keep(position), speed, np.inf, keep.cutoff)


def _lag(first: Array, then: Array, most: int) -> int:
    """Samples by which one channel follows another, 0 to `most`."""
    middle, n = first.mean(), first.size
    first, then = first - middle, then - middle  # or the squares of a position far from 0 round off their difference
    size = smooth_size(n + most)
    products = np.fft.irfft(np.fft.rfft(first, size).conj() * np.fft.rfft(then, size), size)[: most + 1]
    head = np.cumsum(first**2)[n - most - 1 :][::-1]
    tail = np.cumsum(then[::-1] ** 2)[n - most - 1 :][::-1]
    return int(np.argmin((head + tail - 2.0 * products) / np.arange(n, n - most - 1, -1)))


def _from_disturbance(s: Stretch, keep: LowPass, observer: ObserverSettings) -> Motion | None:
    """By Jn a = u + Q^-1 d_hat; speed and position less the line that they drift along."""
    if (force := s.net_force(observer)) is None:
        return None
    a = keep(force) / observer.nominal_inertia
    velocity = _levelled(np.cumsum(a) * s.T, s.t)
    position = _levelled(np.cumsum(velocity) * s.T, s.t)
    return Motion(np.concatenate([a[1:], a[-1:]]), velocity, position, velocity, np.inf, keep.cutoff)


def _levelled(x: Array, t: Array) -> Array:
    centred = t - t.mean()
    return np.asarray(x - x.mean() - centred * (centred @ x) / max(float(centred @ centred), 1e-300))


def asked_for(s: Stretch, model: PlantModel, keep: LowPass) -> tuple[Stretch, Motion]:
    """The stretch with the u that the model needs along its reference, and the motion along that."""
    motion = along_reference(s, keep)
    idle = replace(s, u=np.zeros(s.t.size))
    u = model.motor_inertia * motion.acceleration - Frame(Log(motion.channels(idle), s.T)).net_force(model)
    ahead = round(model.delay / s.T)
    return replace(s, u=np.concatenate([u[ahead:], np.full(ahead, u[-1])])), motion


def in_two_stages(left: Array, slopes: Array, others: Array, along: Array) -> tuple[Array, Array, Array]:
    """(left, slopes, what the instruments explain of the slopes), beside `others`: see `parameters.judged`.

    Parameters
    ----------
    left, slopes, others : shapes (rows,), (rows, values), (rows, m); m may be 0.
    along : slopes and others along the reference, shape (rows, values + m).
    """
    basis = orthonormal(along)
    hat = basis @ (basis.T @ slopes)
    if not others.shape[1]:
        return left, slopes, hat
    explained = basis @ (basis.T @ others)
    both = np.column_stack([left, slopes])
    both = both - others @ np.linalg.lstsq(explained, both, rcond=None)[0]
    return both[:, 0], both[:, 1:], without(orthonormal(explained), hat)
