"""A batch of machines moved through time in fine steps: delay, input effects, bristle friction, a second mass.

Integration is leapfrog: positions live half a fine step after velocities. Friction is an elasto-plastic bristle, a
spring and damper that give way at the friction level. Their values are those that bring the mass to rest in two
fine steps, so a machine at rest stays at rest with a micro-slip of (level / J) dt^2, and nothing chatters.
"""

from collections.abc import Sequence

import numpy as np

from tests.oracle.machine_laws import FORCES, LEVELS, Array, Moment, Values, gather


class Plant:
    """All lanes share the sample time; `effects[i]` are lane i's true effects, `base[i]` the believed ids of them."""

    def __init__(
        self,
        inertia: Array,
        delay: Array,
        effects: Sequence[dict[str, Values]],
        base: Sequence[Sequence[str]],
        sample_time: float,
        rows: int,
        fine_steps: int = 10,
    ) -> None:
        self.lanes, self.parts, self.dt = len(inertia), fine_steps, sample_time / fine_steps
        self.sample_time = sample_time
        names = {name for lane in effects for name in lane}
        self.forces = [(FORCES[n], gather(n, effects), _mask(n, base)) for n in FORCES if n in names]
        self.levels = [(LEVELS[n], gather(n, effects), _mask(n, base)) for n in LEVELS if n in names]
        self.dahl = gather("presliding_friction", effects) if "presliding_friction" in names else None
        self.dead = gather("dead_zone", effects).get("width", 0.0)
        self.limit = gather("saturation", effects).get("limit", np.inf)
        self._set_lag(gather("actuator_lag", effects).get("time_constant", np.zeros(self.lanes)))
        self._set_delay(delay, rows)
        self._set_masses(inertia, effects)
        self.q, self.v, self.ql, self.vl, self.bristle, self.bend, self.lagged = np.zeros((7, self.lanes))

    def _set_lag(self, constant: Array) -> None:
        """Exact first-order step, and the exact mean of the lagged command within it."""
        self.has_lag = bool(np.any(constant > 0.0))
        safe = np.where(constant > 0.0, constant, 1.0)
        self.lag_left = np.where(constant > 0.0, np.exp(-self.dt / safe), 0.0)
        self.lag_mean = np.where(constant > 0.0, (1.0 - self.lag_left) * safe / self.dt, 0.0)

    def _set_delay(self, delay: Array, rows: int) -> None:
        """Share of the older of two held commands in every fine step: the switch may fall inside a fine step."""
        self.whole = np.floor(delay / self.sample_time + 1e-12).astype(int)
        switch = (delay - self.whole * self.sample_time) / self.dt
        self.older = np.clip(switch[None, :] - np.arange(self.parts)[:, None], 0.0, 1.0)
        self.before = int(self.whole.max()) + 1
        self.commands = np.zeros((rows + self.before, self.lanes))

    def _set_masses(self, inertia: Array, effects: Sequence[dict[str, Values]]) -> None:
        self.structured = any("backlash" in e or "flexible_coupling" in e for e in effects)
        springs = [_spring(j, e) for j, e in zip(inertia.tolist(), effects, strict=True)]
        share, self.spring, self.damper, self.half_gap = np.array(springs).T
        self.motor = inertia * (1.0 - share)
        self.load = np.where(share > 0.0, inertia * share, 1.0)

    def place(self, velocity: Array, position: Array | float = 0.0) -> None:
        """Starts all masses with this motion (rad/s, rad)."""
        self.v, self.vl = velocity + 0.0 * self.v, velocity + 0.0 * self.v
        self.q = position + 0.5 * self.dt * self.v
        self.ql = self.q.copy()

    def measured(self) -> tuple[Array, Array]:
        """Motor position (rad) and velocity (rad/s) at the present sample."""
        return self.q - 0.5 * self.dt * self.v, self.v.copy()

    def step(self, row: int, start: float, u: Array) -> Array:
        """Moves all lanes from t = `start` over one sample in which `u` is held; mean force of the base effects."""
        self.commands[row + self.before] = self._static(u)
        newest = row + self.before - self.whole
        lanes = np.arange(self.lanes)
        new, old = self.commands[newest, lanes], self.commands[newest - 1, lanes]
        drives = new + self.older * (old - new)
        base = np.zeros(self.lanes)
        for i in range(self.parts):
            base += self._fine(Moment(self.q, self.v, self._lag(drives[i]), start + (i + 0.5) * self.dt, row))
        return base / self.parts

    def _static(self, u: Array) -> Array:
        """Dead zone first, then the limit; both act on held values, so they may come before the delay."""
        return np.clip(u - np.clip(u, -self.dead, self.dead), -self.limit, self.limit)

    def _lag(self, u: Array) -> Array:
        if not self.has_lag:
            return u
        gap = self.lagged - u
        self.lagged = u + gap * self.lag_left
        return u + gap * self.lag_mean

    def _fine(self, m: Moment) -> Array:
        """One fine step; the base effects' force in it."""
        total, base = m.u, np.zeros(self.lanes)
        for law, values, believed in self.forces:
            force = law(values, m)
            total = total + force
            if believed is not None:
                base = base + believed * force
        if self.dahl is not None:
            total = total - self.dahl["level"] * self.bend
        if self.structured:
            total = total - self._coupling()
        if self.levels:
            rubbing, known = self._friction(m)
            total, base = total + rubbing, base + known
        self.v = m.v + self.dt / self.motor * total
        if self.levels:
            self.bristle = np.clip(self.bristle + self.motor / self.dt * self.v, -self.level, self.level)
        self.q = m.q + self.dt * self.v
        if self.dahl is not None:
            self._bend()
        return base

    def _friction(self, m: Moment) -> tuple[Array, Array]:
        """Force of the rubbing contact, and how much of it the believed levels alone could give."""
        self.level, known, any_known = np.zeros(self.lanes), np.zeros(self.lanes), False
        for law, values, believed in self.levels:
            part = law(values, m)
            self.level = self.level + part
            if believed is not None:
                known, any_known = known + believed * part, True
        force = -np.clip(self.bristle + self.motor / self.dt * m.v, -self.level, self.level)
        return force, np.clip(force, -known, known) if any_known else known

    def _bend(self) -> None:
        """Dahl's equation, exact for a step in one direction: the force nears its level like exp(-path / distance)."""
        level = self.dahl["level"]
        path = self.dt * self.v
        towards = np.sign(path)
        left = np.exp(-np.abs(path) * self.dahl["stiffness"] / np.where(level > 0.0, level, 1.0))
        self.bend = towards + (self.bend - towards) * left

    def _coupling(self) -> Array:
        """Moves the second mass; the torque on it. A gap can push but not pull."""
        twist = self.q - self.ql
        pressed = twist - np.clip(twist, -self.half_gap, self.half_gap)
        torque = self.spring * pressed + self.damper * (self.v - self.vl) * (pressed != 0.0)
        torque = np.where((self.half_gap > 0.0) & (torque * pressed < 0.0), 0.0, torque)
        self.vl = self.vl + self.dt / self.load * torque
        self.ql = self.ql + self.dt * self.vl
        return torque


def _mask(name: str, base: Sequence[Sequence[str]]) -> Array | None:
    """1 in the lanes that believe in this effect; None if none does, which saves the work."""
    mask = np.array([1.0 if name in ids else 0.0 for ids in base])
    return mask if mask.any() else None


CONTACT_DAMPING = 0.2  # ratio, of the load on the flank of a gap


def _spring(inertia: float, effects: dict[str, Values]) -> tuple[float, float, float, float]:
    """Load share, spring (N m/rad), damper (N m s/rad), half gap (rad) of a lane."""
    if "backlash" in effects:
        p = effects["backlash"]
        damper = 2.0 * CONTACT_DAMPING * np.sqrt(p["stiffness"] * inertia * p["load_share"])
        return p["load_share"], p["stiffness"], damper, 0.5 * p["gap"]
    if "flexible_coupling" in effects:
        p = effects["flexible_coupling"]
        motor, load = inertia * (1.0 - p["load_share"]), inertia * p["load_share"]
        spring = (2.0 * np.pi * p["frequency"]) ** 2 / (1.0 / motor + 1.0 / load)
        return p["load_share"], spring, 2.0 * p["damping"] * np.sqrt(spring * load), 0.0
    return 0.0, 0.0, 0.0, 0.0
