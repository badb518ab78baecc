"""The plant J a = w + F - friction forward in time, exact where forces are piecewise constant.

Applied forces that depend on motion are taken at the midpoint of a substep (error O(h^2)). Within a substep all forces
are constant, so the instant of a stop is solved exactly; from rest the plant moves only if the force exceeds the
friction budget. Nothing chatters.
"""

from __future__ import annotations

from dsd_cli.effects import Channels, Effect, Role, get_effect
from dsd_cli.plant.model import EffectValues, PlantModel

#: Substeps of a stretch of constant u when applied forces depend on motion or time.
SUBSTEPS = 2


class Plant:
    """Position (rad or m) and velocity of a plant; `advance` moves it."""

    def __init__(self, model: PlantModel, position: float = 0.0, velocity: float = 0.0) -> None:
        self.position = position
        self.velocity = velocity
        self.set(model)

    def set(self, model: PlantModel) -> None:
        """From now on the plant is that one (its delay is the caller's business)."""
        self.inertia = model.inertia
        self._applied = _of_role(model.effects, Role.APPLIED)
        self._friction = _of_role(model.effects, Role.FRICTION)
        self._varying = bool(self._applied or self._friction)

    def acceleration(self, t: float, u: float) -> float:
        """a at this instant under the delayed u; 0 where friction holds."""
        force, budget = self._forces(t, u, self.velocity, self.position)
        return self._net(force, budget) / self.inertia

    def advance(self, t: float, u: float, duration: float) -> None:
        """Over `duration` (s) from t (s) under a constant delayed u."""
        if not self._varying:
            self._move(*self._forces(t, u, self.velocity, self.position), duration)
            return
        h = duration / SUBSTEPS
        for i in range(SUBSTEPS):
            start = t + i * h
            a = self.acceleration(start, u)
            speed = self.velocity + 0.5 * h * a
            place = self.position + 0.5 * h * (self.velocity + 0.25 * h * a)
            self._move(*self._forces(start + 0.5 * h, u, speed, place), h)

    def _forces(self, t: float, u: float, velocity: float, position: float) -> tuple[float, float]:
        """(u and applied forces, friction budget)."""
        if not self._applied and not self._friction:
            return u, 0.0
        channels = Channels(t, u, velocity, position)
        force, budget = u, 0.0
        for effect, values in self._applied:
            force += effect.force(channels, values)
        for effect, values in self._friction:
            budget += effect.force(channels, values)
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


def _of_role(effects: EffectValues, role: Role) -> list[tuple[Effect, dict[str, float]]]:
    pairs = ((get_effect(name), dict(values)) for name, values in effects.items())
    return [(effect, values) for effect, values in pairs if effect.role is role]
