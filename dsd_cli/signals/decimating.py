"""A finite impulse response of which every few samples one value is taken, as products of matrices."""

from __future__ import annotations

import numpy as np

from dsd_cli.signals.log import Array

#: Values that are made at once, so that they stay at hand.
_CHUNK = 4096
#: Samples, and values, of a group at most.
_SAMPLES, _VALUES = 48, 16


def in_groups(taps: Array, step: int) -> Array:
    """The taps, each `step` samples anew, of a group of values in pieces as long as the group steps over.

    Shape (pieces, values, samples). Values that are a few samples apart make a group, others one each: a product of a
    few columns is slow.
    """
    values = min(max(_SAMPLES // step, 1), _VALUES)
    width = values * step
    pieces = -(-(width - step + len(taps)) // width)
    found = np.zeros((values, pieces * width))
    for i in range(values):
        found[i, i * step : i * step + len(taps)] = taps
    return np.ascontiguousarray(found.reshape(values, pieces, width).swapaxes(0, 1))


def decimated(x: Array, groups: Array, count: int) -> Array:
    """`count` values, shape (count,): the taps of `in_groups` times x, finite, from each step on, 0 behind its end."""
    pieces, values, width = groups.shape
    every, flat = -(-count // values), groups.reshape(pieces * values, width)
    used = np.zeros((every + pieces - 1) * width)
    used[: len(x)] = x[: len(used)]
    samples, found = used.reshape(-1, width), np.empty((every, values))
    for i in range(0, every, _CHUNK // values):
        own = samples[i : min(i + _CHUNK // values, every) + pieces - 1]
        room = np.empty(pieces * (values * len(own) + 1))
        product, room[-pieces:] = room[:-pieces].reshape(len(flat), -1), 0.0
        np.matmul(flat, own.T, out=product)
        made = room.reshape(pieces, -1)[:, :-1].sum(axis=0).reshape(values, -1)  # piece k is that of k groups later
        found[i : i + len(own) - pieces + 1] = made[:, : len(own) - pieces + 1].T
    return np.asarray(found.reshape(-1)[:count])
