"""The plant J a = w + F - friction forward in time, exact where forces are piecewise constant.

Applied forces that depend on motion are taken at the midpoint of a substep (error O(h^2)). Within a substep all forces
are constant, so the instant of a stop is solved exactly; from rest the plant moves only if the force exceeds the
friction budget. Nothing chatters.

Effects with memory are asked for their mean force over the substep that lies ahead, from the state in which it begins;
once the plant has moved, their state is brought up to date with the motion that it really made.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from dsd_cli.effects import Channels, Effect, Role, Shape, get_effect
from dsd_cli.plant.model import EffectValues, PlantModel

#: Substeps of a stretch of constant u when applied forces depend on motion or time.
SUBSTEPS = 2
#: And when effects have memory.
SUBSTEPS_WITH_MEMORY = 4
#: A substep is at most this long, in radians of the resonance of motor against load.
RESONANCE_STEP = 0.05


class Acting(NamedTuple):
    """An effect with its values: force = factors x columns."""

    effect: Effect
    factors: tuple[float, ...]
    shape: Shape

    def force(self, channels: Channels, state: Any) -> float:
        """In the innermost loop of a simulation, and so without what `Effect.run` packs for arrays."""
        effect, factors, shape = self
        columns = effect.columns(channels, shape, state)[0] if effect.memory else effect.columns(channels, shape)
        if len(factors) == 1:
            return factors[0] * float(columns[0])
        force = 0.0
        for factor, column in zip(factors, columns, strict=True):
            force += factor * float(column)
        return force


class Plant:
    """Position (rad or m) and velocity of a plant, that is of its motor; `advance` moves it. resonance : rad/s, of the
    motor against the load that is stiffest, 0 without any."""

    def __init__(self, model: PlantModel, position: float = 0.0, velocity: float = 0.0) -> None:
        self.position = position
        self.velocity = velocity
        self._states: dict[str, Any] = {}
        self.set(model)

    def set(self, model: PlantModel) -> None:
        """From now on the plant is that one (its delay is the caller's business); what effects remember stays."""
        self.inertia = model.motor_inertia
        self._applied = [
            *_acting(model.effects, Role.APPLIED, model.inertia),
            *_acting(model.effects, Role.STRUCTURE, model.inertia),
        ]
        self._friction = _acting(model.effects, Role.FRICTION, model.inertia)
        self._varying = bool(self._applied or self._friction)
        self._with_memory = [acting for acting in (*self._applied, *self._friction) if acting.effect.memory]
        loads = [acting for acting in self._applied if acting.effect.role is Role.STRUCTURE]
        self.resonance = max((_resonance(load, model) for load in loads), default=0.0)
        states, self._states = self._states, {}
        for acting in self._with_memory:
            now = Channels(0.0, 0.0, self.velocity, self.position)
            started = acting.effect.run(now, acting.shape)[1]
            self._states[acting.effect.id] = states.get(acting.effect.id, started)

    def acceleration(self, t: float, u: float) -> float:
        """a at this instant under the delayed u; 0 where friction holds."""
        force, budget = self._forces(t, u, self.velocity, self.position)
        return self._net(force, budget) / self.inertia

    def advance(self, t: float, u: float, duration: float) -> None:
        """Over `duration` (s) from t (s) under a constant delayed u."""
        if not self._varying:
            self._move(*self._forces(t, u, self.velocity, self.position), duration)
            return
        substeps = self._substeps(duration)
        h = duration / substeps
        for i in range(substeps):
            self._substep(t + i * h, u, h)

    def _substep(self, start: float, u: float, h: float) -> None:
        """Over h (s) from `start` (s), at the forces of its midpoint."""
        velocity, position = self.velocity, self.position
        a = self.acceleration(start, u)
        speed = velocity + 0.5 * h * a
        place = position + 0.5 * h * (velocity + 0.25 * h * a)
        self._move(*self._forces(start + 0.5 * h, u, speed, place, h), h)
        if self._with_memory and h > 0.0:
            moved = self.position - position
            self._remember(Channels(start + 0.5 * h, u, moved / h, position + 0.5 * moved, h))

    def _substeps(self, duration: float) -> int:
        if not self._with_memory:
            return SUBSTEPS
        return max(SUBSTEPS_WITH_MEMORY, math.ceil(self.resonance * duration / RESONANCE_STEP))

    def _remember(self, channels: Channels) -> None:
        for acting in self._with_memory:
            name = acting.effect.id
            _, self._states[name] = acting.effect.run(channels, acting.shape, self._states[name])

    def _forces(
        self, t: float, u: float, velocity: float, position: float, interval: float = 0.0
    ) -> tuple[float, float]:
        """(u and applied forces, friction budget), mean over the interval around t."""
        if not self._varying:
            return u, 0.0
        channels, states = Channels(t, u, velocity, position, interval), self._states
        force, budget = u, 0.0
        for acting in self._applied:
            force += acting.force(channels, states.get(acting.effect.id) if states else None)
        for acting in self._friction:
            budget += acting.force(channels, states.get(acting.effect.id) if states else None)
        return force, max(budget, 0.0)

    def _net(self, force: float, budget: float) -> float:
        if self.velocity == 0.0:
            return 0.0 if abs(force) <= budget else force - (budget if force > 0.0 else -budget)
        return force - (budget if self.velocity > 0.0 else -budget)

    def _move(self, force: float, budget: float, left: float) -> None:
        """Constant force and budget for `left` s: at most one stop, then rest or motion along the force."""
        while left > 0.0:
            a = self._net(force, budget) / self.inertia
            v = self.velocity
            if v == 0.0 and a == 0.0:
                return
            stop = -v / a if v * a < 0.0 else left
            if stop >= left:
                self.position += left * (v + 0.5 * left * a)
                self.velocity = v + left * a
                return
            self.position += 0.5 * stop * v
            self.velocity = 0.0
            left -= stop


class Actuator:
    """What input effects make of the command, sample by sample; it has settled on `command` when the loop begins.

    An effect that changes the command within the sample (a lag) is held at its mean over the sample.
    """

    def __init__(self, model: PlantModel, command: float = 0.0) -> None:
        self._states: dict[str, Any] = {}
        self.set(model)
        self.at_rest = self.drive(0.0, command, 0.0)

    def set(self, model: PlantModel) -> None:
        """From now on the plant is that one."""
        self._inputs = _acting(model.effects, Role.INPUT, model.inertia)

    def drive(self, t: float, u: float, interval: float) -> float:
        """u_eff that is held over `interval` (s) from t (s) on."""
        for acting in self._inputs:
            name = acting.effect.id
            channels = Channels(t + 0.5 * interval, u, math.nan, math.nan, interval)
            (changed,), self._states[name] = acting.effect.run(channels, acting.shape, self._states.get(name))
            u = float(changed)
        return u


def _acting(effects: EffectValues, role: Role, inertia: float) -> list[Acting]:
    """The effects of that role, in the order of the model; the force of a load on the motor is -s J a_l."""
    found = []
    for name, values in effects.items():
        effect = get_effect(name)
        if effect.role is role:
            factors, shape = effect.to_columns(values, inertia)
            scale = -inertia if role is Role.STRUCTURE else 1.0
            found.append(Acting(effect, tuple(scale * factor for factor in factors), shape))
    return found


def _resonance(load: Acting, model: PlantModel) -> float:
    """rad/s of motor against load; `shape["frequency"]` of a load is its own frequency on a held motor, Hz."""
    return 2.0 * math.pi * load.shape["frequency"] * math.sqrt(model.inertia / model.motor_inertia)
