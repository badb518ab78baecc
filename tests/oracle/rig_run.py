"""Machines of the outside rig under a loop: the delayed command, and what is recorded at the stamps."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import chain

import numpy as np

from tests.oracle import rig_laws
from tests.oracle.rig_cases import Array
from tests.oracle.rig_physics import TINY, Machine, Plant

Loop = Callable[[int, float, float], float]


@dataclass(frozen=True)
class Motion:
    """Exact signals at the stamps, each of shape (n,); u[k] is the command held from t[k] on.

    acting : what of the commands acts on the plant at t[k], after the actuator and the delay.
    acceleration : of the motor just after t[k]. stuck : whether dry friction holds it.
    """

    t: Array
    u: Array
    q: Array
    v: Array
    acceleration: Array
    acting: Array
    load_q: Array
    load_v: Array
    inner: Array
    stuck: Array


def run(machine: Machine, loop: Loop, stamps: Array, start: float) -> Motion:
    """The machine from rest at `start` under `loop(k, q, v) -> u`, which is asked at every stamp.

    Before the first stamp the command was 0.
    """
    plant = Plant(machine)
    plant.place(start)
    return _Recorder(plant, loop, [float(t) for t in stamps]).run()


class _Recorder:
    def __init__(self, plant: Plant, loop: Loop, stamps: Sequence[float]) -> None:
        self.plant, self.loop, self.stamps = plant, loop, stamps
        self.delay = plant.machine.delay
        self.starts: list[float] = []  # output of the actuator when command k came
        self.taken: list[float] = []  # command k as the actuator takes it

    def run(self) -> Motion:
        plant, stamps = self.plant, self.stamps
        rows, commands = [], []
        arrived = -1  # number of the command that acts on the plant
        for k, t in enumerate(stamps):
            q, v = plant.state[0], plant.state[1]
            u = self.loop(k, q, v)
            commands.append(u)
            self._issue(k, u)
            while arrived < k and stamps[arrived + 1] + self.delay <= t + TINY:
                arrived += 1
            acting = self._output(arrived, t)
            rates = plant.rates(t, plant.state, acting, plant.sliding)
            stuck = bool(plant.budgets) and plant.sliding == 0
            rows.append((*plant.state, 0.0 if stuck else rates[1], acting, float(stuck)))
            if k + 1 < len(stamps):
                arrived = self._integrate(t, stamps[k + 1], k, arrived)
        table = np.fromiter(chain.from_iterable(rows), float, 8 * len(rows)).reshape(-1, 8)
        q, v, lq, lv, z, a, acting, stuck = np.ascontiguousarray(table.T)
        return Motion(np.array(stamps), np.array(commands), q, v, a, acting, lq, lv, z, stuck > 0.5)

    def _issue(self, k: int, u: float) -> None:
        interval = self.stamps[k] - self.stamps[k - 1] if k else 0.0
        command = self.plant.command
        start = command.value(self.starts[-1], self.taken[-1], interval) if k else 0.0
        self.starts.append(start)
        self.taken.append(command.begin(u, interval))

    def _output(self, j: int, t: float) -> float:
        """What acts on the plant at t, command j being the last that has arrived."""
        if j < 0:
            return 0.0
        if not self.plant.command.moving:
            return self.taken[j]
        return self.plant.command.value(self.starts[j], self.taken[j], t - self.delay - self.stamps[j])

    def _integrate(self, t: float, end: float, k: int, arrived: int) -> int:
        plant, stamps = self.plant, self.stamps
        while t < end - TINY:
            coming = stamps[arrived + 1] + self.delay if arrived < k else math.inf
            stop = min(end, coming, rig_laws.next_edge(plant.edges, t) if plant.edges else math.inf)
            steps = plant.steps(stop - t)
            h = (stop - t) / steps
            for i in range(steps):
                s = t + i * h
                if plant.command.moving:
                    u = (self._output(arrived, s), self._output(arrived, s + 0.5 * h), self._output(arrived, s + h))
                else:
                    held = self._output(arrived, s)
                    u = (held, held, held)
                plant.advance(s, h, u)
            t = stop
            while arrived < k and stamps[arrived + 1] + self.delay <= t + TINY:
                arrived += 1
        return arrived
