"""A load on the motor driven by what the model says, not by what a noisy sensor measured.

The acceleration of a load follows from the motor's motion. A coarse sensor's noise moves a simulated load that no motor
ever moved: it would pick up play at every count; and of a stiff contact samples of any motion say too little. So a
model that has a load already may also drive it by its own force,

    F = u(t - L) + forces,    the load by `effects.memory.driven_load` of F / (s_m J),

and that is taken where it leaves clearly less of the balance: else the values may be wrong, and a load that hangs on
them could not be fitted.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from dsd_cli.effects import Role
from dsd_cli.identify.fit.bank import Bank, Terms, drive, has_friction, inputs_of, of_single_logs, raw_columns
from dsd_cli.identify.fit.equations import Equations, equations_of
from dsd_cli.identify.fit.values import coefficients_of, terms_of
from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.recordings.recording import Recording
from dsd_cli.plant.model import PlantModel
from dsd_cli.signals.log import Array, with_channels


def with_driven_load(recordings: Sequence[Recording], model: PlantModel) -> tuple[Recording, ...]:
    """The recordings with "push", what a model with a load does to the motor alone, if that leaves less."""
    terms = terms_of(model)
    loads = [t for t in terms if t.effect.coupling is not None]
    if len(loads) != 1 or not recordings:
        return tuple(recordings)
    (share,), _ = loads[0].effect.to_columns(model.effects[loads[0].id], model.inertia)
    startup = math.ceil(model.delay / recordings[0].sample_time) + 3
    measured = equations_of([_bare(r) for r in recordings], startup)
    pushes = _pushes(measured, model, terms, share)
    by_piece = {id(s.log): x for s, x in zip(measured.stretches, pushes, strict=True)}
    driven = tuple(
        replace(
            r,
            pieces=tuple(with_channels(p, push=by_piece[id(p)]) if id(p) in by_piece else p for p in r.pieces),
            pushed=(loads[0].id, share),
        )
        for r in measured.recordings
    )
    own = equations_of(driven, startup, measured.bands)
    better = _left(own, model, terms) < POLICY.driven_gain**2 * _left(measured, model, terms)
    return driven if better else measured.recordings


def _bare(recording: Recording) -> Recording:
    """Without what an earlier model drove."""
    if not any("push" in p for p in recording.pieces):
        return recording
    pieces = (
        replace(p, channels={name: x for name, x in p.channels.items() if name != "push"}) for p in recording.pieces
    )
    return replace(recording, pieces=tuple(pieces), pushed=None)


def _pushes(equations: Equations, model: PlantModel, terms: Terms, share: float) -> list[Array]:
    """F / (s_m J), mean per interval, by stretch."""
    forces = drive(equations, inputs_of(terms), model.delay)
    for term in terms:
        if term.effect.role in (Role.INPUT, Role.STRUCTURE):
            continue
        given, _ = term.effect.to_columns(model.effects[term.id], model.inertia)
        for c, by_stretch in zip(given, raw_columns(equations, term, model.delay), strict=True):
            forces = [force - c * x for force, x in zip(forces, by_stretch, strict=True)]
    for _, taken in of_single_logs(equations, model.delay):
        forces = [force - x for force, x in zip(forces, taken, strict=True)]
    free = [s.free if has_friction(terms) else 1.0 for s in equations.stretches]
    return [np.nan_to_num(f) * x / ((1.0 - share) * model.inertia) for f, x in zip(forces, free, strict=True)]


def _left(equations: Equations, model: PlantModel, terms: Terms) -> float:
    """Sum of squares of what the model leaves of the balance."""
    bank = Bank(equations)
    tap, theta = coefficients_of(model, terms, bank.tap_time)
    design = bank.design(terms, tap)
    rest = design.rows[0] - sum(c * x for c, x in zip(theta, design.rows[1:], strict=True))
    found = float(np.sum(rest[equations.kept] ** 2))
    return found if math.isfinite(found) else math.inf
