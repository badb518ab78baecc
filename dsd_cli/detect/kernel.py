"""Which kernel runs: the compiled one where the build had a compiler, else its NumPy twin."""

from __future__ import annotations

import os
from typing import Any, Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from dsd_cli.detect.spec import KernelSpec
from dsd_cli.errors import UsageError
from dsd_cli.signals.compiled import compiled_module
from dsd_cli.signals.log import Array

Backend = Literal["compiled", "numpy"]


class Kernel(Protocol):
    """One detector: `step` takes one sample, `run` many; both give the same bits in any mixture."""

    def step(self, u: float, d_hat: float, /) -> tuple[int, float, float, bool]: ...

    def run(self, *buffers: Any) -> None: ...

    def restart(self) -> None: ...


def _compiled_class() -> Any | None:
    if os.environ.get("DSD_KERNEL") == "numpy":
        return None
    return getattr(compiled_module("dsd_cli.detect._kernel"), "Kernel", None)


def active_backend() -> Backend:
    """`compiled`, or `numpy` where there was no compiler (or DSD_KERNEL=numpy)."""
    return "numpy" if _compiled_class() is None else "compiled"


def make_kernel(spec: KernelSpec, backend: Backend | None = None) -> Kernel:
    """The kernel for these states; `backend=None` takes the fastest there is.

    Noise that is not white is made white between prediction and likelihood: the NumPy kernel alone has that.
    """
    backend = "numpy" if spec.settings.sensor_noise else backend
    compiled = None if backend == "numpy" else _compiled_class()
    if compiled is None and backend == "compiled":
        raise UsageError("no compiled kernel in this installation", "leave backend out, or install with a compiler")
    if compiled is None:
        from dsd_cli.detect.numpy_kernel import NumpyKernel

        return NumpyKernel(spec)
    return _make_compiled(compiled, spec)


def likelihoods(kernel: Kernel, spec: KernelSpec, inputs: tuple[Any, ...]) -> tuple[Array, NDArray[np.uint8]]:
    """log p over its window of every state, shape (n, states), and what each row rests on (WARMUP, PARTIAL, FULL).

    inputs : u, d_hat, t and the three columns of `Forces` of the next samples; None where there are none.
    """
    n = len(inputs[0])
    found, status = np.empty((n, len(spec.grid))), np.empty(n, dtype=np.uint8)
    buffers = tuple(None if one is None else np.ascontiguousarray(one) for one in inputs)
    kernel.run(*buffers, found, np.empty(n, dtype=np.int32), np.empty(n), np.empty(n), status, None)
    return found, status


def _make_compiled(compiled: Any, spec: KernelSpec) -> Kernel:
    grid, settings, transition = spec.grid, spec.settings, spec.settings.transition
    axes = grid.axis_indices()
    log_a = None if transition.matrix is None else np.ascontiguousarray(transition.log_matrix(len(grid)))
    mode = 0 if transition.uniform else 1 if log_a is None else 2
    stay, move = (0.0, 0.0) if log_a is not None else transition.log_stay_move(len(grid))
    return compiled(
        np.array(grid.delays),
        np.ascontiguousarray(spec.alphas),
        np.ascontiguousarray(axes),
        log_a,
        len(grid.delays),
        len(grid.combinations),
        len(grid.inertias),
        len(axes),
        settings.window,
        spec.warmup_rows,
        int(spec.timed),
        int(settings.observer_filter),
        spec.aperture,
        mode,
        spec.sample_time,
        spec.time_constant,
        spec.warmup_time,
        spec.sign,
        settings.rho,
        spec.log_likelihood_constant,
        spec.log_likelihood_floor,
        settings.hold,
        settings.confidence,
        stay,
        move,
        settings.initial,
    )
