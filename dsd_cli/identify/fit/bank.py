"""Columns of effects as rows of the equations, each made once and found again by what it is."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from dsd_cli.effects import Effect, Ranges, Role, Shape, get_effect
from dsd_cli.identify.fit.rows import Equations
from dsd_cli.signals.log import Array


@dataclass(frozen=True)
class Term:
    """An effect with given shape parameters: its coefficients are what a fit solves for."""

    id: str
    items: tuple[tuple[str, Any], ...] = ()

    @classmethod
    def of(cls, effect_id: str, shape: Shape) -> Term:
        """From a mapping."""
        return cls(effect_id, tuple(sorted(shape.items())))

    @property
    def shape(self) -> dict[str, Any]:
        """The shape parameters by name."""
        return dict(self.items)

    @property
    def effect(self) -> Effect:
        """The effect itself."""
        return get_effect(self.id)


#: Effects of one model; those that change the command act in this order.
Terms = tuple[Term, ...]


def inputs_of(terms: Iterable[Term]) -> Terms:
    """The effects that change the command."""
    return tuple(t for t in terms if t.effect.role is Role.INPUT)


class Bank:
    """Rows of drive and effects, each made once.

    The drive stands in it by whole samples of delay ("taps"); a delay between two taps mixes them.
    """

    def __init__(self, equations: Equations) -> None:
        self.equations = equations
        self.y = equations.measured()
        self._known: dict[Any, list[Array]] = {}

    def drive(self, inputs: Terms, tap: int, keep: bool = True) -> Array:
        """The command after these input effects, `tap` samples late."""
        key = (inputs, tap)
        if key in self._known:
            return self._known[key][0]
        made = self.equations.rows(drive(self.equations, inputs, tap))
        if keep:
            self._known[key] = [made]
        return made

    def columns(self, term: Term, tap: int, keep: bool = True) -> list[Array]:
        """An effect on the plant, a column per coefficient; `tap`: delay of the u that reaches it, samples."""
        key = (term, tap if "u" in term.effect.needs else None)
        if key in self._known:
            return self._known[key]
        made = [self.equations.rows(raw) for raw in raw_columns(self.equations, term, tap)]
        if keep:
            self._known[key] = made
        return made


def drive(equations: Equations, inputs: Terms, tap: int) -> list[Array]:
    """The command after these input effects, `tap` samples late: mean per interval, by stretch."""
    found = []
    for s in equations.stretches:
        command = s.log["u"]
        for term in inputs:
            command = s.frame.changed_command(term.id, term.shape, command)
        found.append(s.frame.mean_u(command, tap * s.log.sample_time))
    return found


def raw_columns(equations: Equations, term: Term, tap: int) -> list[list[Array]]:
    """Force on the plant per unit of each coefficient, per interval: [coefficient][stretch]."""
    effect, by_stretch = term.effect, []
    unused = [s.log["u"] for s in equations.stretches]
    for s, u in zip(equations.stretches, drive(equations, (), tap) if "u" in effect.needs else unused, strict=True):
        columns, _ = effect.run(s.channels(u), term.shape)
        scale: Any = 1.0
        if effect.role is Role.FRICTION:
            scale = -s.sign
        elif effect.role is Role.STRUCTURE:
            scale = -equations.observer.nominal_inertia
        by_stretch.append([np.nan_to_num(scale * np.broadcast_to(c, len(u))) for c in columns])
    return [list(column) for column in zip(*by_stretch, strict=True)]


def ranges(equations: Equations) -> Ranges:
    """What the recordings contain, for starting shapes."""
    logs = [s.log for s in equations.stretches]
    speeds = [s.motion.velocity[s.keep > 0.0] for s in equations.stretches]
    speed = np.concatenate(speeds) if speeds else np.zeros(1)
    u = np.concatenate([log["u"] for log in logs])
    travel = max((float(np.ptp(log["position"])) for log in logs if "position" in log), default=0.0)
    moving = speed[np.isfinite(speed)]
    return Ranges(
        speed=float(np.sqrt(np.mean(moving**2))) if moving.size else 0.0,
        top_speed=float(np.abs(moving).max(initial=0.0)),
        travel=travel,
        drive=float(np.sqrt(np.mean(u**2))),
        top_drive=float(np.abs(u).max(initial=0.0)),
        sample_time=equations.sample_time,
        duration=sum(len(log) for log in logs) * equations.sample_time,
    )
