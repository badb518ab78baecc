"""Which way round the balance is evidence: the motion on u (forward), or u on the motion (inverse).

Forces that no model follows stand in u. The forward form finds what is missing as long as J a is a fair part of u,
however noisy the sensor. Where friction, weight or cogging is nearly all of u, J a drowns in them: whatever is added,
hardly any of the acceleration is explained. The inverse form then leaves a small share of u, and is evidence. In it
nothing that acts on u can be identified, nor a push: it would explain u by u, or by the time at which u was so, and the
acceleration, in which it had to show, says nothing.
"""

from __future__ import annotations

import numpy as np

from dsd_cli.effects import Role, get_effect
from dsd_cli.identify.fit.bank import INERTIA, Terms
from dsd_cli.identify.fit.delay import best_delay
from dsd_cli.identify.fit.gram import solve, squares, total_gram
from dsd_cli.identify.fit.solve import Solver
from dsd_cli.identify.policy import POLICY

#: Why an effect cannot be told in the inverse form.
NEEDS_ACCELERATION = (
    "friction, weight or cogging is nearly all of u here: the acceleration, in which it would show, says too little"
)


def inverse_is_evidence(solver: Solver, beside: Terms, most_tap: int) -> bool:
    """Whether functions of the motion explain u so much better than the acceleration (`POLICY.much_better_inverse`), or
    u has so little to do with the acceleration (`POLICY.unanswered`), that only the inverse form is evidence.

    beside : effects that are functions of the motion without a shape, and those of the model.
    """
    left = [_left(solver, beside, most_tap, inverse) for inverse in (False, True)]
    return left[0] > POLICY.much_better_inverse * left[1] or _answered(solver, beside, most_tap) < POLICY.unanswered


def _left(solver: Solver, beside: Terms, most_tap: int, inverse: bool) -> float:
    """Share of the power of the acceleration (of u) that u (the acceleration) and functions of the motion leave."""
    one = Solver(solver.bank, solver.blocks, solver.inertia, solver.known, inverse=inverse)
    tap = best_delay(one, beside, most_tap)
    target = one.bank.drive((), tap) if inverse else one.inertia * one.bank.acceleration
    return one.squares(beside, tap) / max(float(target @ target), 1e-300)


def _answered(solver: Solver, beside: Terms, most_tap: int) -> float:
    """Share of what functions of the motion leave of u that the acceleration explains, with an inertia above 0."""
    tap = best_delay(solver, beside, most_tap)
    drive, acceleration, _, *columns = solver.bank.design(beside, tap).rows
    gram = total_gram([drive, acceleration, *columns])
    theta = solve(gram[None])[0]
    without = np.delete(np.delete(gram, 1 + INERTIA, 0), 1 + INERTIA, 1)
    left = squares(without, solve(without[None])[0])
    return 1.0 - squares(gram, theta) / max(left, 1e-300) if theta[INERTIA] > 0.0 else 0.0


def needs_acceleration(effect_id: str) -> bool:
    """Whether an effect can be identified by the forward form alone: one on u, of u, of time, or a mass."""
    effect = get_effect(effect_id)
    of_time = not effect.needs and (effect.listed or effect.searched > 0)
    return effect.role in (Role.INPUT, Role.STRUCTURE) or "u" in effect.needs or of_time
