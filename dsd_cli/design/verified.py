"""A motion so small that every likely plant keeps the limits under the loop."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from dsd_cli.design.closed_loop import SETTLE, Loop, Run, StandsOffError, UnstableLoopError, run_loop
from dsd_cli.design.inverse import Path, command_for
from dsd_cli.design.limits import Limits, TooNarrowError
from dsd_cli.design.motions import FADES, MotionSegment, Room
from dsd_cli.design.optimise import TIMES, joined
from dsd_cli.design.targets import Targets
from dsd_cli.effects import Role, get_effect
from dsd_cli.errors import DataError
from dsd_cli.identify.results import NONE
from dsd_cli.plant.model import PlantModel
from dsd_cli.signals.log import Array

#: By how much a part shrinks at least and at most that broke a limit under the loop, how often, and the share of its
#: size in which any explanation must be able to move the axis.
_SHRINK, _SHRINK_MOST, _SHRINKS, GENTLE = 0.9, 0.5, 12, 0.05
#: Share of a limit that a smaller part aims at; s between samples by which draws are compared; share of the way that is
#: made: else the axis sticks; a speed at which no force but friction is other than at rest.
_KEPT, _COARSE, FOLLOWED, _CREEP = 0.97, 0.02, 0.5, 1e-9

#: Place of an explanation, of one of its draws (`Targets.grown` behind them), and of a loop. The first loop runs the
#: fitted plant (0) and the draw that needs most u; the last one the draw for which the feedforward lacks most, and the
#: fitted plant of the first. Both run `Targets.beside` (-1, -2, ...).
Key = tuple[int, int, int]


@dataclass(frozen=True)
class Verified:
    """parts : of the motion, each once. runs : what each plant did. lost : names of explanations
    that broke a limit on every motion. unstable : a line for each plant whose loop was not stable."""

    parts: tuple[MotionSegment, ...]
    runs: Mapping[Key, Run]
    lost: tuple[str, ...]
    unstable: tuple[str, ...]


def verified(
    targets: Targets,
    plants: Mapping[Key, PlantModel],
    led: PlantModel,
    parts: tuple[MotionSegment, ...],
    room: Room,
    loops: Sequence[Loop],
    allowed: Limits,
) -> Verified:
    """Parts shrink until no plant (`plants_of`) breaks a limit in any of the loops, the motion made as often as it will
    be: an axis that cogging has caught in another valley begins again from there. led : whose u is fed forward.

    A doubtful explanation that goes on any motion beyond what the logs reached, too, is not the axis that made them,
    and not counted; nor is, and that is said, a draw whose loop is not stable or that does so where all is unknown.

    Raises
    ------
    DataError : on any motion a plant breaks a limit, or its loop is unstable. TooNarrowError : where the logs went.
    """
    order = _in_turn(plants)
    wide, lost, unstable, names = parts, list[str](), list[str](), [e.name for e in targets.explanations]
    last, broke, loop = dict[Key, dict[int, tuple[float, float]]](), dict[Key, Run](), loops[0]
    shrunk = list[tuple[Key, tuple[MotionSegment, ...]]]()  # by whom, and what it was before
    run = lru_cache(len(order))(lambda k, x: run_loop(plants[k], loops[k[2]], _planned(led, x, room, loop), allowed))
    for _ in range(_SHRINKS * len(order)):
        runs, why, off, narrow, way = dict[Key, Run](), "", False, set[str](), FOLLOWED * np.ptp(joined(parts, room))
        try:  # who broke a limit will most likely do so in the first half
            for key, times in [*((k, 1) for k in order[:1] if last), *((k, TIMES) for k in order)]:
                now = runs[key] = run(key, times * parts)
                sticks = key in broke and not key[1] and np.ptp(now.path.position) < way
                if sticks or now.exceeded(allowed):
                    break
            else:
                return Verified(parts, runs, tuple(lost), tuple(dict.fromkeys(unstable)))
            runs[key] = broke[key] = broke[key] if sticks else runs[key]  # it keeps them only where it does not move
            smaller = _smaller(parts, runs[key], room, allowed, last.setdefault(key, {}))
            if not sticks and all(x.scale >= GENTLE * first.scale for x, first in zip(smaller, wide, strict=True)):
                shrunk.append((key, parts))
                parts, order = smaller, order[order.index(key) :] + order[: order.index(key)]  # who kept more: last
                continue
            narrow = runs[key].exceeded(allowed).keys() - runs[key].exceeded(room.reached or allowed).keys()
        except UnstableLoopError as failure:
            why, off = failure.message, isinstance(failure, StandsOffError)
        counts = narrow and not (key[0] and key[1] and targets.unknown)
        name, gone = "the model alone" if names[key[0]] == NONE else names[key[0]], [key]
        none = targets.unknown and not (key[0] == 0 and _breaks_not_away(plants[key], allowed))
        if not counts and (off or (key[1] and (why or none))):  # what no loop holds there is not that axis
            which = f"other likely values of {name}" if key[1] else name
            unstable.append(f"{why or 'no motion keeps the limits'} with {which}")
        elif counts or key[0] == 0 or any(key[0] in pair for pair in targets.pairs):
            break
        else:
            gone, lost = [k for k in order if k[0] == key[0]], [*lost, names[key[0]]]
            unstable += [f"{why} with {name} as the plant"] if why else []
        order, last = [k for k in order if k not in gone], {}
        while any(k in gone for k, _ in shrunk):  # as large as before it
            _, parts = shrunk.pop()
    if why:
        raise DataError(f"{why} with {name} as the plant", "set [simulate.controller] to gains that hold this axis")
    raise _refused(runs[key].exceeded(allowed), TooNarrowError if narrow else DataError)


def _in_turn(plants: Mapping[Key, PlantModel]) -> list[Key]:
    """Each plant once in a loop, slow ones last."""
    once = [k for i, k in enumerate(plants) if not any(k[2] == o[2] and plants[k] == plants[o] for o in [*plants][:i])]
    return sorted(once, key=lambda k: any(get_effect(name).memory for name in plants[k].effects))


def _refused(broken: Mapping[str, float], error: type[DataError]) -> DataError:
    by = ", ".join(f"{name} ({100.0 * share:.0f} % beyond)" for name, share in broken.items())
    return error(f"no motion keeps the limits with every likely plant: {by}", "widen that limit, or move --start")


def _breaks_not_away(plant: PlantModel, allowed: Limits) -> bool:
    """Whether u within its limit holds a plant at the start and does not move it from there: such dry friction, on a
    way that no log went, may be the axis all the same."""
    start = np.full(2, allowed.start)
    up, down = (command_for(plant, Path(1.0, start, np.full(2, v), 0.0 * start))[0] for v in (_CREEP, -_CREEP))
    return bool(abs(up + down) <= 2.0 * allowed.u < 2.0 * max(abs(up), abs(down)))


def _planned(led: PlantModel, parts: Sequence[MotionSegment], room: Room, loop: Loop) -> tuple[Path, Array]:
    """(path of these parts, rest before it included; the u that is fed forward)."""
    rested = np.pad(joined(parts, room), (round(SETTLE / room.step), 0), mode="edge")
    wanted = Path.of(rested[:: round(loop.step / room.step)], loop.step)
    return wanted, command_for(led, wanted)


def _smaller(
    parts: Sequence[MotionSegment], run: Run, room: Room, allowed: Limits, last: dict[int, tuple[float, float]]
) -> tuple[MotionSegment, ...]:
    """The parts in which a plant broke a limit, smaller; what breaks while a part begins may be the one before.

    last : place of a part -> its scale when this plant last broke a limit in it, and the share that it reached there: a
    line through both says which scale keeps it. It begins at nothing reached by no motion.
    """
    lengths = [round(part.samples(room.step) * room.step / run.path.step) for part in parts]
    smaller, start = [], 0
    for i, (part, length) in enumerate(zip(parts, lengths, strict=True)):
        begins = range(start, len(run.u) - 1, sum(lengths))
        broken = [run.exceeded(allowed, slice(at, at + length + int(FADES[0] * length))) for at in begins]
        start += length
        if any(broken):
            reached = 1.0 + max(by for one in broken for by in one.values())
            scale, before = last.get(i, (0.0, 0.0))
            last[i] = part.scale, reached
            slope = (before - reached) / (scale - part.scale)
            wanted = part.scale + (_KEPT - reached) / slope if slope > 0.0 else 0.0
            part = replace(part, scale=float(np.clip(wanted, _SHRINK_MOST * part.scale, _SHRINK * part.scale)))
        smaller.append(part)
    return tuple(smaller)


def plants_of(
    targets: Targets, likely: Collection[int], position: Array, room: Room, loops: Sequence[Loop], leading: int = 0
) -> tuple[dict[Key, PlantModel], PlantModel]:
    """(those that are run of each likely explanation, for a motion; the one whose u is fed forward: the leading one as
    fitted, with the friction of its draw that brakes the motion least: friction that is fed forward and is not there
    drives the axis on, and from rest to rest no other force does work)."""
    stride, last = max(int(_COARSE / room.step), 1), len(loops) - 1
    path, found = Path.of(position[::stride], stride * room.step), dict[Key, PlantModel]()
    first, leads = targets.explanations[0], targets.explanations[leading]
    least = min(leads.draws, key=lambda m: float(command_for(m, path) @ path.velocity))
    friction = {n: v for n, v in least.effects.items() if get_effect(n).role is Role.FRICTION}
    led = replace(leads.fitted, effects={**leads.fitted.effects, **friction})
    added = command_for(led, path)
    for i in {0, *likely}:
        draws = targets.explanations[i].draws
        needs = np.array([command_for(m, path, 3.0 * room.limits.u) for m in draws])
        for loop, lacking in ((0, needs), (last, needs - added)):
            for draw in ((0,) if i * loop == 0 else ()) + (int(np.argmax(np.abs(lacking).max(axis=1))),):
                found[i, draw, loop] = draws[draw]
    if targets.grown:  # what needs most u, and what pushes most either way
        needs = np.array([command_for(m, path, 3.0 * room.limits.u) for m in targets.grown])
        off = (needs - added).mean(axis=1)
        for loop, worst in ((0, np.argmax(np.abs(needs).max(axis=1))), (last, np.argmin(off)), (last, np.argmax(off))):
            found[0, len(first.draws) + int(worst), loop] = targets.grown[int(worst)]
    for loop in (0, last):
        found |= {(0, -1 - i, loop): plant for i, plant in enumerate(targets.beside)}
    return found, led
