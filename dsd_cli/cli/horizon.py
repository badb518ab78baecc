"""`--horizon` of `dsd compare`: predict, simulate the whole log, or begin the simulation anew every so many seconds."""

from __future__ import annotations

import math
from typing import Annotated

import typer

from dsd_cli.errors import UsageError

#: Horizons that are words.
PREDICTION, SIMULATION = "prediction", "simulation"
#: s per unit that may be written behind a number; the longer ones first.
_UNITS = {"ms": 1e-3, "us": 1e-6, "min": 60.0, "s": 1.0}

HorizonOption = Annotated[
    str,
    typer.Option(
        "--horizon",
        metavar="prediction|simulation|SECONDS",
        help="Predict d_hat from u and the measured motion, or simulate the motion from u: over the whole log, or "
        "begun anew from the measured motion every so many seconds (0.5s, 50ms).",
    ),
]


def seconds_of(horizon: str) -> float | None:
    """None for a prediction, inf for a simulation of the whole log, else s.

    Raises
    ------
    UsageError : a word or number that is none.
    """
    if horizon in (PREDICTION, SIMULATION):
        return None if horizon == PREDICTION else math.inf
    unit = next((unit for unit in _UNITS if horizon.endswith(unit)), "")
    try:
        seconds = float(horizon.removesuffix(unit)) * _UNITS.get(unit, 1.0)
    except ValueError:
        what = "write prediction, simulation, or a time such as 0.5s or 50ms"
        raise UsageError(f"--horizon {horizon}", what) from None
    if math.isinf(seconds):
        raise UsageError(f"--horizon {horizon}", "write simulation for the whole log")
    if not seconds > 0.0:
        raise UsageError(f"--horizon {horizon}", "must be above 0 s")
    return seconds
