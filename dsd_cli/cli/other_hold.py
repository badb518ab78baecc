"""Whether what stays unexplained is how u was logged between its samples: held, or sampled as a continuous signal.

A u that was sampled and is taken as held is u of half a sample earlier, and what it does within a sample is lost: that
goes with u, the speed and the jerk, as if a gain or a friction were missing.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from dsd_cli.cli.identification import Given
    from dsd_cli.identify.recordings.recording import Recording
    from dsd_cli.identify.results import Diagnosis
    from dsd_cli.plant.model import PlantModel

#: What is unexplained is asked about from this probability on, and the power that is left must fall to this share.
_RATHER, _FALLS_TO = 0.5, 0.5


def said_of_hold(given: Given, logs: Sequence[str], found: Diagnosis) -> tuple[str, ...]:
    """A piece of advice, where the model that was found leaves much less of the logs with the other u_hold."""
    from dsd_cli.cli.recordings import load_recording

    settings, held = given.settings, given.settings.signals.u_hold == "held"
    asked = found.unexplained.probability >= _RATHER and not found.blocked and "-" not in logs
    logged = any(one.provenance["d_hat"].startswith("logged") for one in given.recordings)
    if not asked or logged or settings.says("signals.u_hold"):
        return ()
    other = "sampled" if held else "held"
    changed = settings.override([f"signals.u_hold={other}"])
    again = tuple(load_recording(path, changed).recording for path in logs)
    reached = found.whole_model or found.model
    now, then = (_left(given, recordings, reached) for recordings in (given.recordings, again))
    if not then**2 < _FALLS_TO * now**2:
        return ()
    what = f"with all that was found and u as {other} the held-out error is {then:.3g}, not {now:.3g}"
    return (f'signals.u_hold = "{other}"? {what}: set it and ask again',)


def _left(given: Given, recordings: tuple[Recording, ...], reached: PlantModel) -> float:
    """Held-out force error with all values of a model fitted to these recordings."""
    from dsd_cli.identify.final_fit import ended

    return next(ended(recordings, given.model, reached, given.engine_settings)).score.heldout_rmse
