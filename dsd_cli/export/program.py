"""A model as expressions: the laws of its effects and the plant of `dsd simulate`, called with symbols.

Nothing is written a second time: effects are asked for their columns, and the plant for a substep, as a simulation asks
them; what comes back is the text of every target that computes.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

from dsd_cli.effects import Channels, Role
from dsd_cli.effects.memory import Coupling, load_acceleration
from dsd_cli.export import numpy_names as _numpy_names  # noqa: F401 (NumPy's functions take symbols from now on)
from dsd_cli.export.base import Joint
from dsd_cli.export.expression import Expression, Refused, number, symbol
from dsd_cli.export.ways import merged, repeat
from dsd_cli.plant.filtering import delay_taps
from dsd_cli.plant.model import PlantModel
from dsd_cli.plant.motion import Acting, Actuator, Plant

#: What the functions of a program are given: s, unit of u, SI.
T, U, V, Q, H = symbol("t"), symbol("u"), symbol("v"), symbol("q"), symbol("h", positive=True)

Outputs = dict[str, Expression]


class _Spring(Coupling):
    """A coupling whose laws are asked with symbols; each is joined before it goes into the next, and asked once."""

    asked: dict[tuple[Any, ...], Any]

    @classmethod
    def like(cls, one: Coupling) -> _Spring:
        found = cls(*one)
        found.asked = {}
        return found

    def _once(self, law: Callable[..., Any], *values: Any) -> Any:
        key = (law, *(id(number(x)) for x in values))
        if key not in self.asked:
            self.asked[key] = merged(lambda: law(self, *values))
        return self.asked[key]

    def pull(self, apart: Any, closing: Any) -> Any:
        return self._once(Coupling.pull, apart, closing)

    def side(self, apart: Any, closing: Any) -> Any:
        return self._once(Coupling.side, apart, closing)

    def touches(self, push: Any, left: Any, q: Any, v: Any) -> Any:
        return self._once(Coupling.touches, push, left, q, v)

    def leaves(self, push: Any, lighter: Any, left: Any, depth: Any, w: Any) -> Any:
        return self._once(Coupling.leaves, push, lighter, left, depth, w)

    def rises(self, value: Any, rate: Any, bend: Any, most: Any) -> Any:
        return self._once(Coupling.rises, value, rate, bend, most)

    def rubbed(self, h: Any, speed: Any) -> Any:
        return self._once(Coupling.rubbed, h, speed)

    def steps(self, interval: Any, lighter: Any = 1.0) -> int:
        """One where the interval is a substep of the plant: they are shorter than a step of the load may be."""
        return 1 if isinstance(interval, Expression) else super().steps(interval, lighter)

    def repeated(self, count: int, body: Callable[..., tuple[Any, ...]], *start: Any) -> tuple[Any, ...]:
        return repeat(count, body, *start)


@dataclass(frozen=True)
class Law:
    """An effect with its values, asked with symbols; stands in for `Acting` within the plant."""

    acting: Acting

    @property
    def effect(self) -> Any:
        return self

    @property
    def id(self) -> str:
        return self.acting.effect.id

    @property
    def memory(self) -> bool:
        return self.acting.effect.memory

    @property
    def shape(self) -> Any:
        return self.acting.shape

    def run(self, channels: Channels, shape: Any, state: Any = None) -> Any:
        """As `Effect.run`.

        Raises
        ------
        Refused : the law does what no expression can.
        """
        effect = self.acting.effect
        if effect.role is Role.STRUCTURE:
            if effect.coupling is None:
                raise Refused("its law is no spring between two masses")
            spring = _Spring.like(effect.coupling(shape))
            column, state = load_acceleration(channels.position, channels.velocity, channels.interval, spring, state)
            return (column,), state
        try:
            return merged(lambda: effect.run(channels, shape, state))
        except (TypeError, ValueError, AttributeError, IndexError) as error:
            raise Refused(f"its law cannot be asked with symbols ({error})") from None

    def force(self, channels: Channels, state: Any) -> Any:
        """As `Acting.force`."""
        columns, _ = self.run(channels, self.shape, state)
        return sum([factor * column for factor, column in zip(self.acting.factors, columns, strict=True)])


class _SymbolicPlant(Plant):
    """The plant of the simulator with symbols for its motion and memory."""

    _applied: list[Any]
    _friction: list[Any]
    _with_memory: list[Any]

    def __init__(self, model: PlantModel, states: dict[str, Any], position: Any = Q, velocity: Any = V) -> None:
        super().__init__(model)
        self._applied, self._friction = ([Law(a) for a in x] for x in (self._applied, self._friction))
        self._with_memory = [law for law in (*self._applied, *self._friction) if law.effect.memory]
        self._states, self.position, self.velocity = dict(states), position, velocity

    def _net(self, force: Any, budget: Any) -> Any:
        return merged(lambda: Plant._net(self, force, budget))

    def _move(self, force: Any, budget: Any, left: Any) -> None:
        velocity, position = self.velocity, self.position

        def run() -> tuple[Any, Any]:
            self.velocity, self.position = velocity, position
            Plant._move(self, force, budget, left)
            return self.velocity, self.position

        self.velocity, self.position = merged(run)

    def _forces(self, t: Any, u: Any, velocity: Any, position: Any, interval: Any = 0.0) -> Any:
        return merged(lambda: Plant._forces(self, t, u, velocity, position, interval))

    def start(self) -> dict[str, Any]:
        """What effects remember when the axis begins with this position and velocity."""
        now = Channels(0.0, 0.0, self.velocity, self.position)
        return {law.id: law.run(now, law.shape)[1] for law in self._with_memory}

    def substep(self, t: Any, u: Any, h: Any) -> None:
        """The forces do not depend on anything: then a stretch is one move."""
        if self._varying:
            self._substep(t, u, h)
        else:
            self._move(u, 0.0, h)

    def remembered(self) -> Outputs:
        """What effects remember, by the names of the states."""
        return _flat(self._states)

    def applied(self, t: Any, u: Any, h: Any) -> tuple[Any, Any]:
        """(applied force without u, budget of friction), mean over the interval around t."""
        channels = Channels(t, u, self.velocity, self.position, h)
        applied = sum((law.force(channels, self._states.get(law.id)) for law in self._applied), number(0.0))
        return applied, self._forces(t, u, self.velocity, self.position, h)[1]


@dataclass(frozen=True)
class Stretch:
    """A part of a sample under one command: from `offset` s on, `substeps` of `length` s; `older`: the one before."""

    older: bool
    offset: float
    substeps: int
    length: float


@dataclass(frozen=True)
class Program:
    """What every target that computes writes down.

    Attributes
    ----------
    start : what the plant's effects remember at the beginning, of `q` and `v`; its keys are the names of the states.
    resting : what the input effects remember then, and their names.
    held : the u_eff that has acted before.
    samples : of delay, whole ones. stretches : of one sample.
    drive : of `t` (begin of the sample), `u` and the input states: "u" and the states after it.
    substep : of t, u, h, q, v and the states: "q", "v" and the states h later.
    """

    joint: Joint
    start: Outputs
    resting: dict[str, float]
    held: float
    samples: int
    stretches: tuple[Stretch, ...]
    drive: Outputs
    substep: Outputs


def program(joint: Joint) -> Program:
    """The joint as expressions.

    Raises
    ------
    Refused : a law that cannot be one.
    """
    model, step = joint.model, joint.sample_time
    plant = symbolic_plant(model)
    plant.substep(T, U, H)
    whole, fraction = delay_taps(model.delay, step)
    drive, resting, held = _input(joint)
    return Program(
        joint=joint,
        start=_flat(_SymbolicPlant(model, {}).start()),
        resting=resting,
        held=held,
        samples=whole,
        stretches=tuple(_stretches(Plant(model), fraction, step)),
        drive=drive,
        substep={"q": number(plant.position), "v": number(plant.velocity), **plant.remembered()},
    )


def symbolic_plant(model: PlantModel) -> _SymbolicPlant:
    """The plant with the symbols T, U, V, Q in place of its motion, and one for each number that effects remember."""
    return _SymbolicPlant(model, _symbols(_SymbolicPlant(model, {}).start()))


def _stretches(plant: Plant, fraction: float, step: float) -> Iterator[Stretch]:
    """As the loop of `dsd simulate` cuts a sample: first the older of two commands, then the newer."""
    split = fraction * step
    for older, offset, duration in ((True, 0.0, split), (False, split, step - split)):
        if duration > 0.0:
            count = plant._substeps(duration) if plant._varying else 1
            yield Stretch(older, offset, count, duration / count)


def _input(joint: Joint) -> tuple[Outputs, dict[str, float], float]:
    """(drive, what input effects remember at rest, u_eff at rest), as `Actuator` has it."""
    actuator = Actuator(joint.model)
    resting = {name: state for name, state in actuator._states.items() if state is not None}
    states, step, u = _symbols(resting), joint.sample_time, U
    after: dict[str, Any] = {}
    for law in map(Law, actuator._inputs):
        channels = Channels(T + 0.5 * step, u, number(0.0), number(0.0), step)
        (u,), left = law.run(channels, law.shape, states.get(law.id))
        if left is not None:
            after[law.id] = left
    begin = {name: float(value) for name, value in _flat(resting).items()}
    return {"u": number(u), **_flat(after)}, begin, actuator.at_rest


def _flat(states: dict[str, Any]) -> Outputs:
    """Effect -> what it remembers, as name -> number: `id` or `id_0`, `id_1`, ..."""
    found: Outputs = {}
    for name, state in states.items():
        if isinstance(state, tuple):
            found |= {f"{name}_{i}": number(x) for i, x in enumerate(state)}
        else:
            found[name] = number(state)
    return found


def _symbols(states: dict[str, Any]) -> dict[str, Any]:
    """The same shape with a symbol for each number."""

    def symbolic(name: str, state: Any) -> Any:
        if not isinstance(state, tuple):
            return symbol(name)
        parts: list[Any] = [symbol(f"{name}_{i}") for i in range(len(state))]
        return type(state)(*parts) if hasattr(state, "_fields") else tuple(parts)

    return {name: symbolic(name, state) for name, state in states.items()}
