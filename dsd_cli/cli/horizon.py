"""`--horizon` of `dsd compare`: predict, simulate the whole log, or begin the simulation anew every so many seconds."""

from __future__ import annotations

import math
import re
from typing import Annotated

import typer

from dsd_cli.errors import UsageError

#: Horizons that are words.
PREDICTION, SIMULATION = "prediction", "simulation"
#: s per unit that somebody may write.
_UNITS = {"ms": 1e-3, "us": 1e-6, "min": 60.0}

HorizonOption = Annotated[
    str,
    typer.Option(
        "--horizon",
        metavar="prediction|simulation|SECONDS",
        help="Predict d_hat from u and the measured motion, or simulate the motion from u: over the whole log, or "
        "begun anew from the measured motion every so many seconds (0.5s).",
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
    try:
        seconds = float(horizon.removesuffix("s"))
    except ValueError:
        raise UsageError(f"--horizon {horizon}", _meant(horizon)) from None
    if math.isinf(seconds):
        raise UsageError(f"--horizon {horizon}", "write simulation for the whole log")
    if not seconds > 0.0:
        raise UsageError(f"--horizon {horizon}", "must be above 0 s")
    return seconds


def _meant(horizon: str) -> str:
    found = re.fullmatch(r"(\d+\.?\d*)\s*(ms|us|min)", horizon)
    return (
        f"write {float(found[1]) * _UNITS[found[2]]:g}s"
        if found
        else "write prediction, simulation, or seconds such as 0.5s"
    )
