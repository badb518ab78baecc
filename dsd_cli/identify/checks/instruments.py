"""The reference as instrument: values that the noise which a controller answers does not bend.

A controller puts the noise of its sensor into u, and least squares of u on the motion takes that for an answer of the
axis: inertia and delay lean. The motion that was asked for drives both and has none of that noise: the same columns
along the reference are instruments (two-stage least squares, as IDIM-IV of Janot, Vandanjon and Gautier, 2014). Where
the reference explains little of the motion, errors are large and values not wrong.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from dsd_cli.identify.checks.balance import orthonormal, without
from dsd_cli.identify.checks.lowpass import LowPass
from dsd_cli.identify.checks.motion import Motion, along_reference
from dsd_cli.identify.checks.stretches import Stretch
from dsd_cli.plant.model import PlantModel
from dsd_cli.plant.prediction import Frame
from dsd_cli.signals.log import Array, Log


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
