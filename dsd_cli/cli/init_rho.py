"""rho of a proposed config: how far d_hat strays from what inertia and delay predict, and whether that is noise."""

from __future__ import annotations

import numpy as np

from dsd_cli.cli.init_proposal import Proposal
from dsd_cli.files.logs import LoadedLog
from dsd_cli.plant.model import ObserverSettings, PlantModel
from dsd_cli.plant.observer import observe_log
from dsd_cli.plant.prediction import predict_d_hat
from dsd_cli.signals.log import Array
from dsd_cli.signals.spread import rms

#: rho, as a multiple of what the first model leaves; and at least, as a share of u: no sensor is better than that.
RHO_OF_LEFT, RHO_LEAST = 1.5, 0.002
#: What is left is a force and no noise, if it is more than this share of u, and its means over a window are more than
#: this share of it: of white noise behind Q they are a third.
SHARE_OF_U, SLOW = 0.1, 0.6


def put_rho(loaded: LoadedLog, model: PlantModel, observer: ObserverSettings, window: int, out: Proposal) -> None:
    """rho, and whether a force is missing, which then hides what delays and inertias differ by; `window`: samples."""
    error = _error(loaded, model, observer)
    size, spread = np.abs(error), float(np.std(loaded.log["u"]))
    left = rms(size[size <= np.quantile(size, 0.95)]) if size.size else 0.0
    if not 0.0 < left < spread:  # more is no fit at all
        return
    rho = float(f"{max(RHO_OF_LEFT * left, RHO_LEAST * spread):.3g}")
    why = f"{RHO_OF_LEFT:g} times what inertia and delay leave"
    means = error[: error.size // window * window].reshape(-1, window).mean(axis=1)
    if left > SHARE_OF_U * spread and rms(means) > SLOW * rms(error):
        why += ", wide because [model] lacks a force: run dsd improve LOG --states before dsd detect"
    out.put("detector", "rho", rho, why)


def _error(loaded: LoadedLog, model: PlantModel, observer: ObserverSettings) -> Array:
    """d_hat around the prediction of that model, unit of u."""
    log = loaded.log
    observed = log if "d_hat" in log and not ("velocity" in log or "position" in log) else observe_log(log, observer)
    error: Array = observed["d_hat"] - predict_d_hat(model, observed, observer)
    return error[np.isfinite(error)]
