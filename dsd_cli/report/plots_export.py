"""The picture of `dsd export --plot`: the exported model where it was run, beside `dsd simulate`."""

from __future__ import annotations

from typing import Any

import numpy as np

from dsd_cli.export.making import Verified
from dsd_cli.report.figure import MEASURED, PREDICTED, RESIDUAL, channel_label, headline, legend_above, line, sheet
from dsd_cli.signals.units import Units

#: Where a target is run, if by another name than its own.
_WHERE = {"mjcf": "MuJoCo", "urdf": "MuJoCo, from URDF"}


def draw(checked: Verified, target: str, units: Units) -> Any:
    """The figure: the command, both speeds, and what they are off."""
    t = np.arange(len(checked.u), dtype=np.float64) * checked.sample_time
    figure = sheet(11.0, 7.0)
    command, speed, off = figure.subplots(3, 1, sharex=True, height_ratios=[0.8, 1.6, 0.8])
    where = _WHERE.get(target, target)
    headline(figure, f"the model in {where}: its speed is {checked.rms_percent:.2g} % (rms) off `dsd simulate`", 110)
    line(command, t, checked.u, MEASURED)
    command.set_ylabel(channel_label("u", units))
    line(speed, t, checked.wanted, MEASURED, "dsd simulate", lw=2.5, alpha=0.6)
    line(speed, t, checked.found, PREDICTED, where, linestyle="--")
    speed.set_ylabel(channel_label("velocity", units))
    legend_above(speed, 2)
    line(off, t, checked.found - checked.wanted, RESIDUAL)
    off.set_ylabel("difference")
    off.set_xlabel(f"time (s), under {checked.how}")
    figure.align_ylabels()
    return figure
