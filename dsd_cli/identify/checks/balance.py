"""The force balance u(t - L) = J a + what depends on the motion, in the band in which the acceleration is seen."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dsd_cli.identify.checks.band import Band, difference
from dsd_cli.identify.checks.stretches import LowPass, Stretch
from dsd_cli.signals.log import Array

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

    Parameters
    ----------
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
