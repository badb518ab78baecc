"""`--states`: the detector's candidates, its rho and the nominal inertia of a config, after its model was fitted anew.

A grid that was laid around another model does not have the delay and the inertia that were found, and a rho of a model
that lacked friction is no measure of what this one leaves.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from dsd_cli.cli.init_rho import RHO_LEAST, RHO_OF_LEFT
from dsd_cli.errors import DataError
from dsd_cli.files.config import Config, Observer
from dsd_cli.identify.compare.evaluation import evaluate
from dsd_cli.plant.model import PlantModel

if TYPE_CHECKING:
    from dsd_cli.cli.identification import Given

#: Errors up to this share count: the loudest are those of stops and spikes.
_QUIETEST = 0.95
#: Digits of what is written, and share of a value by which a candidate may be off it.
_DIGITS, _NEAR = 4, 1e-3
#: Share of the least step between candidates by which the nearest one may be off a value that it serves as well as.
_SERVES = 0.1
#: Times what suits the model up to which a rho labels as well: it is asked for 1 to 2 times what a model leaves.
_RHO_SUITS = 2.0

Path = tuple[str, ...]


@dataclass(frozen=True)
class Refreshed:
    """Keys of the config with their new values, and a sentence that says them; both empty where nothing changes."""

    values: Mapping[Path, Any]
    said: str


def put_states(text: str, given: Given, model: PlantModel, wanted: bool) -> tuple[str, str]:
    """The text of the config with what `--states` refreshes, and what to say of it; unchanged where nobody `wanted` it.

    Raises
    ------
    DataError : see `evaluate`. UsageError : a key is written in a way that cannot be changed in place.
    """
    from dsd_cli.files.config.values_edit import with_keys

    if not wanted:
        return text, lacking(given.settings, given, model)
    new = refreshed(given.settings, given, model)
    return (with_keys(text, new.values), f"refreshed: {new.said}") if new.values else (text, "")


def lacking(config: Config, given: Given, model: PlantModel) -> str:
    """What of a model [states] and rho do not have, as one line with the way to mend it; "" if nothing."""
    if config.states is None:
        return ""
    grids = ("delay", model.delay, config.states.delays), ("inertia", model.inertia, config.states.inertias)
    missing = [f"{name} {value:.4g}" for name, value, grid in grids if not _serves(grid, value)]
    what = "is no candidate" if len(missing) == 1 else "are no candidates"
    said = [f"{' and '.join(missing)} of [model] {what} of [states]"] if missing else []
    rho = suits = config.detector.rho
    with suppress(DataError):  # of a log that is too short for d_hat the fit may be good all the same
        suits = _rho(given, model, 1.0)
    if max(rho, suits) > _RHO_SUITS * min(rho, suits):
        said.append(f"detector.rho = {rho:g} does not suit what the model leaves now ({suits:g} does)")
    return f"{', and '.join(said)}: --states mends that" if said else ""


def refreshed(config: Config, given: Given, model: PlantModel) -> Refreshed:
    """[states], rho, the initial state and Jn for that model: each axis keeps its spacing, and gets the model's value.

    Jn stays where a d_hat was logged: it is that of the observer which made it.

    Raises
    ------
    DataError : see `evaluate`.
    """
    if config.states is None:
        return Refreshed({}, "")
    observer = config.require(Observer)
    values: dict[Path, Any] = {}
    own = not given.recordings[0].provenance.get("d_hat", "").startswith("logged")
    jn = _rounded(model.inertia) if own else observer.nominal_inertia
    delays = with_delay(config.states.delays, model.delay)
    inertias = with_inertia(config.states.inertias, model.inertia)
    rho = _rho(given, model, jn / observer.nominal_inertia)
    for path, before, after in (
        (("observer", "nominal_inertia"), observer.nominal_inertia, jn),
        (("states", "delays"), config.states.delays, delays),
        (("states", "inertias"), config.states.inertias, inertias),
        (("detector", "rho"), config.detector.rho, rho),
    ):
        if before != after:
            values[path] = after
    if (initial := config.detector.initial) is not None and {"delays", "inertias"} & {path[1] for path in values}:
        delay = delays[config.states.delays.index(_nearest(config.states.delays, initial.delay))]
        inertia = inertias[config.states.inertias.index(_nearest(config.states.inertias, initial.inertia))]
        values["detector", "initial"] = {"delay": delay, "inertia": inertia}
    return Refreshed(values, ", ".join(f"{'.'.join(path)} = {_text(value)}" for path, value in values.items()))


def with_delay(delays: Sequence[float], found: float) -> tuple[float, ...]:
    """The candidates with the delay that was found in place of the nearest one."""
    near = _nearest(delays, found)
    return tuple(delays) if _has(delays, found) else tuple(_rounded(found) if one == near else one for one in delays)


def with_inertia(inertias: Sequence[float], found: float) -> tuple[float, ...]:
    """The candidates in the same ratios, the nearest one at the inertia that was found."""
    near = min(inertias, key=lambda one: abs(math.log(one / found)))
    if _has((near,), found):
        return tuple(inertias)
    return tuple(_rounded(found if one == near else one * found / near) for one in inertias)


def _rho(given: Given, model: PlantModel, scale: float) -> float:
    """What the model leaves of d_hat, the loudest apart; the error of d_hat is in proportion to Jn."""
    found = evaluate(given.recordings, model, given.observer)
    left, u = np.abs(found.pooled(lambda s: s.errors)), found.pooled(lambda s: s.judged(s.log["u"]))
    rms = float(np.sqrt(np.mean(left[left <= np.quantile(left, _QUIETEST)] ** 2)))
    return float(f"{max(RHO_OF_LEFT * rms * scale, RHO_LEAST * float(np.std(u))):.3g}")


def _has(grid: Sequence[float], value: float) -> bool:
    return any(math.isclose(one, value, rel_tol=_NEAR, abs_tol=1e-9) for one in grid)


def _serves(grid: Sequence[float], value: float) -> bool:
    """Whether a candidate is so near that labels are the same."""
    steps = np.diff(np.sort(grid))
    return _has(grid, value) or (steps.size > 0 and abs(_nearest(grid, value) - value) < _SERVES * float(steps.min()))


def _nearest(grid: Sequence[float], value: float) -> float:
    return min(grid, key=lambda one: abs(one - value))


def _rounded(value: float) -> float:
    return float(f"{value:.{_DIGITS}g}")


def _text(value: Any) -> str:
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{name} = {one:g}" for name, one in value.items()) + " }"
    return f"[{', '.join(f'{one:g}' for one in value)}]" if isinstance(value, tuple) else f"{value:g}"
