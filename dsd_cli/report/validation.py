"""What a model is worth on a log that nobody fitted, in lines and as JSON."""

from __future__ import annotations

import math
from dataclasses import asdict
from typing import Any

from dsd_cli.identify.compare.forward import Tracking
from dsd_cli.identify.compare.versus import Validation
from dsd_cli.report.conclusions import CONTROLLER
from dsd_cli.report.names import estimates_json, force_error, number_or_none, values_text
from dsd_cli.signals.units import Units


def validation_lines(one: Validation, units: Units) -> list[str]:
    """Prediction, prediction with levels of its own, free simulation."""
    lines = [f"{one.log}, not fitted: {force_error(one.band_hz)} {one.rmse:.3g} {units.force}"]
    if math.isfinite(one.rmse_with_levels):
        lines[0] += f"; with levels of its own {one.rmse_with_levels:.3g} ({values_text(one.levels)})"
    if one.simulation is None:
        return [*lines, f"  no free simulation: {one.not_simulated}"]
    run = one.simulation
    off = [_off("open loop from the logged u", run.open_loop[0])]
    off += [_off("closed loop from the logged reference", run.closed_loop[0])] if run.closed_loop else []
    lines.append(f"  free simulation, {'; '.join(off)} (rms)")
    return [*lines, f"  {CONTROLLER}"] if run.of_controller else lines


def _off(how: str, main: Tracking) -> str:
    return f"{how}: {main.channel} {main.rmse:.3g} {main.unit} off"


def validation_json(one: Validation) -> dict[str, Any]:
    """The same."""
    run = one.simulation
    return {
        "log": one.log,
        "rmse": number_or_none(one.rmse),
        "rmse_with_levels": number_or_none(one.rmse_with_levels),
        "levels": estimates_json(one.levels),
        "simulation": None
        if run is None
        else {
            "open_loop": [asdict(x) for x in run.open_loop],
            "closed_loop": [asdict(x) for x in run.closed_loop] or None,
        },
        "no_simulation": one.not_simulated or None,
    }
