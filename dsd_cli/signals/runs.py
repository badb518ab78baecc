"""Runs of marked samples."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def runs(marks: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """(first, behind the last) of every run of marks that stand side by side; marks : shape (n,)."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], marks, [False]]).astype(np.int8))).tolist()
    return list(zip(edges[::2], edges[1::2], strict=True))
