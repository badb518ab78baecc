"""A load on the motor driven by what the model says, not by what a noisy sensor measured.

The acceleration of a load follows from the motor's motion. A coarse sensor's noise moves a simulated load that no motor
ever moved: it would pick up play at every count; and of a stiff contact samples of any motion say too little. So a
model that has a load already may also drive it by its own force,

    F = u(t - L) + forces,    the load by `effects.memory.driven_load` of F / (s_m J),

and that is taken where it leaves clearly less of the balance: else the values may be wrong, and a load that hangs on
them could not be fitted. A load that rattles no simulation follows; where its contacts are identified sample by sample
(`fit.contacts`), only those rows count in which it is off and has no acceleration: (1 - s) J a = F.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from dsd_cli.effects import Role
from dsd_cli.effects.memory import Coupling
from dsd_cli.identify.fit.bank import Bank, Terms, drive, has_friction, inputs_of, of_single_logs, raw_columns
from dsd_cli.identify.fit.contacts import contacts_with
from dsd_cli.identify.fit.equations import Equations, equations_of
from dsd_cli.identify.fit.errors import left_by, sensor_variance
from dsd_cli.identify.fit.pushes import Pushes
from dsd_cli.identify.fit.values import terms_of
from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.recordings.recording import Recording
from dsd_cli.plant.model import PlantModel
from dsd_cli.signals.log import Array, Log, with_channels

#: Channels of a piece that say what drives its load.
DRIVEN = ("push", "clear")


def both_driven(
    recordings: Sequence[Recording], holdout: Sequence[Recording], model: PlantModel
) -> tuple[tuple[Recording, ...], tuple[Recording, ...]]:
    """Recordings and those held out, as `with_driven_load`; by contacts only where both show them: what is judged is
    what was fitted."""
    found, aside = with_driven_load(recordings, model), with_driven_load(holdout, model)
    if not aside or by_contacts(found) == by_contacts(aside):
        return found, aside
    return with_driven_load(recordings, model, False), with_driven_load(holdout, model, False)


def by_contacts(recordings: Sequence[Recording]) -> bool:
    """Whether rows count by the contacts of a load."""
    return any("clear" in p for r in recordings for p in r.pieces)


def with_driven_load(
    recordings: Sequence[Recording], model: PlantModel, contacts: bool = True
) -> tuple[Recording, ...]:
    """The recordings with "push", what a model with a load does to the motor alone, if that leaves less; or with
    "clear", where a load with play is off, if that does; not without `contacts`."""
    terms = terms_of(model)
    loads = [(t, t.effect.coupling(t.shape)) for t in terms if t.effect.coupling is not None]
    if len(loads) != 1 or not recordings:
        return tuple(recordings)
    ((term, coupling),) = loads
    (share,), _ = term.effect.to_columns(model.effects[term.id], model.inertia)
    startup = math.ceil(model.delay / recordings[0].sample_time) + 3
    measured = equations_of([_bare(r) for r in recordings], startup)
    forces, motor = pushes_of(measured, model, terms), (1.0 - share) * model.inertia
    best, left = measured.recordings, _left(measured, model)
    floor = POLICY.floor_factor * model.inertia * math.sqrt(sensor_variance(measured, sure=False))
    for channels_of in (_simulated, _by_contacts)[: 1 + (contacts and one_sensor(measured))]:
        if channels_of is _by_contacts and left < floor**2:  # followed, and all rows count
            break
        if channels := channels_of(forces, motor, model.inertia, coupling):
            moved = equations_of(_with(measured, channels, (term.id, share, coupling)), startup, measured.bands)
            known = len(moved.kept) > len(measured.kept) // 2  # else it remembers too long where it began
            rest = _left(moved, model) if known and np.mean(moved.kept) > POLICY.least_moving else math.inf
            # what is missing drives a simulated load, too: but for noise of the motor, 1 - share of that is left
            whole = channels_of is _by_contacts or rest < ((1.0 - share) * floor) ** 2
            fair = 1.0 if whole else 1.0 - share
            if rest < (POLICY.driven_gain * fair) ** 2 * left:
                best, left = moved.recordings, rest
    return best


def _simulated(forces: Pushes, motor: float, inertia: float, coupling: Coupling) -> list[dict[str, Array]]:
    """What drives the motor alone, F / (s_m J), by stretch."""
    return [{"push": x / motor} for x in forces.before]


def _by_contacts(forces: Pushes, motor: float, inertia: float, coupling: Coupling) -> list[dict[str, Array]]:
    """Where a load with play is off, by stretch; nothing where no contacts of it show."""
    gap = 2.0 * coupling.half_gap
    touch = contacts_with(forces, motor, inertia, gap) if gap > 0.0 else None
    return [{"clear": x, "push": np.zeros(len(x))} for x in touch.alone(forces)] if touch is not None else []


def one_sensor(equations: Equations) -> bool:
    """Whether all recordings were measured alike, as windows of samples suppose."""
    return len({(r.sensor.kind, r.sensor.two_intervals) for r in equations.recordings}) == 1


def _with(
    equations: Equations, by_stretch: Sequence[dict[str, Array]], pushed: tuple[str, float, Coupling]
) -> tuple[Recording, ...]:
    """The recordings with more channels."""
    by_piece = {id(s.log): x for s, x in zip(equations.stretches, by_stretch, strict=True)}

    def piece(p: Log) -> Log:
        return with_channels(p, **by_piece[id(p)]) if id(p) in by_piece else p

    return tuple(replace(r, pieces=tuple(map(piece, r.pieces)), pushed=pushed) for r in equations.recordings)


def _bare(recording: Recording) -> Recording:
    """Without what an earlier model drove."""
    if not any(name in p for p in recording.pieces for name in DRIVEN):
        return recording
    pieces = (
        replace(p, channels={name: x for name, x in p.channels.items() if name not in DRIVEN}) for p in recording.pieces
    )
    return replace(recording, pieces=tuple(pieces), pushed=None)


def pushes_of(equations: Equations, model: PlantModel, terms: Terms) -> Pushes:
    """What a model says moves the motor, but for its loads."""
    equations = equations.in_full()
    step, held = equations.sample_time, has_friction(terms)
    less, more = min(step, model.delay), step  # no u acts before it is there
    force, early, late = (drive(equations, inputs_of(terms), model.delay + x) for x in (0.0, -less, more))
    changes: list[list[Array]] = [[step / (less + more) * (x - y) for x, y in zip(early, late, strict=True)]]
    for term in terms:
        if term.effect.role in (Role.INPUT, Role.STRUCTURE):
            continue
        given, _ = term.effect.to_columns(model.effects[term.id], model.inertia)
        for c, by_stretch in zip(given, raw_columns(equations, term, model.delay), strict=True):
            force = [f - c * x for f, x in zip(force, by_stretch, strict=True)]
            changes.append([-x for x in by_stretch])
    for _, taken in of_single_logs(equations, model.delay):
        force = [f - x for f, x in zip(force, taken, strict=True)]
    free = [s.free if held else np.ones(len(s.log)) for s in equations.stretches]
    before = [[np.nan_to_num(x) * f for x, f in zip(by, free, strict=True)] for by in (force, *changes)]
    forces = [[s.averaged(x, False) for s, x in zip(equations.stretches, by, strict=True)] for by in before]
    noise = max((r.sensor.noise for r in equations.recordings), key=lambda noise: noise.scale)
    acceleration = [s.acceleration for s in equations.stretches]
    return Pushes(acceleration, forces, noise, equations.stretches[0].two_intervals, step, before[0])


def _left(equations: Equations, model: PlantModel) -> float:
    """Mean square of what the model leaves of the balance, in rows that count."""
    found = float(np.mean(left_by(Bank(equations), model)[0] ** 2))
    return found if math.isfinite(found) else math.inf
