"""The machines of the outside rig, integrated one at a time in plain floats by classical Runge-Kutta steps.

Dry friction is an event: a step that would turn the speed round ends where it is zero, and from there the axis sticks
or slides. So is the beginning of a contact, where the force of its damper is there at once: a step of a load that is
off ends where it meets the flank.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, field

from tests.oracle import rig_laws, rig_parts
from tests.oracle.rig_cases import Values

#: Longest step, s: usually, with play between motor and load, and where their contact may begin or end.
STEP, STEP_PLAY, STEP_CONTACT = 1e-3, 5e-4, 1.25e-4
NEAR = 0.002  # share of the gap: so close to an end of the play a contact may begin or end
TINY = 1e-9  # s, below which two instants are one

State = tuple[float, float, float, float, float]  # q, v of the motor, q, v of the load, inner state of the friction


@dataclass(frozen=True)
class Machine:
    """inertia kg m2 of all masses, delay s, effects {id: values}."""

    inertia: float
    delay: float
    effects: dict[str, Values] = field(default_factory=dict)


class Plant:
    """A machine in motion."""

    def __init__(self, machine: Machine) -> None:
        effects = machine.effects
        self.machine = machine
        self.applied = [rig_laws.APPLIED[e](p) for e, p in effects.items() if e in rig_laws.APPLIED]
        self.budgets = [rig_laws.BUDGETS[e](p) for e, p in effects.items() if e in rig_laws.BUDGETS]
        self.hysteresis = [law for law in self.applied if isinstance(law, rig_laws.Play)]
        commands = [rig_parts.COMMANDS[e](p) for e, p in effects.items() if e in rig_parts.COMMANDS]
        self.command = commands[0] if commands else rig_parts.Direct()
        loads = [rig_parts.LOADS[e](p, machine.inertia) for e, p in effects.items() if e in rig_parts.LOADS]
        self.load = loads[0] if loads else None
        memories = [rig_parts.MEMORIES[e](p) for e, p in effects.items() if e in rig_parts.MEMORIES]
        self.inner = memories[0] if memories else None
        self.swing = effects.get("swinging_inertia")
        self.gap = effects["backlash"]["gap"] if "backlash" in effects else None
        self.edges = rig_laws.edges(effects)
        self.state: State = (0.0, 0.0, 0.0, 0.0, 0.0)
        self.sliding = 0  # direction in which dry friction lets the axis slide; 0 holds it
        rigid = not (self.load or self.inner or self.swing)
        self.rates = self._rigid_rates() if rigid else self._rates()
        self.off = False  # the load is within its play, whatever a stage of a step says
        self._step = self._rigid_step if rigid else self._full_step if self.gap is None else self._play_step

    def place(self, q: float) -> None:
        """At rest at q, the load beside the motor."""
        self.state = (q, 0.0, q, 0.0, 0.0)

    def budget(self, t: float, q: float, v: float, u: float) -> float:
        return sum(law(t, q, v, u) for law in self.budgets)

    def _rigid_rates(self) -> Callable[[float, State, float, int], State]:
        accelerate = self.accelerate = self._acceleration()
        return lambda t, x, u, sliding: (x[1], accelerate(t, x[0], x[1], u, sliding), 0.0, 0.0, 0.0)

    def _acceleration(self) -> Callable[[float, float, float, float, int], float]:
        applied, budgets, per_inertia = tuple(self.applied), tuple(self.budgets), 1.0 / self.machine.inertia

        def accelerate(t: float, q: float, v: float, u: float, sliding: int) -> float:
            force = u
            for law in applied:
                force += law(t, q, v)
            if sliding:
                for level in budgets:
                    force -= sliding * level(t, q, v, u)
            return force * per_inertia

        return accelerate

    def _rates(self) -> Callable[[float, State, float, int], State]:
        inertia = self.machine.inertia
        share, pull = (self.load.share, self.load.pull) if self.load else (0.0, None)
        inner, sigma = self.inner or (None, 0.0)
        swing, of_load, constant = self.swing, share * inertia, inertia * (1.0 - share)
        applied, budgets = tuple(self.applied), tuple(self.budgets)

        def rates(t: float, x: State, u: float, sliding: int) -> State:
            q, v, ql, vl, z = x
            force = u - sigma * z
            for law in applied:
                force += law(t, q, v)
            if sliding:
                for level in budgets:
                    force -= sliding * level(t, q, v, u)
            pulled = pull(q - ql, v - vl) if pull and not self.off else 0.0
            built_up = inner(z, v) if inner else 0.0
            if swing is None:
                return v, (force - of_load * pulled) / constant, vl, pulled, built_up
            angle = 2.0 * q + swing["phase"]
            mass = inertia * (1.0 - share + swing["share"] * math.cos(angle))
            force -= of_load * pulled - inertia * swing["share"] * math.sin(angle) * v * v
            return v, force / mass, vl, pulled, built_up

        return rates

    def advance(self, t: float, h: float, u: tuple[float, float, float]) -> None:
        """Over h seconds; u at the beginning, in the middle and at the end."""
        if self.budgets:
            self._advance_with_friction(t, h, u)
        else:
            self.state = self._step(t, h, u, 0)
        for law in self.hysteresis:
            law.commit(self.state[0])

    def _advance_with_friction(self, t: float, h: float, u: tuple[float, float, float]) -> None:
        for _ in range(4):
            if self.sliding == 0:
                push = self.rates(t, self.state, u[0], 0)[1] * self._mass()
                if abs(push) <= self.budget(t, self.state[0], 0.0, u[0]):
                    self.state = self._held(t, h, u)
                    return
                self.sliding = 1 if push > 0.0 else -1
            after = self._step(t, h, u, self.sliding)
            before = self.state[1]
            if after[1] * self.sliding >= 0.0:
                self.state = after
                return
            part = before / (before - after[1]) if before * self.sliding > 0.0 else 0.0
            here = u[0] + part * (u[2] - u[0])
            q, _, *rest = self._step(t, part * h, (u[0], 0.5 * (u[0] + here), here), self.sliding)
            self.state, self.sliding = (q, 0.0, *rest), 0
            t, h, u = t + part * h, (1.0 - part) * h, (here, 0.5 * (here + u[2]), u[2])
        self.state = self._held(t, h, u)

    def _mass(self) -> float:
        q = self.state[0]
        swing = self.swing["share"] * math.cos(2.0 * q + self.swing["phase"]) if self.swing else 0.0
        return self.machine.inertia * (1.0 - (self.load.share if self.load else 0.0) + swing)

    def _held(self, t: float, h: float, u: tuple[float, float, float]) -> State:
        """The motor stands; a load may swing on."""
        q, _, ql, vl, z = self.state
        if self.load is None:
            return q, 0.0, ql, vl, z
        if self.gap is not None and abs(q - ql) < 0.5 * self.gap:
            met = q + math.copysign(0.5 * self.gap, vl)
            if abs(vl) * h <= abs(met - ql):
                return q, 0.0, ql + h * vl, vl, z
            h, ql = h - (met - ql) / vl, math.nextafter(met, math.copysign(math.inf, vl))
        pull = self.load.pull
        a1 = pull(q - ql, -vl)
        a2 = pull(q - ql - 0.5 * h * vl, -(vl + 0.5 * h * a1))
        a3 = pull(q - ql - 0.5 * h * (vl + 0.5 * h * a1), -(vl + 0.5 * h * a2))
        a4 = pull(q - ql - h * (vl + 0.5 * h * a2), -(vl + h * a3))
        return q, 0.0, ql + h * vl + h * h / 6.0 * (a1 + a2 + a3), vl + h / 6.0 * (a1 + 2.0 * (a2 + a3) + a4), z

    def steps(self, lasts: float) -> int:
        """Into how many steps `lasts` seconds are cut: short ones where a contact may begin or end."""
        longest = STEP
        if self.gap is not None:
            q, v, ql, vl, _ = self.state
            beyond, toward = abs(q - ql) - 0.5 * self.gap, abs(v - vl) * lasts
            if abs(beyond) < 2.0 * toward + NEAR * self.gap:
                longest = STEP_CONTACT
            elif beyond > 0.0:
                longest = STEP_PLAY
        return max(math.ceil(lasts / longest - 1e-6), 1)

    def _rigid_step(self, t: float, h: float, u: tuple[float, float, float], sliding: int) -> State:
        accelerate, half, (q, v, ql, vl, z) = self.accelerate, 0.5 * h, self.state
        begin, middle, end = u
        a1 = accelerate(t, q, v, begin, sliding)
        v2 = v + half * a1
        a2 = accelerate(t + half, q + half * v, v2, middle, sliding)
        v3 = v + half * a2
        a3 = accelerate(t + half, q + half * v2, v3, middle, sliding)
        # A push that ends with this step acts until its end.
        a4 = accelerate(t + h - TINY, q + h * v3, v + h * a3, end, sliding)
        return q + h * (v + h / 6.0 * (a1 + a2 + a3)), v + h / 6.0 * (a1 + 2.0 * (a2 + a3) + a4), ql, vl, z

    def _play_step(self, t: float, h: float, u: tuple[float, float, float], sliding: int) -> State:
        """As `_full_step`; where the load meets its flank is found by false position, from beyond it."""
        if self._depth(self.state) >= 0.0:
            return self._full_step(t, h, u, sliding)

        def until(part: float) -> tuple[float, State]:
            here = u[0] + part * (u[2] - u[0])
            after = self._full_step(t, part * h, (u[0], 0.5 * (u[0] + here), here), sliding)
            return self._depth(after), after

        self.off = True
        low, below, high = 0.0, self._depth(self.state), 1.0
        above, met = until(high)
        if above >= 0.0:
            for _ in range(60):
                if high - low < 1e-13 or above == 0.0:
                    break
                part = low - below * (high - low) / (above - below)
                part = min(max(part, low + 1e-3 * (high - low)), high - 1e-3 * (high - low))
                depth, after = until(part)
                if depth >= 0.0:
                    high, above, met = part, depth, after
                else:
                    low, below = part, depth
        self.off = False
        if above < 0.0:
            return met
        before, self.state = self.state, met
        here = u[0] + high * (u[2] - u[0])
        left = (1.0 - high) * h
        after = self._full_step(t + high * h, left, (here, 0.5 * (here + u[2]), u[2]), sliding)
        self.state = before
        return after

    def _depth(self, state: State) -> float:
        """How far in contact; below 0: off."""
        return abs(state[0] - state[2]) - 0.5 * self.gap

    def _full_step(self, t: float, h: float, u: tuple[float, float, float], sliding: int) -> State:
        rates, half = self.rates, 0.5 * h
        q, v, ql, vl, z = x = self.state
        v1, a1, w1, b1, z1 = rates(t, x, u[0], sliding)
        x2 = (q + half * v1, v + half * a1, ql + half * w1, vl + half * b1, z + half * z1)
        v2, a2, w2, b2, z2 = rates(t + half, x2, u[1], sliding)
        x3 = (q + half * v2, v + half * a2, ql + half * w2, vl + half * b2, z + half * z2)
        v3, a3, w3, b3, z3 = rates(t + half, x3, u[1], sliding)
        x4 = (q + h * v3, v + h * a3, ql + h * w3, vl + h * b3, z + h * z3)
        v4, a4, w4, b4, z4 = rates(t + h - TINY, x4, u[2], sliding)
        sixth = h / 6.0
        return (
            q + sixth * (v1 + 2.0 * (v2 + v3) + v4),
            v + sixth * (a1 + 2.0 * (a2 + a3) + a4),
            ql + sixth * (w1 + 2.0 * (w2 + w3) + w4),
            vl + sixth * (b1 + 2.0 * (b2 + b3) + b4),
            z + sixth * (z1 + 2.0 * (z2 + z3) + z4),
        )
