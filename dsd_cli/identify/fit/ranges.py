"""What recordings contain: speeds, travel, drive, noise."""

from __future__ import annotations

import numpy as np

from dsd_cli.effects import Ranges
from dsd_cli.identify.fit.equations import Equations
from dsd_cli.identify.policy import POLICY


def ranges(equations: Equations) -> Ranges:
    """What the recordings contain, for starting shapes."""
    logs = [s.log for s in equations.stretches]
    speeds = [s.mean.velocity[s.free > 0.0] for s in equations.stretches]
    speed = np.concatenate(speeds) if speeds else np.zeros(1)
    u = np.concatenate([log["u"] for log in logs])
    travel = max((float(np.ptp(log["position"])) for log in logs if "position" in log), default=0.0)
    way = max((float(np.sum(np.abs(np.diff(log["position"])))) for log in logs if "position" in log), default=0.0)
    moving = speed[np.isfinite(speed)]
    return Ranges(
        speed=float(np.sqrt(np.mean(moving**2))) if moving.size else 0.0,
        top_speed=float(np.abs(moving).max(initial=0.0)),
        travel=travel,
        drive=float(np.sqrt(np.mean(u**2))),
        top_drive=float(np.quantile(np.abs(u), POLICY.exercised)) if u.size else 0.0,
        sample_time=equations.sample_time,
        duration=sum(len(log) for log in logs) * equations.sample_time,
        resolution=POLICY.resolved_deviations * max(r.position_noise for r in equations.recordings),
        band_hz=equations.band.hz,
        passes=way / travel if travel > 0.0 else 0.0,
        cycle=max(r.cycle for r in equations.recordings),
        spike_drive=float(np.abs(u).max(initial=0.0)),
    )
