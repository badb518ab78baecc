"""What the picture of a diagnosis shows, as numbers: the residual, and what each effect that was found takes of it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dsd_cli.effects import Role, get_effect
from dsd_cli.errors import DataError
from dsd_cli.identify.fit.bank import Bank
from dsd_cli.identify.fit.equations import equations_of
from dsd_cli.identify.fit.values import coefficients_of, terms_of
from dsd_cli.identify.recordings.recording import Recording
from dsd_cli.identify.results import DELAY, INERTIA, Addition, Diagnosis
from dsd_cli.plant.model import PlantModel
from dsd_cli.report.verdict import candidate
from dsd_cli.signals.log import Array

#: Samples after the delay with which the first row begins: a row looks at one step of delay more.
_LATER = 50
#: Effects of the set that are shown beside the verdict's.
MOST_BESIDE = 3
#: Words of `Diagnosis.depends_on` that are channels of a log.
_CHANNELS = {"velocity": "velocity", "direction": "velocity", "position": "position", "u": "u", "time": "t"}


@dataclass(frozen=True)
class ResidualView:
    """The force that the model lacks (unit of u, in the band), against one channel; shape (n,). Friction is below 0
    where v is above.

    `explained` : what `effect` takes of it, None without one; `together` : what the whole set that was found takes,
    None where that is the effect alone. `way` : sign of the speed, None without one. `beside` : the effects that are in
    the model already.
    """

    on: str
    x: Array
    residual: Array
    effect: str = ""
    explained: Array | None = None
    together: Array | None = None
    way: Array | None = None
    beside: tuple[str, ...] = ()


def residual_views(result: Diagnosis, given: PlantModel, recordings: Sequence[Recording]) -> tuple[ResidualView, ...]:
    """The verdict's view: the residual of the model fitted along with its effect, but without it, against the channel
    that it needs; and one for each other effect of the set: what the others leave to it.

    Raises
    ------
    DataError : the recordings are too short for a balance.
    """
    winner = candidate(result, result.verdict)
    model = None if winner is None else winner.model
    without = result.model if winner is None or model is None else _without(model, winner.effect, given)
    others = [name for name in result.found if name != result.verdict]
    whole = result.whole_model if others else None
    rows = Rows(recordings, [m for m in (without, model, whole) if m is not None])
    residual = rows.balance(without)
    together = None if whole is None else residual - rows.balance(whole)
    if winner is None or model is None:
        first = rows.view(_channel(result, recordings), residual, together=together)
    else:
        explained = residual - rows.balance(model)
        on = _channel(result, recordings)
        first = rows.view(on, residual, effect=winner.effect, explained=explained, together=together)
    if whole is None:
        return (first,)
    return (first, *(rows.partial(whole, name, result.found, recordings) for name in others[:MOST_BESIDE]))


def addition_view(result: Addition, given: PlantModel, recordings: Sequence[Recording]) -> ResidualView:
    """Residual of the model with the effect but for it, against the channel it needs, and what the effect takes of it.

    Raises
    ------
    DataError : the recordings are too short for a balance.
    """
    without = _without(result.model, result.effect, given)
    rows = Rows(recordings, [result.model, without])
    residual = rows.balance(without)
    explained = residual - rows.balance(result.model)
    on = _first_of(["u"] if result.effect in (INERTIA, DELAY) else _needs(result.effect), recordings)
    return rows.view(on, residual, effect=result.effect, explained=explained)


class Rows:
    """The rows of the recordings that count, for models of any delay up to theirs."""

    def __init__(self, recordings: Sequence[Recording], models: Sequence[PlantModel]) -> None:
        latest = max(model.delay for model in models)
        self.equations = equations_of(recordings, math.ceil(latest / recordings[0].sample_time) + _LATER)
        if not self.equations.stretches:
            raise DataError(f"{recordings[0].name}: too short for a picture", "log longer")
        self.bank, self.kept = Bank(self.equations), self.equations.kept

    def of(self, channel: str) -> Array:
        """A channel at the rows that count."""
        stretches = self.equations.stretches
        return np.asarray(self.equations.of_rows([stretch.log[channel] for stretch in stretches])[self.kept])

    def balance(self, model: PlantModel) -> Array:
        """r = J a - u_eff(t - L) - sum f_k of the rows that count: a missing force with its own sign."""
        terms = terms_of(model)
        tap, theta = coefficients_of(model, terms, self.bank.tap_time)
        drive, *columns = self.bank.design(terms, tap).rows
        return np.asarray(theta @ np.stack(columns) - drive)[self.kept]

    def view(self, on: str, residual: Array, **more: object) -> ResidualView:
        """Against that channel."""
        moving = all("velocity" in stretch.log for stretch in self.equations.stretches)
        way = np.sign(self.of("velocity")) if moving else None
        return ResidualView(on, self.of(on), residual, way=way, **more)  # type: ignore[arg-type]

    def partial(
        self, whole: PlantModel, effect: str, found: Sequence[str], recordings: Sequence[Recording]
    ) -> ResidualView:
        """What all others of the set leave, and what this one takes of it."""
        residual = self.balance(_without(whole, effect, whole))
        beside = tuple(name for name in found if name != effect)
        on = _first_of(_needs(effect), recordings)
        return self.view(on, residual, effect=effect, explained=residual - self.balance(whole), beside=beside)


def _without(model: PlantModel, effect: str, given: PlantModel) -> PlantModel:
    if effect in (INERTIA, DELAY):
        return model.changed(**{effect: getattr(given, effect)})
    rest = {name: values for name, values in model.effects.items() if name != effect}
    return PlantModel(model.inertia, model.delay, rest, model.rest_speed)


def _needs(name: str) -> list[str]:
    effect = get_effect(name)
    return [*effect.needs, *(["u"] if effect.role in (Role.INPUT, Role.STRUCTURE) else [])]


def _channel(result: Diagnosis, recordings: Sequence[Recording]) -> str:
    """The channel that the verdict's effect looks at; for a remainder without name, the first that it depends on."""
    if result.verdict in (INERTIA, DELAY):
        return _first_of(["u"], recordings)
    if candidate(result, result.verdict) is not None:
        return _first_of(_needs(result.verdict), recordings)
    return _first_of([_CHANNELS[word] for word in result.depends_on if word in _CHANNELS], recordings)


def _first_of(wanted: Sequence[str], recordings: Sequence[Recording]) -> str:
    logs = [piece for recording in recordings for piece in recording.pieces]
    return next((name for name in wanted if all(name in log for log in logs)), "t")
