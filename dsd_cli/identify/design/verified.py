"""A motion so small that every likely plant keeps the limits under the loop."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from dsd_cli.errors import DataError
from dsd_cli.identify.design.closed_loop import SETTLE, Loop, Run, UnstableLoopError, run_loop
from dsd_cli.identify.design.inverse import Path, command_for
from dsd_cli.identify.design.limits import Limits
from dsd_cli.identify.design.motions import FADES, Part, Room
from dsd_cli.identify.design.optimise import TIMES, joined
from dsd_cli.identify.design.targets import Targets
from dsd_cli.identify.results import NONE
from dsd_cli.plant.model import PlantModel
from dsd_cli.signals.log import Array

#: By how much a part shrinks at least and at most that broke a limit under the loop, how often, and the share of its
#: size in which any explanation must be able to move the axis.
_SHRINK, _SHRINK_MOST, _SHRINKS, GENTLE = 0.9, 0.5, 12, 0.05
#: Share of a limit that a smaller part aims at.
_KEPT = 0.97
#: s between samples by which draws are compared.
_COARSE = 0.02

#: Place of an explanation, of one of its draws, and of a loop. The first loop runs the fitted plant (0) and the draw
#: that needs most u; the last one that and the draw for which the feedforward lacks most.
Key = tuple[int, int, int]
#: Of the first explanation the fitted plant with the delay of the model, of which a slow log says little.
_OTHER_DELAY = (0, -1, 0)


@dataclass(frozen=True)
class Verified:
    """parts : of the motion, each once. runs : what each plant did. lost : names of explanations
    that broke a limit on every motion. unstable : a line for each plant whose loop was not stable."""

    parts: tuple[Part, ...]
    runs: Mapping[Key, Run]
    lost: tuple[str, ...]
    unstable: tuple[str, ...]


def verified(
    targets: Targets,
    plants: Mapping[Key, PlantModel],
    parts: tuple[Part, ...],
    room: Room,
    loops: Sequence[Loop],
    allowed: Limits,
) -> Verified:
    """Parts shrink until no plant (`plants_of`) breaks a limit in any of the loops, the motion made as often as it will
    be: an axis that cogging has caught in another valley begins again from there.

    Where the explanations are doubtful, one that does so on any motion is not the axis that made the logs, and is not
    counted. Nor is a draw whose loop is not stable or, where nobody knows what is missing, that stands beyond a limit
    even at rest; that is said.

    Raises
    ------
    DataError : however small the motion, a plant breaks a limit; the loop is not stable with a plant that counts.
    """
    order = [k for i, k in enumerate(plants) if not any(k[2] == o[2] and plants[k] == plants[o] for o in [*plants][:i])]
    wide, lost, unstable, names = parts, list[str](), list[str](), [e.name for e in targets.explanations]
    last = dict[Key, dict[int, tuple[float, float]]]()
    for _ in range(_SHRINKS * len(targets.explanations)):
        wanted, runs, why = _wanted(joined(TIMES * parts, room), room, loops[0]), dict[Key, Run](), ""
        planned = wanted, command_for(targets.explanations[0].fitted, wanted)
        try:
            for key in order:
                runs[key] = run_loop(plants[key], loops[key[2]], planned, allowed)
                if runs[key].exceeded(allowed):
                    break
            else:
                return Verified(parts, runs, tuple(lost), tuple(unstable))
            smaller = _smaller(parts, runs[key], room, allowed, last.setdefault(key, {}))
            runaway = any(now.scale < GENTLE * first.scale for now, first in zip(smaller, wide, strict=True))
        except UnstableLoopError as failure:
            name = names[key[0]]
            if key[1]:  # a likely plant that the loop cannot hold is not the axis that made the logs in such a loop
                order = [k for k in order if k != key]
                unstable.append(f"{failure.message} with other likely values of {_called(name)}")
                continue
            smaller, runaway = parts, True
            why = f"{failure.message} with {_called(name)} as the plant"
        if not runaway:  # who broke a limit is asked first
            parts, order = smaller, [key, *(k for k in order if k != key)]
            continue
        if key[1] and targets.unknown:  # it stands beyond a limit before it moves: no matter of the motion
            parts, order, last = wide, [k for k in order if k != key], {}
            unstable.append(f"no motion keeps the limits with other likely values of {_called(names[key[0]])}")
            continue
        if key[0] == 0 or any(key[0] in pair for pair in targets.pairs):
            break
        parts, order, last = wide, [k for k in order if k[0] != key[0]], {}
        lost.append(names[key[0]])
        unstable += [why] if why else []
    if why:
        raise DataError(why, "set [simulate.controller] to gains that hold this axis")
    broken = ", ".join(f"{name} ({100.0 * by:.0f} % beyond)" for name, by in runs[key].exceeded(allowed).items())
    raise DataError(
        f"no motion keeps the limits with every likely plant: {broken}", "widen that limit, or move --start"
    )


def _wanted(position: Array, room: Room, loop: Loop) -> Path:
    """At the samples of the loop, with the rest before it."""
    rested = np.pad(position, (round(SETTLE / room.step), 0), mode="edge")
    return Path.of(rested[:: round(loop.step / room.step)], loop.step)


def _called(name: str) -> str:
    """An explanation in a sentence."""
    return "the model alone" if name == NONE else name


def _smaller(
    parts: Sequence[Part], run: Run, room: Room, allowed: Limits, last: dict[int, tuple[float, float]]
) -> tuple[Part, ...]:
    """The parts in which a plant broke a limit, smaller; what breaks while a part begins may be the one before.

    last : place of a part -> its scale when this plant last broke a limit in it, and the share that it reached there: a
    line through both says which scale keeps it. It begins at nothing reached by no motion.
    """
    lengths = [round(part.samples(room.step) * room.step / run.path.step) for part in parts]
    smaller, start = [], 0
    for i, (part, length) in enumerate(zip(parts, lengths, strict=True)):
        begins = [start + turn * sum(lengths) for turn in range(TIMES)]
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
    targets: Targets, likely: Collection[int], position: Array, room: Room, loops: Sequence[Loop], delay: float
) -> dict[Key, PlantModel]:
    """Those that are run of each likely explanation, for a motion; delay : of the model, s."""
    stride = max(int(_COARSE / room.step), 1)
    path, found = Path.of(position[::stride], stride * room.step), dict[Key, PlantModel]()
    first = targets.explanations[0].fitted
    added = command_for(first, path)
    for i in {0, *likely}:
        draws = targets.explanations[i].draws
        needs = np.array([command_for(m, path, 3.0 * room.limits.u) for m in draws])
        for loop, lacking in ((0, needs), (len(loops) - 1, needs - added)):
            for draw in (0, int(np.argmax(np.abs(lacking).max(axis=1)))):
                found[i, draw, loop] = draws[draw]
    return found | {_OTHER_DELAY: replace(first, delay=delay)}
