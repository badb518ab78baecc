"""Does the label explain its window, or does it only explain it better than the other candidates?

A lead of so many nats counts every sample as independent evidence of standard deviation rho. What a model lacks (a
friction, a late sensor, an inertia off the grid) lasts for many samples, and a wrong candidate may then lead far. So
the lead of a confident label must hold after three corrections, each nothing where the model is right and rho is the
noise:

1. *The noise is what is left.* Of white noise the sums over m samples have the variance m rho^2, for every m. Where the
   residual of the label exceeds that on any time scale, the lead is divided by as much.
2. *No value between or beyond the candidates is much better.* What the best inertia and delay near the label would
   gain (the score test: two values, from the label's own residual) is subtracted from the lead. No other delay of the
   grid may explain the window better, by more than half a nat, when both have their best inertia.
3. *No force that the model lacks.* Where the motion is known, the label must stand with a constant, a viscous and a
   dry force of any size beside it: its lead, and all of the second correction. Until the labels of this recording were
   within the noise for some windows (trust.py).

The sums are of blocks, a sixteenth of the window each; a verdict stands for the next block. `_goodness.c` computes
them, numpy_goodness.py where there was no compiler.
"""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from dsd_cli.detect.kernel import Backend, active_backend
from dsd_cli.detect.spec import KernelSpec
from dsd_cli.detect.trust import BLOCKS
from dsd_cli.signals.compiled import compiled_module
from dsd_cli.signals.log import Array


class Goodness(Protocol):
    """Fed with y and z of every sample (`Engine.run`), it says which labels do not explain their window."""

    def restart(self) -> None:
        """Forget the window."""

    def unfounded(
        self, model: Array, state: NDArray[np.int32], confident: NDArray[np.bool_], forces: Array | None
    ) -> NDArray[np.bool_]:
        """Which confident labels of the next samples do not stand, shape (n,).

        Parameters
        ----------
        model : y and z, shape (n, 1 + groups); y is NaN where nothing is judged.
        forces : what unknown forces would do to y, shape (n, k).
        """


def make_goodness(spec: KernelSpec, window: int, forces: int, backend: Backend | None = None) -> Goodness:
    """The checks for these states.

    Parameters
    ----------
    window : samples that a label must explain, `BLOCKS` or more.
    forces : how many unknown forces each sample comes with.
    """
    found = compiled_module("dsd_cli.detect._goodness") if (backend or active_backend()) == "compiled" else None
    if found is not None:
        return CompiledGoodness(found.Goodness, spec, window, forces)
    from dsd_cli.detect.numpy_goodness import NumpyGoodness

    return NumpyGoodness(spec, window, forces)


class CompiledGoodness:
    """`_goodness.c` behind the interface of `Goodness`."""

    def __init__(self, compiled: Any, spec: KernelSpec, window: int, forces: int) -> None:
        grid, settings = spec.grid, spec.settings
        self._core = compiled(
            np.ascontiguousarray(spec.alphas, dtype=np.float64),
            len(grid.delays) * len(grid.combinations),
            max(window // BLOCKS, 1),
            forces,
            0.5 / settings.rho**2,
            settings.confidence,
            len(spec.alphas) > 1,
            len(grid.delays) > 1,
        )

    def restart(self) -> None:
        """Forget the window."""
        self._core.restart()

    def unfounded(
        self, model: Array, state: NDArray[np.int32], confident: NDArray[np.bool_], forces: Array | None
    ) -> NDArray[np.bool_]:
        """See `Goodness`."""
        wrong = np.empty(state.size, dtype=np.bool_)
        x = None if forces is None else np.ascontiguousarray(forces)
        columns = (np.ascontiguousarray(model), np.ascontiguousarray(state, dtype=np.int32))
        self._core.run(*columns, np.ascontiguousarray(confident), x, wrong)
        return wrong
