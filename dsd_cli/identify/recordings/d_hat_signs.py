"""Whether a logged d_hat has the sign that u and the logged motion give it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from dsd_cli.errors import DataError
from dsd_cli.identify.policy import POLICY
from dsd_cli.plant.filtering import SETTLED
from dsd_cli.plant.model import ObserverSettings
from dsd_cli.plant.observer import observe_log
from dsd_cli.plant.prediction import Frame
from dsd_cli.signals.log import Array, Log


def check_signs(pieces: Sequence[Log], observer: ObserverSettings, name: str) -> None:
    """A logged d_hat must be Q { Jn a } - Q u with the a of the logged motion.

    Raises
    ------
    DataError : a sign is wrong, as far as noise lets it be seen.
    """
    if not any(channel in pieces[0] for channel in ("velocity", "position")):
        return
    d_hat, force, drive = (np.concatenate(parts) for parts in zip(*(_sides(p, observer) for p in pieces), strict=True))
    x = np.stack([force, drive])
    (g, h), *_ = np.linalg.lstsq(x.T, d_hat, rcond=None)
    variance = POLICY.correlated_samples * float(np.mean((d_hat - g * force - h * drive) ** 2))
    errors = np.sqrt(np.maximum(variance * np.diag(np.linalg.pinv(x @ x.T)), 1e-300))
    if (g > 0.0 > h) or min(abs(g) / errors[0], abs(h) / errors[1]) < POLICY.clear_signs:
        return
    if g < 0.0 < h:
        raise DataError(f"{name}: d_hat has the other sign than its velocity or position", "set observer.sign")
    wrong, key = ("velocity or position", "velocity_scale, position_scale") if g < 0.0 else ("u", "u_sign")
    raise DataError(
        f"{name}: {wrong} has the other sign than the other channels", f"turn the sign of {wrong} in [signals]: {key}"
    )


def _sides(piece: Log, observer: ObserverSettings) -> tuple[Array, Array, Array]:
    """(d_hat, Q { Jn a } from the motion, Q u), without the samples in which they settle."""
    motion = {name: x for name, x in piece.channels.items() if name != "d_hat"}
    if piece.d_hat_source == "position" and "position" in motion:
        motion.pop("velocity", None)
    bare = replace(piece, channels=motion, d_hat_source="logged")
    observed = observe_log(bare, observer)
    frame = Frame(observed)
    drive = frame.seen(frame.mean_u(piece["u"], 0.0), observer)
    first = min(int(SETTLED * observer.time_constant / piece.sample_time) + 3, len(piece) // 2)
    return piece["d_hat"][first:], (observed["d_hat"] + drive)[first:], drive[first:]
